r"""Edges of conditions: their faces, and fluxes handed on to the nodes beside them so that linear fields stay exact.

Nodes near a free edge lack bonds. In a linear field that rises by 1 in a metre along the inward normal n they gain
R . n with R_i = V_i sum_j g_ij V_j (x_j - x_i), m^(d+1)/s. It is 0 inside a body and adds up to D A over an edge of the
extent A. A flux that is shared out as R . n has the exact linear field for its equilibrium; one that acts on the outer
row alone leaves that row off by about q h / D. An exchange that changes a field within a spacing is a prescribed value
instead, at a wall that is D / coefficient outside, where the slope at the edge leads (Robin's condition). Symbols:

    A   extent of the edge, m^(d-1)        z   depth of a node below the edge, m
    D   diffusivity, m^2/s                 w   share of a node in the flux
    H   exchange between the outside and the nodes, 1 / (1 / coefficient + sum(w z) / D), m/s
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, Source
from pdmesh.model.neighbours import tree_of
from pdsolve.diffusion.families import diffusivities, extended
from pdsolve.diffusion.walls import Array, Bonds, Faces, Rows
from pdsolve.model import Model, ModelError

CLEAR = 0.2  # of D A, by which the sum of R . n may miss it at a free edge
ON_EDGE = 1e-3  # of a spacing
AHEAD = 0.5  # of a spacing outside an edge: the middle of where nodes are looked for
AROUND = 1.0  # of a spacing around it
BEYOND = 0.25  # of a spacing outside an edge: from there on nodes are beyond it
BESIDE = 0.5  # of a spacing: how near to the next cell's place a node is that makes an edge one inside a body


def parts(volume: Array, delta: Array) -> tuple[Array, Array]:
    """The part of an edge (k,) beside each of its cells, whose sum is 1, and their depths (k,) times its extent, m^d.

    Cells of nested spacings are as deep as they are wide.
    """
    finer = delta.max() / delta
    area = volume * finer
    return area / area.sum(), area.sum() / finer


def outward(
    position: Array, delta: Array, reach: Array, rows: Rows
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Outward unit normals (k, d) of an edge at its nodes, whether (k,) no node is beyond it, and whether one of these
    nodes is."""
    tree = tree_of(position)
    around = tree.query_ball_point(position[rows], reach[rows])
    inward = np.array([position[near].mean(axis=0) for near in around]) - position[rows]
    normal = -_normals(position[rows], inward, reach[rows])
    distance, next_one = tree.query(position[rows] + normal * delta[rows, None])
    free = np.asarray(distance > BESIDE * delta[rows])
    return normal, free, ~free & np.isin(next_one, rows)


def beside_edge(bonds: Bonds, volume: Array, gain: Array, rows: Rows, extent: float) -> tuple[Rows, Array, Array]:
    """Rows (k,) that a flux through an edge of that extent arrives at, their shares (k,) of it, which add up to 1, and
    the resistance (k,) between the edge and them, s/m.

    The nodes of the edge are `rows`; all have the `volume` (n,), m^d, and `gain` (n, d) is R.

    Each of these hands the part of its own cell on to the nodes that it is the nearest to, or keeps it if that part of
    the edge is not free.
    """
    D, position, delta = bonds.diffusivity[rows], bonds.position, bonds.delta
    normal = _normals(position[rows], gain[rows], bonds.reach[rows])
    part, depth = parts(volume[rows], delta[rows])
    reach = 2 * float(bonds.reach[rows].max())
    distance, owner = tree_of(position[rows]).query(position, distance_upper_bound=reach)
    near = np.flatnonzero(np.isfinite(distance))
    owner = owner[near]
    way = ((position[near] - position[rows[owner]]) * normal[owner]).sum(axis=1)
    w = (gain[near] * normal[owner]).sum(axis=1) * (way > -delta[near] / 2)
    total_weight = np.bincount(owner, w, len(rows))
    free = np.abs(total_weight - D * extent * part) < CLEAR * D * extent * part
    hands = free[owner] & (w != 0)
    near, owner, way = near[hands], owner[hands], way[hands]
    w = w[hands] / total_weight[owner]
    z = depth[owner] / extent - delta[rows[owner]] / 2 + way
    resistance = np.maximum(np.bincount(owner, w * z, len(rows)), 0.0) / D
    closed_rows = np.flatnonzero(~free)
    share = np.concatenate([part[owner] * w, part[closed_rows]])
    resistance = np.concatenate([resistance[owner], np.zeros(len(closed_rows))])
    return np.concatenate([near, rows[closed_rows]]), share, resistance


def _normals(x: Array, inward: Array, reach: Array) -> Array:
    """Inward unit normals (k, d) of an edge at its nodes x: across the line or plane of their neighbours."""
    around = tree_of(x).query_ball_point(x, reach)
    normals = np.zeros(inward.shape)
    for at, neighbours in enumerate(around):
        _, axes = np.linalg.eigh(np.cov(x[neighbours].T, bias=True).reshape(inward.shape[1], -1))
        normals[at] = axes[:, 0] if len(neighbours) > 1 else inward[at]
    normals *= np.where((normals * inward).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return np.asarray(normals / np.maximum(np.sqrt((normals**2).sum(axis=1)), np.finfo(float).tiny)[:, None])


def extent_of(condition: Source | Exchange) -> float:
    """Length, m, or area, m^2, that a flux goes through."""
    return condition.length or condition.surface or 0.0


def _ways_to_edge(model: Model, number: int) -> tuple[Rows, Array, Array]:
    """Rows (k,) of a condition, vectors (k, d) to its edge along the axes of the nodes, and their lengths (k,), m.

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
    way = np.array(ways)[order[np.searchsorted(nodes, grid.ids[rows], sorter=order)]][:, extended(model)]
    return rows, way, np.sqrt((way**2).sum(axis=1))


def held_edge(model: Model, number: int, edge: int) -> tuple[Rows, Faces]:
    """Nodes on the edge of a condition, which have the prescribed value themselves, and the faces of the first row
    beside it."""
    (rows, way, far), grid = _ways_to_edge(model, number), model.grid
    on, first = far < ON_EDGE * grid.delta[rows], far < (1 - ON_EDGE) * grid.delta[rows]
    first_rows, way = rows[first & ~on], way[first & ~on]
    faces = _faces(model, first_rows, way, way / far[first & ~on, None], edge, np.zeros(len(first_rows)))
    return rows[on], faces


def _faces(model: Model, rows: Rows, way: Array, normal: Array, edge: int, beyond: Array) -> Faces:
    """Faces (k,) of an edge, at a `way` (k, d) from these rows."""
    area = model.grid.delta[rows] ** (way.shape[1] - 1)
    return Faces(model.grid.position[rows][:, extended(model)] + way, normal, area, np.full(len(rows), edge), beyond)


def outer_faces(model: Model, number: int, volume: Array, edge: int) -> tuple[Rows, NDArray[np.bool_], Faces, float]:
    """The outer nodes (k,) of an exchange, at which of them its edge is free, the faces there, and their extent.

    `volume` (n,) is that of all nodes, m^d. Raises ModelError.
    """
    condition, grid = model.settings.conditions[number], model.grid
    assert isinstance(condition, Exchange)
    position = grid.position[:, extended(model)]
    if condition.edge is None:
        rows = model.selected(condition)
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
        foot = position[rows] + way
        near = tree_of(position).query_ball_point(foot + AHEAD * delta[:, None] * normal, AROUND * delta)
        heights = ((position[nodes] - foot[at]) @ normal[at] for at, nodes in enumerate(near))
        free = np.array([not (height > BEYOND * delta[at]).any() for at, height in enumerate(heights)], dtype=bool)
    faces = _faces(model, rows, way, normal, edge, diffusivities(model)[rows] / condition.coefficient).chosen(free)
    part, _ = parts(volume[rows], delta)
    return rows, free, faces, extent_of(condition) * float(part[free].sum())
