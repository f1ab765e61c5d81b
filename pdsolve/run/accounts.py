"""The interface of a run to its physics: accounts of conserved quantities, and closing remarks."""

from __future__ import annotations

from typing import Any, Protocol

from pdsolve.results import Frame
from pdsolve.run.measures import Asked
from pdsolve.run.system import Prepared, System
from pdsolve.state import State


class Accounts(Protocol):
    """Accounts of what a run conserves: energy and momentum, or amounts of a substance."""

    @property
    def broken(self) -> int:
        """Directed bonds broken, as of the last entry."""

    @property
    def balance(self) -> float:
        """Relative error of the balance at the last entry: amount created over amount supplied."""

    def words(self, broken: int) -> str:
        """State of the accounts in words, with so many broken bonds, for a progress display."""

    def follow(self, system: System) -> None:
        """Continue with changed nodes."""

    def settle(self, state: State, step: int, bond_state: Asked) -> None:
        """Make this step the last entry, without recording it."""

    def take(self, state: State, step: int, bond_state: Asked) -> None:
        """Record this step. Raises UnstableError."""

    def entered(self, frame: Frame) -> Frame:
        """The frame with the records since the last one."""

    def meta(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""

    def summary(self) -> dict[str, Any]:
        """Results of the run for its summary."""

    def close(self) -> None:
        """Issue warnings that follow from the final accounts."""


class Together:
    """The books of a motion and of what diffuses on the same nodes; see `Accounts`."""

    def __init__(self, motion: Accounts, others: tuple[tuple[Accounts, Prepared], ...]) -> None:
        self._motion, self._others = motion, others

    @property
    def broken(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self._motion.broken

    @property
    def balance(self) -> float:
        """The worst of all, by size."""
        return max([self._motion.balance, *(accounts.balance for accounts, _ in self._others)], key=abs)

    def words(self, broken: int) -> str:
        """How the books stand with so many broken bonds, for a watcher."""
        return "; ".join([self._motion.words(broken), *(accounts.words(broken) for accounts, _ in self._others)])

    def follow(self, system: System) -> None:
        """Go on with other nodes."""
        self._motion.follow(system)

    def settle(self, state: State, step: int, bond_state: Asked) -> None:
        """Make the last entries those of this step, without noting them."""
        self._motion.settle(state, step, bond_state)
        for accounts, prepared in self._others:
            accounts.settle(prepared.state, step, bond_state)

    def take(self, state: State, step: int, bond_state: Asked) -> None:
        """Note this step. Raises UnstableError."""
        self._motion.take(state, step, bond_state)
        for accounts, prepared in self._others:
            accounts.take(prepared.state, step, bond_state)

    def entered(self, frame: Frame) -> Frame:
        """The frame with what was noted since the last one."""
        frame = self._motion.entered(frame)
        for accounts, _ in self._others:
            frame = accounts.entered(frame)
        return frame

    def meta(self) -> dict[str, Any]:
        """What results say of the physics from the start on."""
        return {**self._motion.meta(), "physics": "thermoelastic"}

    def summary(self) -> dict[str, Any]:
        """What the run came to: that of the motion, and of each other under the name of its physics."""
        others = [accounts.summary() for accounts, _ in self._others]
        return {**self._motion.summary(), **{str(summary["physics"]): summary for summary in others}}

    def close(self) -> None:
        """Warn of what the books show in the end."""
        self._motion.close()
