"""Nodes whose prescribed motion coarse cells do not have."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Displacement, InitialVelocity, Velocity
from pdmesh.model.selection import components
from pdmesh.model.values_of_place import is_of_place
from pdsolve.adaptivity.hybrid.space.box import CellBox
from pdsolve.adaptivity.hybrid.space.layout import coordinates_of_sites
from pdsolve.conditions import initial_velocity
from pdsolve.model import Model

SAME = 1e-9  # of the largest value: round-off


def nodes_unfit_for_coarse(
    model: Model, box: CellBox, site_of_grid_row: NDArray[np.int64], grid_row_at_site: NDArray[np.int32]
) -> NDArray[np.int64]:
    """Fine nodes (k, 3) that would not move as prescribed if they hung between coarse nodes.

    A held node may hang between held ones alone; initial velocities, and what is prescribed, are to be linear between
    coarse nodes. `site_of_grid_row` (n,) is where the rows of the grid are, `grid_row_at_site` (sites,) the row at each
    site or -1.
    """
    unfit_rows = [np.zeros(0, dtype=np.int64)]
    for condition in model.settings.conditions:
        if isinstance(condition, Displacement | Velocity):
            rows, is_constrained = model.selected(condition), np.zeros((len(site_of_grid_row), 1))
            is_constrained[rows] = 1.0
            unfit_rows.append(
                rows[
                    _mean_of_coarse_nodes_around(is_constrained, rows, box, site_of_grid_row, grid_row_at_site)[:, 0]
                    < 1.0
                ]
            )
            prescribed_values = [value or 0.0 for value in components(condition, 3)]
            if any(map(is_of_place, prescribed_values)):
                values = np.zeros((len(site_of_grid_row), 3))
                values[rows] = model.vectors(prescribed_values, rows)
                away = np.abs(
                    _mean_of_coarse_nodes_around(values, rows, box, site_of_grid_row, grid_row_at_site) - values[rows]
                ).max(axis=1)
                unfit_rows.append(rows[away > SAME * np.abs(values).max()])
    if any(isinstance(condition, InitialVelocity) for condition in model.settings.conditions):
        velocity, rows = initial_velocity(model), np.arange(len(site_of_grid_row))
        away = np.abs(
            _mean_of_coarse_nodes_around(velocity, rows, box, site_of_grid_row, grid_row_at_site) - velocity
        ).max(axis=1)
        unfit_rows.append(rows[away > SAME * np.abs(velocity).max()])
    return coordinates_of_sites(box, site_of_grid_row[np.unique(np.concatenate(unfit_rows))])


def _mean_of_coarse_nodes_around(
    values: NDArray[np.float64], rows: NDArray[np.int64], box: CellBox, site: NDArray[np.int64], node: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Mean (k, j) of the values (n, j) of the coarse nodes that these rows (k,) lie between.

    A node that is not there counts as one that moves likewise.
    """
    at, sides = coordinates_of_sites(box, site[rows]), np.array([box.fine_nodes_x, box.fine_nodes_y, box.fine_nodes_z])
    mean = np.zeros((len(rows), values.shape[1]))
    for signs in product((-1, 1), repeat=3):
        end = at + np.array(signs) * (at % 2)
        inside = np.where(end < sides, end, at)
        neighbour = node[(inside[:, 2] * box.fine_nodes_y + inside[:, 1]) * box.fine_nodes_x + inside[:, 0]]
        has_neighbour = (end < sides).all(axis=1) & (neighbour >= 0)
        mean += values[np.where(has_neighbour, neighbour, rows)] / 8
    return mean
