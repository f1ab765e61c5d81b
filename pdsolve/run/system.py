"""A prepared model: everything that does not change during its steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive
from pdsolve.diffusion.system import Transport
from pdsolve.lattice.operator import BlockLattice
from pdsolve.model import Model, counted
from pdsolve.numerics.team import Team
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.operators.protocol import Operator
from pdsolve.options import Options, threads_of
from pdsolve.ranks.slabs import Slab
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import State
from pdsolve.stepper import Stepper
from pdsolve.zone.summary import ZoneSummary

if TYPE_CHECKING:
    from pdsolve.adaptivity.factory import MovingZoneOperator
    from pdsolve.crack_growth.growth import Growth
    from pdsolve.run.node_changes import Regridder


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
    crack_growth: Growth | None = None  # cracks that are particles
    contact: PenaltyContact | None = None  # of bodies and crack faces; a part of the operator
    transport: Transport | None = None  # what carries a substance; None: the model moves
    moving_zone_operator: MovingZoneOperator | None = None  # the operator, if it has the state and an energy ledger
    regridder: Regridder | None = None  # what changes the nodes between steps
    coupled_runs: tuple[PreparedRun, ...] = ()  # other unknowns of the same nodes, which the stepper marches too
    ranks: Ranks | None = None  # of which `operator` and what goes by nodes are those of rank 0; None: one process
    broken_bonds_of_removed_nodes: int = (
        0  # directed bonds that broke and are none of the operator's: of nodes that are gone
    )

    @property
    def requested_model(self) -> Model:
        """The model as given, with all conditions."""
        return self.full_model or self.model

    @property
    def zone_summary(self) -> ZoneSummary | None:
        """Summary of finer nodes that come and go; None without any."""
        if self.moving_zone_operator is not None:
            return self.moving_zone_operator.zone_summary()
        return None if self.regridder is None else self.regridder.zone_summary(self)

    def profile_time_or_load_factor(self, step_number: int) -> float:
        """Time of the profiles of conditions after `step_number`, s."""
        factor = self.stepper.load_factor
        return step_number * self.time_step if factor is None else factor

    @property
    def thread_count(self) -> int:
        """Number of threads that share the work."""
        return threads_of(self.options, len(self.model.grid), isinstance(self.operator, BlockLattice))

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
    """The system of changed nodes of the same plate."""
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


def nodes_may_change(system: System) -> bool:
    """Whether nodes may be born and die."""
    return system.regridder is not None or system.moving_zone_operator is not None
