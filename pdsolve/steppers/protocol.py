"""The interface of a stepper: what the run asks of a time integration."""

from __future__ import annotations

from typing import Protocol

from pdsolve.state import State


class Stepper(Protocol):
    """A time integration of the state of a system."""

    def advance(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
