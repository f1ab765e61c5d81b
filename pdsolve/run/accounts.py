"""What a run asks of its accounts: records of what is conserved, and closing remarks."""

from __future__ import annotations

from typing import Any, Protocol

from pdsolve.results import FrameRecord
from pdsolve.run.system import System


class Accounts(Protocol):
    """Records of what a run conserves: energy and momentum, or amounts of a substance.

    Their rows are in the database; whoever resumes a run opens its accounts with the results so far.
    """

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""

    @property
    def last_break_step(self) -> int:
        """Step in which a bond broke last, as of the last entry; 0: none has."""

    @property
    def balance_error(self) -> float:
        """Relative error of the balance at the last entry: amount created over amount supplied."""

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of the balance in words, with so many broken bonds, for a progress display."""

    def follow(self, system: System) -> None:
        """Continue with changed nodes."""

    def evaluate(self, step: int) -> None:
        """Evaluate the balance at this step, without recording it."""

    def record(self, step: int) -> None:
        """Record this step. Raises UnstableError."""

    def move_rows_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with the rows since the last one."""

    def metadata(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""

    def summary(self) -> dict[str, Any]:
        """Entries for the summary of the results."""

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last entries."""


class CoupledAccounts:
    """The accounts of a motion and of what diffuses on the same nodes; see `Accounts`."""

    def __init__(self, motion: Accounts, others: tuple[Accounts, ...]) -> None:
        self._motion, self._all = motion, (motion, *others)

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self._motion.broken_directed_bond_count

    @property
    def last_break_step(self) -> int:
        """Step in which a bond broke last, as of the last entry; 0: none has."""
        return self._motion.last_break_step

    @property
    def balance_error(self) -> float:
        """The worst of all, by size."""
        return max((accounts.balance_error for accounts in self._all), key=abs)

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of all balances in words, with so many broken bonds, for a progress display."""
        return "; ".join(accounts.progress_text(broken_directed_bond_count) for accounts in self._all)

    def follow(self, system: System) -> None:
        """Continue with changed nodes of the motion."""
        self._motion.follow(system)

    def evaluate(self, step: int) -> None:
        """Evaluate all balances at this step, without recording them."""
        for accounts in self._all:
            accounts.evaluate(step)

    def record(self, step: int) -> None:
        """Record this step. Raises UnstableError."""
        for accounts in self._all:
            accounts.record(step)

    def move_rows_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with the rows since the last one."""
        for accounts in self._all:
            frame = accounts.move_rows_into(frame)
        return frame

    def metadata(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""
        return {**self._motion.metadata(), "physics": "thermoelastic"}

    def summary(self) -> dict[str, Any]:
        """The summary of the motion, and summaries of what is coupled to it under the names of their physics."""
        motion, *others = (accounts.summary() for accounts in self._all)
        return {**motion, **{str(summary["physics"]): summary for summary in others}}

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last entries of the motion."""
        self._motion.warn_at_end()
