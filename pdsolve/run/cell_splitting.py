"""Runs whose cells split where energy is high, and merge behind it."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import numpy as np

from pdsolve.adaptivity.quadtree import criteria
from pdsolve.adaptivity.quadtree.incremental_bonds import create_leaf_bonds, update_leaf_bonds
from pdsolve.adaptivity.quadtree.inherited_cracks import PreviousBonds, inherit_break_steps
from pdsolve.adaptivity.quadtree.interpolation import interpolate_state
from pdsolve.adaptivity.quadtree.leaf_mapping import LeafOrigins, leaves_after_split_and_merge
from pdsolve.adaptivity.quadtree.operator import LeafHistory, QuadtreeOperator, read_leaf_history
from pdsolve.adaptivity.quadtree.tree import Quadtree, QuadtreeCells
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import damping, put_loads
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.rest.equilibrium import force_densities
from pdsolve.run.assembly import assemble_system, stable_time_step_from_stiffness_bound
from pdsolve.run.measures import half_kick_work_of_acceleration_error
from pdsolve.run.measures import verlet_conserved_energy as energy_of
from pdsolve.run.system import PreparedRun, Regridder, System, SystemAfterNodeChange
from pdsolve.state import State
from pdsolve.zone.summary import ZoneSummary


class CellSplitting(Regridder):
    """Splits and merges the cells of a run; its history is stored in the operator."""

    nodes_may_change = True

    def __init__(self, tree: Quadtree) -> None:
        """`tree` has the cells that can split."""
        self.tree = tree
        self.settings = tree.model.settings.run.split
        self.steps_between_checks = self.settings.every
        self._critical = criteria.critical_energy_densities(self.tree)

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """Split and merge cells after `step`; None if all stay."""
        old_operator, wanted = expect_quadtree_operator(system), self.settings
        energy = old_operator.energies(state)[0]
        before = PreviousBonds(old_operator.all_bonds, old_operator.columns.broken)
        if wanted.by == "energy":
            height = criteria.energy_densities_over_largest(self.tree, old_operator.cells, energy, self._critical)
        else:
            height = criteria.largest_relative_stretches(
                self.tree, old_operator.cells, old_operator.all_bonds, before.break_steps, state.value
            )
        leaf_states = criteria.LeafStates(
            old_operator.cells, system.model.grid.position, height, before.has_broken_bond
        )
        old_operator.history = old_operator.history._replace(
            checks_below_threshold=np.where(
                leaf_states.criterion_value < wanted.merge, old_operator.history.checks_below_threshold + 1, 0
            )
        )
        splits = criteria.mask_leaves_to_split(self.tree, leaf_states, wanted.threshold)
        merged = criteria.list_parents_to_merge(
            self.tree, leaf_states, old_operator.history.checks_below_threshold >= wanted.hold, splits, wanted.threshold
        )
        if not splits.any() and not len(merged.root_row):
            return None
        cells, origins = leaves_after_split_and_merge(self.tree, old_operator.cells, splits, merged)
        new, begun = self._prepare_run_with_cells(system, cells, origins)
        operator = expect_quadtree_operator(new)
        operator.columns.broken[:] = inherit_break_steps(before, operator.all_bonds, origins)
        for values, moved_values in zip(
            begun, interpolate_state(state, origins, old_operator.all_bonds, before.break_steps == 0), strict=True
        ):
            values[:] = moved_values
        new.drive.held_force[:] = system.drive.held_force
        put_loads(new.drive, step * system.time_step)
        created = energy_of(new, begun, operator.energies(begun)[0]) - energy_of(system, state, energy)
        force_density = force_densities(operator, begun._replace(dissipated=np.zeros_like(begun.dissipated)))
        created += half_kick_work_of_acceleration_error(new, begun, force_density, damping(new.model))
        calm = np.where(origins.is_unchanged, old_operator.history.checks_below_threshold[origins.origin_rows[:, 0]], 0)
        operator.history = LeafHistory(calm, old_operator.history.refinement_energy + created)
        # Former rows of nodes that keep their bonds; -1 for others
        old_bonds, new_bonds = old_operator.all_bonds, operator.all_bonds
        origin = np.where(origins.is_unchanged, origins.origin_rows[:, 0], -1)
        removed = np.ones(len(old_bonds.start) - 1, dtype=bool)
        removed[origin[origins.is_unchanged]] = False
        changed = np.zeros(len(origin), dtype=bool)
        changed[new_bonds.source[~origins.is_unchanged[new_bonds.neighbour]]] = True
        lost = np.zeros(len(removed), dtype=bool)
        lost[old_bonds.source[removed[old_bonds.neighbour]]] = True
        same = origins.is_unchanged & ~changed & ~lost[origin] & (system.family_sizes[origin] == new.family_sizes)
        return SystemAfterNodeChange(new, begun, np.where(same, origin, -1))

    def _prepare_run_with_cells(
        self, system: System, cells: QuadtreeCells, origins: LeafOrigins | None = None
    ) -> PreparedRun:
        """The system of these leaves at rest; `origins` is their origin, if any.

        Raises UnstableError if the run's step is too long for it.
        """
        tree, threads = self.tree, system.thread_count
        model = tree.model_of_leaves(cells)
        rule = system.scheme.by_pairs(model)
        bonds = (
            create_leaf_bonds(rule)
            if origins is None
            else update_leaf_bonds(rule, model, expect_quadtree_operator(system).leaf_bonds, origins)
        )
        operator = QuadtreeOperator(tree, cells, model, bonds, system.scheme, threads)
        steps = system.time_step, system.stable_time_step
        rest = assemble_system(model, system.options, system.scheme, operator, bonds.assembly.counted, *steps)
        sure = stable_time_step_from_stiffness_bound(operator.stiffness_bound(), model.rho)
        if sure < system.time_step <= system.stable_time_step:
            raise UnstableError(
                f"{model.name}: cells have a stable time step of {sure:.4g} s, less than the run's,"
                f" {system.time_step:.4g} s; use a smaller run.time_step"
            )
        return PreparedRun(dataclasses.replace(rest.system, full_model=tree.model, regridder=self), rest.state)

    def zone_summary(self, system: System) -> ZoneSummary:
        """Summary of the cells that have split."""
        return expect_quadtree_operator(system).zone_summary()

    def summary(self, system: System) -> dict[str, Any]:
        """The energy that splitting and merging created, and the share of split cells."""
        zone_summary = self.zone_summary(system)
        return {"split": {"refinement": zone_summary.refinement, "fine_share": zone_summary.fine_share}}

    def create_system_with_checkpoint_nodes(self, initial_system: System, checkpoint: CheckpointArrays) -> PreparedRun:
        """The system of a checkpoint's cells. Raises CheckpointError for ids that are no set of leaves."""
        ids = entry(checkpoint, "ids", (None,), np.int64)
        memory, cells = read_leaf_history(checkpoint, len(ids)), self.tree.leaves_with_node_ids_or_none(ids)
        if cells is None:
            raise CheckpointError("ids of cells are no whole plate; they must be those of its leaves in order")
        prepared = self._prepare_run_with_cells(initial_system, cells)
        expect_quadtree_operator(prepared.system).history = memory
        return prepared


def expect_quadtree_operator(system: System) -> QuadtreeOperator:
    """The operator of such a run."""
    return cast("QuadtreeOperator", system.operator)
