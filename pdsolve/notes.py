"""What a run notes on its way, in the terms of its results."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.trees import tree_of
from pdsolve.checks import Watch
from pdsolve.conditions import put_loads
from pdsolve.measures import Ledger, books, fields
from pdsolve.reactions import Reaction, grips, reactions
from pdsolve.results import Breaks, Families, Frame, Nodes
from pdsolve.stability import check_physics
from pdsolve.state import Broken, State
from pdsolve.system import System

KEPT = 1.0  # s between checkpoints in full precision


def nodes(system: System) -> Nodes:
    """The nodes as results know them."""
    grid, cut = system.model.grid, system.family - system.count
    return Nodes(grid.ids, grid.position, grid.delta, system.area, system.family, cut)


def families(system: System, first: int, last: int) -> Families:
    """Who is bonded to whom before anything has broken, for the rows `first` to `last` - 1."""
    _, target = system.operator.bonds(first, last)
    return Families(np.concatenate([[0], np.cumsum(system.count[first:last])]), target)


def breaks(system: System, after: int) -> Breaks:
    """Bonds broken after a step, in order."""
    ids, found = system.model.grid.ids, system.operator.broken(after)
    order = np.lexsort((found.target, found.source, found.step))
    return Breaks(found.step[order], ids[found.source[order]], ids[found.target[order]])


def checkpoint(system: System, state: State) -> dict[str, NDArray[Any]]:
    """Everything a later run needs to go on to the same bits, but for the broken bonds."""
    return {**state._asdict(), "held_force": system.drive.held_force, **system.operator.keep()}


def restore(system: System, state: State, step: int, kept: Mapping[str, NDArray[Any]], broken: Breaks) -> None:
    """Go back to the state after `step`; of the bonds `broken` those until then count."""
    for name, values in state._asdict().items():
        values[:] = kept[name].reshape(values.shape)
    system.drive.held_force[:] = kept["held_force"]
    ids = system.model.grid.ids
    order = np.argsort(ids)
    past = broken.step <= step
    source, target = (order[np.searchsorted(ids, column[past], sorter=order)] for column in broken[1:])
    system.operator.back(kept, Broken(broken.step[past], source, target))
    put_loads(system.drive, step * system.time_step)


class Notes:
    """What a run has noted since it last wrote: ledger entries, probes and reactions."""

    def __init__(self, system: System, state: State, step: int, earlier: float = 0.0) -> None:
        """`earlier` are the seconds spent before an interruption."""
        grid, run = system.model.grid, system.model.settings.run
        self._system, self._state = system, state
        self._earlier, self._began = earlier, clock.perf_counter()
        self._ledgers: list[Ledger] = []
        self._probes: list[tuple[float, ...]] = []
        self._reactions: list[Reaction] = []
        self._grips = grips(system.model)
        self._rows = tree_of(grid.position).query(np.reshape(run.probes, (-1, 2)))[1] if run.probes else []
        self._watch = Watch(system.model)
        self.written = step
        self._kept = clock.perf_counter()
        self._energies = system.operator.energies(state)
        self.last = books(system, state, step, self._energies)

    def wall(self) -> float:
        """Seconds spent on the run, those before an interruption counted."""
        return self._earlier + clock.perf_counter() - self._began

    def take(self, step: int) -> None:
        """Note the ledger, the probes and the reactions of this step. Raises UnstableError."""
        system, state = self._system, self._state
        self._energies = system.operator.energies(state)
        self.last = books(system, state, step, self._energies)
        check_physics(system, state, self.last)
        self._watch.look(state.value, lambda row: system.operator.bonds(row, row + 1)[1], step)
        self._ledgers.append(self.last)
        u, v, a = state.value, state.rate, state.second
        for row in dict.fromkeys(self._rows):
            values = (*u[row].tolist(), *v[row].tolist(), *a[row].tolist())
            self._probes.append((step, self.last.time, int(system.model.grid.ids[row]), *values))
        self._reactions += reactions(self._grips, system, state, step, self.last.time)

    def frame(self, step: int, whole: bool, state: bool) -> Frame:
        """All that was noted, to be written; `whole` with the fields, after a step that was taken note of; with the
        `state` now or when it is time."""
        system, run = self._system, self._system.model.settings.run
        state |= clock.perf_counter() - self._kept > KEPT
        if state:
            self._kept = clock.perf_counter()
        found = fields(system, self._state, run.fields, self._energies) if whole else None
        frame = Frame(
            step,
            step * system.time_step,
            found,
            breaks(system, self.written),
            self._ledgers,
            self._probes,
            checkpoint(system, self._state) if state else None,
            self._reactions,
            self.wall(),
        )
        self._ledgers, self._probes, self._reactions, self.written = [], [], [], step
        return frame
