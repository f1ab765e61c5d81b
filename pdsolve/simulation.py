"""A run from model to results: prepare, march, write. Readable in one sitting."""

from __future__ import annotations

import ctypes
import json
import sys
import time as clock
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np

from pdmesh import VERSION
from pdsolve.adaptive.hybrid import Told
from pdsolve.checks import advise, closing
from pdsolve.measures import Ledger, books, pieces
from pdsolve.model import Model, ModelError, model_of
from pdsolve.notes import Notes, families, nodes, restore
from pdsolve.results import Behind, Results, ResultsError, Writer, behind, writing_to
from pdsolve.state import Broken, State
from pdsolve.system import Options, System, prepare
from pdsolve.unstable import UnstableError

PATIENCE = 5e7  # bond updates between two looks at the watcher, some 20 ms
SAMPLE = 5  # steps timed for an estimate
DEFAULT = Options()


class Progress(NamedTuple):
    """What a watcher is shown."""

    step: int
    steps: int
    broken: int  # directed bonds, as of the last ledger
    balance: float  # likewise
    fine: Told | None = None  # of a fine zone that moves


class Plan(NamedTuple):
    """What a run would take."""

    nodes: int
    bonds: int
    steps: int
    time_step: float  # s
    stable_time_step: float  # s
    memory: int  # bytes of the arrays that marching uses
    wall_time: float  # s, by a few timed steps


Watcher = Callable[[Progress], bool]  # returns whether to stop


def simulate(
    model: Model,
    output: Path | None = None,
    options: Options = DEFAULT,
    watch: Watcher | None = None,
    provenance: str = "",
) -> Results:
    """Solve a model; the results are in the file `output`, or in memory if None.

    `watch` is called many times a second and stops the run by returning True; `provenance` says who asked.
    No other run may be writing to that file. Raises ModelError, UnstableError (the frames so far are kept),
    ResultsError.
    """
    with writing_to(output):
        system, state = prepare(model, options)
        advise(model, system.count, system.scheme.partial_cells, system.scheme.symmetric)
        return _run(system, state, output, watch, provenance)


def run(
    system: System, state: State, output: Path | None = None, watch: Watcher | None = None, provenance: str = ""
) -> Results:
    """Solve a model that is prepared; the rest as in `simulate`. Raises UnstableError, ResultsError."""
    with writing_to(output):
        return _run(system, state, output, watch, provenance)


def _run(system: System, state: State, output: Path | None, watch: Watcher | None, provenance: str) -> Results:
    def new() -> Writer:
        cracks = system.model.grid.cracks
        return Writer.create(output, nodes(system), partial(families, system), cracks, _meta(system, provenance))

    return _finish(system, state, new, output, None, watch)


def resume(output: Path, threads: int | None = None, watch: Watcher | None = None) -> Results:
    """Go on with the run in the file `output` from its last checkpoint, to the same bits as without a stop.

    A run that is finished is left as it is. All that is in the file is looked at before. Raises ResultsError,
    ModelError, UnstableError.
    """
    if not _is_finished(output):
        with writing_to(output):
            if not _is_finished(output):
                return _resume(output, threads, watch)
    return Results.open(output)


def _is_finished(output: Path) -> bool:
    with Results.open(output) as results:
        return results.meta().get("status") == "finished"


def _resume(output: Path, threads: int | None, watch: Watcher | None) -> Results:
    with Results.open(output) as results:
        results.verify()
        meta, known, (step, kept) = results.meta(), results.nodes(), results.checkpoint()
        if not kept.keys() >= set(State._fields):
            raise ResultsError(
                f"{output}: found a checkpoint by {meta['program']}, expected this version's; solve it anew"
            )
        model = model_of(results.model(), str(output))
        system, state = prepare(model, Options(meta["mode"], meta["precision"], threads, meta.get("kernel")))
        same = float(meta["time_step"]) == system.time_step and np.array_equal(known.family, system.family)
        if not same or not np.array_equal(known.cut, system.family - system.count):
            raise ResultsError(
                f"{output}: found a run by {meta['program']} with a step of {meta['time_step']:.6g} s, expected the"
                f" bonds and the step of this version, {system.time_step:.6g} s; solve it anew"
            )
        restore(system, state, step, kept, results.breaks())
    notes = Notes(system, state, step, float(meta.get("wall_time", 0.0)))
    return _finish(system, state, partial(Writer.reopen, output), output, notes, watch)


def plan(model: Model, options: Options = DEFAULT) -> Plan:
    """What solving the model would take, from its bonds and a few steps. Raises ModelError."""
    system, state = prepare(model, options)
    advise(model, system.count, system.scheme.partial_cells, system.scheme.symmetric)
    system.stepper.march(state, 1, 2)
    began = clock.perf_counter()
    system.stepper.march(state, 2, 2 + SAMPLE)
    per_step = (clock.perf_counter() - began) / SAMPLE
    steps, bonds = model.settings.run.steps, system.bonds
    return Plan(
        len(model.grid), bonds, steps, system.time_step, system.bound, system.operator.bytes(), per_step * steps
    )


def _finish(
    system: System,
    state: State,
    make: Callable[[], Writer],
    output: Path | None,
    notes: Notes | None,
    watch: Watcher | None,
) -> Results:
    """March to the end, from the start where there are no `notes` yet; `make` gives the writer."""
    _give_back_memory()
    with behind(make, new=notes is None) as writer:
        try:
            if notes is None:
                notes = Notes(system, state, 0)
                notes.take(0)
                writer.write(notes.frame(0, whole=True, state=True))
            status = _march(system, state, writer, notes, watch)
        except BaseException as error:
            ends = {UnstableError: "unstable", KeyboardInterrupt: "interrupted"}
            writer.abandon(ends.get(type(error), "failed"))
            raise
        last = writer.done()
        last.close(status)
    return Results(last.connection, "results in memory") if output is None else Results.open(output)


def _give_back_memory() -> None:
    """Hand to the system what reading the model and making its bonds have freed: Linux's C library would keep some
    300 bytes a node."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def _march(system: System, state: State, writer: Behind, notes: Notes, watch: Watcher | None) -> str:
    """Step on to the end, from event to event; returns "finished" or "interrupted"."""
    run, step = system.model.settings.run, notes.written
    chunk = max(1, int(PATIENCE / max(system.bonds, 1)))
    interrupted = done = False

    def asked() -> bool:
        """Whether the watcher wants the run to stop."""
        books = notes.last
        balance = books.balance(system.initial_energy)
        fine = system.hybrid.told() if system.hybrid else None
        return watch is not None and watch(Progress(step, run.steps, books.broken, balance, fine))

    writer.stop = asked
    while step < run.steps and not (interrupted or done):
        ends = (step + chunk, _next(step, run.every), _next(step, run.ledger or run.every), run.steps)
        system.stepper.march(state, step + 1, min(ends) + 1)
        step = min(ends)
        writer.look()
        interrupted = asked()
        if step in ends[1:]:
            notes.take(step)
            done = _is_enough(system, notes.now.broken, step)
        whole = step % run.every == 0 or step == run.steps or done
        if whole or interrupted:
            writer.write(notes.frame(step, whole, state=step == run.steps or done or interrupted))
    found = notes.last if notes.last.step == step else books(system, state, step)
    writer.done().tell({"summary": json.dumps(_summary(system, found, notes.wall(), done))})
    balance, spent = found.balance(system.initial_energy), found.dissipated
    closing(system.model, balance, spent, system.scheme.symmetric)
    return "finished" if done or step == run.steps else "interrupted"


def _next(step: int, interval: int) -> int:
    return (step // interval + 1) * interval


def _is_enough(system: System, broken: Broken, step: int) -> bool:
    """Whether the run has seen what its model waits for."""
    run = system.model.settings.run
    if run.until == "split":
        return pieces(system) > 1
    if run.until == "quiet":
        last = int(broken.step.max(initial=0))
        return last > 0 and run.quiet is not None and (step - last) * system.time_step >= run.quiet
    return False


def _meta(system: System, provenance: str) -> dict[str, Any]:
    return {
        "program": f"pdsolve {VERSION}",
        "provenance": provenance,
        "units": "SI, per unit thickness",
        "numpy": np.__version__,
        "numba": numba.__version__,
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.threads,
        "kernel": system.operator.name,
        "time_step": system.time_step,
        "stable_time_step": system.bound,
        "initial_energy": system.initial_energy,
        "model": system.model.to_json(),
    }


def _summary(system: System, books: Ledger, wall: float, stopped_early: bool) -> dict[str, Any]:
    bonds = system.bonds
    return {
        "nodes": len(system.model.grid),
        "bonds": bonds,
        "steps": books.step,
        "time": books.time,
        "time_step": system.time_step,
        "stable_time_step": system.bound if np.isfinite(system.bound) else None,
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.threads,
        "kernel": system.operator.name,
        "wall_time": wall,
        "bond_updates_per_second": bonds * books.step / wall if wall > 0 else 0.0,
        "broken_bonds": books.broken,
        "energy": {name: getattr(books, name) for name in ("kinetic", "strain", "dissipated", "work")},
        "balance": books.balance(system.initial_energy),
        "stopped": system.model.settings.run.until if stopped_early else None,
        **({"hybrid": system.hybrid.told()._asdict()} if system.hybrid else {}),
    }


__all__ = [
    "ModelError",
    "Options",
    "Plan",
    "Progress",
    "ResultsError",
    "System",
    "UnstableError",
    "plan",
    "prepare",
    "resume",
    "simulate",
]
