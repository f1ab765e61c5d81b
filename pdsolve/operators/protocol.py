"""What steppers, measures and results may ask of an operator, whatever it sums over.

listed   any law over a list of bonds, in the plane and in space: the reference
blocks   pair laws on lattices, fast, and those of families that say their passes in tuples
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Kept = Mapping[str, NDArray[Any]]  # what an operator puts into a checkpoint


class Operator(Protocol):
    """What the neighbours of n nodes do to them; rows are those of the cloud."""

    name: str  # of the kernel, for the record
    unknowns: tuple[Unknown, ...]
    symmetric: bool  # energy and momentum are conserved

    def place(self, state: State) -> State:
        """The state in arrays of the operator's own layout, to go on with."""

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w) at a state, N/m^3, to `out`; what is over its limit breaks in this `step`.

        `dt` is the time since the last step, s, 0 at rest. What breaking spends is booked in the state.
        """

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Densities (n,), J/m^3, of the energy that is held, and that softening has spent so far."""

    def fields(self, state: State) -> Mapping[str, NDArray[np.float64]]:
        """What it knows of nodes (n,) besides, by the names of columns of results, in SI units."""

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of what resists a node's motion, N/m^4: densities rho are stable up to sqrt(2 rho / it)."""

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the force densities by the values, (n w, n w), N/m^4; component a of node i is at
        w i + a."""

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of both nodes of the bonds that are intact, source and target, in order; of the sources from
        `first` to `last` - 1, or of all. Those at the `start` may be asked for while others march."""

    def broken(self, after: int = 0) -> Broken:
        """The bonds broken after a step."""

    def keep(self) -> Kept:
        """What bonds remember, for a checkpoint, by the rows of their nodes; but for what has broken."""

    def back(self, kept: Kept, broken: Broken) -> None:
        """Go back to what was kept, and to these broken bonds."""

    def bytes(self) -> int:
        """Memory of all its arrays."""
