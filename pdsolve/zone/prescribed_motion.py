"""Nodes whose prescribed motion coarse cells do not have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Acceleration, Displacement, InitialDisplacement, InitialVelocity, Velocity
from pdmesh.model.selection import components
from pdmesh.model.values_of_place import is_of_place
from pdsolve.conditions import conditions_of, has_conditions, initial_displacement, initial_velocity
from pdsolve.model import Model
from pdsolve.zone.cells import LatticeNumbering, lattice_coordinates, place_number_at

SAME = 1e-9  # of the largest value: round-off
Lookup = Callable[[NDArray[np.int64]], NDArray[np.signedinteger]]


def nodes_kept_fine_by_prescribed_motion(
    model: Model, numbering: LatticeNumbering, places_of_grid_rows: Lookup, grid_rows_at: Lookup
) -> NDArray[np.int64]:
    """Fine nodes (k, d) that would not move as prescribed if they hung between coarse nodes.

    A held node may hang between held ones alone; initial velocities, and what is prescribed, are to be linear between
    coarse nodes. `grid_rows_at` has the rows of the grid at fine places, -1 without a node.
    """
    dimension, lookups = len(numbering.counts), (numbering, places_of_grid_rows, grid_rows_at)
    unfit_rows, count = [np.zeros(0, dtype=np.int64)], len(model.grid)
    prescribed: list[tuple[int, Displacement | Velocity | Acceleration]] = []
    prescribed += conditions_of(model.settings, Displacement)
    prescribed += conditions_of(model.settings, Velocity)
    prescribed += conditions_of(model.settings, Acceleration)
    for _, condition in prescribed:
        rows, is_held = model.selected(condition), np.zeros((count, 1))
        is_held[rows] = 1.0
        unfit_rows.append(rows[_mean_of_coarse_nodes_around(is_held, rows, *lookups)[:, 0] < 1.0])
        prescribed_values = [value or 0.0 for value in components(condition, dimension)]
        if any(map(is_of_place, prescribed_values)):
            values = np.zeros((count, dimension))
            values[rows] = model.vectors(prescribed_values, rows)
            unfit_rows.append(_rows_of_nonlinear_values(values, rows, *lookups))
    if has_conditions(model.settings, InitialVelocity):
        unfit_rows.append(_rows_of_nonlinear_values(initial_velocity(model), np.arange(count), *lookups))
    if has_conditions(model.settings, InitialDisplacement):
        start = initial_displacement(model, None, dimension)
        unfit_rows.append(_rows_of_nonlinear_values(start, np.arange(count), *lookups))
    return np.column_stack(lattice_coordinates(numbering, places_of_grid_rows(np.unique(np.concatenate(unfit_rows)))))


def _rows_of_nonlinear_values(
    values: NDArray[np.float64], rows: NDArray[np.int64], *lookups: *tuple[LatticeNumbering, Lookup, Lookup]
) -> NDArray[np.int64]:
    """Rows, of these (k,), whose values (n, j) are not the mean of those of the coarse nodes they lie between."""
    away = np.abs(_mean_of_coarse_nodes_around(values, rows, *lookups) - values[rows]).max(axis=1, initial=0.0)
    return np.asarray(rows[away > SAME * np.abs(values).max(initial=0.0)])


def _mean_of_coarse_nodes_around(
    values: NDArray[np.float64],
    rows: NDArray[np.int64],
    numbering: LatticeNumbering,
    places_of_grid_rows: Lookup,
    grid_rows_at: Lookup,
) -> NDArray[np.float64]:
    """Mean (k, j) of the values (n, j) of the coarse nodes that these rows (k,) of the grid lie between.

    A node that is not there counts as one that moves likewise.
    """
    place, mean = places_of_grid_rows(rows).astype(np.int64), np.zeros((len(rows), values.shape[1]))
    x = lattice_coordinates(numbering, place)
    for corner in range(2 ** len(x)):
        ends = [along + (2 * (corner >> axis & 1) - 1) * (along % 2) for axis, along in enumerate(x)]
        inside = np.logical_and.reduce([end < count for end, count in zip(ends, numbering.counts, strict=True)])
        neighbour = grid_rows_at(np.where(inside, place_number_at(numbering, ends), place))
        mean += values[np.where(inside & (neighbour >= 0), neighbour, rows)] / 2 ** len(x)
    return mean
