"""This checkout and another one side by side: how much longer the other takes, each a ratio of one interleaved run.

`python -m benchmarks.beside DIR` measures intact steps, whole runs, runs with twenty frames, first and later starts,
and the bytes of bonds. DIR has the other checkout. Each has a process of its own, and they take turns. Steps and whole
runs are measured by user time, as they take one thread.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent.parent
SAMPLE = 0.2  # s of one measurement of steps
ROUNDS, WHOLE = 9, 7
FRAMES = 20
STRIP = 2000  # nodes along a strip


class Job(NamedTuple):
    """What both measure, as their processes are told."""

    name: str
    model: str  # a grid file
    mode: str = "conservative"
    precision: str = "float64"
    threads: int = 1
    kind: str = "steps"  # intact steps, a whole run, one written with frames, its start, or the bytes of its bonds


# ---- in a process of its own, with a checkout of its own


def serve(job: Job) -> None:
    """Measure once for each line of stdin; write seconds a step."""
    measured = {"steps": _steps, "whole": _whole, "frames": _frames, "bytes": _bytes}[job.kind](job)
    for _ in sys.stdin:
        print(measured(), flush=True)


def _steps(job: Job) -> Callable[[], float]:
    import numpy as np

    problem = _prepared(job)
    motion = getattr(problem, "motion", None)
    u = problem.state.value if motion is None else motion.u
    u[:] = 1e-9 * np.random.default_rng(0).standard_normal(u.shape)
    at = 1

    advance = _march_of(problem)

    def take(steps: int) -> float:
        nonlocal at
        began = _user_time()
        advance(at, at + steps)
        at += steps
        return (_user_time() - began) / steps

    take(2)
    steps = max(1, int(SAMPLE / max(take(3), 1e-6)))
    return lambda: take(steps)


def _whole(job: Job) -> Callable[[], float]:
    def run() -> float:
        problem, steps = _prepared(job), _model(job).settings.run.steps
        began = _user_time()
        _march_of(problem)(1, steps + 1)
        return (_user_time() - began) / steps

    run()
    return run


def _bytes(job: Job) -> Callable[[], float]:
    system = _prepared(job).system
    bonds = getattr(system, "directed_bond_count", None) or system.bonds  # as older checkouts name them
    size = system.operator.bytes() / bonds
    return lambda: size


def _march_of(problem: Any) -> Callable[[int, int], object]:
    """What takes the steps of a prepared run, which older checkouts name otherwise."""
    march: Callable[[int, int], object] = problem.advance if hasattr(problem, "advance") else problem.march
    return march


def _user_time() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def _frames(job: Job) -> Callable[[], float]:
    from pdsolve.run.simulation import simulate

    def run() -> float:
        with tempfile.TemporaryDirectory() as folder:
            model = _model(job)
            with simulate(model, Path(folder) / "run.sqlite", _options(job)) as results:
                return float(results.summary()["wall_time"]) / model.settings.run.steps

    run()
    return run


def _prepared(job: Job) -> Any:
    from pdsolve.run.simulation import prepare

    return prepare(_model(job), _options(job))


def _model(job: Job) -> Any:
    from pdsolve.model import read_model

    return read_model(Path(job.model))


def _options(job: Job) -> Any:
    from pdsolve.run.simulation import Options

    return Options(job.mode, job.precision, job.threads)


# ---- in this process


def least_of_turns(job: Job, other: Path, rounds: int) -> tuple[float, float]:
    """The least seconds a step of another checkout and of this one, whose processes take turns."""
    from benchmarks.timing import Served, least

    words = [sys.executable, "-P", __file__, "--serve", json.dumps(job)]
    processes = {folder: Served(words, folder, PYTHONPATH=str(folder)) for folder in (other, HERE)}
    best = least({str(folder): partial(process.ask, "") for folder, process in processes.items()}, rounds)
    for process in processes.values():
        process.close()
    return best[str(other)], best[str(HERE)]


def started(model: str, other: Path, rounds: int) -> Iterator[dict[str, Any]]:
    """From shell to shell: a run that compiles, and the least of some that need not."""
    from benchmarks.timing import environment, timed

    with tempfile.TemporaryDirectory() as folder:

        def seconds(checkout: Path) -> float:
            variables = environment(PYTHONPATH=str(checkout), NUMBA_CACHE_DIR=f"{folder}/{checkout.name}")
            command = [sys.executable, "-P", "-m", "pdsolve", model, "-o", f"{folder}/run.sqlite", "--force", "-q"]
            return timed(partial(subprocess.run, command, env=variables, cwd=checkout, check=True), time.perf_counter)

        cold = [seconds(checkout) for checkout in (other, HERE)]
        yield row("the first run, which compiles", *cold, unit="s")
        warm = [[seconds(checkout) for checkout in (other, HERE)] for _ in range(rounds)]
        yield row("a later run, from shell to shell", *(min(column) for column in zip(*warm, strict=True)), unit="s")


def row(name: str, other: float, here: float, unit: str = "s a step") -> dict[str, Any]:
    """A line of the table."""
    return {"what": name, "other": other, "here": here, "unit": unit, "ratio": other / here}


def jobs(folder: Path) -> Iterator[Job]:
    """All that is measured, their models written to `folder`."""
    import msgspec

    from benchmarks.models import lattice_grid, scene_model
    from benchmarks.speed import GLASS, PLATES
    from pdmesh.model.document import Horizon, Run, Settings
    from pdsolve.model import Model

    def written(model: Model, name: str) -> str:
        path = folder / f"{name}.json"
        path.write_text(model.to_json())
        return str(path)

    strips = {f"strip {width} wide": (width, STRIP) for width in (16, 20, 24)}
    for name, shape in {"4k": PLATES["4k"], "64k": PLATES["64k"], **strips}.items():
        for m in (3.0, 4.0):
            settings = Settings(material=GLASS, horizon=Horizon(m), run=Run(time_step=2e-8))
            model = written(Model(lattice_grid(*shape), settings), f"{name}-{m:g}")
            for precision in ("float64", "float32"):
                yield Job(f"intact, {name}, m = {m:g}, {precision}", model, precision=precision)
    for name, law in (("duran50", "brittle"), ("kalthoff_winkler", "bilinear")):
        scene = scene_model(f"{name}.geo")
        assert scene.settings.material is not None
        material = msgspec.structs.replace(
            scene.settings.material, law=law, **({"kr": 2.0} if law != "brittle" else {})
        )
        run = msgspec.structs.replace(scene.settings.run, every=max(1, scene.settings.run.steps // FRAMES))
        settings = msgspec.structs.replace(scene.settings, material=material, run=run)
        model = written(dataclasses.replace(scene, settings=settings), f"{name}-{law}")
        yield Job(f"{name}, {law}, the march", model, kind="whole")
        yield Job(f"{name}, {law}, with {FRAMES} frames", model, kind="frames")
    run = Run(time_step=2e-8, steps=1000, every=50)
    settings = Settings(material=GLASS, horizon=Horizon(3.0), run=run)
    model = written(Model(lattice_grid(*PLATES["64k"]), settings), "64k-frames")
    yield Job("64k, 1000 steps, the march", model, kind="whole")
    yield Job(f"64k, 1000 steps, with {FRAMES} frames", model, kind="frames")
    yield from _jobs_of_lattices(folder)


def _jobs_of_lattices(folder: Path) -> Iterator[Job]:
    """Intact steps of plates and bodies of one spacing and of several, and the bytes of their bonds."""
    from benchmarks.lattices import models

    for name, model in models().items():
        path = folder / f"{name.replace(' ', '_').replace('`', '')}.json"
        path.write_text(model.to_json())
        yield Job(f"intact, {name}", str(path))
        yield Job(f"bytes, {name}", str(path), kind="bytes")


def compared(other: Path, rounds: int = ROUNDS, only: str = "") -> Iterator[dict[str, Any]]:
    """A row for each job, or for those alone whose names have a match of a pattern."""
    with tempfile.TemporaryDirectory() as folder:
        for job in jobs(Path(folder)):
            if not re.search(only, job.name):
                continue
            measured = least_of_turns(job, other.resolve(), {"steps": rounds, "bytes": 1}.get(job.kind, WHOLE))
            yield row(job.name, *measured, **({"unit": "B a bond"} if job.kind == "bytes" else {}))
        if only:
            return
        yield from started(str(Path(folder) / "duran50-brittle.json"), other.resolve(), 5)


def tell(row: dict[str, Any]) -> None:
    """Print a row as a line."""
    seconds = f"{row['other']:.3g} and {row['here']:.3g} {row['unit']}"
    print(f"{row['what']}: {row['ratio']:.2f} ({seconds})", flush=True)


def main() -> int:
    """Measure, or serve who measures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.beside", description=__doc__)
    parser.add_argument("other", type=Path, nargs="?", help="the other checkout")
    parser.add_argument("--only", default="", help="a pattern: measure what has a match of it in its name alone")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(Job(*json.loads(args.serve)))
        return 0
    for comparison in compared(args.other, only=args.only):
        tell(comparison)
    return 0


if __name__ == "__main__":
    sys.exit(main())
