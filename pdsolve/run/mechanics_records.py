"""Records of a motion: energy ledger, probes and reactions, with checks of the physics."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pdmesh.model.bond_counts import pair_count
from pdsolve.checks import closing, warn_of_created_energy, warn_of_damping, warn_of_missing_dissipation
from pdsolve.errors import UnstableError
from pdsolve.fracture.broken_area import broken_area
from pdsolve.laws.material_checks import negative_secants
from pdsolve.results import FrameRecord, Results
from pdsolve.run.inversion_checks import InversionAndPrecisionChecks
from pdsolve.run.measures import EnergyBalanceRow, NodeEnergiesAndBreaks, compute_energy_balance_row
from pdsolve.run.operator_factory import compute_stable_time_step_of_intact_bonds
from pdsolve.run.reactions import ConditionForceRow, compute_condition_forces, list_force_conditions_with_nodes
from pdsolve.run.system import System
from pdsolve.state import State

RUNAWAY = 10.0  # times the energy put in: more than this is not physics


class MechanicsRecords:
    """The records of one motion; see `pdsolve.run.physics_records.PhysicsRecords`."""

    def __init__(
        self,
        system: System,
        state: State,
        step: int,
        energies_and_breaks: NodeEnergiesAndBreaks,
        past_results: Results | None,
    ) -> None:
        """`past_results` are those of a resumed run after `step`, else None."""
        self._initialize_records(system, step, past_results)
        self._motion_checks: InversionAndPrecisionChecks | None = None
        self._given = False, False
        self._find_monitored_nodes()
        self.last = compute_energy_balance_row(system, state, step, energies_and_breaks)
        self._heat_energy = self._compute_clamped_swelling_energy(state)

    def _initialize_records(self, system: System, step: int, past_results: Results | None) -> None:
        self._system, materials = system, system.model.materials
        self._flows = any(material.solid == "j2" and material.form != "rate" for material in materials)  # to warn of
        self._nodes_changed = past_results is not None and len(past_results.epochs()) > 1  # which makes or loses energy
        self._largest_work = 0.0  # J/m, the largest work, given or taken
        if past_results is not None:
            done = past_results.history()
            self._largest_work = float(np.abs(done["work"][done["step"] <= step]).max(initial=0.0))
        self._balance_rows: list[EnergyBalanceRow] = []
        self._probes: list[tuple[float, ...]] = []
        self._reactions: list[ConditionForceRow] = []

    def _compute_clamped_swelling_energy(self, state: State) -> float:
        """What heat can do at most, J/m, against which little is round-off; 0 without it."""
        return float(np.sum(self._system.area * self._system.stepper.energy_density_at_zero_displacement(state)))

    def switch_system(self, system: System) -> None:
        """Continue with changed nodes."""
        self._system, self._nodes_are_current, self._nodes_changed = system, False, True
        if self._motion_checks is not None:  # it has the nodes before, which are many
            self._given, self._motion_checks = self._motion_checks.inversion_and_imprecision_warned, None

    def _find_monitored_nodes(self) -> None:
        """Find the nodes of conditions and probes among the current nodes."""
        model, run = self._system.model, self._system.model.settings.run
        probes = [*run.probes, *(end for gap in run.gaps for end in gap.ends)]
        self._force_conditions = list_force_conditions_with_nodes(self._system)
        self._probed = model.grid.nearest(probes)[1].tolist() if probes else []
        self._motion_checks = InversionAndPrecisionChecks(
            model, partial(self._system.operator.bonds, at_start=True), self._given
        )
        self._nodes_are_current = True

    @property
    def broken_directed_bond_count(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self.last.broken

    @property
    def balance_error(self) -> float:
        """Relative error of the last ledger entry; see `EnergyBalanceRow.balance_error`."""
        return self.last.balance_error(self._system.initial_energy, max(self._largest_work, self._heat_energy))

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of the balance in words, with so many broken bonds, for a progress display."""
        fine = self._system.zone_summary
        text = f"broken bonds {pair_count(broken_directed_bond_count)}, balance {self.balance_error:+.1e}"
        if fine is not None:
            text += f", fine {fine.fine_share:.1%}"
            text += f", clipped stretch {fine.clipped_stretch:.2f}" if fine.clipped_stretch else ""
        return text

    def evaluate_balance(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Evaluate the balance at this step, unless it is the last entry."""
        if self.last.step != step:
            self.last = compute_energy_balance_row(self._system, state, step, energies_and_breaks)
            self._heat_energy = self._compute_clamped_swelling_energy(state)

    def record_step(self, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks) -> None:
        """Record the ledger, the probes and the reactions of this step. Raises UnstableError."""
        if not self._nodes_are_current:
            self._find_monitored_nodes()
        system = self._system
        self.evaluate_balance(state, step, energies_and_breaks)
        if self._is_unstable(self.last, bool(np.isfinite(state.value).all())):
            finite = np.isfinite(state.value).all(axis=1)
            worst = int((~finite).argmax() if not finite.all() else np.abs(state.rate).sum(axis=1).argmax())
            most, node = max(self._largest_work, self._heat_energy), int(system.model.grid.ids[worst])
            raise UnstableError(instability_message(system, self.last, most, node))
        self._largest_work = max(self._largest_work, abs(self.last.work))
        assert self._motion_checks is not None
        self._motion_checks.warn_of_inversion_or_imprecision(
            state.value[:, : system.model.grid.dimension], energies_and_breaks.broken_bonds, step
        )
        if self._flows:
            from pdsolve.run.plastic_checks import warn_if_plastic_strain_is_large  # few bodies flow

            self._flows = not warn_if_plastic_strain_is_large(system, step)
        self._balance_rows.append(self.last)
        for row in dict.fromkeys(self._probed):
            node = int(system.model.grid.ids[row])
            self._probes.append(
                (
                    step,
                    self.last.time,
                    node,
                    *list_node_displacement_velocity_acceleration(state, row, system.model.grid.dimension),
                )
            )
        self._reactions += compute_condition_forces(self._force_conditions, system, state, step, self.last.time)

    def _is_unstable(self, balance_row: EnergyBalanceRow, values_are_finite: bool) -> bool:
        """Whether energy is created, or values are not `values_are_finite`."""
        created = _ratio_of_energy_to_supplied(self._system, balance_row, max(self._largest_work, self._heat_energy))
        return not (values_are_finite and np.isfinite(balance_row.kinetic + balance_row.strain) and created <= RUNAWAY)

    def move_records_into(self, frame: FrameRecord) -> FrameRecord:
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
        if not plain or self._nodes_changed or system.options.team is not None or not self.broken_directed_bond_count:
            return {}
        model, broken = system.model, system.operator.broken()
        of_material = model.materials, model.material_of
        cracks = broken_area(model.grid, model.settings.horizon.ratio, *of_material, broken.source, broken.target)
        if not cracks.cost > 0:  # bonds as long as a horizon, of a conical micromodulus, cost nothing
            return {}
        created = self.balance_error * self.last.energy_scale(
            system.initial_energy, max(self._largest_work, self._heat_energy)
        )
        sure = system.scheme.symmetric and model.settings.contact is None
        return {"cracks": {**cracks._asdict(), "spent": self.last.dissipated - (created if sure else 0.0)}}

    def warn_at_end(self) -> None:
        """Issue warnings that follow from the last records."""
        system, last = self._system, self.last
        put_in = last.energy_scale(system.initial_energy, self._largest_work)
        closing(system.model, self.balance_error, last.dissipated, system.scheme.symmetric)
        if system.scheme.symmetric and not self._nodes_changed:
            warn_of_missing_dissipation(system.model, self.balance_error * put_in, put_in, last.dissipated)
        warn_of_created_energy(system.model, last.refinement, put_in)
        warn_of_damping(system.model, last.damped + last.friction, put_in)


def list_node_displacement_velocity_acceleration(state: State, row: int, dimension: int) -> list[float]:
    """What is recorded of the motion of a node in d dimensions: u, v, a in the plane, and then along z."""
    fields = state.value, state.rate, state.second
    plane, space = ([field[row, axes].tolist() for field in fields] for axes in (slice(2), slice(2, dimension)))
    along = [value for values in space for value in values] or [0.0] * 3
    return [*(value for values in plane for value in values), *along]


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
        intact_step = compute_stable_time_step_of_intact_bonds(system.model, system.operator)
        if system.time_step > intact_step:
            return f", and with the bonds that are left up to {intact_step:.4g} s; take a shorter step (run.time_step)"
        return "; the step is not the cause: check loads and prescribed motion"
    return (
        f"; the cause is the one-sided bonds of the {system.scheme.name} mode, which make energy: --mode conservative"
    )
