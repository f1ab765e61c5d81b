"""A prepared model: what stays during its steps, and what changes nodes or cuts bonds between them.

Some nodes are born and some die between two steps. A node whose bonds change, such as one beside a splitting cell, dies
too and is born again under the same id: what is stored about a node holds for its whole life.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Scheme
from pdsolve.conditions import Drive
from pdsolve.diffusion.system import Transport
from pdsolve.model import Model, counted
from pdsolve.numerics.team import Team
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.options import Options, threads_of
from pdsolve.ranks.slabs import Slab
from pdsolve.state import Broken, State, zero_state
from pdsolve.stepper import Stepper
from pdsolve.zone.cells import EVERY
from pdsolve.zone.summary import ZoneSummary

if TYPE_CHECKING:
    from pdsolve.adaptivity.factory import MovingZoneOperator
    from pdsolve.adaptivity.hybrid.operator import HybridOperator
    from pdsolve.crack_growth.growth import Growth

GAP = 64  # rows between nodes whose bonds are asked for together
Ends = tuple[NDArray[np.int64], NDArray[np.int64]]  # of bonds: source and target rows


class RefinementThresholdFromStep(NamedTuple):
    """From a step on, cells become fine at `refinement_stretch_ratio` of the stretch that breaks bonds."""

    first_step: int
    refinement_stretch_ratio: float


class SystemAfterNodeChange(NamedTuple):
    """The system of another set of m nodes, and its state."""

    system: System  # of the same settings and the same step; its loads are those of now
    state: State
    previous_rows: NDArray[np.int64]  # (m,) row of each node in the cloud before, -1 of those that are born


class Regridder:
    """What changes nodes, or cuts bonds, between two steps, from the state alone, so that a resumed run equals an
    uninterrupted one. All has the answer of nodes and bonds that stay."""

    nodes_may_change: bool = False  # may be born and die
    steps_between_checks: int | None = None  # steps between two calls of `change_nodes`; None: it is not called
    least_steps: int = 1  # that are taken at once, as what begins some costs a part of a step
    stops_at_records_only: bool = False  # between which nodes change that nobody has asked for

    def is_due(self, step: int) -> bool:
        """Whether `change_nodes` is to be called after `step`."""
        return self.steps_between_checks is not None and step % self.steps_between_checks == 0

    def next_check(self, step: int, last_step: int) -> int:
        """The next step after which `change_nodes` may be due, `last_step` without any."""
        return last_step if self.steps_between_checks is None else next_multiple(step, self.steps_between_checks)

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """The nodes after `step`; None if they stay. Bonds may have been cut."""
        return None

    def collect_change(self, system: System) -> SystemAfterNodeChange | None:
        """The change that the stepper itself has made since the last call; None without any."""
        return None

    def create_system_with_checkpoint_nodes(self, initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
        """The system of a checkpoint with the nodes `checkpoint["ids"]`, in that order.

        `initial_system` is that of the start. The caller restores state, loads and broken bonds.
        """
        raise NotImplementedError("nodes stay")

    def refine_earlier(self, thresholds: tuple[RefinementThresholdFromStep, ...]) -> None:
        """Make cells fine earlier than the model says; without thresholds, as it says."""

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, by name."""
        return {}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint, with the bonds broken until then. Raises CheckpointError."""

    def particle_rows(self, after_step: int) -> Sequence[tuple[float, ...]]:
        """Rows of crack particles since a step."""
        return ()

    def bonds_of_rows(self, system: System, rows: NDArray[np.int64]) -> list[Ends]:
        """Source and target rows of the intact bonds of these nodes, which increase, and of some between them."""
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > GAP) + 1) if len(rows) else []
        return [system.operator.bonds(int(run[0]), int(run[-1]) + 1) for run in runs]

    def zone_summary(self, system: System) -> ZoneSummary | None:
        """Summary of finer nodes that come and go; None without any."""
        return None

    def summary(self, system: System) -> dict[str, Any]:
        """Entries for the summary of the results."""
        zone_summary = self.zone_summary(system)
        return {} if zone_summary is None else {"hybrid": zone_summary._asdict()}


def next_multiple(step: int, interval: int) -> int:
    """The next step that is a multiple of an interval."""
    return (step // interval + 1) * interval


NODES_STAY = Regridder()


class Ranks(NamedTuple):
    """The ranks that share the nodes of a run, and what rank 0 knows of all of them."""

    team: Team
    slabs: tuple[Slab, ...]
    directed_bond_count: int  # at the start
    unbonded_node_rows: NDArray[np.int64]  # (k,) at the start


@dataclass(frozen=True)
class System:
    """A prepared model; n nodes."""

    model: Model
    options: Options
    scheme: Scheme
    operator: Operator
    stepper: Stepper
    drive: Drive  # loads and holds; what they are now changes with time
    area: NDArray[np.float64]  # (n,) m^2
    family_sizes: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included
    initial_bond_counts: NDArray[np.int64]  # (n,) bonds at the start, those cut by a pre-crack left out
    time_step: float  # s
    stable_time_step: float  # surely stable time step, s
    initial_energy: float  # J/m
    full_model: Model | None = None  # all there is to solve, where `model` is of the nodes there are now
    contact: PenaltyContact | None = None  # of bodies and crack faces; a part of the operator
    transport: Transport | None = None  # what carries a substance; None: the model moves
    moving_zone_operator: MovingZoneOperator | None = None  # the operator, if it has the state and an energy ledger
    regridder: Regridder = NODES_STAY  # what changes nodes or cuts bonds between steps
    coupled_runs: tuple[PreparedRun, ...] = ()  # other unknowns of the same nodes, which the stepper marches too
    ranks: Ranks | None = None  # of which `operator` and what goes by nodes are those of rank 0; None: one process
    broken_bonds_of_removed_nodes: int = (
        0  # directed bonds that broke and are none of the operator's: of nodes that are gone
    )

    @property
    def requested_model(self) -> Model:
        """The model as given, with all conditions."""
        return self.full_model or self.model

    def profile_time_or_load_factor(self, step_number: int) -> float:
        """Time of the profiles of conditions after `step_number`, s."""
        factor = self.stepper.load_factor
        return step_number * self.time_step if factor is None else factor

    @property
    def thread_count(self) -> int:
        """Number of threads that share the work."""
        return threads_of(self.options, len(self.model.grid), self.operator.bond_layout in ("blocks", "tiles"))

    @property
    def writes_rank_databases(self) -> bool:
        """Whether each rank writes a database of its own, as there are so many nodes."""
        return self.ranks is not None and len(self.model.grid) > self.options.one_file

    @property
    def unbonded_node_rows(self) -> NDArray[np.int64]:
        """Rows (k,) of the nodes without a bond at the start."""
        return np.flatnonzero(self.initial_bond_counts == 0) if self.ranks is None else self.ranks.unbonded_node_rows

    @property
    def directed_bond_count(self) -> int:
        """Number of directed bonds at the start."""
        return int(self.initial_bond_counts.sum()) if self.ranks is None else self.ranks.directed_bond_count


class PreparedRun(NamedTuple):
    """A system and its state, ready to march."""

    system: System
    state: State

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1, in place."""
        self.system.stepper.advance(self.state, first_step, end_step)
        self.system.stepper.synchronize()


def system_with_moved_zone(system: System, zone_operator: MovingZoneOperator) -> System:
    """The system of changed nodes of the same plate or body."""
    count, family = zone_operator.initial_bond_counts_and_family_sizes
    return replace(
        system,
        model=counted(zone_operator.current_nodes_model, system.time_step),
        operator=zone_operator,
        moving_zone_operator=zone_operator,
        stepper=system.stepper.on_operator(zone_operator),
        area=zone_operator.area,
        family_sizes=family,
        initial_bond_counts=count,
    )


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
        return None if system.moving_zone_operator is None else system.moving_zone_operator.engine.zone_summary()


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
    same = (before.places[row] == shown.places) & (before.signatures_of_changes[row] == shown.signatures_of_changes)
    return SystemAfterNodeChange(
        system_with_moved_zone(system, shown),
        shown.state() if with_state else zero_state(0, 2),
        np.where(same, row, -1),
    )
