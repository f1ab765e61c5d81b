"""Nodes whose prescribed motion coarse cells do not have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Displacement, InitialVelocity, Velocity
from pdmesh.model.selection import components
from pdsolve.adaptivity.hybrid.lattice import BELOW, LEFT, Lattice
from pdsolve.model import Model

SAME = 1e-9  # of the largest value: round-off


def between(model: Model, at: Lattice, place: NDArray[np.int64], row: NDArray[np.int32]) -> NDArray[np.int64]:
    """Places (k,) of fine nodes that would not move as prescribed if they hung between coarse nodes.

    `place` (n,) are those of the grid's rows, `row` (places,) is the inverse, -1 without a node. A held node may hang
    between held ones alone; initial velocities are to be linear between coarse nodes.
    """
    found = np.zeros(len(place), dtype=bool)
    velocity = np.zeros((len(place), 2))
    for condition in model.settings.conditions:
        if isinstance(condition, InitialVelocity):
            velocity[model.selected(condition)] = components(condition, 2)
        elif isinstance(condition, Displacement | Velocity):
            held = np.zeros((len(place), 1))
            held[rows := model.selected(condition)] = 1.0
            found[rows] |= (_mean(held, at, place[rows], row)[:, 0] < 1.0) & (held[rows, 0] > 0)
    if velocity.any():
        away = np.abs(_mean(velocity, at, place, row) - velocity).max(axis=1)
        found |= away > SAME * np.abs(velocity).max()
    return place[found]


def _mean(
    values: NDArray[np.float64], at: Lattice, place: NDArray[np.int64], row: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Mean (k, j) of the values (n, j) of the coarse nodes that the nodes at these places (k,) lie between.

    A node that is not there counts as one that moves likewise.
    """
    y, x = np.divmod(place, at.stride)
    odd_x, odd_y = (x - LEFT) % 2, (y - BELOW) % 2
    own, found = row[place], np.zeros((len(place), values.shape[1]))
    for sign_y in (-1, 1):
        for sign_x in (-1, 1):
            other = row[place + sign_y * odd_y * at.stride + sign_x * odd_x]
            found += values[np.where(other < 0, own, other)] / 4
    return found
