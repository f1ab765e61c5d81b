"""A cloud whose nodes split into four and merge again while it marches: a fine zone that moves along a crack."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid

from pdmesh.model.document import Load, Run
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.options import Options
from pdsolve.run.assembly import prepare_explicit_motion
from pdsolve.run.prepare import prepare
from pdsolve.run.subdomain import restore_state
from pdsolve.run.system import PreparedRun, Regridder, System, SystemAfterNodeChange
from pdsolve.state import State

QUARTERS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / 4  # of the spacing: where a node's parts are


def torn_plate() -> Model:
    """A cracked plate of 21 x 12 nodes torn apart in 60 steps, bonds breaking; its model names no node by its id."""
    grid = dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[0.0, 0.0, 8e-3, 0.0]]))
    pull = 6e10
    ends = (
        Load(box=(0.0, 4.4e-3, 1.0, 1.0), body_force=(0.0, pull)),
        Load(box=(0.0, -1.0, 1.0, -4.4e-3), body_force=(0.0, -pull)),
    )
    run = Run(time_step=50e-9, steps=60, every=10, ledger=5, probes=((8e-3, 0.5e-3), (1e-2, 5e-3)))
    return plate(grid, conditions=ends, run=run)


class Moving(Regridder):
    """Nodes of the lattice `coarse`, whose ids are 1 to n, are split where the zone is; the part p of node k is node
    n + 4 (k - 1) + p + 1.

    A bond is broken if one between the same nodes of the lattice, or parts of theirs, was: none heals.
    """

    nodes_may_change = True
    steps_between_checks = 4

    def __init__(self, coarse: Grid, start: float = 6e-3, speed: float = 0.1e-3, half: float = 1.6e-3) -> None:
        """The middle of the zone, m, after `step` is at `start` + `speed` step, 0; it reaches `half` to each side."""
        self.coarse, self.start, self.speed, self.half = coarse, start, speed, half

    def lattice(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the lattice that nodes are, or are parts of."""
        count = len(self.coarse)
        return np.where(ids <= count, ids - 1, (ids - count - 1) // 4)

    def ids(self, step: int) -> NDArray[np.int64]:
        """Who is there after `step`, by place."""
        away = np.abs(self.coarse.position - [self.start + self.speed * step, 0.0])
        fine = (away <= self.half).all(axis=1)
        parts = len(self.coarse) + 4 * np.flatnonzero(fine)[:, None] + np.arange(4) + 1
        ids = np.concatenate([np.flatnonzero(~fine) + 1, parts.ravel()])
        return ids[np.lexsort(self.grid(ids).position.T)]

    def grid(self, ids: NDArray[np.int64]) -> Grid:
        """The cloud of these nodes."""
        whole, row = ids <= len(self.coarse), self.lattice(ids)
        part = np.where(whole[:, None], 0, QUARTERS[(ids - len(self.coarse) - 1) % 4])
        delta = self.coarse.delta[row]
        return dataclasses.replace(
            self.coarse,
            ids=ids,
            position=self.coarse.position[row] + part * delta[:, None],
            delta=np.where(whole, delta, delta / 2),
            border=np.zeros(len(ids), dtype=bool),
            hole_id=np.full(len(ids), -1),
        )

    def create_system_with_checkpoint_nodes(self, system: System, kept: CheckpointArrays) -> PreparedRun:
        """As in `Regridder`."""
        model = dataclasses.replace(system.model, grid=self.grid(kept["ids"]))
        return prepare_explicit_motion(model, system.options, system.scheme)

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """As in `Regridder`."""
        ids, known = self.ids(step), system.model.grid.ids
        if set(ids) == set(known):
            return None
        new, fresh = self.create_system_with_checkpoint_nodes(system, {"ids": ids})
        restore_state(new, fresh, step, self._moved(system, state, new), system.operator.broken())  # type: ignore[arg-type]
        rows = {node: row for row, node in enumerate(known.tolist())}
        origin = np.array([rows.get(node, -1) for node in ids.tolist()])
        before, after = (_bonded(one) for one in (system, new))
        changed = np.array([origin[row] < 0 or before[node] != after[node] for row, node in enumerate(ids.tolist())])
        return SystemAfterNodeChange(new, fresh, np.where(changed, -1, origin))

    def _moved(self, system: System, state: State, new: System) -> dict[str, NDArray[Any]]:
        """A checkpoint for the new cloud: parts have what the whole had, wholes the mean of their parts."""
        ids, known, area = new.model.grid.ids, system.model.grid.ids, system.area
        count = len(self.coarse)
        kept: dict[str, NDArray[Any]] = {
            "ids": ids,
            "held_force": new.drive.held_force,
            **new.operator.checkpoint_arrays(),
        }
        place = {node: row for row, node in enumerate(known.tolist())}
        for name, values in state._asdict().items():
            whole = np.zeros((count, *values.shape[1:]))
            weight = np.zeros(count)
            np.add.at(whole, self.lattice(known), (area * values.T).T)
            np.add.at(weight, self.lattice(known), area)
            mean = (whole.T / weight).T
            kept[name] = np.array(
                [
                    values[place[node]] if node in place else mean[row]
                    for node, row in zip(ids.tolist(), self.lattice(ids).tolist(), strict=True)
                ]
            )
        old = system.operator.broken()
        since: dict[tuple[int, int], int] = {}
        ends = (self.lattice(known[side]).tolist() for side in (old.source, old.target))
        for one, other, when in zip(*ends, old.step.tolist(), strict=True):
            for pair in ((one, other), (other, one)):
                since[pair] = min(when, since.get(pair, when))
        source, target = new.operator.bonds(at_start=True)
        pairs = zip(*(self.lattice(ids[side]).tolist() for side in (source, target)), strict=True)
        when = np.array([since.get(pair, 0) for pair in pairs])
        gone = when > 0
        return kept | {"broken_step": when[gone], "broken_source": source[gone], "broken_target": target[gone]}


def marched(model: Model, adapt: Moving, options: Options) -> Iterator[tuple[int, System, State]]:
    """A run by hand: step, system and state after every step, before nodes change."""
    system, state = prepare(model, options)
    for step in range(1, model.settings.run.steps + 1):
        yield step - 1, system, state
        change = adapt.change_nodes(system, state, step - 1) if (step - 1) % adapt.steps_between_checks == 0 else None
        if change is not None:
            system, state, _ = change
        system.stepper.advance(state, step, step + 1)
    yield step, system, state


def _bonded(system: System) -> dict[int, tuple[int, frozenset[int]]]:
    """How many bonds count in a node's damage, and to whom it is still bonded, by ids."""
    ids, (source, target) = system.model.grid.ids, system.operator.bonds()
    cut = np.searchsorted(source, np.arange(1, len(ids)))
    return {
        int(node): (int(family), frozenset(near.tolist()))
        for node, family, near in zip(ids, system.family_sizes, np.split(ids[target], cut), strict=True)
    }
