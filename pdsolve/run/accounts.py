"""What a run asks of its accounts, records of what is conserved; those of a motion are on all ranks."""

from __future__ import annotations

from operator import itemgetter
from typing import Any, NamedTuple, Protocol

import numpy as np

from pdmesh.model.amounts import pair_count
from pdsolve.checks import closing, warn_of_created_energy, warn_of_damping, warn_of_missing_dissipation
from pdsolve.errors import UnstableError
from pdsolve.fracture.broken_area import broken_area
from pdsolve.laws.material_checks import negative_secants
from pdsolve.measures.balance import energy_supplied
from pdsolve.numerics.team import PASSED, Team
from pdsolve.results import FrameRecord, Results
from pdsolve.run.assembly import compute_stable_time_step_of_intact_bonds
from pdsolve.run.measures import (
    BalancePart,
    ConditionForceRow,
    EnergyBalanceRow,
    add_condition_forces,
    compute_balance_part,
    join_balance,
    list_condition_force_rows,
)
from pdsolve.run.motion_checks import DisplacementRange, compute_displacement_range, warn_if_plastic_strain_is_large
from pdsolve.run.subdomain import Subdomain
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


RUNAWAY = 10.0  # times the energy put in: more than this is not physics


class BalanceReport(NamedTuple):
    """What a rank says of its nodes after a step."""

    balance: BalancePart
    last_break_step: int  # 0 without a broken bond
    values_are_finite: bool
    displacement_range: DisplacementRange


class EnergyAccounts:
    """The accounts of one motion; see `pdsolve.run.accounts.Accounts`."""

    def __init__(self, system: System, team: Team, step: int, past_results: Results | None) -> None:
        """`system` is that of all ranks, whose subdomains are at `step`; `past_results` are those of a resumed run."""
        self._system, self._team, materials = system, team, system.model.materials
        self._flows = team.size == 1 and any(
            material.solid == "j2" and material.form != "rate" for material in materials
        )
        self._nodes_changed = past_results is not None and len(past_results.epochs()) > 1  # which makes or loses energy
        self._largest_work = 0.0  # J/m, the largest work, given or taken
        if past_results is not None:
            done = past_results.history()
            self._largest_work = float(np.abs(done["work"][done["step"] <= step]).max(initial=0.0))
        self._balance_rows: list[EnergyBalanceRow] = []
        self._probes: list[tuple[float, ...]] = []
        self._reactions: list[ConditionForceRow] = []
        self._find_monitored_nodes()
        self._evaluate(step)

    def follow(self, system: System) -> None:
        """Continue with changed nodes."""
        self._system, self._nodes_are_current, self._nodes_changed = system, False, True

    def _find_monitored_nodes(self) -> None:
        """Find the nodes of probes, and what the motion is checked by, among the current nodes."""
        model, run = self._system.model, self._system.model.settings.run
        places = [*run.probes, *(end for gap in run.gaps for end in gap.ends)]
        self._probed = list(dict.fromkeys(model.grid.nearest(places)[1].tolist() if places else []))
        lengths = self._team.everywhere(local_smallest_spacing_and_breaking_elongation)
        self._team.everywhere(set_smallest_spacing_and_breaking_elongation_of_ranks, lengths)
        self._nodes_are_current = True

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self.last.broken

    @property
    def balance_error(self) -> float:
        """Relative error of the last ledger entry; see `EnergyBalanceRow.balance_error`."""
        return self.last.balance_error(self._system.initial_energy, self._energy_supplied)

    @property
    def _energy_supplied(self) -> float:
        """The energy supplied until the last ledger entry, J/m."""
        largest_work = max(self._largest_work, abs(self.last.work))
        return energy_supplied(largest_work, self._system.initial_energy, self._heat_energy)

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of the balance in words, with so many broken bonds, for a progress display."""
        fine = self._system.regridder.zone_summary(self._system)
        text = f"broken bonds {pair_count(broken_directed_bond_count)}, balance {self.balance_error:+.1e}"
        if fine is not None:
            text += f", fine {fine.fine_share:.1%}"
            text += f", clipped stretch {fine.clipped_stretch:.2f}" if fine.clipped_stretch else ""
        return text

    def evaluate(self, step: int) -> None:
        """Evaluate the balance at this step, unless it is the last entry."""
        if self.last.step != step:
            self._evaluate(step)

    def _evaluate(self, step: int) -> None:
        self._reports: list[BalanceReport] = self._team.everywhere(report_balance, step)
        subdomain: Subdomain = self._team.subdomain
        self.last = join_balance([report.balance for report in self._reports], subdomain.node_count)
        self.last_break_step = max(report.last_break_step for report in self._reports)
        # What heat can do at most, J/m, against which little is round-off; 0 without it
        densities = self._system.stepper.energy_density_at_zero_displacement(subdomain.state)
        self._heat_energy = float(np.sum(self._system.area * densities))

    def record(self, step: int) -> None:
        """Record the ledger, the probes and the reactions of this step. Raises UnstableError."""
        if not self._nodes_are_current:
            self._find_monitored_nodes()
        self.evaluate(step)
        team, time, finite = self._team, self.last.time, all(report.values_are_finite for report in self._reports)
        most = max(self._largest_work, self._heat_energy)
        created = _ratio_of_energy_to_supplied(self._system, self.last, most)
        finite_energy = finite and np.isfinite(self.last.kinetic + self.last.strain)
        if not (finite_energy and created <= RUNAWAY):  # energy is made, or values are no numbers
            _, node = max(team.everywhere(find_fastest_local_node, finite), key=itemgetter(0))  # the first of them
            raise UnstableError(instability_message(self._system, self.last, most, node))
        self._largest_work = max(self._largest_work, abs(self.last.work))
        extents = [report.displacement_range for report in self._reports]
        low = tuple(map(min, zip(*(extent.minimum_by_axis for extent in extents), strict=True)))
        high = tuple(map(max, zip(*(extent.maximum_by_axis for extent in extents), strict=True)))
        extent, checks = DisplacementRange(low, high, extents[0].dtype_name), self._team.subdomain.motion_checks
        if checks.triangles_may_be_inverted(extent):
            texts = self._team.everywhere(describe_local_inverted_triangle)
            text = next((text for text in texts if text is not None), None)
            if text is not None:
                checks.warn_of_inverted_triangle(text, step)
        checks.warn_of_imprecise_displacements(extent, step)
        if self._flows:
            self._flows = not warn_if_plastic_strain_is_large(self._system, step)
        self._balance_rows.append(self.last)
        if self._probed:
            rows = {
                row: motion for part in team.everywhere(list_local_probe_motion, self._probed) for row, motion in part
            }
            self._probes += [(step, time, *rows[row]) for row in self._probed]
        self._reactions += team.everywhere(sum_condition_forces, step, time)[-1]

    def move_rows_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with the records since the last one."""
        frame = frame._replace(ledger=self._balance_rows, probes=self._probes, reactions=self._reactions)
        self._balance_rows, self._probes, self._reactions = [], [], []
        return frame

    def metadata(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""
        return {"initial_energy": self._system.initial_energy}

    def summary(self) -> dict[str, Any]:
        """Results of the run for its summary."""
        names = "kinetic", "strain", "dissipated", "damped", "friction", "work"
        return {
            "broken_bonds": pair_count(self.broken_directed_bond_count),
            "energy": {name: getattr(self.last, name) for name in names},
            "energy_supplied": self._energy_supplied,
            "balance": self.balance_error,
            **self._crack_area_and_energy_summary(),
            **({"energy_unit": "J"} if self._system.model.grid.dimension == 3 else {}),
        }

    def _crack_area_and_energy_summary(self) -> dict[str, Any]:
        """Area of the cracks, G0 times it, and what bonds took, for a summary; nothing where nodes change, or cracks
        cost another energy.

        Bonds took what is booked as dissipated, less what the balance has too much.
        """
        system, run = self._system, self._system.model.settings.run
        plain = run.adapt == "none" and run.cracks == "bonds" and run.fatigue is None
        if not plain or self._nodes_changed or self._team.size > 1 or not self.broken_directed_bond_count:
            return {}
        model, broken = system.model, system.operator.broken()
        of_material = model.materials, model.material_of
        cracks = broken_area(model.grid, model.settings.horizon.ratio, *of_material, broken.source, broken.target)
        if not cracks.cost > 0:  # bonds as long as a horizon, of a conical micromodulus, cost nothing
            return {}
        created = self.balance_error * self._energy_supplied
        joined = {"interfaces": len(model.settings.interfaces)} if model.settings.interfaces else {}
        sure = system.scheme.symmetric and model.settings.contact is None
        return {"cracks": {**cracks._asdict(), "spent": self.last.dissipated - (created if sure else 0.0), **joined}}

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last records."""
        system, last = self._system, self.last
        put_in = self._energy_supplied
        closing(system.model, self.balance_error, last.dissipated, system.scheme.symmetric)
        if system.scheme.symmetric and not self._nodes_changed:
            warn_of_missing_dissipation(system.model, self.balance_error * put_in, put_in, last.dissipated)
        warn_of_created_energy(system.model, last.refinement, put_in)
        warn_of_damping(system.model, last.damped + last.friction, put_in)


def report_balance(team: Team, step: int) -> BalanceReport:
    """What this rank says of its nodes after a step."""
    subdomain: Subdomain = team.subdomain
    energies, own_rows = subdomain.energies_and_breaks(step), subdomain.own_rows
    system, state = subdomain.system, subdomain.state
    nodes = own_rows, subdomain.begin + own_rows.start, subdomain.node_count
    balance = compute_balance_part(system, state, step, energies, *nodes)
    u = state.value[own_rows, : system.model.grid.dimension]
    finite = bool(np.isfinite(state.value[own_rows]).all())
    last_break_step = int(energies.broken_bonds.step.max(initial=0))
    return BalanceReport(balance, last_break_step, finite, compute_displacement_range(u))


def local_smallest_spacing_and_breaking_elongation(team: Team) -> tuple[float, float]:
    """The lengths by which this rank looks at the motion."""
    subdomain: Subdomain = team.subdomain
    return subdomain.motion_checks.smallest_spacing_and_breaking_elongation


def set_smallest_spacing_and_breaking_elongation_of_ranks(team: Team, lengths: list[tuple[float, float]]) -> None:
    """Look at the motion of own nodes by the lengths of all ranks."""
    subdomain: Subdomain = team.subdomain
    subdomain.motion_checks.set_smallest_spacing_and_breaking_elongation_of_ranks(lengths, subdomain.own_rows)


def describe_local_inverted_triangle(team: Team) -> str | None:
    """An inverted triangle of own nodes, in words."""
    subdomain: Subdomain = team.subdomain
    return subdomain.motion_checks.describe_inverted_triangle(subdomain.state.value[:, :2], subdomain.broken())


def find_fastest_local_node(team: Team, all_values_are_finite: bool) -> tuple[float, int]:
    """The speed of the fastest own node along all axes, m/s, and its id; or 1 and the first that is not finite, or
    0."""
    subdomain: Subdomain = team.subdomain
    state, own_rows = subdomain.state, subdomain.own_rows
    ids = subdomain.system.model.grid.ids[own_rows]
    if all_values_are_finite:
        speed = np.abs(state.rate[own_rows]).sum(axis=1)
        return float(speed.max()), int(ids[speed.argmax()])
    wrong = ~np.isfinite(state.value[own_rows]).all(axis=1)
    return float(wrong.any()), int(ids[wrong.argmax()])


def list_local_probe_motion(team: Team, rows: list[int]) -> list[tuple[int, tuple[float, ...]]]:
    """The rows, among those of all nodes, that are own nodes, with the id and what is recorded of its motion."""
    subdomain: Subdomain = team.subdomain
    own_rows, grid, state = subdomain.own_rows, subdomain.system.model.grid, subdomain.state
    fields, motion = (state.value, state.rate, state.second), list[tuple[int, tuple[float, ...]]]()
    for row in rows:
        local_row = row - subdomain.begin
        if own_rows.start <= local_row < own_rows.stop:
            plane = [value for field in fields for value in field[local_row, :2].tolist()]
            along_z = [value for field in fields for value in field[local_row, 2 : grid.dimension].tolist()]
            motion.append((row, (int(grid.ids[local_row]), *plane, *(along_z or [0.0] * 3))))
    return motion


def sum_condition_forces(team: Team, step: int, time: float) -> list[ConditionForceRow]:
    """The reactions of all ranks, on the last one: each adds to the sums of those before it, node by node."""
    subdomain: Subdomain = team.subdomain
    of = subdomain.force_conditions, subdomain.system, subdomain.state
    if not subdomain.force_conditions:
        return []
    sums = add_condition_forces(*of, step, None if team.rank == 0 else team.received(team.rank - 1, PASSED))
    if team.rank < team.size - 1:
        team.comm.send(sums, team.rank + 1, PASSED)
        return []
    return list_condition_force_rows(*of, sums, step, time)


def instability_message(system: System, balance_row: EnergyBalanceRow, largest_work: float, node_id: int) -> str:
    """What is said of a run that is not stable: step, time, the id of a node, energy and the stability bound.

    `largest_work`, J/m, is the largest work so far.
    """
    return (
        f"unstable at step {balance_row.step}, {balance_row.time:.4g} s, node {node_id}: energy is"
        f" {_ratio_of_energy_to_supplied(system, balance_row, largest_work):.3g} times what was put in; the time step "
        f"is {system.time_step:.4g} s, stable up to {system.stable_time_step:.4g} s"
        f"{_instability_cause_text(system)}"
    )


def _ratio_of_energy_to_supplied(system: System, balance_row: EnergyBalanceRow, largest_work: float) -> float:
    """The energy that is there over what was put in; 0 where nothing was."""
    energy_supplied = max(abs(balance_row.work), largest_work) + system.initial_energy
    return (balance_row.kinetic + balance_row.strain) / energy_supplied if energy_supplied else 0.0


def _instability_cause_text(system: System) -> str:
    """The likely cause of an instability other than the time step."""
    if system.time_step > system.stable_time_step:
        return ""
    laws = negative_secants(system.model)
    if laws:
        names = " and ".join(f"'{name}'" for name in laws)
        return f"; the likely cause is the law {names}, whose secant turns negative"
    if system.scheme.symmetric:
        intact_step = np.inf  # on ranks unknown, whose operator here has the nodes of one rank
        if system.ranks is None:
            intact_step = compute_stable_time_step_of_intact_bonds(system.model, system.operator)
        if system.time_step > intact_step:
            return f", and with the bonds that are left up to {intact_step:.4g} s; take a shorter step (run.time_step)"
        return "; the step is not the cause: check loads and prescribed motion"
    return (
        f"; the cause is the one-sided bonds of the {system.scheme.name} mode, which make energy: --mode conservative"
    )
