"""Forces of loads on nodes, and their sums: force and moment of each load."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Document, Load
from pdmesh.model.node_arrays import selected
from pdmesh.model.node_grid import Grid
from pdmesh.model.suggestions import called
from pdmesh.model.values_at_places import values_at, vectors_at


class Resultant(NamedTuple):
    """What a load adds up to where its profile is 1, or its data is largest: N and N m, in a plate per metre of
    thickness."""

    name: str
    force: NDArray[np.float64]  # (d,)
    moment: NDArray[np.float64]  # (1,) about the z axis, or (3,), through the middle of the grid's box


def resultants(document: Document, grid: Grid) -> Iterator[Resultant]:
    """The resultant of each load of a grid file."""
    middle = (grid.position.min(axis=0) + grid.position.max(axis=0)) / 2
    for number, load in enumerate(document.conditions):
        if isinstance(load, Load):
            rows = np.flatnonzero(selected(grid, load.nodes, load.box))
            force = nodal_forces(load, grid, rows)
            arm = grid.position[rows] - middle
            flat = grid.dimension == 2
            turning = arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] if flat else np.cross(arm, force)
            moment = np.atleast_1d(turning.sum(axis=0))
            yield Resultant(called(load.name, number), force.sum(axis=0), moment)


def nodal_forces(load: Load, grid: Grid, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Force of a load on each of its nodes, rows (k,): (k, d), N in space, N/m in a plate."""
    size = grid.cells[rows]
    if load.body_force is not None:
        return np.asarray(size[:, None] * vectors_at(load.body_force, grid.position[rows]))
    if load.force is not None:
        return np.asarray((size / size.sum())[:, None] * np.array(load.force))
    if load.pressure is not None:
        return pressure_forces(load, values_at(load.pressure, grid.position[rows]), grid.ids[rows])
    extent = load.length or load.surface
    if load.shares is not None:
        size = size * shares_of(load, grid.ids[rows])
    share = size / size.sum() * extent if extent else size / (load.rows * grid.delta[rows])
    assert load.traction is not None
    return np.asarray(share[:, None] * vectors_at(load.traction, grid.position[rows]))


def shares_of(load: Load, ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shares (k,) of a load's nodes with these ids (k,); 1 of a load without shares."""
    if load.shares is None or load.nodes is None:
        return np.ones(len(ids))
    return np.array(load.shares)[_places_in_list(load, ids)]


def pressure_forces(load: Load, pressure: NDArray[np.float64], ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """Force of pressures (k,), Pa, where faces have not moved: (k, d), N in space, N/m in a plate, on nodes of the load
    with these `ids` (k,)."""
    areas = np.array(load.area_vectors)[_places_in_list(load, ids)]
    return np.asarray(-pressure[:, None] * areas)


def _places_in_list(load: Load, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where these ids (k,) are in the list of a load's nodes."""
    nodes = np.array(load.nodes, dtype=np.int64)
    order = np.argsort(nodes, kind="stable")
    return order[np.searchsorted(nodes, ids, sorter=order)]
