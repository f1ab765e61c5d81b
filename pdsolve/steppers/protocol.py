"""The interface of a stepper: what the run asks of a time integration."""

from __future__ import annotations

from typing import Protocol

from pdsolve.state import State


class Stepper(Protocol):
    """A time integration of the state of a system."""

    def advance(self, state: State, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1, in place."""
