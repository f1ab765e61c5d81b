"""Runs whose cells split where energy is high, and merge behind it."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree import criteria
from pdsolve.adaptivity.quadtree.incremental_bonds import filled, refilled
from pdsolve.adaptivity.quadtree.inherited_cracks import Before, healed, inherited, sources
from pdsolve.adaptivity.quadtree.interpolation import moved
from pdsolve.adaptivity.quadtree.leaf_mapping import Transfer, transfer_of
from pdsolve.adaptivity.quadtree.operator import Leaves, Memory, remembered
from pdsolve.adaptivity.quadtree.tree import Cells
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import put_loads
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.operators.protocol import Kept
from pdsolve.run.assembly import assembled
from pdsolve.run.energy_steps import energy as energy_of
from pdsolve.run.energy_steps import pushed
from pdsolve.run.node_changes import Change
from pdsolve.run.operator_factory import stable
from pdsolve.run.system import Prepared, System
from pdsolve.state import State
from pdsolve.steppers.equilibrium import forces


class Splitting:
    """Splits and merges the cells of a run; its history is stored in the operator."""

    def __init__(self, system: System) -> None:
        """`system` is the system at the start."""
        self.tree = leaves(system).tree
        self.settings = self.tree.model.settings.run.split
        self.every = self.settings.every
        self._critical = criteria.criticals(self.tree)

    def epoch(self, system: System, state: State, step: int) -> Change | None:
        """Split and merge cells after `step`; None if all stay."""
        operator, wanted = leaves(system), self.settings
        energy, before = operator.energies(state)[0], Before(operator.list, operator.steps())
        if wanted.by == "energy":
            height = criteria.heights(self.tree, operator.cells, energy, self._critical)
        else:
            height = criteria.stretches(self.tree, operator.cells, operator.list, before.broken, state.value)
        model = system.model
        look = criteria.Look(operator.cells, model.grid.position, model.horizons, height, before.hurt)
        operator.memory = operator.memory._replace(
            calm=np.where(look.height < wanted.merge, operator.memory.calm + 1, 0)
        )
        splits = criteria.split(self.tree, look, wanted.threshold)
        merged = criteria.merge(self.tree, look, operator.memory.calm >= wanted.hold, splits, wanted.threshold)
        if not splits.any() and not len(merged.root):
            return None
        cells, transfer = transfer_of(self.tree, operator.cells, splits, merged)
        return self._changed(system, state, step, cells, transfer, before, energy)

    def _changed(
        self,
        system: System,
        state: State,
        step: int,
        cells: Cells,
        transfer: Transfer,
        before: Before,
        energies_before: NDArray[np.float64],
    ) -> Change:
        """The leaves `cells` after this step, made from the bonds before and their energies (n,), J/m^3."""
        old_operator = leaves(system)
        new, begun = self._cloud(system, cells, transfer)
        operator = leaves(new)
        broken = inherited(before, operator.list, transfer)
        assert not healed(before, operator.list, transfer, broken), f"step {step}: a bond has healed"
        operator.put(broken)
        for values, moved_values in zip(
            begun, moved(state, transfer, old_operator.list, before.broken == 0), strict=True
        ):
            values[:] = moved_values
        new.drive.held_force[:] = system.drive.held_force
        put_loads(new.drive, step * system.time_step)
        created = energy_of(new, begun, operator.energies(begun)[0]) - energy_of(system, state, energies_before)
        created += pushed(new, begun, forces(operator, begun._replace(dissipated=np.zeros_like(begun.dissipated))))
        calm = np.where(transfer.stays, old_operator.memory.calm[transfer.before[:, 0]], 0)
        operator.memory = Memory(calm, old_operator.memory.created + created)
        return Change(new, begun, self._origin(system, new, transfer))

    def _cloud(self, system: System, cells: Cells, transfer: Transfer | None = None) -> Prepared:
        """The system of these leaves at rest; `transfer` is their origin, if any.

        Raises UnstableError if the run's step is too long for it.
        """
        tree, threads = self.tree, system.threads
        model = tree.model_of(cells)
        rule = system.scheme.by_pairs(model)
        bonds = filled(rule) if transfer is None else refilled(rule, model, leaves(system).filled, transfer)
        operator = Leaves(tree, cells, model, bonds, system.scheme, threads)
        steps = system.time_step, system.bound
        rest = assembled(model, system.options, system.scheme, operator, bonds.assembly.counted, *steps)
        sure = stable(operator.stiffness_bound(), model.rho)
        if sure < system.time_step <= system.bound:
            raise UnstableError(
                f"{model.name}: cells have a stable time step of {sure:.4g} s, less than the run's,"
                f" {system.time_step:.4g} s; use a smaller run.time_step"
            )
        return Prepared(dataclasses.replace(rest.system, whole=tree.model), rest.state)

    def _origin(self, system: System, new: System, transfer: Transfer) -> NDArray[np.int64]:
        """Former rows (m,) of nodes that keep their bonds; -1 for others."""
        before, now = leaves(system).list, leaves(new).list
        origin = np.where(transfer.stays, transfer.before[:, 0], -1)
        removed = np.ones(len(before.start) - 1, dtype=bool)
        removed[origin[transfer.stays]] = False
        changed = np.zeros(len(origin), dtype=bool)
        changed[sources(now)[~transfer.stays[now.neighbour]]] = True
        lost = np.zeros(len(removed), dtype=bool)
        lost[sources(before)[removed[before.neighbour]]] = True
        same = transfer.stays & ~changed & ~lost[origin] & (system.family[origin] == new.family)
        return np.where(same, origin, -1)

    def back(self, system: System, checkpoint: Kept) -> Prepared:
        """The system of a checkpoint's cells. Raises CheckpointError for ids that are no set of leaves."""
        ids = entry(checkpoint, "ids", (None,), np.int64)
        memory, cells = remembered(checkpoint, len(ids)), self.tree.leaves(ids)
        if cells is None:
            raise CheckpointError("ids of cells are no whole plate; they must be those of its leaves in order")
        prepared = self._cloud(system, cells)
        leaves(prepared.system).memory = memory
        return prepared


def leaves(system: System) -> Leaves:
    """The operator of such a run."""
    assert isinstance(system.operator, Leaves)
    return system.operator
