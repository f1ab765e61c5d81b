"""Changes of nodes during a run: some are born and some die between two steps.

A node whose bonds change, such as one beside a splitting cell, dies too and is born again under the same id: what is
stored about a node holds for its whole life.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.run.system import (
    Ends,
    PreparedRun,
    RefinementThresholdFromStep,
    Regridder,
    System,
    SystemAfterNodeChange,
    system_with_moved_zone,
)
from pdsolve.state import Broken, State, zero_state
from pdsolve.zone.cells import EVERY
from pdsolve.zone.summary import ZoneSummary

if TYPE_CHECKING:
    from pdsolve.adaptivity.hybrid.operator import HybridOperator
    from pdsolve.crack_growth.growth import Growth


class MovingZone(Regridder):
    """A fine zone that moves within the steps of its operator, which has the state."""

    nodes_may_change = True
    least_steps = EVERY
    stops_at_records_only = True

    def __init__(self) -> None:
        self._thresholds: tuple[RefinementThresholdFromStep, ...] = ()

    def refine_earlier(self, thresholds: tuple[RefinementThresholdFromStep, ...]) -> None:
        """Make cells fine earlier than the model says; without thresholds, as it says."""
        self._thresholds = thresholds

    def is_due(self, step: int) -> bool:
        """Whether cells are to become fine earlier after `step`."""
        return any(threshold.first_step <= step for threshold in self._thresholds)

    def next_check(self, step: int, last_step: int) -> int:
        """The next step from which cells become fine earlier."""
        return next((each.first_step for each in self._thresholds if each.first_step > step), last_step)

    def change_nodes(self, system: System, state: State, step: int) -> None:
        """Let cells become fine as early as they are to be after `step`; the operator changes its nodes by itself."""
        begun = [threshold for threshold in self._thresholds if threshold.first_step <= step]
        engine = cast("HybridOperator", system.moving_zone_operator).engine
        engine.set_refinement_stretch_ratio(begun[-1].refinement_stretch_ratio)

    def collect_change(self, system: System) -> SystemAfterNodeChange | None:
        """The change of nodes since the last call, with a state of none; None without any."""
        return create_system_if_zone_changed(system, with_state=False)

    def create_system_with_checkpoint_nodes(self, initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
        """The system of a checkpoint with its nodes, and with their state."""
        operator = initial_system.moving_zone_operator
        assert operator is not None
        operator.restore(checkpoint, operator.broken())
        change = create_system_if_zone_changed(initial_system)
        return PreparedRun(initial_system, operator.state()) if change is None else PreparedRun(*change[:2])

    def bonds_of_rows(self, system: System, rows: NDArray[np.int64]) -> list[Ends]:
        """Source and target rows of the intact bonds of these nodes, which increase."""
        assert system.moving_zone_operator is not None
        return [system.moving_zone_operator.bonds_of(rows)]

    def zone_summary(self, system: System) -> ZoneSummary | None:
        """Summary of the fine zone."""
        return None if system.moving_zone_operator is None else system.moving_zone_operator.zone_summary()


class GrowingCracks(Regridder):
    """Cracks of particles, which cut bonds as they grow: in motion between steps, at rest as the stepper asks."""

    def __init__(self, growth: Growth) -> None:
        self.growth, self.steps_between_checks = growth, growth.every

    def change_nodes(self, system: System, state: State, step: int) -> None:
        """Let cracks grow after `step`."""
        self.growth.look(state, step + 1)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The particles and their memory."""
        return self.growth.checkpoint_arrays()

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint, with the bonds broken until then. Raises CheckpointError."""
        self.growth.restore(checkpoint, broken)

    def particle_rows(self, after_step: int) -> Sequence[tuple[float, ...]]:
        """Rows of the particles since a step."""
        return self.growth.rows(after_step)

    def summary(self, system: System) -> dict[str, Any]:
        """How many particles there are, and what is to be said of them."""
        return {"particles": len(self.growth.particles.place), "remarks": self.growth.remarks}


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
