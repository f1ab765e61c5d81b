"""Changes of nodes during a run: some are born and some die between two steps.

A node whose bonds change, such as one beside a splitting cell, dies too and is born again under the same id: what is
stored about a node holds for its whole life.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.run.system import PreparedRun, System, system_with_moved_zone
from pdsolve.state import State, zero_state
from pdsolve.zone.summary import ZoneSummary


class SystemAfterNodeChange(NamedTuple):
    """The system of another set of m nodes, and its state."""

    system: System  # of the same settings and the same step; its loads are those of now
    state: State
    previous_rows: NDArray[np.int64]  # (m,) row of each node in the cloud before, -1 of those that are born


class Regridder(Protocol):
    """Decides when and how nodes change, from the state alone, so that a resumed run equals an uninterrupted one."""

    steps_between_checks: int  # steps between two looks

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """The nodes after `step`, a multiple of `steps_between_checks`; None if they stay."""

    def create_system_with_checkpoint_nodes(self, initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
        """The system of a checkpoint with the nodes `checkpoint["ids"]`, in that order.

        `initial_system` is that of the start. The caller restores state, loads and broken bonds.
        """

    def zone_summary(self, system: System) -> ZoneSummary | None:
        """Summary of the finer nodes."""

    def summary(self, zone_summary: ZoneSummary) -> dict[str, Any]:
        """Entries for the summary of the results."""


def create_system_if_zone_changed(system: System, with_state: bool = True) -> SystemAfterNodeChange | None:
    """The nodes of a moving fine zone if they have changed since the last call; else None.

    Without `with_state`, that of the change is of no nodes.
    """
    assert system.moving_zone_operator is not None
    before, shown = system.moving_zone_operator, system.moving_zone_operator.new_operator_if_nodes_changed()
    if shown is None:
        return None
    row = np.minimum(np.searchsorted(before.places, shown.places), len(before.places) - 1)
    same = (before.places[row] == shown.places) & (
        before.node_and_bond_signatures[row] == shown.node_and_bond_signatures
    )
    return SystemAfterNodeChange(
        system_with_moved_zone(system, shown),
        shown.state() if with_state else zero_state(0, 2),
        np.where(same, row, -1),
    )


def create_system_with_checkpoint_zone(initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
    """The system of a checkpoint, for a run that began as `initial_system`."""
    assert initial_system.moving_zone_operator is not None
    initial_system.moving_zone_operator.restore(checkpoint, initial_system.moving_zone_operator.broken())
    change = create_system_if_zone_changed(initial_system)
    return (
        PreparedRun(initial_system, initial_system.moving_zone_operator.state())
        if change is None
        else PreparedRun(change.system, change.state)
    )
