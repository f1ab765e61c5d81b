"""Viscous damping proportional to stiffness: the part of Rayleigh damping that `run.damping_time` asks for.

A bond that is not broken pulls with its elastic stiffness times a time beta, s, times the rate of its stretch, along
the direction that it has now: -beta K v of small displacements, with the velocities v in the middle of a step. A mode
of angular frequency w decays by the ratio beta w / 2 of critical damping, so that short waves die first. Rigid motion,
turning included, is not damped; momentum and angular momentum stay. As velocities lag behind by half a step, the stable
step is shorter, by sqrt(1 + x^2) - x with the ratio x of the highest mode (Belytschko, Liu, Moran: Nonlinear finite
elements). The work of these forces is booked as damped by the trapezoidal rule that Verlet itself follows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import like
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.operators.together import Together, unwrap_bond_operator
from pdsolve.operators.unbreakable import UnbreakableOperator
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

FORCE = "damping_force"  # in checkpoints


def add_stiffness_damping(model: Model, operator: Operator, state: State) -> Operator:
    """The operator of a model with its damping; `state` is at rest and undeformed."""
    beta = model.settings.run.damping_time
    damping = StiffnessDamping(unwrap_bond_operator(operator), model.grid.position, state, beta)
    return Together(damping, operator)


def damped_stable_time_step(undamped_step: float, beta: float) -> float:
    """The longest surely stable step, s, where it is `undamped_step` without damping by a time `beta`, s.

    The highest angular frequency is at most 2 / undamped_step.
    """
    ratio = beta / undamped_step
    return undamped_step * float(np.sqrt(1 + ratio**2) - ratio) if np.isfinite(undamped_step) else undamped_step


class StiffnessDamping(UnbreakableOperator):
    """The damping forces of n nodes; see `Operator`. They have no energy of their own and no bonds."""

    name = "stiffness damping"
    symmetric = True

    def __init__(self, bonds: Operator, position: NDArray[np.float64], state: State, beta: float) -> None:
        """`bonds` are of nodes at `position` (n, d), m; their stiffness in `state`, at rest and undeformed, damps for a
        time `beta`, s."""
        self._bonds, self._position, self._beta, self.unknowns = bonds, position, beta, bonds.unknowns
        nodes, width = state.value.shape
        blocks = bonds.tangent(state).tobsr((width, width))
        blocks.sort_indices()
        self._start, self._target = blocks.indptr, blocks.indices  # blocks of node i from start[i] on, by targets
        source = np.repeat(np.arange(nodes), np.diff(self._start))
        self._bond_keys = source * nodes + self._target  # (b,) ascending
        # k (b,), N/m^4, of blocks -k n n of a bond in the direction n; 0 of those of a node with itself
        self._initial_stiffness = np.where(source == self._target, 0.0, -np.trace(blocks.data, axis1=1, axis2=2))
        self._stiffness, self._known_step = self._initial_stiffness.copy(), 0
        self._force = np.zeros(state.value.shape)  # of the last step, N/m^3

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w) at the velocities of a state to `out`, and book the energy they take."""
        broken = self._bonds.broken(self._known_step)
        self._known_step = step - 1
        keys = broken.source * len(self._force) + broken.target
        self._stiffness[np.searchsorted(self._bond_keys, keys)] = 0.0  # what is broken damps no more
        velocity, force = np.ascontiguousarray(state.rate, dtype=np.float64), np.zeros_like(self._force)
        current = self._position + state.value
        add_damping_forces(self._start, self._target, self._beta * self._stiffness, current, velocity, force)
        state.damped[:] -= dt / 2 * ((self._force + force) * velocity).sum(axis=1)
        out += force
        self._force = force

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """No energy (n,) is stored or dissipated by softening."""
        return np.zeros(len(self._force)), np.zeros(len(self._force))

    def stiffness_bound(self) -> NDArray[np.float64]:
        """No stiffness (n,): what damping does to the stable step is not that of a spring."""
        return np.zeros(len(self._force))

    def tangent(self, state: State) -> csr_array:
        """No stiffness (n w, n w)."""
        from scipy.sparse import csr_array

        return csr_array((self._force.size, self._force.size))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The forces of the last step."""
        return {FORCE: self._force}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the forces of the last step; the bonds say later which are broken. Raises CheckpointError."""
        self._force = like(checkpoint, FORCE, self._force).copy()
        self._stiffness, self._known_step = self._initial_stiffness.copy(), 0

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        of_bonds = self._target, self._bond_keys, self._initial_stiffness, self._stiffness
        return sum(array.nbytes for array in (*of_bonds, self._start, self._force))


@cached_njit(error_model="numpy")
def add_damping_forces(start, target, damping, position, velocity, force):  # type: ignore[no-untyped-def]
    """Add to `force` (n, d), N/m^3, what bonds of these coefficients `damping` (b,), N s/m^4, pull with at the current
    `position` (n, d), m, and `velocity` (n, d), m/s."""
    for i in range(len(force)):
        for k in range(start[i], start[i + 1]):
            j = target[k]
            if damping[k] == 0:
                continue
            along, square = 0.0, 0.0
            for axis in range(force.shape[1]):
                y = position[j, axis] - position[i, axis]
                along += y * (velocity[j, axis] - velocity[i, axis])
                square += y * y
            pull = damping[k] * along / square
            for axis in range(force.shape[1]):
                force[i, axis] += pull * (position[j, axis] - position[i, axis])
