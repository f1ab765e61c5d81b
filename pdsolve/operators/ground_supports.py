"""Springs to the ground and pins in holes as an operator: forces that grow with displacements, without bonds.

    k    (s, d)   N/m^4, stiffness of a sprung node along each axis over its volume
    r    (p, 2)   m, arms of a pin's nodes about its centre; J r is r turned by a right angle
    phi           rad, the turn of a pin's ring that costs the least energy: sum(V J r . u) / sum(V r . r)

A pin's nodes are tied to their ring by springs of `TIED` E / delta^2 (N/m^4), so that it takes no moment about its
centre; its translation under a force F is that of springs, about F delta / (2 pi R TIED E) for a hole of radius R.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Pin, Spring
from pdsolve.conditions import Areas, Entries, chosen, driving_conditions, entries
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.operators.together import Together
from pdsolve.operators.unbreakable import UnbreakableOperator
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

TIED = 4.0  # E / delta^2: a pin's springs, stiff beside a plate and soft enough to leave the time step nearly as it is


class Ring(NamedTuple):
    """The nodes of a pin."""

    rows: NDArray[np.int64]  # (p,)
    k: Array  # (p,) N/m^4
    turn: Array  # (p, 2) m, J r
    weight: Array  # (p, 2) 1/m: phi is the sum of weight times u


class GroundSupports(UnbreakableOperator):
    """The spring supports and pins of n nodes; see `Operator`."""

    name = "supports"
    symmetric = True

    def __init__(self, model: Model, volume: Array, unknowns: tuple[Unknown, ...]) -> None:
        """`volume` (n,), m^d."""
        d, self._nodes, self.unknowns = model.grid.dimension, len(volume), unknowns
        self._d, self._width = d, sum(unknown.width for unknown in unknowns)
        self._k, self._rings = np.zeros((self._nodes, d)), list[Ring]()
        for condition in model.settings.conditions:
            if isinstance(condition, Spring):
                rows = model.selected(condition)
                self._k[rows] += resistance_of_spring(condition, model, volume, rows)
            elif isinstance(condition, Pin):
                ring_rows = model.selected(condition)
                E = model.node_values("E")[ring_rows]
                arm = model.grid.position[ring_rows] - np.array(condition.centre)
                turn = np.column_stack([-arm[:, 1], arm[:, 0]])
                k = np.full(len(ring_rows), TIED * float((E / model.grid.delta[ring_rows] ** 2).min()))
                moment = volume[ring_rows] @ (arm**2).sum(axis=1)
                self._rings.append(Ring(ring_rows, k, turn, volume[ring_rows, None] * turn / moment))
        self._rows = np.flatnonzero(self._k.any(axis=1))

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities, N/m^3, to `out` (n, w)."""
        u = state.value
        out[self._rows, : self._d] -= self._k[self._rows] * u[self._rows, : self._d]
        for ring in self._rings:
            out[ring.rows, :2] -= ring.k[:, None] * _slip(ring, u)

    def energies(self, state: State) -> tuple[Array, Array]:
        """Energy densities (n,), J/m^3: stored in springs; nothing is dissipated."""
        u, energy = state.value, np.zeros(self._nodes)
        energy[self._rows] = (self._k[self._rows] * u[self._rows, : self._d].astype(float) ** 2).sum(axis=1) / 2
        for ring in self._rings:
            energy[ring.rows] += ring.k * (_slip(ring, u) ** 2).sum(axis=1) / 2
        return energy, np.zeros(self._nodes)

    def forces_of(self, rows: NDArray[np.int64], volume: Array, state: State) -> Array:
        """The force (d,), N/m or N, of all supports on these nodes."""
        out = np.zeros((self._nodes, self._width))
        self.accumulate_force(state, out, 0, 0.0)
        return np.asarray(volume[rows] @ out[rows, : self._d])

    def stiffness_bound(self) -> Array:
        """Half the largest stiffness (n,) along an axis, N/m^4: springs to the ground have one end that moves."""
        bound = self._k.max(axis=1) / 2
        for ring in self._rings:
            bound[ring.rows] += ring.k / 2
        return np.asarray(bound)

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the force densities by the values, (n w, n w), N/m^4; the same in all states."""
        from scipy.sparse import coo_array

        w, d = self._width, self._d
        at = (w * self._rows[:, None] + np.arange(d)).ravel()
        rows, columns, values = [at], [at], [self._k[self._rows].ravel()]
        for ring in self._rings:
            ends = (w * ring.rows[:, None] + np.arange(2)).ravel()
            turned = np.outer(ring.turn.ravel(), ring.weight.ravel())
            stiff = np.repeat(ring.k, 2)[:, None] * (np.eye(len(ends)) - turned)
            rows.append(np.repeat(ends, len(ends)))
            columns.append(np.tile(ends, len(ends)))
            values.append(stiff.ravel())
        ends_of = np.concatenate(rows), np.concatenate(columns)
        size = w * self._nodes
        matrix: csr_array = coo_array((np.concatenate(values), ends_of), shape=(size, size)).tocsr()
        return matrix

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Nothing: supports have no history."""
        return {}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Nothing to restore."""

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        return self._k.nbytes + sum(array.nbytes for ring in self._rings for array in ring)


def supported(model: Model, volume: Array, bonds: Operator) -> Operator:
    """The operator of a model's bonds with its spring supports and pins; the bonds come last. `volume` (n,), m^d."""
    return Together(GroundSupports(model, volume, bonds.unknowns), bonds)


def supports_of(operator: Operator) -> GroundSupports | None:
    """The supports in an operator, if there are any."""
    parts = operator.parts if isinstance(operator, Together) else (operator,)
    flat_parts = (supports_of(part) if isinstance(part, Together) else part for part in parts)
    return next((part for part in flat_parts if isinstance(part, GroundSupports)), None)


def grounded(model: Model, width: int) -> NDArray[np.bool_]:
    """Mask (n, width) of components that supports resist; of a pin those of one node, as its ring turns."""
    is_supported = np.zeros((len(model.grid), width), dtype=bool)
    for condition in model.settings.conditions:
        if isinstance(condition, Spring):
            along = condition.stiffness or condition.body_stiffness or ()
            rows = model.selected(condition)
            is_supported[np.ix_(rows, np.flatnonzero(along))] = True
        elif isinstance(condition, Pin):
            is_supported[model.selected(condition)[0], :2] = True
    return is_supported


def springs_of_components(model: Model, volume: Areas) -> Entries:
    """The spring supports of components of nodes, N/m^4, each with the number of its condition among those that act
    throughout a run."""
    springs = [entries(np.zeros(0, dtype=np.int64), 0, 0.0, 0)]
    for number, (_, condition) in enumerate(driving_conditions(model)):
        if isinstance(condition, Spring):
            rows = model.selected(condition)
            for axis, stiffness in enumerate(resistance_of_spring(condition, model, volume, rows).T):
                springs.append(entries(rows, axis, stiffness, number))
    every = Entries(*(np.concatenate(column) for column in zip(*springs, strict=True)))
    return chosen(every, every.value > 0)


def resistance_of_spring(spring: Spring, model: Model, volume: Areas, rows: NDArray[np.int64]) -> Array:
    """Stiffness (k, d), N/m^4, of a spring support at its nodes."""
    if spring.body_stiffness is not None:
        return np.tile(np.array(spring.body_stiffness), (len(rows), 1))
    extent = spring.length or spring.surface
    per = np.full(len(rows), extent / volume[rows].sum()) if extent else 1 / (spring.rows * model.grid.delta[rows])
    assert spring.stiffness is not None
    return np.asarray(per[:, None] * np.array(spring.stiffness))


def _slip(ring: Ring, u: NDArray[Any]) -> Array:
    """Displacements (p, 2) of a pin's nodes beside the ring that turns with them, m."""
    displacement = u[ring.rows, :2].astype(float)
    return np.asarray(displacement - float((ring.weight * displacement).sum()) * ring.turn)
