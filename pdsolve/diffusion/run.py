"""A run of diffusion from model to results: prepare, march, write; and how one goes on."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint import entry, like
from pdsolve.diffusion.dissolution import State
from pdsolve.diffusion.masses import Masses, fields, masses
from pdsolve.diffusion.system import System, prepare
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.model import Model
from pdsolve.provenance import made_by
from pdsolve.results import (
    Behind,
    Breaks,
    Families,
    Frame,
    Nodes,
    Results,
    ResultsError,
    Writer,
    behind,
    gone_back,
)
from pdsolve.steppers.step_batching import Pace

PATIENCE = 5e7  # link updates between two looks at the watcher
KEPT = 1.0  # s between checkpoints

Watcher = Callable[[int, int, str], bool]  # is told the step, of how many, and how it stands; returns whether to stop


def simulate(model: Model, output: Path | None, threads: int | None, watch: Watcher | None, provenance: str) -> Results:
    """Solve a model; the results are in the file `output`, or in memory if None, and nobody else writes to it.

    Raises ModelError, UnstableError, ResultsError.
    """
    system, state = prepare(model, threads)

    def new() -> Writer:
        grid, count = model.grid, system.operator.count
        nodes = Nodes(grid.ids, grid.position, grid.delta, system.operator.volume, count, system.blocked)
        return Writer.create(output, nodes, _unbonded, grid.cracks, _meta(system, provenance))

    return _March(system, state, 0, 0.0, None).finish(new, output, watch)


def _unbonded(first: int, last: int) -> Families:
    """Families are not written: no link breaks."""
    return Families(np.zeros(last - first + 1, dtype=np.int64), np.zeros(0, dtype=np.int64))


def resume(results: Results, model: Model, output: Path, threads: int | None, watch: Watcher | None) -> Results:
    """Go on with a run of `model` from its last checkpoint, to the same bits as without a stop.

    `results` are looked at already, and are closed here. Raises ResultsError, ModelError, UnstableError.
    """
    meta, known, (step, kept) = results.meta(), results.nodes(0), results.checkpoint()
    system, state = prepare(model, threads)
    same = float(meta["time_step"]) == system.time_step and np.array_equal(known.family, system.operator.count)
    if not same or not kept.keys() >= set(State._fields):
        raise ResultsError(
            f"{output}: found a run by {meta['program']} with a step of {meta['time_step']:.6g} s, expected the links"
            f" and the step of this version, {system.time_step:.6g} s; solve it anew"
        )
    with gone_back(output):
        for name, values in state._asdict().items():
            values[:] = like(kept, name, values)
        entry(kept, "solid", state.solid.shape, state.solid.dtype, 0, 1)
        if step > model.settings.run.steps:
            raise CheckpointError(f"found step {step}, expected at most the run's {model.settings.run.steps}")
        masses = results.masses()
        if not len(masses):
            raise CheckpointError("found one without masses at the start, expected these too")
        start = Masses(*masses[0])
    results.close()
    march = _March(system, state, step, float(meta.get("wall_time", 0.0)), start)
    return march.finish(partial(Writer.reopen, output), output, watch)


def _meta(system: System, provenance: str) -> dict[str, Any]:
    return {
        **made_by(provenance, system.model.grid.dimension),
        "physics": "diffusion",
        "mode": "conservative",
        "precision": "float64",
        "threads": system.threads,
        "kernel": system.operator.name,
        "time_step": system.time_step,
        "stable_time_step": system.bound,
        "model": system.model.to_json(),
    }


class _March:
    """A run between two of its steps."""

    def __init__(self, system: System, state: State, step: int, wall: float, start: Masses | None) -> None:
        self.system, self.state, self.step = system, state, step
        self.new = start is None
        self._wall, self._began = wall, clock.perf_counter()
        self._kept = self._began
        self.start = self.last = start or masses(system, state, 0, None)
        self._rows: list[Masses] = []

    def finish(self, make: Callable[[], Writer], output: Path | None, watch: Watcher | None) -> Results:
        """March to the end; `make` gives the writer, of a new file where the run begins."""
        with behind(make, self.new) as writer:
            try:
                if self.new:
                    self._rows.append(self.start)
                    writer.write(self._frame(whole=True, keep=True))
                status = self._march(writer, watch)
            except BaseException as error:
                ends = {UnstableError: "unstable", KeyboardInterrupt: "interrupted"}
                writer.abandon(ends.get(type(error), "failed"))
                raise
            last = writer.done()
            last.close(status)
        return Results(last.connection, "results in memory") if output is None else Results.open(output)

    def _march(self, writer: Behind, watch: Watcher | None) -> str:
        run, system = self.system.model.settings.run, self.system
        links, stop = int(system.operator.count.sum()), False
        most, pace = int(PATIENCE / max(links, 1)), Pace(links)

        def asked() -> bool:
            return watch is not None and watch(self.step, run.steps, self._told())

        writer.stop = asked
        while self.step < run.steps and not stop:
            ledger = run.ledger or run.every
            ends = (self.step + pace.steps(1, most), _next(self.step, run.every), _next(self.step, ledger), run.steps)
            before, self.step, began = self.step, min(ends), clock.perf_counter()
            system.stepper.march(self.state, before + 1, self.step + 1)
            pace.took(self.step - before, clock.perf_counter() - began)
            writer.look()
            noted = self.step in ends[1:]
            if noted:
                self._take()
            stop = asked()
            whole = self.step % run.every == 0 or self.step == run.steps
            if whole or stop:
                writer.write(self._frame(whole, keep=stop or self.step == run.steps))
        if self.last.step != self.step:
            self.last = masses(system, self.state, self.step, self.start.solid)
        writer.done().tell({"summary": json.dumps(self._summary())})
        return "finished" if self.step == run.steps else "interrupted"

    def _take(self) -> None:
        """Put this step into the books. Raises UnstableError."""
        content = self.state.content
        if not np.isfinite(content).all():
            worst = int((~np.isfinite(content)).argmax())
            raise UnstableError(
                f"unstable at step {self.step}, {self.step * self.system.time_step:.4g} s, node"
                f" {self.system.model.grid.ids[worst]}: its content is {content[worst]}, expected a number"
            )
        self.last = masses(self.system, self.state, self.step, self.start.solid)
        self._rows.append(self.last)

    def _frame(self, whole: bool, keep: bool) -> Frame:
        keep |= clock.perf_counter() - self._kept > KEPT
        if keep:
            self._kept = clock.perf_counter()
        nothing = np.zeros(0, dtype=np.int64)
        found: dict[str, NDArray[np.floating]] | None = None
        if whole:
            found = {name: values.astype("<f4") for name, values in fields(self.system, self.state).items()}
        frame = Frame(
            self.step,
            self.step * self.system.time_step,
            found,
            Breaks(nothing, nothing, nothing),
            [],
            [],
            {name: values.copy() for name, values in self.state._asdict().items()} if keep else None,
            wall_time=self._spent(),
            masses=self._rows,
        )
        self._rows = []
        return frame

    def _spent(self) -> float:
        return self._wall + clock.perf_counter() - self._began

    def _told(self) -> str:
        left = f"{1 - self.last.solid / self.start.solid:.1%} dissolved, " if self.start.solid else ""
        return f"{left}balance {self.last.balance(self.start):+.1e}"

    def _summary(self) -> dict[str, Any]:
        system, links, wall = self.system, int(self.system.operator.count.sum()), self._spent()
        return {
            "physics": "diffusion",
            "nodes": len(system.model.grid),
            "links": links,
            "steps": self.step,
            "time": self.last.time,
            "time_step": system.time_step,
            "stable_time_step": system.bound if np.isfinite(system.bound) else None,
            "method": system.stepper.name,
            "threads": system.threads,
            "kernel": system.operator.name,
            "wall_time": wall,
            "link_updates_per_second": links * self.step / wall if wall > 0 else 0.0,
            "masses": self.last._asdict(),
            "dissolved_share": 1 - self.last.solid / self.start.solid if self.start.solid else None,
            "balance": self.last.balance(self.start),
        }


def _next(step: int, interval: int) -> int:
    return (step // interval + 1) * interval
