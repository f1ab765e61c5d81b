"""What operators have in common that march nodes of their own, of two lattices, and take no state from outside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.operator import Kept
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Nodes(Protocol):
    """The fine and coarse nodes."""

    def keep(self) -> Kept:
        """What a checkpoint holds of them."""

    def bytes(self) -> int:
        """What they take."""


N = TypeVar("N", bound=Nodes)


class OfItsOwn(Generic[N]):
    """An operator whose state is that of `hybrid`."""

    name: str
    hybrid: N

    def keep(self) -> Kept:
        """As in `Operator`."""
        return self.hybrid.keep()

    def back(self, kept: Kept, broken: Broken) -> None:
        """As in `Operator`; the nodes are those of the checkpoint."""

    def place(self, state: State) -> State:
        """As in `Operator`."""
        return state

    def stiffest(self) -> NDArray[np.float64]:
        """Raises TypeError: the step is bounded by lattices, of which these nodes are some."""
        raise TypeError(f"{self.name}: found nodes of two lattices, expected those of one")

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Raises TypeError: forces are those of its own nodes, not of a state that is given."""
        raise TypeError(f"{self.name}: found a state from outside, expected to march")

    def tangent(self, state: State) -> csr_array:
        """Raises TypeError, as `add`."""
        raise TypeError(f"{self.name}: found a state from outside, expected to march")

    def bytes(self) -> int:
        """As in `Operator`."""
        return self.hybrid.bytes()
