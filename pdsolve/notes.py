"""What a run notes on its way, in the terms of its results."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.trees import tree_of
from pdsolve.checks import Watch
from pdsolve.conditions import put_loads
from pdsolve.measures import Ledger, ask, books, fields
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
    """Who is bonded to whom before anything has broken, for the rows `first` to `last` - 1; while a run goes on too."""
    _, target = system.operator.bonds(first, last, start=True)
    return Families(np.concatenate([[0], np.cumsum(system.count[first:last])]), target)


def breaks(system: System, after: int, broken: Broken | None = None) -> Breaks:
    """Bonds broken after a step, in order; of all that are `broken`, if known."""
    ids, found = system.model.grid.ids, system.operator.broken(after) if broken is None else broken
    new = np.flatnonzero(found.step > after)
    step, source, target = (column[new] for column in found)
    order = np.lexsort((target, source, step))
    return Breaks(step[order], ids[source[order]], ids[target[order]])


def checkpoint(system: System, state: State) -> dict[str, NDArray[Any]]:
    """Everything a later run needs to go on to the same bits, but for the broken bonds; a copy."""
    here = {**state._asdict(), "held_force": system.drive.held_force}
    return {name: values.copy() for name, values in here.items()} | dict(system.operator.keep())


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
        self._watch = Watch(system.model, partial(system.operator.bonds, start=True))
        self.written = step
        self._kept = clock.perf_counter()
        self.now = ask(system, state)
        self.last = books(system, state, step, self.now)

    def wall(self) -> float:
        """Seconds spent on the run, those before an interruption counted."""
        return self._earlier + clock.perf_counter() - self._began

    def take(self, step: int) -> None:
        """Note the ledger, the probes and the reactions of this step. Raises UnstableError."""
        system, state = self._system, self._state
        if step != self.last.step:
            self.now = ask(system, state)
            self.last = books(system, state, step, self.now)
        check_physics(system, state, self.last)
        self._watch.look(state.value, self.now.broken, step)
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
        asked = self.now if self.last.step == step else None
        found = fields(system, self._state, run.fields, asked) if whole else {}
        frame = Frame(
            step,
            step * system.time_step,
            {name: values.astype("<f4") for name, values in found.items()} if whole else None,
            breaks(system, self.written, asked and asked.broken),
            self._ledgers,
            self._probes,
            checkpoint(system, self._state) if state else None,
            self._reactions,
            self.wall(),
        )
        self._ledgers, self._probes, self._reactions, self.written = [], [], [], step
        return frame
