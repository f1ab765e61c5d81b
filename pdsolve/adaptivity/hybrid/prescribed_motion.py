"""Nodes whose prescribed motion coarse cells do not have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Displacement, InitialVelocity, Velocity
from pdmesh.model.selection import components
from pdmesh.model.values_of_place import is_of_place
from pdsolve.adaptivity.hybrid.lattice import BELOW, LEFT
from pdsolve.conditions import initial_velocity

if TYPE_CHECKING:
    from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate

SAME = 1e-9  # of the largest value: round-off


def places_unfit_for_coarse(plate: HybridPlate) -> NDArray[np.int64]:
    """Places (k,) of fine nodes that would not move as prescribed if they hung between coarse nodes.

    A held node may hang between held ones alone; initial velocities, and what is prescribed, are to be linear between
    coarse nodes.
    """
    model, unfit_places = plate.model, [np.zeros(0, dtype=np.int64)]
    for condition in model.settings.conditions:
        if not isinstance(condition, Displacement | Velocity):
            continue
        rows = model.selected(condition)
        place = plate.places_of_grid_rows(rows)
        is_held = np.zeros((len(model.grid), 1))
        is_held[rows] = 1.0
        unfit_places.append(place[_mean_of_coarse_nodes_around(is_held, plate, place)[:, 0] < 1.0])
        prescribed_values = [value or 0.0 for value in components(condition, 2)]
        if any(map(is_of_place, prescribed_values)):
            values = np.zeros((len(model.grid), 2))
            values[rows] = model.vectors(prescribed_values, rows)
            unfit_places.append(_places_of_nonlinear_values(values, plate, rows))
    if any(isinstance(condition, InitialVelocity) for condition in model.settings.conditions):
        unfit_places.append(_places_of_nonlinear_values(initial_velocity(model), plate, np.arange(len(model.grid))))
    return np.unique(np.concatenate(unfit_places))


def _places_of_nonlinear_values(
    values: NDArray[np.float64], plate: HybridPlate, rows: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Places of these rows (k,) whose values (n, 2) are not the mean of those of the coarse nodes they lie between."""
    place = plate.places_of_grid_rows(rows)
    away = np.abs(_mean_of_coarse_nodes_around(values, plate, place) - values[rows]).max(axis=1, initial=0.0)
    return np.asarray(place[away > SAME * np.abs(values).max(initial=0.0)])


def _mean_of_coarse_nodes_around(
    values: NDArray[np.float64], plate: HybridPlate, place: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Mean (k, j) of the `values` (n, j) of the coarse nodes which the nodes at these places (k,) lie between.

    A node that is not there counts as one that moves likewise.
    """
    numbering, mean = plate.numbering, np.zeros(1)
    y, x = np.divmod(place, numbering.fine_row_stride)
    odd_x, odd_y = (x - LEFT) % 2, (y - BELOW) % 2
    for sign_y in (-1, 1):
        for sign_x in (-1, 1):
            neighbour = place + sign_y * odd_y * numbering.fine_row_stride + sign_x * odd_x
            mean = mean + values[plate.grid_rows_at(np.where(plate.has_node(neighbour), neighbour, place))] / 4
    return mean
