"""The interface of a run to its physics: records of conserved quantities, and closing remarks."""

from __future__ import annotations

from typing import Any, Protocol

from pdsolve.results import FrameRecord
from pdsolve.run.measures import NodeEnergiesAndBreaks
from pdsolve.run.system import PreparedRun, System
from pdsolve.state import State


class PhysicsRecords(Protocol):
    """Records of what a run conserves: energy and momentum, or amounts of a substance."""

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""

    @property
    def balance_error(self) -> float:
        """Relative error of the balance at the last entry: amount created over amount supplied."""

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of the balance in words, with so many broken bonds, for a progress display."""

    def switch_system(self, system: System) -> None:
        """Continue with changed nodes."""

    def evaluate_balance(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Evaluate the balance at this step, without recording it."""

    def record_step(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Record this step. Raises UnstableError."""

    def move_records_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with the records since the last one."""

    def metadata(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""

    def summary(self) -> dict[str, Any]:
        """Results of the run for its summary."""

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last records."""


class CoupledRecords:
    """The records of a motion and of what diffuses on the same nodes; see `PhysicsRecords`."""

    def __init__(
        self, motion_records: PhysicsRecords, other_records: tuple[tuple[PhysicsRecords, PreparedRun], ...]
    ) -> None:
        self._motion, self._others = motion_records, other_records

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self._motion.broken_directed_bond_count

    @property
    def balance_error(self) -> float:
        """The worst of all, by size."""
        return max([self._motion.balance_error, *(records.balance_error for records, _ in self._others)], key=abs)

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of all balances in words, with so many broken bonds, for a progress display."""
        return "; ".join(
            [
                self._motion.progress_text(broken_directed_bond_count),
                *(records.progress_text(broken_directed_bond_count) for records, _ in self._others),
            ]
        )

    def switch_system(self, system: System) -> None:
        """Go on with other nodes."""
        self._motion.switch_system(system)

    def evaluate_balance(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Make the last entries those of this step, without noting them."""
        self._motion.evaluate_balance(state, step, energies_and_breaks)
        for records, prepared in self._others:
            records.evaluate_balance(prepared.state, step, energies_and_breaks)

    def record_step(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Note this step. Raises UnstableError."""
        self._motion.record_step(state, step, energies_and_breaks)
        for records, prepared in self._others:
            records.record_step(prepared.state, step, energies_and_breaks)

    def move_records_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with what was noted since the last one."""
        frame = self._motion.move_records_into(frame)
        for records, _ in self._others:
            frame = records.move_records_into(frame)
        return frame

    def metadata(self) -> dict[str, Any]:
        """What results say of the physics from the start on."""
        return {**self._motion.metadata(), "physics": "thermoelastic"}

    def summary(self) -> dict[str, Any]:
        """What the run came to: that of the motion, and of each other under the name of its physics."""
        others = [records.summary() for records, _ in self._others]
        return {**self._motion.summary(), **{str(summary["physics"]): summary for summary in others}}

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last records of the motion."""
        self._motion.warn_at_end()
