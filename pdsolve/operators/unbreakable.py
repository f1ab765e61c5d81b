"""What an operator answers whose bonds do not break, if it has any: fluxes, or forces beside those of bonds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import BondLayout, Motion
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from pdsolve.stepper import Stepper


class UnbreakableOperator:
    """An operator none of whose bonds break, without bonds unless it says otherwise; see `Operator`."""

    bond_layout: BondLayout = "listed"

    def to_own_layout(self, state: State) -> State:
        """The state itself, whose arrays are those of all nodes."""
        return state

    def fields(self, state: State) -> dict[str, NDArray[Any]]:
        """Empty: what has no bonds stores no fields."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4."""
        raise NotImplementedError("written for each operator")

    def intact_stiffness_bound(self) -> None:
        """None: no bond breaks."""

    def march(self, motion: Motion) -> Stepper | None:
        """None: general steppers take the steps."""
        return None

    def update_history(self, state: State) -> None:
        """Nothing: no node remembers strain."""

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """No bonds: source and target rows (0,)."""
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)

    def broken(self, after_step: int = 0) -> Broken:
        """No broken bonds."""
        return Broken(*np.zeros((3, 0), dtype=np.int64))
