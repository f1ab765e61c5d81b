"""How fast the solver is: the fast kernel against the listed one and numpy, in one interleaved run.

`python -m benchmarks.speed` writes speed.json and speed.png, with what the processor allows; `--against DIR` measures
another checkout beside this one; `--quick` measures one plate and fails where the fast kernel is less than `LEAST`
times the listed one. docs/developers/benchmarks.md says how each number is made.
"""

from __future__ import annotations

import argparse
import dataclasses
import io
import itertools
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import msgspec
import numba
import numpy as np
from llvmlite.binding import get_host_cpu_name
from tqdm import tqdm

from benchmarks import beside, bound
from benchmarks.models import lattice_grid, scene_model, shaken
from benchmarks.processes import processes
from benchmarks.timing import least_of_steps, timed
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Progress, simulate
from pdsolve.run.system import PreparedRun

LEAST = 4.0  # times the listed one, in the quick form
SAMPLE = 0.05  # s of one measurement
ROUNDS, QUICK_ROUNDS = 7, 9
GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
LAWS = {"brittle": GLASS, "bilinear": Material(E=65e9, rho=2235.0, G0=204.0, law="bilinear", kr=2.0)}
MODES = ("thesis", "conservative")
PLATES = {"4k": (101, 42), "13k": (131, 101), "64k": (400, 160), "1M": (1000, 1000)}
LISTED_UP_TO = 2_000_000  # nodes; above, lists of bonds are too long for a desktop


def grids(names: list[str]) -> dict[str, Grid]:
    """The plates of one scale of these names, and the grids of the shipped scenes."""
    return {name: lattice_grid(*PLATES[name]) if name in PLATES else scene_model(f"{name}.geo").grid for name in names}


def intact(grid: Grid, law: str, options: Options) -> PreparedRun:
    """A plate in small random motion that breaks nothing."""
    settings = Settings(material=LAWS[law], horizon=Horizon(3.0), run=Run(time_step=2e-8))
    return shaken(Model(grid, settings), options, 1e-9)


class NumpyBonds:
    """The solver as one would write it in numpy: a list of bonds, bincount for the sums."""

    def __init__(self, problem: PreparedRun) -> None:
        system, state = problem
        bonds = system.scheme.fill(system.model).whole().bonds
        self.i = np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))
        self.j, self.xi = bonds.neighbour, bonds.xi.astype(float)
        self.length = np.hypot(*self.xi.T)
        self.stiffness, self.peak, self.limit = bonds.stiffness, bonds.peak, bonds.limit
        self.intact, self.worst = np.ones(len(self.i), dtype=bool), bonds.peak.copy()
        self.softens = bool((bonds.peak < bonds.limit).any())
        self.rho, self.dt = system.model.rho, system.time_step
        self.u, self.v, self.a = (values.astype(float) for values in state[:3])

    def take(self, steps: int) -> None:
        """Take some steps."""
        for _ in range(steps):
            self.v += self.dt / 2 * self.a
            self.u += self.dt * self.v
            y = self.xi + self.u[self.j] - self.u[self.i]
            now = np.hypot(y[:, 0], y[:, 1])
            stretch = now / self.length - 1
            self.intact &= stretch <= self.limit
            pull = np.where(self.intact, self.stiffness * stretch / now, 0.0)
            if self.softens:
                self.worst = np.maximum(self.worst, stretch)
                pull *= self.peak * (self.limit - self.worst) / ((self.limit - self.peak) * self.worst)
            for axis in (0, 1):
                self.a[:, axis] = np.bincount(self.i, pull * y[:, axis], minlength=len(self.u)) / self.rho
            self.v += self.dt / 2 * self.a


def stepper(problem: PreparedRun, threads: int) -> Callable[[int], float]:
    """Takes steps of a problem, one sequence after the other, and returns their seconds."""
    at = 1

    def take(steps: int) -> float:
        nonlocal at
        numba.set_num_threads(threads)
        first, at = at, at + steps
        return timed(lambda: problem.advance(first, at), time.perf_counter)

    return take


def measure(name: str, grid: Grid, law: str, mode: str, rounds: int, threads: int) -> dict[str, Any]:
    """ns a bond and step of all variants on one grid; on one thread only the three in double precision."""
    precisions = ("float64", "float32") if threads > 1 else ("float64",)
    variants = [("blocks", precision, used) for precision in precisions for used in dict.fromkeys((threads, 1))]
    if len(grid) <= LISTED_UP_TO:
        variants += [("listed", precision, threads) for precision in precisions]
        variants += [("listed", "float64", 1)] if threads > 1 else []
    runs: dict[str, PreparedRun] = {}
    measures: dict[str, Callable[[int], float]] = {}
    for kernel, precision, used in variants:
        key = f"{kernel} {precision}" + (", 1 thread" if used < threads else "")
        runs[key] = intact(grid, law, Options(mode, precision, used, kernel))
        measures[key] = stepper(runs[key], used)
    if len(grid) <= LISTED_UP_TO:
        bare = NumpyBonds(runs["listed float64"])
        measures["numpy float64"] = lambda steps: timed(lambda: bare.take(steps), time.perf_counter)
    seconds = least_of_steps(measures, rounds, SAMPLE)
    system = runs["blocks float64"].system
    assert not len(system.operator.broken().step), "a bond broke: this is not the intact cost"
    bonds = system.directed_bond_count
    ns = {key: 1e9 * value / bonds for key, value in seconds.items()}
    return {"grid": name, "nodes": len(grid), "bonds": bonds, "law": law, "mode": mode, "ns": ns, "ratios": ratios(ns)}


def ratios(ns: dict[str, float]) -> dict[str, float]:
    """What the requirements are about."""
    pairs = {
        "listed / blocks, float64": ("listed float64", "blocks float64"),
        "listed float64 / blocks float32": ("listed float64", "blocks float32"),
        "listed / blocks, float32": ("listed float32", "blocks float32"),
        "numpy / blocks, float64": ("numpy float64", "blocks float64"),
        "listed / blocks, float64, 1 thread": ("listed float64, 1 thread", "blocks float64, 1 thread"),
        "listed float64 / blocks float32, 1 thread": ("listed float64, 1 thread", "blocks float32, 1 thread"),
        "1 thread / all": ("blocks float64, 1 thread", "blocks float64"),
    }
    return {name: ns[slow] / ns[quick] for name, (slow, quick) in pairs.items() if slow in ns and quick in ns}


def scene_of(name: str, law: str) -> Model:
    """A shipped scene whose bonds follow one of the two laws."""
    model = scene_model(f"{name}.geo")
    assert model.settings.material is not None
    other = {"law": "bilinear", "kr": 2.0} if law == "bilinear" else {"law": "brittle"}
    material = msgspec.structs.replace(model.settings.material, **other)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, material=material))


def growing(model: Model, mode: str, rounds: int) -> dict[str, Any]:
    """ns a bond of a whole run whose crack grows, against the same plate left alone, and against the whole run with
    all that a user gets: ledger, frames on disk, a progress bar."""
    steps = model.settings.run.steps
    best: dict[str, float] = {}
    for _ in range(rounds):
        for name in ("growing", "intact", "with frames"):
            problem = prepare(model, Options(mode))
            if name == "intact":
                for load in (problem.system.drive.force, problem.system.drive.before):
                    load[:] = 0
                problem.state.rate[:] = problem.state.second[:] = 0
            if name == "with frames":
                seconds = _written(model, mode)
            else:
                began = time.perf_counter()
                problem.advance(1, steps + 1)
                seconds = time.perf_counter() - began
            best[name] = min(best.get(name, np.inf), seconds / steps / problem.system.directed_bond_count * 1e9)
    ratios = {
        "growing / intact": best["growing"] / best["intact"],
        "with frames / without": best["with frames"] / best["growing"],
    }
    return {
        "mode": mode,
        "steps": steps,
        "frames": steps // model.settings.run.frame_interval,
        "ns": best,
        "ratios": ratios,
    }


def _written(model: Model, mode: str) -> float:
    """Seconds of the time loop of a run that writes a file and shows how far it is."""
    with tempfile.TemporaryDirectory() as folder, tqdm(total=model.settings.run.steps, file=io.StringIO()) as bar:

        def watch(progress: Progress) -> bool:
            bar.update(progress.step - bar.n)
            return False

        with simulate(model, Path(folder) / "run.sqlite", Options(mode), watch) as results:
            return float(results.summary()["wall_time"])


def chart(rows: list[dict[str, Any]], least: dict[str, float], path: Path) -> None:
    """ns a bond against nodes: all variants, and the least of a thread of this processor."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    modes = sorted({(row["mode"], row["law"]) for row in rows})
    figure, axes = plt.subplots(1, len(modes), figsize=(4 * len(modes), 4), sharey=True, squeeze=False)
    for axis, (mode, law) in zip(axes[0], modes, strict=True):
        for name in sorted({name for row in rows for name in row["ns"]}):
            points = sorted(
                (row["nodes"], row["ns"][name])
                for row in rows
                if (row["mode"], row["law"]) == (mode, law) and name in row["ns"]
            )
            axis.loglog(*zip(*points, strict=True), marker="o", label=name)
        for (precision, ns), style in zip(least.items(), ("--", ":"), strict=True):
            axis.axhline(ns, color="k", linestyle=style, linewidth=1, label=f"bound of 1 thread, {precision}")
        axis.set(title=f"{law}, {mode}", xlabel="nodes")
        axis.xaxis.set_minor_formatter("")
        axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("ns per directed bond and step")
    axes[0, -1].legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1, 0.5))
    figure.savefig(path, dpi=150, bbox_inches="tight")


def tell(row: dict[str, Any]) -> None:
    """A line or two on a measurement."""
    print(f"{row['grid']} ({row['nodes']} nodes, {row['bonds']} bonds), {row['law']}, {row['mode']}")
    print("   ns a bond: " + ", ".join(f"{name} {value:.3g}" for name, value in row["ns"].items()))
    print("   " + "; ".join(f"{name}: {value:.3g}" for name, value in row["ratios"].items()), flush=True)


def quick() -> int:
    """The check for continuous integration, on one thread: other work on the machine then slows all variants alike."""
    row = measure("4k", lattice_grid(*PLATES["4k"]), "brittle", "conservative", QUICK_ROUNDS, 1)
    tell(row)
    ratio = row["ratios"]["listed / blocks, float64"]
    if ratio < LEAST:
        print(f"the fast kernel is {ratio:.3g} times the listed one, expected at least {LEAST:g}", file=sys.stderr)
        return 1
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.speed", description=__doc__)
    parser.add_argument("--quick", action="store_true", help=f"one plate; fails below {LEAST:g} times the listed one")
    usual = "4k,13k,64k,1M,duran50,kalthoff_winkler"
    parser.add_argument("--grids", default=usual, help="of 4k, 13k, 64k, 1M and the shipped scenes")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--runs", default="kalthoff_winkler,duran50", help="shipped scenes whose whole run is timed")
    parser.add_argument("--against", type=Path, metavar="DIR", help="another checkout, measured beside this one")
    parser.add_argument("-o", "--output", type=Path, default=Path("speed.json"))
    args = parser.parse_args(arguments)
    threads = min(2, numba.config.NUMBA_NUM_THREADS)
    if args.quick:
        return quick()
    rows = []
    for name, grid in grids(args.grids.split(",")).items():
        for law in LAWS:
            for mode in MODES:
                rows.append(measure(name, grid, law, mode, args.rounds, threads))
                tell(rows[-1])
    numba.set_num_threads(threads)
    runs = []
    for name, law, mode in itertools.product(filter(None, args.runs.split(",")), LAWS, MODES):
        runs.append({"scene": name, "law": law, **growing(scene_of(name, law), mode, 3)})
        shown = ", ".join(f"{key} {value:.3g}" for key, value in runs[-1]["ratios"].items())
        print(f"{name}, {law}, {mode}: {shown}", flush=True)
    waiting = processes()
    print("; ".join(f"{what} {seconds:.2f} s" for what, seconds in waiting.items()))
    machine = {
        "processor": get_host_cpu_name(),
        "cores": os.cpu_count(),
        "threads": threads,
        "numba": numba.__version__,
    }
    least = {precision: bound.ns_per_bond(precision) for precision in ("float64", "float32")}
    print("; ".join(f"the least of a thread, {precision}: {ns:.3g} ns a bond" for precision, ns in least.items()))
    measurement = {"machine": machine, "bound": least, "intact": rows, "runs": runs, "processes": waiting}
    if args.against:
        measurement["against"] = list(beside.compared(args.against))
        for comparison in measurement["against"]:
            beside.tell(comparison)
    args.output.write_text(json.dumps(measurement, indent=1))
    chart(rows, least, args.output.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
