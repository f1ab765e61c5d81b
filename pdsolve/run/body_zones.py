"""Runs of bodies whose cells become fine around what breaks."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.arrays import EVERY
from pdsolve.adaptivity.hybrid.space.operator import SpaceHybrid
from pdsolve.adaptivity.hybrid.space.prepare import drive_of_nodes
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import Kept
from pdsolve.run.assembly import assembled
from pdsolve.run.energy_steps import energy, pushed
from pdsolve.run.node_changes import Change
from pdsolve.run.system import Prepared, System
from pdsolve.state import State, zero_state


class Refining:
    """Makes cells fine around broken bonds and stretched springs; its history is stored in the operator."""

    every = EVERY

    def epoch(self, system: System, state: State, step: int) -> Change | None:
        """Refine after `step`; None if no cell becomes fine."""
        before = zone_of(system)
        new = before.wanted(state, step - self.every)
        if not len(new):
            return None
        energy_before = energy(system, state, before.held_around(state, new))
        after = before.refined(new)
        fresh = _on(system, after, step)
        rows = before.row_of_grid(after.rows)
        new_state = _moved(before, after, state, rows)
        pull, which = after.forces_around(new_state, new)
        _hold(system, fresh, rows, pull, which)
        energy_created = (
            energy(fresh, new_state, after.held_around(new_state, new))
            - energy_before
            + pushed(fresh, new_state, pull, which)
        )
        after.history = after.history._replace(made=after.history.made + energy_created)
        return Change(fresh, new_state, _origin(system, fresh, rows))

    def back(self, system: System, checkpoint: Kept) -> Prepared:
        """The system of a checkpoint's cells. Raises CheckpointError for cells that no run from here can have."""
        after = zone_of(system).restored(checkpoint)
        if not np.array_equal(after.model.grid.ids, checkpoint["ids"]):
            raise CheckpointError("ids of nodes are not those of its cells")
        fresh = _on(system, after, 0)
        return Prepared(fresh, zero_state(len(after.volume), after.unknowns[0].width))


def zone_of(system: System) -> SpaceHybrid:
    """The operator of such a run."""
    assert isinstance(system.operator, SpaceHybrid)
    return system.operator


def _on(system: System, after: SpaceHybrid, step: int) -> System:
    """The system of other nodes."""
    steps, driven = (system.time_step, system.bound), drive_of_nodes(after, step * system.time_step)
    prepared = assembled(after.model, system.options, system.scheme, after, after.counted, *steps, driven=driven)
    return dataclasses.replace(prepared.system, whole=system.whole)


def _moved(before: SpaceHybrid, after: SpaceHybrid, state: State, rows: NDArray[np.int64]) -> State:
    """The state on the nodes `after` a refinement: interpolated, with what was booked where it was; `rows` (n,) are
    those before, -1 for new nodes."""
    old, nodes = rows >= 0, len(rows)
    booked = np.zeros((3, nodes))
    for density_after, density_before in zip(booked, state[3:], strict=True):
        density_after[old] = density_before[rows[old]] * before.volume[rows[old]] / after.volume[old]
    return State(*(before.moved(after.rows, values) for values in state[:3]), *booked)


def _hold(
    system: System,
    fresh: System,
    rows: NDArray[np.int64],
    pull: NDArray[np.float64],
    which: NDArray[np.bool_],
) -> None:
    """Set the forces on held components: of `which` nodes (n,) the force densities `pull` (n, 3), of others those they
    had; `rows` (n,) are those before."""
    old, new = system.drive, fresh.drive
    node, axis = new.holds.node, new.holds.axis
    previous_force = np.zeros_like(old.force)
    previous_force[old.holds.node, old.holds.axis] = old.held_force
    new.held_force[:] = np.where(which[node], (pull + new.force)[node, axis], previous_force[rows[node], axis])


def _origin(system: System, fresh: System, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The `rows` (m,) before of nodes that keep their cell and their bonds; -1 for others."""
    before, after = zone_of(system), zone_of(fresh)
    old = np.flatnonzero(rows >= 0)
    rows_before = rows[old]
    same = (before.volume[rows_before] == after.volume[old]) & (system.family[rows_before] == fresh.family[old])
    same &= system.count[rows_before] == fresh.count[old]
    return np.where(np.isin(np.arange(len(rows)), old[same]), rows, -1)
