"""The common part of operators on two lattices: they determine which nodes exist, and have a fused march."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.model import Model
from pdsolve.operators.protocol import BondLayout, CheckpointArrays, Motion, Operator
from pdsolve.state import Broken, State, Unknown, zero_state
from pdsolve.stepper import Stepper

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.zone.summary import ZoneSummary


class EnergyBalanceTotals(NamedTuple):
    """Energies, momentum and broken bonds of all nodes; of a plate per unit thickness."""

    kinetic: float  # J, in the plane J/m, as those below
    strain: float
    dissipated: float  # by bonds
    damped: float  # taken by damping
    work: float
    momentum_x: float  # N s, in the plane N s/m
    momentum_y: float
    broken: int  # directed bonds, so far
    momentum_z: float = 0.0  # N s, of bodies


class TwoLatticeEngine(Protocol):
    """The fine and coarse nodes."""

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises UnstableError."""

    def sum_forces_and_break_bonds(self, step: int, dt: float) -> None:
        """Sum the forces at the displacements there are, those of loads left out; bonds over their limit break."""

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint."""

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint."""

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone; with collocation its stretch is that of coarse pairs."""

    def bytes(self) -> int:
        """The memory of the nodes' arrays, bytes."""


N = TypeVar("N", bound=TwoLatticeEngine)


class TwoLatticeOperator(ABC, Generic[N]):
    """An operator on the n current nodes of `engine`, in the order of their places; its arrays are those of `engine`.

    A tied node has no motion of its own: its force density is the one with which it follows the nodes it is tied to.
    """

    name: str
    unknowns: tuple[Unknown, ...] = (Unknown("u", 2, 2),)
    symmetric: bool
    bond_layout: BondLayout = "listed"
    engine: N
    places: NDArray[np.int64]  # (n,)

    @property
    def kind(self) -> np.dtype[Any]:
        """Precision of the motion."""
        return np.dtype(np.float64)

    @property
    @abstractmethod
    def current_nodes_model(self) -> Model:
        """The model of the n current nodes, without conditions."""

    @property
    @abstractmethod
    def nodes_are_unchanged(self) -> bool:
        """Whether the nodes of `engine` are unchanged."""

    @abstractmethod
    def new_operator_if_nodes_changed(self) -> Self | None:
        """The operator on the current nodes if they have changed, else None."""

    @abstractmethod
    def _write_node_motion(self, state: State) -> None:
        """Set the nodes of `engine` to the values and rates of a state."""

    def set_node_motion(self, state: State) -> None:
        """Set the nodes of `engine` to the values and rates of a state.

        Raises RuntimeError if the nodes have changed.
        """
        if not self.nodes_are_unchanged:
            raise RuntimeError(f"{self.name}: nodes have become others; ask for the present ones")
        self._write_node_motion(state)

    @abstractmethod
    def copy_to_state(self, state: State) -> None:
        """Update a state from the nodes of `engine`."""

    @abstractmethod
    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations (n, d), m/s^2, from the most recent sum of forces."""

    @abstractmethod
    def dissipated_energy(self) -> NDArray[np.float64]:
        """Energy density (n,), J/m^3, dissipated so far by the nodes' broken and softened bonds."""

    @abstractmethod
    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (n d, n d), N/m^4, of the force densities by the values; see `Operator`."""

    @abstractmethod
    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of some nodes; see `Operator`."""

    def bonds_of(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of these nodes, which increase, in order."""
        source, target = self.bonds(int(rows[0]), int(rows[-1]) + 1) if len(rows) else np.zeros((2, 0), dtype=np.int64)
        is_wanted = np.isin(source, rows)
        return source[is_wanted], target[is_wanted]

    def state(self) -> State:
        """The state of the current nodes."""
        state = zero_state(len(self.places), self.unknowns[0].width, self.kind)
        self.copy_to_state(state)
        return state

    def to_own_layout(self, state: State) -> State:
        """The state unchanged: the arrays of the two lattices are the operator's own."""
        return state

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add force densities (n, d), N/m^3, to `out`; bonds over their limit break; see `Operator`."""
        before = self.dissipated_energy()
        self.set_node_motion(state)
        self.engine.sum_forces_and_break_bonds(step, dt)
        out += self.current_nodes_model.rho[:, None] * self.accelerations()
        state.dissipated[:] += self.dissipated_energy() - before

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,), N/m^4, from the row sums of the tangent at rest (Gershgorin's discs); see `Operator`."""
        nodes = len(self.places)
        rows = abs(self.tangent(zero_state(nodes, 2))).sum(axis=1)
        return np.asarray(rows.reshape(nodes, 2).max(axis=1) / 2, dtype=np.float64)

    def intact_stiffness_bound(self) -> None:
        """None: pairs that are left are no stiffer as others break."""

    def march(self, motion: Motion) -> Stepper | None:
        """Steps of both lattices, which have the motion and its conditions."""
        return TwoLatticeStepper(self)

    def update_history(self, state: State) -> None:
        """Nothing: no node remembers strain."""

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays of the two lattices for a checkpoint."""
        return self.engine.checkpoint_arrays()

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint, which has the broken bonds; for other nodes see `new_operator_if_nodes_changed`."""
        self.engine.restore(checkpoint)

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: the two lattices store no fields besides their displacements."""
        return {}

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        return self.engine.bytes()


class TwoLatticeStepper(Stepper):
    """Takes steps with a two-lattice operator: forces and motion in one sweep, during which nodes may change."""

    operator_has_state, integrator = True, "fused march"

    def __init__(self, operator: TwoLatticeOperator[Any]) -> None:
        self._operator = operator

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1; returns the last one. Raises UnstableError.

        The state is updated as long as it has the operator's nodes; it may have none.
        """
        self._operator.engine.advance(first_step, end_step)
        if self._operator.nodes_are_unchanged and len(state.value):
            self._operator.copy_to_state(state)
        return end_step - 1

    def on_operator(self, operator: Operator) -> Stepper:
        """The stepper of the same plate or body with other current nodes."""
        return TwoLatticeStepper(cast("TwoLatticeOperator[Any]", operator))
