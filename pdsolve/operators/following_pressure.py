"""Pressure that follows its faces as an operator: what their motion adds to the dead pressure among the loads.

F = -p (A(x) - A(X)) on the corners of pieces of faces, at x now and X at the start, and from there on the nodes that
carry them; A are area vectors. A corner moves as the nodes that carry it, so that the work of F is p times the area, or
volume, that the faces sweep. It is booked by the trapezoidal rule of Verlet, as that of loads.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Load
from pdmesh.model.load_resultants import shares_of
from pdmesh.model.pressed_faces import FacePieces, area_vectors, carried, pieces_of
from pdsolve.conditions import factors
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.unbreakable import UnbreakableOperator
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]


class FollowingLoad(NamedTuple):
    """The nodes of a pressure and what they carry."""

    load: Load
    rows: NDArray[np.int64]  # (k,)
    pieces: FacePieces
    at_start: Array  # (f, d) area vectors

    def force(self, displacement: Array, time: float) -> Array:
        """What displacements (k, d) of the nodes add to their forces (k, d) at a time, s."""
        (factor,) = factors(self.load, [time])
        assert isinstance(self.load.pressure, float | int)
        moved = self.pieces.corners + self.pieces.weights @ displacement
        change = area_vectors(moved, self.pieces.pieces) - self.at_start
        return -factor * self.load.pressure * carried(self.pieces, change)


class FollowingPressure(UnbreakableOperator):
    """Pressures that follow their faces on n nodes in motion; see `Operator`."""

    name = "pressure"
    symmetric = True

    def __init__(self, model: Model, loads: Sequence[Load], volume: Array, unknowns: tuple[Unknown, ...]) -> None:
        """`volume` (n,), m^d."""
        self._d, self._volume, self.unknowns = model.grid.dimension, volume, unknowns
        self._time, self._pressed = 0.0, list[FollowingLoad]()
        for load in loads:
            rows = model.selected(load)
            part = model.grid.part(rows)
            cells = part.cells * shares_of(load, part.ids)
            pieces = pieces_of(load.faces or (), part.position, part.delta, cells)
            self._pressed.append(FollowingLoad(load, rows, pieces, area_vectors(pieces.corners, pieces.pieces)))

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities, N/m^3, to `out` (n, w), and book their work since the last step, `dt` s ago."""
        if dt > 0:
            self._time = step * dt
        for pressed in self._pressed:
            rows, size = pressed.rows, self._volume[pressed.rows][:, None]
            u = state.value[rows, : self._d].astype(float)
            force = pressed.force(u, self._time) / size
            out[rows, : self._d] += force
            if dt > 0:
                way = dt * state.rate[rows, : self._d].astype(float)
                before = pressed.force(u - way, self._time - dt) / size
                state.work[rows] += ((before + force) / 2 * way).sum(axis=1)

    def energies(self, state: State) -> tuple[Array, Array]:
        """Nothing (n,) is stored or dissipated."""
        return np.zeros(len(self._volume)), np.zeros(len(self._volume))

    def stiffness_bound(self) -> Array:
        """A bound (n,) of what the largest pressures add to each node's stiffness, N/m^4."""
        bound = np.zeros(len(self._volume))
        for load, rows, pieces, _ in self._pressed:
            most = max((abs(factor) for _, factor in load.profile), default=1.0)
            sides = np.linalg.norm(np.diff(pieces.corners[pieces.pieces], axis=1), axis=2).max(axis=1)
            at_corners = np.zeros(len(pieces.corners))
            np.add.at(at_corners, pieces.pieces, (sides ** (self._d - 2))[:, None] / self._d)
            assert isinstance(load.pressure, float | int)
            bound[rows] += most * abs(load.pressure) * (pieces.weights.T @ at_corners) / self._volume[rows]
        return bound

    def tangent(self, state: State) -> csr_array:
        """Pressure follows in motion only."""
        raise NotImplementedError("a pressure that follows its faces has no tangent; models at rest refuse it")

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The time of the last forces, s."""
        return {"time": np.array([self._time])}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint."""
        self._time = float(checkpoint["time"][0])

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        return sum(p.rows.nbytes + p.pieces.corners.nbytes + p.pieces.weights.data.nbytes for p in self._pressed)
