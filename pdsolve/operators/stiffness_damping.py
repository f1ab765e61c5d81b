"""Viscous damping proportional to stiffness: the part of Rayleigh damping that `run.damping_time` asks for.

The force densities are -beta K v with a time beta, s, the elastic stiffness K of the bonds that are not broken, and the
velocities v in the middle of a step. A mode of angular frequency w decays by the ratio beta w / 2 of critical damping,
so that short waves die first; rigid motion is not damped. As velocities lag behind by half a step, the stable step is
shorter, by sqrt(1 + x^2) - x with the ratio x of the highest mode (Belytschko, Liu, Moran: Nonlinear finite elements).
The work of these forces is booked as damped by the trapezoidal rule that Verlet itself follows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import like
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.operators.together import Together, unwrap_bond_operator
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

FORCE = "damping_force"  # in checkpoints


def add_stiffness_damping(model: Model, operator: Operator, state: State) -> Operator:
    """The operator of a model with its damping; `state` is at rest and undeformed."""
    damping = StiffnessDamping(unwrap_bond_operator(operator), state, model.settings.run.damping_time)
    return Together(damping, operator)


def damped_stable_time_step(undamped_step: float, beta: float) -> float:
    """The longest surely stable step, s, where it is `undamped_step` without damping by a time `beta`, s.

    The highest angular frequency is at most 2 / undamped_step.
    """
    ratio = beta / undamped_step
    return undamped_step * float(np.sqrt(1 + ratio**2) - ratio) if np.isfinite(undamped_step) else undamped_step


class StiffnessDamping:
    """The damping forces of n nodes; see `Operator`. They have no energy of their own and no bonds."""

    name = "stiffness damping"
    symmetric = True

    def __init__(self, bonds: Operator, state: State, beta: float) -> None:
        """`bonds` are those whose stiffness in `state`, at rest and undeformed, damps for a time `beta`, s."""
        self._bonds, self._beta, self.unknowns = bonds, beta, bonds.unknowns
        self._width = state.value.shape[1]
        self._whole = bonds.tangent(state).tobsr((self._width, self._width))
        self._whole.sort_indices()
        nodes, each = len(state.value), np.diff(self._whole.indptr)
        self._pairs = np.repeat(np.arange(nodes), each) * nodes + self._whole.indices  # (blocks,) ascending
        self._stiffness, self._known_step = self._whole.copy(), 0
        self._force = np.zeros(state.value.shape)  # of the last step, N/m^3

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w) at the velocities of a state to `out`, and book the energy they take."""
        self._remove_broken_bonds(step - 1)
        velocity = np.ascontiguousarray(state.rate, dtype=np.float64)
        force = -self._beta * (self._stiffness @ velocity.ravel()).reshape(velocity.shape)
        state.damped[:] -= dt / 2 * ((self._force + force) * velocity).sum(axis=1)
        out += force
        self._force = force

    def _remove_broken_bonds(self, until_step: int) -> None:
        """Let bonds that broke until a step damp no more: what a bond adds to its source's rows goes."""
        new, blocks = self._bonds.broken(self._known_step), self._stiffness
        self._known_step = until_step
        if not len(new.step):
            return
        order = np.lexsort((new.target, new.source, new.step))  # as step by step, whatever the run began with
        source, target, nodes = new.source[order], new.target[order], len(self._force)
        bond, own = (np.searchsorted(self._pairs, source * nodes + end) for end in (target, source))
        np.add.at(blocks.data, own, blocks.data[bond])
        blocks.data[bond] = 0.0

    def to_own_layout(self, state: State) -> State:
        """The state, which may be in any layout."""
        return state

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """No energy (n,) is stored or dissipated by softening."""
        return np.zeros(len(self._force)), np.zeros(len(self._force))

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """No fields."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """No stiffness (n,): what damping does to the stable step is not that of a spring."""
        return np.zeros(len(self._force))

    def tangent(self, state: State) -> csr_array:
        """No stiffness (n w, n w)."""
        return 0.0 * self._whole.tocsr()

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """No bonds."""
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)

    def broken(self, after_step: int = 0) -> Broken:
        """No broken bonds."""
        return Broken(*np.zeros((3, 0), dtype=np.int64))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The forces of the last step."""
        return {FORCE: self._force}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the forces of the last step; the bonds say later which are broken. Raises CheckpointError."""
        self._force = like(checkpoint, FORCE, self._force).copy()
        self._stiffness, self._known_step = self._whole.copy(), 0

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        arrays = self._whole.data, self._stiffness.data, self._whole.indices, self._pairs, self._force
        return sum(array.nbytes for array in arrays)
