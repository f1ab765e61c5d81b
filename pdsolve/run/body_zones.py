"""Runs of bodies whose cells become fine around what breaks."""

from __future__ import annotations

import dataclasses
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.hybrid.space.prepare import create_conditions_of_current_nodes
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.run.assembly import assemble_system
from pdsolve.run.energy_steps import half_kick_work_of_acceleration_error, verlet_conserved_energy
from pdsolve.run.system import PreparedRun, Regridder, System, SystemAfterNodeChange
from pdsolve.state import State, zero_state
from pdsolve.zone.cells import EVERY
from pdsolve.zone.summary import ZoneSummary


class BodyCellRefinement(Regridder):
    """Makes cells fine around softened or broken bonds and stretched springs; the operator stores its history."""

    nodes_may_change = True
    steps_between_checks = EVERY

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """Refine after `step`; None if no cell becomes fine."""
        before = expect_body_zone_operator(system)
        new = before.mark_new_fine_cells(state, step - self.steps_between_checks)
        if not len(new):
            return None
        energy_before = verlet_conserved_energy(system, state, before.energies_near_new_cells(state, new))
        after = before.operator_after_refinement(new)
        fresh = _system_with_refined_operator(system, after, step)
        rows = before.current_rows_of_grid_rows(after.rows)
        old, booked = rows >= 0, np.zeros((3, len(rows)))  # energy stays where it was: new nodes have none
        for density_after, density_before in zip(booked, state[3:], strict=True):
            density_after[old] = density_before[rows[old]] * before.volume[rows[old]] / after.volume[old]
        new_state = State(*(before.interpolate_at_grid_rows(after.rows, values) for values in state[:3]), *booked)
        pull, which = after.force_densities_near_new_cells(new_state, new)
        # What holds a node is known where forces are; elsewhere it stays
        previous_holds, drive = system.drive.holds, fresh.drive
        previous_force = np.zeros_like(system.drive.force)
        previous_force[previous_holds.node, previous_holds.axis] = system.drive.held_force
        node, axis = drive.holds.node, drive.holds.axis
        known_force = (pull + drive.force)[node, axis]
        drive.held_force[:] = np.where(which[node], known_force, previous_force[rows[node], axis])
        energy_created = (
            verlet_conserved_energy(fresh, new_state, after.energies_near_new_cells(new_state, new))
            - energy_before
            + half_kick_work_of_acceleration_error(fresh, new_state, pull, after.damping_rates, which)
        )
        after.history = after.history._replace(refinement_energy=after.history.refinement_energy + energy_created)
        return SystemAfterNodeChange(fresh, new_state, _previous_row_of_nodes_with_same_bonds(system, fresh, rows))

    def zone_summary(self, system: System) -> ZoneSummary:
        """Summary of the fine cells."""
        return expect_body_zone_operator(system).zone_summary()

    def create_system_with_checkpoint_nodes(self, initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
        """The system of a checkpoint's cells. Raises CheckpointError for cells that no run from here can have."""
        after = expect_body_zone_operator(initial_system).operator_with_checkpoint_cells(checkpoint)
        if not np.array_equal(after.current_nodes_model.grid.ids, checkpoint["ids"]):
            raise CheckpointError("ids of nodes are not those of its cells")
        fresh = _system_with_refined_operator(initial_system, after, 0)
        return PreparedRun(fresh, zero_state(len(after.volume), after.unknowns[0].width, after.kind))


def expect_body_zone_operator(system: System) -> HybridBodyOperator:
    """The operator of such a run."""
    return cast("HybridBodyOperator", system.operator)


def _system_with_refined_operator(system: System, operator: HybridBodyOperator, step: int) -> System:
    """The system of other nodes."""
    steps, driven = (
        (system.time_step, system.stable_time_step),
        create_conditions_of_current_nodes(operator, step * system.time_step),
    )
    prepared = assemble_system(
        operator.current_nodes_model,
        system.options,
        system.scheme,
        operator,
        operator.volumes_and_bond_counts,
        *steps,
        conditions=driven,
        damping_rates=operator.damping_rates,
    )
    return dataclasses.replace(prepared.system, full_model=system.full_model, regridder=system.regridder)


def _previous_row_of_nodes_with_same_bonds(
    old_system: System, new_system: System, previous_rows: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The `previous_rows` (m,) before of nodes that keep their cell and their bonds; -1 for others."""
    before, after = expect_body_zone_operator(old_system), expect_body_zone_operator(new_system)
    old = np.flatnonzero(previous_rows >= 0)
    rows_before = previous_rows[old]
    same = (before.volume[rows_before] == after.volume[old]) & (
        old_system.family_sizes[rows_before] == new_system.family_sizes[old]
    )
    same &= old_system.initial_bond_counts[rows_before] == new_system.initial_bond_counts[old]
    return np.where(np.isin(np.arange(len(previous_rows)), old[same]), previous_rows, -1)
