"""What an operator answers whose bonds do not break, if it has any: fluxes, or forces beside those of bonds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.state import Broken, State


class UnbreakableOperator:
    """An operator none of whose bonds break, without bonds unless it says otherwise; see `Operator`."""

    def to_own_layout(self, state: State) -> State:
        """The state itself, whose arrays are those of all nodes."""
        return state

    def fields(self, state: State) -> dict[str, NDArray[Any]]:
        """Empty: what has no bonds stores no fields."""
        return {}

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """No bonds: source and target rows (0,)."""
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)

    def broken(self, after_step: int = 0) -> Broken:
        """No broken bonds."""
        return Broken(*np.zeros((3, 0), dtype=np.int64))
