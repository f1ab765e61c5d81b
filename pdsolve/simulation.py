"""A run from model to results: prepare, march, write. Readable in one sitting."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from pdmesh import VERSION
from pdsolve.bonds import Assembly, Bonds
from pdsolve.conditions import body_force
from pdsolve.energy import Ledger, ledger
from pdsolve.kernels.bond_sums import Motion
from pdsolve.model import Model, ModelError, model_of
from pdsolve.results import Breaks, Frame, Nodes, Results, ResultsError, Writer, remove
from pdsolve.schemes import EXACT_LOAD, SCHEMES
from pdsolve.steppers.verlet import advance, stability_bound

SAFETY = 0.8  # of the stability bound, for a model that names no time step
RUNAWAY = 10.0  # times the work done so far: more energy than this is not physics
PATIENCE = 5e6  # bond updates between two looks at the watcher, some 20 ms

# On Linux the OpenMP layer starts a parallel loop three times as fast as numba's own.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]


class UnstableError(ArithmeticError):
    """A run whose state is no longer physics; the message names step, time, node, energy and the bound."""


class Progress(NamedTuple):
    """What a watcher is shown."""

    step: int
    steps: int
    broken: int
    balance: float  # of the last ledger


@dataclass(frozen=True)
class Options:
    """How to solve, as opposed to what."""

    mode: str = "conservative"
    precision: str = "float64"
    threads: int | None = None  # None: all there are


@dataclass(frozen=True)
class Problem:
    """A model prepared for marching; n nodes."""

    model: Model
    options: Options
    assembly: Assembly
    force: NDArray[np.floating]  # (n, 2) body force, N/m^3
    motion: Motion
    time_step: float  # s
    bound: float  # surely stable time step, s


Watcher = Callable[[Progress], bool]  # returns whether to stop


def prepare(model: Model, options: Options) -> Problem:
    """Bonds, loads and a plate at rest. Raises ModelError for options or a model that cannot be run."""
    if options.mode not in SCHEMES:
        raise ModelError(f"mode: found '{options.mode}', expected one of {', '.join(SCHEMES)}")
    if options.precision not in ("float64", "float32"):
        raise ModelError(f"precision: found '{options.precision}', expected float64 or float32")
    cores = numba.config.NUMBA_NUM_THREADS
    if options.threads is not None and not 1 <= options.threads <= cores:
        raise ModelError(f"threads: found {options.threads}, expected 1 to {cores}")
    numba.set_num_threads(options.threads or cores)
    kind = np.dtype(options.precision).type
    assembly = SCHEMES[options.mode](model)
    bound = stability_bound(assembly.bonds, model.material.rho)
    step = model.settings.run.time_step
    if step is None:
        if not np.isfinite(bound):
            raise ModelError(f"{model.name}: $.run.time_step: found none, expected one for a model without bonds")
        step = SAFETY * bound
    bonds = Bonds(
        assembly.bonds.start,
        assembly.bonds.neighbour,
        *(np.ascontiguousarray(column, dtype=kind) for column in assembly.bonds[2:]),
    )
    force = np.ascontiguousarray(body_force(model, assembly.area, EXACT_LOAD[options.mode]).T, dtype=kind)
    nodes = len(model.grid)
    at_rest = Motion(
        u=np.zeros((nodes, 2), dtype=kind),
        v=np.zeros((nodes, 2), dtype=kind),
        a=force / kind(model.material.rho),
        broken=np.zeros(len(bonds.neighbour), dtype=np.int32),
        dissipated=np.zeros(nodes),
        work=np.zeros(nodes),
    )
    advance(bonds, at_rest, force, model.material.rho, step, 1, 1)  # no step: compiles before the clock runs
    return Problem(model, options, assembly._replace(bonds=bonds), force, at_rest, step, bound)


def simulate(
    model: Model,
    output: Path | None = None,
    options: Options = Options(),
    watch: Watcher | None = None,
    provenance: str = "",
) -> Results:
    """Solve a model; the results are in the file `output`, or in memory if None.

    `watch` is called many times a second and stops the run by returning True; `provenance` says who asked.
    Raises ModelError, UnstableError (the frames so far are kept), ResultsError.
    """
    problem = prepare(model, options)
    try:
        writer = Writer.create(output, _nodes(problem), _meta(problem, provenance))
        writer.write(_frame(problem, _books(problem, 0), since=-1, whole=True))
    except ResultsError:
        if output is not None:
            remove(output)
        raise
    return _finish(problem, writer, output, 0, watch)


def resume(output: Path, threads: int | None = None, watch: Watcher | None = None) -> Results:
    """Go on with the run in the file `output` from its last checkpoint, to the same bits as without a stop.

    Raises ResultsError, ModelError, UnstableError.
    """
    with Results.open(output) as results:
        meta = results.meta()
        model = model_of(meta["model"], str(output))
        problem = prepare(model, Options(meta["mode"], meta["precision"], threads))
        step, saved = results.checkpoint()
        breaks = results.breaks()
    motion = problem.motion
    for name, values in saved.items():
        getattr(motion, name)[:] = values.reshape(getattr(motion, name).shape)
    motion.broken[_bond_numbers(problem, breaks)] = breaks.step
    return _finish(problem, Writer.reopen(output), output, step, watch)


def _finish(problem: Problem, writer: Writer, output: Path | None, step: int, watch: Watcher | None) -> Results:
    status = "failed"
    try:
        status = _march(problem, writer, step, watch)
    except UnstableError:
        status = "unstable"
        raise
    finally:
        writer.close(status)
    return Results(writer.connection, "results in memory") if output is None else Results.open(output)


def _march(problem: Problem, writer: Writer, step: int, watch: Watcher | None) -> str:
    """Step on to the end, a frame at a time; returns "finished" or "interrupted"."""
    run, rho, bonds = problem.model.settings.run, problem.model.material.rho, problem.assembly.bonds
    chunk = max(1, int(PATIENCE / max(len(bonds.neighbour), 1)))
    began, begun_at, written, last = clock.perf_counter(), step, step, _books(problem, step)
    stopped = False
    while step < run.steps and not stopped:
        until = min(step + chunk, (step // run.every + 1) * run.every, run.steps)
        advance(bonds, problem.motion, problem.force, rho, problem.time_step, step + 1, until + 1)
        step = until
        broken = int(np.count_nonzero(problem.motion.broken))
        stopped = watch is not None and watch(Progress(step, run.steps, broken, last.balance))
        due = step % run.every == 0 or step == run.steps
        if due or stopped:
            books = _books(problem, step)
            _check_physics(problem, books)
            writer.write(_frame(problem, books, since=written, whole=due))
            written, last = step, books
    wall = clock.perf_counter() - began
    writer.tell({"summary": json.dumps(_summary(problem, last, wall, step - begun_at))})
    return "interrupted" if step < run.steps else "finished"


def _books(problem: Problem, step: int) -> Ledger:
    assembly = problem.assembly
    return ledger(
        assembly.bonds, problem.motion, assembly.area, problem.model.material.rho, step, step * problem.time_step
    )


def _check_physics(problem: Problem, books: Ledger) -> None:
    energy, u = books.kinetic + books.strain, problem.motion.u
    finite = np.isfinite(u).all(axis=1)
    ratio = energy / abs(books.work) if books.work else 0.0
    if finite.all() and np.isfinite(energy) and ratio <= RUNAWAY:
        return
    worst = int((~finite).argmax() if not finite.all() else np.abs(problem.motion.v).sum(axis=1).argmax())
    raise UnstableError(
        f"unstable at step {books.step}, {books.time:.4g} s, node {problem.model.grid.ids[worst]}: energy is"
        f" {ratio:.3g} times the work done; the time step is {problem.time_step:.4g} s,"
        f" surely stable up to {problem.bound:.4g} s"
    )


def damage(problem: Problem) -> NDArray[np.float64]:
    """Damage (n,): 1 - intact / initial bonds, those cut by a pre-crack counted as broken; 0 without any."""
    bonds, family = problem.assembly.bonds, problem.assembly.family
    running = np.concatenate([[0], np.cumsum(problem.motion.broken == 0)])
    intact = running[bonds.start[1:]] - running[bonds.start[:-1]]
    return np.where(family > 0, 1 - intact / np.maximum(family, 1), 0.0)


def _frame(problem: Problem, books: Ledger, since: int, whole: bool) -> Frame:
    motion = problem.motion
    u, v = motion.u, motion.v
    fields = {"ux": u[:, 0], "uy": u[:, 1], "vx": v[:, 0], "vy": v[:, 1], "damage": damage(problem)}
    return Frame(
        books.step,
        books.time,
        fields if whole else None,
        _new_breaks(problem, since),
        books,
        {name: getattr(motion, name) for name in ("u", "v", "a", "dissipated", "work")},
    )


def _new_breaks(problem: Problem, since: int) -> Breaks:
    bonds, broken, ids = problem.assembly.bonds, problem.motion.broken, problem.model.grid.ids
    new = np.flatnonzero(broken > max(since, 0))
    new = new[np.argsort(broken[new], kind="stable")]
    source = np.searchsorted(bonds.start, new, side="right") - 1
    return Breaks(broken[new].astype(np.int64), ids[source], ids[bonds.neighbour[new]])


def _bond_numbers(problem: Problem, breaks: Breaks) -> NDArray[np.int64]:
    """Where the broken bonds of a file stand in the bond list."""
    bonds, ids = problem.assembly.bonds, problem.model.grid.ids
    order = np.argsort(ids)
    node, neighbour = (order[np.searchsorted(ids, column, sorter=order)] for column in breaks[1:])
    source = np.repeat(np.arange(len(ids)), np.diff(bonds.start))
    return np.searchsorted(source * len(ids) + bonds.neighbour, node * len(ids) + neighbour)


def _nodes(problem: Problem) -> Nodes:
    grid, assembly = problem.model.grid, problem.assembly
    cut = assembly.family - np.diff(assembly.bonds.start)
    return Nodes(grid.ids, grid.position, grid.delta, assembly.area, assembly.family, cut)


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
        "time_step": problem.time_step,
        "stable_time_step": problem.bound,
        "model": problem.model.to_json(),
    }


def _summary(problem: Problem, books: Ledger, wall: float, steps: int) -> dict[str, Any]:
    bonds = len(problem.assembly.bonds.neighbour)
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
        "wall_time": wall,
        "bond_updates_per_second": bonds * steps / wall if wall > 0 else 0.0,
        "broken_bonds": books.broken,
        "energy": {name: getattr(books, name) for name in ("kinetic", "strain", "dissipated", "work")},
        "balance": books.balance,
    }


__all__ = [
    "Options",
    "Problem",
    "Progress",
    "ResultsError",
    "UnstableError",
    "damage",
    "prepare",
    "resume",
    "simulate",
]
