"""Faces of edges at which values are prescribed or exchanged, beside the nodes of a condition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, Source
from pdmesh.model.kd_trees import tree_of
from pdsolve.diffusion.edge_fluxes import outward, parts
from pdsolve.diffusion.families import diffusivities, extended
from pdsolve.diffusion.walls import Faces
from pdsolve.model import Model, ModelError

ON_EDGE = 1e-3  # of a spacing
AHEAD = 0.5  # of a spacing outside an edge: the middle of where nodes are looked for
AROUND = 1.0  # of a spacing around it
BEYOND = 0.25  # of a spacing outside an edge: from there on nodes are beyond it

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def extent_of(condition: Source | Exchange) -> float:
    """Length, m, or area, m^2, that a flux goes through."""
    return condition.length or condition.surface or 0.0


def _ways_to_edge(model: Model, number: int) -> tuple[Rows, Array, Array]:
    """Rows (k,) of a condition, vectors (k, d) to its edge along the axes of the nodes, and distances (k,), m.

    Raises ModelError.
    """
    condition, grid = model.settings.conditions[number], model.grid
    assert isinstance(condition, Concentration | Exchange)
    nodes, ways = np.array(condition.nodes or (), dtype=np.int64), condition.edge or ()
    if len(ways) != len(nodes) or any(len(way) != grid.dimension for way in ways):
        raise ModelError(
            f"{model.name}: $.conditions[{number}].edge has {len(ways)} ways; give {len(nodes)}, one for each of"
            f" its nodes, in {grid.dimension} dimensions"
        )
    rows, order = model.selected(condition), np.argsort(nodes, kind="stable")
    way = np.array(ways)[order[np.searchsorted(nodes, grid.ids[rows], sorter=order)]]
    return rows, way[:, extended(model)], np.sqrt((way**2).sum(axis=1))


def held_edge(model: Model, number: int, edge: int) -> tuple[Rows, Faces]:
    """Nodes on the edge of a condition, which have the prescribed value themselves, and the faces of the first row
    beside it."""
    (rows, way, far), grid = _ways_to_edge(model, number), model.grid
    on, first = far < ON_EDGE * grid.delta[rows], far < (1 - ON_EDGE) * grid.delta[rows]
    beside, way = rows[first & ~on], way[first & ~on]
    faces = _faces(model, beside, way, way / far[first & ~on, None], edge, np.zeros(len(beside)))
    return rows[on], faces


def _faces(model: Model, rows: Rows, way: Array, normal: Array, edge: int, beyond: Array) -> Faces:
    """Faces (k,) of an edge, at a `way` (k, d) from these rows."""
    area = model.grid.delta[rows] ** (way.shape[1] - 1)
    return Faces(model.grid.position[rows][:, extended(model)] + way, normal, area, np.full(len(rows), edge), beyond)


def outer_faces(
    model: Model, number: int, rows: Rows, volume: Array, edge: int
) -> tuple[Rows, NDArray[np.bool_], Faces, float]:
    """The outer nodes (k,) of an exchange, at which of them its edge is free, the faces there, and their extent.

    `rows` are those of its nodes, and `volume` is that of all nodes. Raises ModelError.
    """
    condition, grid = model.settings.conditions[number], model.grid
    assert isinstance(condition, Exchange)
    position = grid.position[:, extended(model)]
    if condition.edge is None:
        delta = grid.delta[rows]
        normal, free, inner = outward(position, grid.delta, 2 * grid.delta, rows)
        free &= not inner.any()  # of nodes in several rows each has its share
        way = normal * (parts(volume[rows], delta)[1] / extent_of(condition) - delta / 2)[:, None]
    else:
        rows, way, far = _ways_to_edge(model, number)
        outer = far < grid.delta[rows] * (1 - ON_EDGE)
        rows, way, far = rows[outer], way[outer], far[outer]
        delta = grid.delta[rows]
        on = far < ON_EDGE * delta
        normal = way / np.where(on, 1.0, far)[:, None]
        if on.any():  # across the edge, as no way says where it is
            normal[on] = outward(position, grid.delta, 2 * grid.delta, rows)[0][on]
        free = _is_free(position, delta, position[rows] + way, normal)
    faces = _faces(model, rows, way, normal, edge, diffusivities(model)[rows] / condition.coefficient).chosen(free)
    part, _ = parts(volume[rows], delta)
    return rows, free, faces, extent_of(condition) * float(part[free].sum())


def _is_free(position: Array, delta: Array, foot: Array, normal: Array) -> NDArray[np.bool_]:
    """Mask (k,) of places on an edge beyond which there is no node."""
    is_free = np.ones(len(foot), dtype=bool)
    near = tree_of(position).query_ball_point(foot + AHEAD * delta[:, None] * normal, AROUND * delta)
    for at, neighbours in enumerate(near):
        is_free[at] = not (((position[neighbours] - foot[at]) @ normal[at]) > BEYOND * delta[at]).any()
    return is_free
