"""Entries in the ledger, probes and reactions of all ranks, to the bits of one process."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import factor_now
from pdsolve.errors import UnstableError
from pdsolve.numerics.ordered_sums import Branches, branches, total
from pdsolve.numerics.team import PASSED, Team
from pdsolve.ranks.part import Part, broken
from pdsolve.results import Results
from pdsolve.run.inversion_checks import DisplacementRange, InversionAndPrecisionChecks, compute_displacement_range
from pdsolve.run.measures import (
    EnergyBalanceRow,
    NodeEnergiesAndBreaks,
    compute_node_energies_and_breaks,
    node_energy_functions,
)
from pdsolve.run.mechanics_records import (
    MechanicsRecords,
    instability_message,
    list_node_displacement_velocity_acceleration,
)
from pdsolve.run.on_ranks.start import RankSystem, SystemOnRanks
from pdsolve.run.reactions import ConditionForceRow
from pdsolve.state import Broken, State

Array = NDArray[np.float64]


class RankReport(NamedTuple):
    """What a rank says of a step."""

    energy_balance_sums: dict[str, Branches]  # of the ledger
    broken_directed_bond_count: int  # directed bonds so far
    last_break_step: int  # step of the last one
    values_are_finite: bool  # whether all displacements of own nodes are finite
    displacement_range: DisplacementRange


class GatheredReports(NamedTuple):
    """What all ranks say of a step."""

    balance_row: EnergyBalanceRow
    last_break_step: int  # step of the last broken bond, 0 without any
    values_are_finite: bool
    displacement_range: DisplacementRange


class MechanicsRecordsOnRanks(MechanicsRecords):
    """The records of a motion on all ranks; see `pdsolve.run.physics_records.PhysicsRecords`."""

    def __init__(self, system: SystemOnRanks, resumed_step: int, past_results: Results | None) -> None:
        """`past_results` are those of a resumed run after `resumed_step`, else None."""
        assert system.team is not None
        self._team, self._whole = system.team, system
        self._initialize_records(system, resumed_step, past_results)
        grid, run = system.model.grid, system.model.settings.run
        places = [*run.probes, *(end for gap in run.gaps for end in gap.ends)]
        rows = dict.fromkeys(grid.nearest(places)[1].tolist() if places else [])
        self._owned = [[row for row in rows if slab.first <= row < slab.last] for slab in system.slabs]
        self._order = {row: number for number, row in enumerate(rows)}
        subdomain: RankSystem = self._team.part.now
        self._kinds, self._checks = subdomain.force_conditions, subdomain.motion_checks
        lengths_of_all = self._team.everywhere(local_smallest_spacing_and_breaking_elongation)
        self._team.everywhere(set_smallest_spacing_and_breaking_elongation_of_ranks, lengths_of_all)
        self.known = self._gather_reports(resumed_step)
        self.last, self._heat_energy = self.known.balance_row, 0.0

    def evaluate_balance(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks | None) -> None:
        """Evaluate the balance at this step, unless it is the last entry."""
        if self.last.step != step:
            self.known = self._gather_reports(step)
            self.last = self.known.balance_row

    def record_step(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks | None) -> None:
        """Record the ledger, the probes and the reactions of this step. Raises UnstableError."""
        self.evaluate_balance(state, step, energies_and_breaks)
        if self._is_unstable(self.last, self.known.values_are_finite):  # the error is that of one process
            worst = self._team.everywhere(find_fastest_local_node, self.known.values_are_finite)
            most = max(speed for speed, _ in worst)
            node = next(node for speed, node in worst if speed == most)
            raise UnstableError(
                instability_message(self._whole, self.last, max(self._largest_work, self._heat_energy), node)
            )
        self._largest_work = max(self._largest_work, abs(self.last.work))
        extent = self.known.displacement_range
        if self._checks.triangles_may_be_inverted(extent):
            words = next(
                (words for words in self._team.everywhere(describe_local_inverted_triangle) if words is not None), None
            )
            if words is not None:
                self._checks.warn_of_inverted_triangle(words, step)
        self._checks.warn_of_imprecise_displacements(extent, step)
        self._balance_rows.append(self.last)
        time = self.last.time
        if self._order:
            probe_values = [
                probe
                for rank_probes in self._team.everywhere(list_local_probe_motion, items=self._owned)
                for probe in rank_probes
            ]
            probe_values.sort(key=lambda probe: self._order[probe[0]])
            self._probes += [(step, time, *values) for _, *values in probe_values]
        if self._kinds:
            self._reactions += self._team.everywhere(sum_condition_forces_over_ranks, step, time)[-1]

    def _gather_reports(self, step: int) -> GatheredReports:
        """The ledger entry after a step, from all ranks."""
        said: list[RankReport] = self._team.everywhere(make_rank_report, step)
        count = len(self._whole.model.grid)
        sums = {
            name: total([report.energy_balance_sums[name] for report in said], count)
            for name in said[0].energy_balance_sums
        }
        ledger = EnergyBalanceRow(
            step, step * self._whole.time_step, broken=sum(report.broken_directed_bond_count for report in said), **sums
        )
        least, most = (
            tuple(
                pick(values)
                for values in zip(*(getattr(report.displacement_range, end) for report in said), strict=True)
            )
            for end, pick in (("minimum_by_axis", min), ("maximum_by_axis", max))
        )
        extent = DisplacementRange(least, most, said[0].displacement_range.dtype_name)
        return GatheredReports(
            ledger,
            max(report.last_break_step for report in said),
            all(report.values_are_finite for report in said),
            extent,
        )


def compute_energies_and_breaks_of_rank_once(team: Team, step: int) -> NodeEnergiesAndBreaks:
    """What the operator says of the window's state after a step, asked once."""
    subdomain: RankSystem = team.part.now
    if subdomain.bond_state_step != step:
        subdomain.energies_and_breaks = compute_node_energies_and_breaks(subdomain.system, subdomain.state)
        subdomain.bond_state_step = step
    return subdomain.energies_and_breaks


def make_rank_report(team: Team, step: int) -> RankReport:
    """What this rank says of the state after a step."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    energies_and_breaks, slab = compute_energies_and_breaks_of_rank_once(team, step), part.slab
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        values = node_energy_functions(
            subdomain.system,
            subdomain.state,
            energies_and_breaks.strain_energy_density,
            energies_and_breaks.softening_energy_density,
        )
        sums = {name: branches(of()[part.own], slab.first, slab.nodes) for name, of in values.items()}
    mine, u = broken(part), subdomain.state.value[part.own]
    d = subdomain.system.model.grid.dimension
    finite = bool(np.isfinite(u).all())
    return RankReport(sums, len(mine.step), int(mine.step.max(initial=0)), finite, compute_displacement_range(u[:, :d]))


def local_smallest_spacing_and_breaking_elongation(team: Team) -> tuple[float, float]:
    """The lengths by which this rank's window looks at the motion."""
    return _motion_checks(team).smallest_spacing_and_breaking_elongation


def set_smallest_spacing_and_breaking_elongation_of_ranks(
    team: Team, spacings_and_elongations: list[tuple[float, float]]
) -> None:
    """Look at the motion of own nodes by the lengths of all ranks."""
    _motion_checks(team).set_smallest_spacing_and_breaking_elongation_of_ranks(spacings_and_elongations, team.part.own)


def describe_local_inverted_triangle(team: Team) -> str | None:
    """An inverted triangle of own nodes, in words."""
    subdomain: RankSystem = team.part.now
    return subdomain.motion_checks.describe_inverted_triangle(subdomain.state.value[:, :2], Broken(*broken(team.part)))


def find_fastest_local_node(team: Team, all_values_are_finite: bool) -> tuple[float, int]:
    """The speed of the fastest own node along all axes, m/s, and its id; or 1 and the first that is not finite, or
    0."""
    part: Part = team.part
    state, ids = part.now.state, part.model.grid.ids[part.own]
    if all_values_are_finite:
        speed = np.abs(state.rate[part.own]).sum(axis=1)
        return float(speed.max()), int(ids[speed.argmax()])
    wrong = ~np.isfinite(state.value[part.own]).all(axis=1)
    return float(wrong.any()), int(ids[wrong.argmax()])


def list_local_probe_motion(team: Team, grid_rows: list[int]) -> list[tuple[Any, ...]]:
    """The motion of own nodes at rows of the whole grid: row, id, and what is recorded of it."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    d = part.model.grid.dimension
    at, ids = [row - part.slab.begin for row in grid_rows], part.model.grid.ids
    return [
        (row, int(ids[local_row]), *list_node_displacement_velocity_acceleration(subdomain.state, local_row, d))
        for row, local_row in zip(grid_rows, at, strict=True)
    ]


def sum_condition_forces_over_ranks(team: Team, step: int, time: float) -> list[ConditionForceRow]:
    """The reactions of all ranks, on the last one: each adds to the sums of those before it, node by node."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    system, state, d = subdomain.system, subdomain.state, subdomain.system.model.grid.dimension
    drive, area, rho = system.drive, system.area, system.model.rho
    holds, loads, count = drive.holds, drive.loads, len(subdomain.force_conditions)
    pulls, pushes = np.zeros((2, count * d))
    sums = _ConditionForceSums(pulls, pushes, np.zeros((count, d)), np.zeros(count, dtype=np.int64))
    if team.rank > 0:
        sums = team.received(team.rank - 1, PASSED)
    pull = area[holds.node] * (rho[holds.node] * state.second[holds.node, holds.axis].astype(float) - drive.held_force)
    np.add.at(sums.holding_force, d * holds.profile + holds.axis, pull)
    np.add.at(sums.load_force, d * loads.profile + loads.axis, area[loads.node] * loads.value)
    for number, grip in enumerate(subdomain.force_conditions):
        displacement = state.value[grip.node_rows, :d].astype(float)
        sums.displacement_sum[number] = np.add.reduce(
            np.concatenate([sums.displacement_sum[number : number + 1], displacement]), axis=0
        )
        sums.node_count[number] += len(grip.node_rows)
    if team.rank < team.size - 1:
        team.comm.send(sums, team.rank + 1, PASSED)
        return []
    at, all_reactions = system.profile_time_or_load_factor(step), list[ConditionForceRow]()
    for number, grip in enumerate(subdomain.force_conditions):
        components = slice(d * number, d * number + d)
        factor = float(factor_now(drive.profiles, number, at))
        force = (sums.holding_force[components] + factor * sums.load_force[components]).tolist()
        mean = (sums.displacement_sum[number] / sums.node_count[number]).tolist()
        all_reactions.append(
            ConditionForceRow(
                step, time, grip.condition_number, grip.condition_kind, *force[:2], *mean[:2], *force[2:], *mean[2:]
            )
        )
    return all_reactions


class _ConditionForceSums(NamedTuple):
    holding_force: Array  # (grips d,) of holding forces
    load_force: Array  # (grips d,) of loads at factor 1
    displacement_sum: Array  # (grips, d) of displacements
    node_count: NDArray[np.int64]  # (grips,)


def _motion_checks(team: Team) -> InversionAndPrecisionChecks:
    subdomain: RankSystem = team.part.now
    return subdomain.motion_checks
