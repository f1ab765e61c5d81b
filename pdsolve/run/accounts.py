"""What a run asks of its physics: the books it keeps, and what it has to say in the end."""

from __future__ import annotations

from typing import Any, Protocol

from pdsolve.results import Frame
from pdsolve.run.measures import Asked
from pdsolve.run.system import System
from pdsolve.state import State


class Accounts(Protocol):
    """The books of what is conserved in a run: energy and momentum of a motion, amounts of a substance."""

    @property
    def broken(self) -> int:
        """Directed bonds broken, as of the last entry."""

    @property
    def balance(self) -> float:
        """What has appeared from nowhere, as of the last entry, over what was put in."""

    def words(self, broken: int) -> str:
        """How the books stand with so many broken bonds, for a watcher."""

    def follow(self, system: System) -> None:
        """Go on with other nodes."""

    def settle(self, state: State, step: int, asked: Asked) -> None:
        """Make the last entry that of this step, without noting it."""

    def take(self, state: State, step: int, asked: Asked) -> None:
        """Note this step. Raises UnstableError."""

    def entered(self, frame: Frame) -> Frame:
        """The frame with what was noted since the last one."""

    def meta(self) -> dict[str, Any]:
        """What results say of the physics from the start on."""

    def summary(self) -> dict[str, Any]:
        """What the run came to."""

    def close(self) -> None:
        """Warn of what the books show in the end."""
