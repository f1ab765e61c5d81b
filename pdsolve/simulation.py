"""A run from model to results: prepare, march, write. Readable in one sitting."""

from __future__ import annotations

import ctypes
import json
import sys
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np

from pdmesh import VERSION
from pdmesh.trees import tree_of
from pdsolve.checks import Watch, advise, closing
from pdsolve.energy import Ledger
from pdsolve.model import Model, ModelError, model_of
from pdsolve.problem import Options, Problem, prepare
from pdsolve.reactions import Reaction, grips, reactions
from pdsolve.results import Frame, Results, ResultsError, Writer, writing_to
from pdsolve.schemes import PARTIAL_CELLS, SYMMETRIC

RUNAWAY = 10.0  # times the energy put in: more than this is not physics
PATIENCE = 5e7  # bond updates between two looks at the watcher, some 20 ms
KEPT = 1.0  # s between checkpoints in full precision
SAMPLE = 5  # steps timed for an estimate
DEFAULT = Options()


class UnstableError(ArithmeticError):
    """A run whose state is no longer physics; the message names step, time, node, energy and the bound."""


class Progress(NamedTuple):
    """What a watcher is shown."""

    step: int
    steps: int
    broken: int
    balance: float  # of the last ledger


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
        problem = prepare(model, options)
        advise(model, problem.count, PARTIAL_CELLS[options.mode], SYMMETRIC[options.mode])
        return _run(problem, output, watch, provenance)


def run(problem: Problem, output: Path | None = None, watch: Watcher | None = None, provenance: str = "") -> Results:
    """Solve a model that is prepared; the rest as in `simulate`. Raises UnstableError, ResultsError."""
    with writing_to(output):
        return _run(problem, output, watch, provenance)


def _run(problem: Problem, output: Path | None, watch: Watcher | None, provenance: str) -> Results:
    cracks = problem.model.grid.cracks
    writer = Writer.create(output, problem.nodes(), problem.families, cracks, _meta(problem, provenance))
    try:
        notes = _Notes(problem, 0)
        notes.take(0)
        writer.write(notes.frame(0, whole=True, state=True))
    except BaseException:
        writer.discard()
        raise
    return _finish(problem, writer, output, notes, watch)


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
        meta, nodes = results.meta(), results.nodes()
        model = model_of(results.model(), str(output))
        problem = prepare(model, Options(meta["mode"], meta["precision"], threads, meta.get("kernel")))
        same = float(meta["time_step"]) == problem.time_step and np.array_equal(nodes.family, problem.family)
        if not same or not np.array_equal(nodes.cut, problem.family - problem.count):
            raise ResultsError(
                f"{output}: found a run by {meta['program']} with a step of {meta['time_step']:.6g} s, expected the"
                f" bonds and the step of this version, {problem.time_step:.6g} s; solve it anew"
            )
        step, state = results.checkpoint()
        problem.restore(step, state, results.breaks())
    notes = _Notes(problem, step, float(meta.get("wall_time", 0.0)))
    return _finish(problem, Writer.reopen(output), output, notes, watch)


def plan(model: Model, options: Options = DEFAULT) -> Plan:
    """What solving the model would take, from its bonds and a few steps. Raises ModelError."""
    problem = prepare(model, options)
    advise(model, problem.count, PARTIAL_CELLS[options.mode], SYMMETRIC[options.mode])
    problem.march(1, 2)
    began = clock.perf_counter()
    problem.march(2, 2 + SAMPLE)
    per_step = (clock.perf_counter() - began) / SAMPLE
    steps, bonds = model.settings.run.steps, problem.bonds
    return Plan(len(model.grid), bonds, steps, problem.time_step, problem.bound, problem.bytes(), per_step * steps)


class _Notes:
    """What a run has noted since it last wrote: ledger entries, probes and reactions."""

    def __init__(self, problem: Problem, step: int, earlier: float = 0.0) -> None:
        grid, run = problem.model.grid, problem.model.settings.run
        self._problem = problem
        self._earlier, self._began = earlier, clock.perf_counter()
        self._ledgers: list[Ledger] = []
        self._probes: list[tuple[float, ...]] = []
        self._reactions: list[Reaction] = []
        self._grips = grips(problem.model)
        self._rows = tree_of(grid.position).query(np.reshape(run.probes, (-1, 2)))[1] if run.probes else []
        self._watch = Watch(problem.model)
        self.written = step
        self._kept = clock.perf_counter()
        self._energies = problem.energies()
        self.last = problem.books(step, self._energies)

    def wall(self) -> float:
        """Seconds spent on the run, those before an interruption counted."""
        return self._earlier + clock.perf_counter() - self._began

    def take(self, step: int) -> None:
        """Note the ledger, the probes and the reactions of this step. Raises UnstableError."""
        problem = self._problem
        self._energies = problem.energies()
        self.last = problem.books(step, self._energies)
        _check_physics(problem, self.last)
        self._watch.look(problem.motion.u, problem.intact_neighbours, step)
        self._ledgers.append(self.last)
        u, v, a = problem.motion.u, problem.motion.v, problem.motion.a
        for row in dict.fromkeys(self._rows):
            values = (*u[row].tolist(), *v[row].tolist(), *a[row].tolist())
            self._probes.append((step, self.last.time, int(problem.model.grid.ids[row]), *values))
        plate = problem.drive, problem.motion, problem.area, problem.model.rho
        self._reactions += reactions(self._grips, *plate, step, self.last.time)

    def frame(self, step: int, whole: bool, state: bool) -> Frame:
        """All that was noted, to be written; `whole` with the fields, after a step that was taken note of; with the
        `state` now or when it is time."""
        problem = self._problem
        state |= clock.perf_counter() - self._kept > KEPT
        if state:
            self._kept = clock.perf_counter()
        fields = problem.fields(problem.model.settings.run.fields, self._energies) if whole else None
        frame = Frame(
            step,
            step * problem.time_step,
            fields,
            problem.breaks_after(self.written if step else 0),
            self._ledgers,
            self._probes,
            problem.state() if state else None,
            self._reactions,
            self.wall(),
        )
        self._ledgers, self._probes, self._reactions, self.written = [], [], [], step
        return frame


def _finish(problem: Problem, writer: Writer, output: Path | None, notes: _Notes, watch: Watcher | None) -> Results:
    _give_back_memory()
    try:
        status = _march(problem, writer, notes, watch)
    except BaseException as error:
        ends = {UnstableError: "unstable", KeyboardInterrupt: "interrupted"}
        writer.abandon(ends.get(type(error), "failed"))
        raise
    writer.close(status)
    return Results(writer.connection, "results in memory") if output is None else Results.open(output)


def _give_back_memory() -> None:
    """Hand to the system what reading the model and making its bonds have freed: Linux's C library would keep some
    300 bytes a node."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def _march(problem: Problem, writer: Writer, notes: _Notes, watch: Watcher | None) -> str:
    """Step on to the end, from event to event; returns "finished" or "interrupted"."""
    run, step = problem.model.settings.run, notes.written
    chunk = max(1, int(PATIENCE / max(problem.bonds, 1)))
    interrupted = done = False

    def asked() -> bool:
        """Whether the watcher wants the run to stop."""
        balance = notes.last.balance(problem.initial_energy)
        return watch is not None and watch(Progress(step, run.steps, len(problem.broken()), balance))

    writer.stop = asked
    while step < run.steps and not (interrupted or done):
        ends = (step + chunk, _next(step, run.every), _next(step, run.ledger or run.every), run.steps)
        problem.march(step + 1, min(ends) + 1)
        step = min(ends)
        interrupted = asked()
        if step in ends[1:]:
            notes.take(step)
            done = _is_enough(problem, step)
        whole = step % run.every == 0 or step == run.steps or done
        if whole or interrupted:
            writer.write(notes.frame(step, whole, state=step == run.steps or done or interrupted))
    books = notes.last if notes.last.step == step else problem.books(step)
    writer.tell({"summary": json.dumps(_summary(problem, books, notes.wall(), done))})
    balance, spent = books.balance(problem.initial_energy), books.dissipated
    closing(problem.model, balance, spent, SYMMETRIC[problem.options.mode])
    return "finished" if done or step == run.steps else "interrupted"


def _next(step: int, interval: int) -> int:
    return (step // interval + 1) * interval


def _is_enough(problem: Problem, step: int) -> bool:
    """Whether the run has seen what its model waits for."""
    run = problem.model.settings.run
    if run.until == "split":
        return problem.pieces() > 1
    if run.until == "quiet":
        last = int(problem.motion.broken[problem.broken()].max(initial=0))
        return last > 0 and run.quiet is not None and (step - last) * problem.time_step >= run.quiet
    return False


def _check_physics(problem: Problem, books: Ledger) -> None:
    energy, u = books.kinetic + books.strain, problem.motion.u
    finite = np.isfinite(u).all(axis=1)
    given = abs(books.work) + problem.initial_energy
    ratio = energy / given if given else 0.0
    if finite.all() and np.isfinite(energy) and ratio <= RUNAWAY:
        return
    worst = int((~finite).argmax() if not finite.all() else np.abs(problem.motion.v).sum(axis=1).argmax())
    raise UnstableError(
        f"unstable at step {books.step}, {books.time:.4g} s, node {problem.model.grid.ids[worst]}: energy is"
        f" {ratio:.3g} times what was put in; the time step is {problem.time_step:.4g} s,"
        f" surely stable up to {problem.bound:.4g} s"
        f"{_suspect(problem)}"
    )


def _suspect(problem: Problem) -> str:
    """What to look at where it is not the time step."""
    if problem.time_step > problem.bound:
        return ""
    if SYMMETRIC[problem.options.mode]:
        return ", so it is not the step: look at what is held or loaded"
    return (
        f", so it is not the step: the {problem.options.mode} mode's one-sided bonds make energy, --mode conservative"
    )


def _meta(problem: Problem, provenance: str) -> dict[str, Any]:
    return {
        "program": f"pdsolve {VERSION}",
        "provenance": provenance,
        "units": "SI, per unit thickness",
        "numpy": np.__version__,
        "numba": numba.__version__,
        "mode": problem.options.mode,
        "precision": problem.options.precision,
        "threads": numba.get_num_threads(),
        "kernel": problem.kernel,
        "time_step": problem.time_step,
        "stable_time_step": problem.bound,
        "initial_energy": problem.initial_energy,
        "model": problem.model.to_json(),
    }


def _summary(problem: Problem, books: Ledger, wall: float, stopped_early: bool) -> dict[str, Any]:
    bonds = problem.bonds
    return {
        "nodes": len(problem.model.grid),
        "bonds": bonds,
        "steps": books.step,
        "time": books.time,
        "time_step": problem.time_step,
        "stable_time_step": problem.bound if np.isfinite(problem.bound) else None,
        "mode": problem.options.mode,
        "precision": problem.options.precision,
        "threads": numba.get_num_threads(),
        "kernel": problem.kernel,
        "wall_time": wall,
        "bond_updates_per_second": bonds * books.step / wall if wall > 0 else 0.0,
        "broken_bonds": books.broken,
        "energy": {name: getattr(books, name) for name in ("kinetic", "strain", "dissipated", "work")},
        "balance": books.balance(problem.initial_energy),
        "stopped": problem.model.settings.run.until if stopped_early else None,
    }


__all__ = [
    "ModelError",
    "Options",
    "Plan",
    "Problem",
    "Progress",
    "ResultsError",
    "UnstableError",
    "plan",
    "prepare",
    "resume",
    "simulate",
]
