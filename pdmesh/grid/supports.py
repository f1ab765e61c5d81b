"""Checks that supports balance the forces on each piece of a plate, so that it neither flies off nor turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Acceleration, AnyCondition, Displacement, Load, Pin, Settings, Spring, Velocity
from pdmesh.model.load_resultants import nodal_forces
from pdmesh.model.node_grid import Grid

UNBALANCED = 0.05  # of the forces on a piece: what is less may come from nodes that are not quite on edges
NOTHING = 1e-12  # of the largest: what does not resist a rigid motion at all


def unheld(grid: Grid, settings: Settings, number: NDArray[np.int64]) -> Iterator[tuple[int, float]]:
    """Pieces with forces that neither balance nor are supported, and the unbalanced force, N/m.

    `number` (n,) is the piece of each node; ids count from 1. Forces with different profiles do not balance each other.
    """
    loads = [condition for condition in settings.conditions if isinstance(condition, Load)]
    loaded = [np.unique(number[rows_of(load)]) for load in loads]
    for piece in np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *loaded])):
        inside = number == piece
        acted_on = np.concatenate([rows_of(condition) for condition in settings.conditions])
        motions = _Motions(grid.position, grid.position[acted_on[inside[acted_on]]])
        free = _free_motions(settings, motions, inside)
        for profile in dict.fromkeys(load.profile for load in loads):
            residual, total = np.zeros(3), 0.0
            for load in loads:
                if load.profile == profile:
                    rows = rows_of(load)
                    force = np.where(inside[rows, None], nodal_forces(load, grid, rows), 0.0)
                    residual += np.einsum("ni,nij->j", force, motions.of(rows))
                    total += float(np.hypot(*force.T).sum())
            unbalanced = float(np.linalg.norm(free @ residual))
            if unbalanced > UNBALANCED * total:
                yield int(piece), unbalanced
                break


def rows_of(condition: AnyCondition) -> NDArray[np.int64]:
    """Rows of the nodes of a condition."""
    return np.array(condition.nodes or (), dtype=np.int64) - 1


class _Motions:
    """Rigid motions of equal size: along x, along y, and a rotation about the centre of `reference_position` (k, 2)."""

    def __init__(self, position: NDArray[np.float64], reference_position: NDArray[np.float64]) -> None:
        self._position, self._middle = position, reference_position.mean(axis=0)
        self._size = float(np.ptp(reference_position, axis=0).max()) / 2 or 1.0

    def of(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Displacements (k, 2, 3) of these nodes in each rigid motion."""
        return self.at(self._position[rows])

    def at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements (k, 2, 3) of places (k, 2), m, in each rigid motion."""
        turn = (places - self._middle) / self._size
        motions = np.zeros((len(places), 2, 3))
        motions[:, 0, 0] = motions[:, 1, 1] = 1.0
        motions[:, 0, 2], motions[:, 1, 2] = -turn[:, 1], turn[:, 0]
        return motions


def _free_motions(settings: Settings, motions: _Motions, inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Projection (3, 3) onto the rigid motions that no support resists."""
    resistance = np.zeros((3, 3))
    for condition in settings.conditions:
        for axis, constraint in enumerate(_held(condition)):
            rows = rows_of(condition)
            way = motions.of(rows[inside[rows]])[:, axis]
            if isinstance(condition, Pin):  # whose ring turns about its centre
                way = motions.at(np.array([condition.centre]))[:, axis] * len(way)
            resistance += way.T @ way * constraint
    strength, ways = np.linalg.eigh(resistance)
    free = ways[:, strength <= NOTHING * max(strength.max(), NOTHING)]
    return np.asarray(free @ free.T)


def _held(condition: AnyCondition) -> tuple[bool, ...]:
    """Whether a condition resists motions along x and y; a pin does at its centre."""
    if isinstance(condition, Displacement | Velocity | Acceleration):
        return condition.x is not None, condition.y is not None
    if isinstance(condition, Spring):
        along = condition.stiffness or condition.body_stiffness or ()
        return tuple(value > 0 for value in along[:2])
    return (True, True) if isinstance(condition, Pin) else ()
