"""A cut-out of a plate whose opposite sides are joined: waves without edges, in the solver itself."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial import cKDTree
from system_checks import bonds_of

from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Assembly, Bonds, Part
from pdsolve.model import Model
from pdsolve.run.assembly import prepare_explicit_motion
from pdsolve.run.system import PreparedRun

Box = tuple[float, float, float, float]  # x0, y0, x1, y1, m; a side of infinite length is not joined


def joined(problem: PreparedRun, box: Box) -> PreparedRun:
    """The nodes of `problem` with x0 <= x < x1 and y0 <= y < y1, their bonds led around the box."""
    system, bonds = problem.system, bonds_of(problem)
    grid = system.model.grid
    low, high = np.array(box[:2]), np.array(box[2:])
    x = grid.position
    inside = ((x >= low - 1e-9) & (x < high - 1e-9)).all(axis=1)
    rows = np.flatnonzero(inside)
    wrapped = x.copy()
    for axis in np.flatnonzero(np.isfinite(high - low)):
        wrapped[:, axis] = low[axis] + (x[:, axis] - low[axis] + 1e-9) % (high[axis] - low[axis]) - 1e-9
    distance, image = cKDTree(x[rows]).query(wrapped)
    sub = Model(_some(grid, rows), system.model.settings)
    chosen = np.concatenate([np.arange(bonds.start[row], bonds.start[row + 1]) for row in rows])
    neighbour = bonds.neighbour[chosen]
    assert distance[neighbour].max() < 1e-9, "the box is not a period of the grid"
    counts = np.diff(bonds.start)[rows]
    own = Bonds(
        np.concatenate([[0], np.cumsum(counts)]),
        image[neighbour].astype(np.int32),
        *(np.ascontiguousarray(column[chosen]) for column in bonds[2:]),
    )
    assembly = Assembly(own, system.area[rows], system.family_sizes[rows])
    source = system.scheme.fill(system.model)._replace(area=assembly.area, part=lambda rows: _part(assembly, rows))
    scheme = system.scheme._replace(fill=lambda _: source)
    return prepare_explicit_motion(sub, system.options, scheme)


def _part(assembly: Assembly, rows: np.ndarray) -> Part:
    start, *columns = assembly.bonds
    own = slice(start[rows[0]], start[rows[-1] + 1])
    bonds = Bonds(start[rows[0] : rows[-1] + 2] - start[rows[0]], *(column[own] for column in columns))
    return Part(int(rows[0]), bonds, assembly.family[rows])


def _some(grid: Grid, rows: np.ndarray) -> Grid:
    columns = {name: getattr(grid, name)[rows] for name in ("ids", "position", "delta", "border", "hole_id")}
    return dataclasses.replace(grid, **columns, areas=None if grid.areas is None else grid.areas[rows])
