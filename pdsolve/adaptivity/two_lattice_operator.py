"""What operators have in common that march nodes of their own, of two lattices, and take no state from outside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Kept
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Sums(NamedTuple):
    """What such nodes come to, all together."""

    kinetic: float  # J/m
    strain: float  # J/m
    dissipated: float  # J/m, spent by bonds
    damped: float  # J/m, taken by damping
    work: float  # J/m
    momentum_x: float  # N s/m
    momentum_y: float  # N s/m


class Nodes(Protocol):
    """The fine and coarse nodes."""

    def keep(self) -> Kept:
        """What a checkpoint holds of them."""

    def bytes(self) -> int:
        """The memory of the nodes' arrays, bytes."""


N = TypeVar("N", bound=Nodes)


class TwoLatticeOperator(Generic[N]):
    """An operator whose state is that of `hybrid`."""

    name: str
    hybrid: N

    def keep(self) -> Kept:
        """What a checkpoint holds of the two lattices."""
        return self.hybrid.keep()

    def back(self, kept: Kept, broken: Broken) -> None:
        """Restore a checkpoint, whose nodes this operator has, and its broken bonds."""

    def place(self, state: State) -> State:
        """The state unchanged: the arrays of the two lattices are the operator's own."""
        return state

    def stiffness_bound(self) -> NDArray[np.float64]:
        """Raises TypeError: the step is bounded by lattices, of which these nodes are some."""
        raise TypeError(f"{self.name}: found nodes of two lattices, expected those of one")

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Raises TypeError: forces are those of its own nodes, not of a state that is given."""
        raise TypeError(f"{self.name}: found a state from outside, expected to march")

    def tangent(self, state: State) -> csr_array:
        """Raises TypeError: the tangent is of a given state, but the lattices hold their own."""
        raise TypeError(f"{self.name}: found a state from outside, expected to march")

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        return self.hybrid.bytes()
