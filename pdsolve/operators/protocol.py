"""The interface of operators to steppers, measures and results.

listed   any law over a list of bonds, in the plane and in space: the reference
blocks   pair laws on lattices, fast, and laws of families whose passes are tuples
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.conditions import Drive
    from pdsolve.operators.contact.operator import PenaltyContact
    from pdsolve.operators.ghosts import Ghosts
    from pdsolve.stepper import Stepper

CheckpointArrays = Mapping[str, NDArray[Any]]  # what an operator puts into a checkpoint
BondLayout = Literal["tiles", "blocks", "families", "listed"]  # pairs on lattices, families on lattices, one by one


class Motion(NamedTuple):
    """What moves n nodes besides the forces of an operator."""

    state: State  # in the operator's own layout
    drive: Drive
    rho: NDArray[np.floating]  # (n,) kg/m^3, in the precision of the steps; of a content the volume, m^d
    time_step: float  # s
    damping_rates: NDArray[np.float64]  # (n,) 1/s, of free components
    ghosts: Ghosts | None = None  # nodes of other ranks
    contact: PenaltyContact | None = None  # that acts beside the operator


class Forces(Protocol):
    """What steppers in time ask of an operator."""

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w) at a state, N/m^3, to `out`; bonds over their limit break in this `step`.

        `dt` is the time since the last step, s. In quasi-static analysis it is 0: no time passes, and a law that
        depends on the rate has its instantaneous stiffness. Dissipated energy is booked in the state.
        """


class Operator(Forces, Protocol):
    """The forces of neighbours on n nodes; rows are those of the nodes."""

    name: str  # of the kernel, for the record
    unknowns: tuple[Unknown, ...]
    symmetric: bool  # energy and momentum are conserved

    @property
    def bond_layout(self) -> BondLayout:
        """How its bonds are stored."""

    def to_own_layout(self, state: State) -> State:
        """The state in the operator's own array layout."""

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""

    def fields(self, state: State) -> Mapping[str, NDArray[np.float64]]:
        """Other stored fields (n,), by result column, in SI units."""

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4: steps up to sqrt(2 rho / it) are stable for densities rho."""

    def intact_stiffness_bound(self) -> NDArray[np.float64] | None:
        """A bound (n,) of each node's stiffness, N/m^4, with the bonds that are left; it may grow in families whose
        bonds break. None: it never grows."""

    def march(self, motion: Motion) -> Stepper | None:
        """What takes steps in the operator's own sweeps, which sum forces and move nodes; None: Verlet calls
        `accumulate_force`."""

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the force densities by the values, (n w, n w), N/m^4.

        Component a of node i is at w i + a.
        """

    def update_history(self, state: State) -> None:
        """Update what nodes remember of strain at an equilibrium; no bond breaks."""

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of all, in order.

        Those at the start may be requested during a march.
        """

    def broken(self, after_step: int = 0) -> Broken:
        """The bonds broken after a step."""

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes, except which are broken."""

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint with these broken bonds."""

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""


class FluxOperator(Operator, Protocol):
    """An operator of one unknown of first order and one component, whose rates are linear in a potential of it."""

    volume: NDArray[np.float64]  # (n,) m^d; times the rates' derivatives by the potentials it is symmetric

    def potential(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """The potential (n,) at these values (n,)."""

    def follows(self, value: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose potential changes as their value does; that of others is constant."""

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add the rates (n,) at this `potential` (n,) to `out` (n,); linear."""
