"""Whether this checkout computes what another does, bit by bit: shipped scenes x laws x modes x kernels x precisions.

Each scene is solved in each way that nodes come and go, too, as far as that is possible.
`make compare AGAINST=DIR`, or `python -m benchmarks.compare DIR`; DIR is another checkout, such as `git worktree add`
makes one. Both solve the same scenes side by side on this machine, each with its own packages; nothing is stored, as
bits differ between processors. Scenes are coarsened and their materials weakened, so that much breaks in few steps.
Returns 1 where anything differs, and says what and by how much.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
COARSER = 2.0  # times the spacings of a scene, if not given
WEAKER = 0.1  # of its fracture energy
# How many in all, between frames, between ledger entries; a load step takes as long as some fifty time steps
TIME_STEPS, LOAD_STEPS = (400, 200, 50), (8, 4, 2)
LAWS = ("as shipped", "bilinear")
MODES, KERNELS, PRECISIONS = ("thesis", "conservative"), ("blocks", "listed"), ("float64", "float32")
STATE = ("value", "rate", "second", "dissipated", "damped", "work", "held_force")
Arrays = dict[str, NDArray[Any]]


class Way(NamedTuple):
    """One way to solve a scene."""

    law: str
    mode: str
    kernel: str
    precision: str

    def __str__(self) -> str:
        return ", ".join(self)


WAYS = tuple(itertools.starmap(Way, itertools.product(LAWS, MODES, KERNELS, PRECISIONS)))
ADAPTED = ("hybrid", "split", "collocation")  # with the law as shipped; a grid of its own each
Job = tuple[list[str], list[str]]  # words for `pdmesh build`, and ways to solve a scene


# In the process of each checkout


def solve(scene: Path, overrides: list[str], ways: list[str], folder: Path) -> Iterator[tuple[str, Arrays]]:
    """The grid of a scene, and what each of these ways to solve it finds."""
    from pdmesh.__main__ import main as pdmesh
    from pdsolve import Options, read_model

    path = folder / f"{scene.stem}.json"
    with contextlib.redirect_stderr(io.StringIO()) as stderr:
        failed = pdmesh(["build", str(scene), "-o", str(path), "-q", "--trust", *overrides])
    if failed:  # as of a scene that is too coarse
        yield from ((name, refused(stderr.getvalue())) for name in ["grid", *ways])
        return
    yield "grid", {"bytes": np.frombuffer(path.read_bytes(), dtype=np.uint8)}
    model = read_model(path)
    for adapt in ADAPTED:
        if adapt in ways:
            yield f"adapted, {adapt}", adapted(scene, overrides, folder, adapt)
    for way in WAYS:
        if str(way) in ways:
            yield str(way), solved(model, way.law, Options(way.mode, way.precision, 1, way.kernel))


def adapted(scene: Path, overrides: list[str], folder: Path, adapt: str) -> Arrays:
    """What a run finds whose nodes come and go, or why there is none."""
    from pdmesh.__main__ import main as pdmesh
    from pdsolve import Options, read_model

    # a grid that all of them can have; collocation with so few nodes in a horizon has to be damped
    grid = "split" if adapt == "split" else "hybrid"
    path, words = folder / f"{scene.stem}.{adapt}.json", ["--adapt", grid, "--trust", "-q", *overrides]
    with contextlib.redirect_stderr(io.StringIO()) as stderr:
        if pdmesh(["build", str(scene), "-o", str(path), *words]):
            return refused(stderr.getvalue())
    model = read_model(path)
    settings, run = model.settings, model.settings.run
    seam = msgspec.structs.replace(run.collocation, damped=True)
    settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(run, adapt=adapt, collocation=seam))
    model = dataclasses.replace(model, settings=settings)
    return solved(model, LAWS[0], Options("conservative", threads=1), 1.0)


def solved(model: Any, law: str, options: Any, toughness: float = WEAKER) -> Arrays:
    """What a run of a model finds whose bonds are of this law and that tough, or why there is none."""
    from pdsolve import simulate

    model = dataclasses.replace(model, settings=weakened(model.settings, law, toughness))
    try:
        with simulate(model, None, options) as results:
            return everything(results)
    except (ValueError, ArithmeticError) as error:
        return refused(str(error))


def refused(why: str) -> Arrays:
    """What is found where there is no run; names of folders do not count."""
    return {"refused": np.frombuffer(re.sub(r"/\S*/", "", why).encode(), dtype=np.uint8)}


def weakened(settings: Any, law: str, toughness: float) -> Any:
    """The settings of a model that breaks soon, its bonds of this law."""

    def material(given: Any) -> Any:
        if given is None:  # of what diffuses alone
            return None
        softening = {"law": "bilinear", "kr": 2.0} if law == "bilinear" else {}
        return msgspec.structs.replace(given, G0=toughness * given.G0, **softening)

    regions = tuple(msgspec.structs.replace(region, material=material(region.material)) for region in settings.regions)
    steps, every, ledger = LOAD_STEPS if settings.run.solver == "static" else TIME_STEPS
    run = msgspec.structs.replace(
        settings.run, steps=steps, every=every, ledger=ledger, until=None, quiet=None, time_step=None
    )
    return msgspec.structs.replace(settings, material=material(settings.material), regions=regions, run=run)


def everything(results: Any) -> Arrays:
    """All that a run has computed."""
    arrays: Arrays = {}
    for step in results.frames()[0].tolist():
        arrays |= {f"{name} at step {step}": results.field(name, step) for name in results.stored(step)}
    arrays |= {f"broken bonds: {name}": column for name, column in results.breaks()._asdict().items()}
    for name in ("history", "probes", "reactions"):
        table = getattr(results, name)()
        arrays |= {f"{name}: {column}": np.ascontiguousarray(table[column]) for column in table.dtype.names}
    state = results.checkpoint()[1]
    names = [name for name in STATE if name in state] or [name for name in state if name != "number"]  # of a fine zone
    arrays |= {f"checkpoint: {name}": state[name].ravel() for name in names}
    if len(state.get("worst", ())):
        arrays["checkpoint: worst"] = np.sort(state["worst"])
    return arrays


def work(jobs: dict[str, Job], folder: Path, tree: Path) -> None:
    """Solve all scenes, a file for each way, with the packages of this tree."""
    import pdsolve

    if not Path(str(pdsolve.__file__)).is_relative_to(tree):
        raise SystemExit(f"{pdsolve.__file__}: found this package, expected that of {tree}")
    warnings.simplefilter("ignore")
    for scene, job in jobs.items():
        for number, (name, arrays) in enumerate(solve(Path(scene), *job, folder)):
            part = folder / f"{Path(scene).stem}.{number}"
            np.savez(part.with_suffix(".part.npz"), name=np.array(name), **arrays)
            part.with_suffix(".part.npz").rename(f"{part}.npz")


# In the process that compares


def coarsened(scene: Path, coarser: float) -> list[str]:
    """Words for `pdmesh build` that make a scene's spacings so many times as large."""
    words = [sys.executable, "-m", "pdmesh", "params", str(scene), "--trust", "--json"]
    parameters = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    spacings = {name: row["value"] for name, row in parameters.items() if name.lower().endswith("spacing")}
    return [word for name, value in spacings.items() for word in ("--set", f"{name}={coarser * value:g}")]


def differing(here: Arrays, there: Arrays) -> list[str]:
    """What differs, and by how much at most, as a share of the largest."""
    lines = [f"{name}: only in one" for name in sorted(here.keys() ^ there.keys())]
    for name in here.keys() & there.keys():
        a, b = here[name], there[name]
        if (a.shape, a.dtype) != (b.shape, b.dtype):
            lines.append(f"{name}: {a.dtype}{a.shape} and {b.dtype}{b.shape}")
        elif a.tobytes() != b.tobytes():
            apart = ""
            if np.issubdtype(a.dtype, np.number):
                apart = f" by {np.abs(a - b.astype(a.dtype)).max() / max(float(np.abs(a).max()), 1e-300):.1e}"
            lines.append(f"{name}: differ{apart}")
    return sorted(lines)


def ways_of(number: int, sample: bool) -> list[str]:
    """All ways to solve a scene, or three of them, others for the next scene, so that all are tried on several."""
    ways = [str(way) for way in WAYS]
    conservative = [str(way) for way in WAYS if way.mode == MODES[1]]  # which most scenes can have
    return [ADAPTED[number % 3], conservative[number % 8], ways[(5 * number + 3) % 16]] if sample else [*ADAPTED, *ways]


def compare(against: Path, jobs: dict[str, Job], folder: Path) -> int:
    """Print what each way of each scene has; returns how many differ."""
    running = []
    for tree in (ROOT, against):
        scratch = folder / ("this" if tree == ROOT else "other")
        scratch.mkdir()
        words = [sys.executable, "-P", __file__, "--work", json.dumps(jobs), str(scratch), str(tree)]
        running.append((scratch, subprocess.Popen(words, env={**os.environ, "PYTHONPATH": str(tree)})))
    different = 0
    for scene, (_, ways) in ((Path(scene), job) for scene, job in jobs.items()):
        for number in range(1 + len(set(ways))):
            parts = [scratch / f"{scene.stem}.{number}.npz" for scratch, _ in running]
            while not all(part.exists() for part in parts):
                if any(process.poll() not in (None, 0) for _, process in running):
                    for _, process in running:
                        process.terminate()
                    raise SystemExit(f"{scene.name} was not solved by both")
                time.sleep(0.1)
            here, there = (dict(np.load(part)) for part in parts)
            name, broken = here.pop("name"), len(here.get("broken bonds: step", ()))
            lines = differing(here, {key: values for key, values in there.items() if key != "name"})
            different += bool(lines)
            verdict = "DIFFERENT" if lines else "the same"
            what = f", {broken} bonds broken" if number else ""
            if "refused" in here:
                what = f", refused: {here['refused'].tobytes().decode().strip()}"
            print(f"{scene.stem}: {name}: {verdict}{what}", flush=True)
            for line in lines:
                print(f"    {line}")
    for _, process in running:
        process.wait()
    return different


def main() -> int:
    """Compare; returns the exit code."""
    if sys.argv[1:2] == ["--work"]:
        work(json.loads(sys.argv[2]), Path(sys.argv[3]), Path(sys.argv[4]))
        return 0
    parser = argparse.ArgumentParser(prog="benchmarks.compare", description=__doc__)
    parser.add_argument("against", type=Path, help="another checkout")
    parser.add_argument("--scenes", default="", help="some of geometries, separated by commas (default: all plates)")
    parser.add_argument("--coarser", type=float, default=COARSER, help="times the spacings (default: %(default)s)")
    parser.add_argument("--sample", action="store_true", help="three ways a scene, in place of all")
    args = parser.parse_args()
    against = args.against.resolve()
    if not (against / "pdsolve" / "__main__.py").is_file():
        parser.error(f"{args.against}: found no pdsolve in it, expected a checkout")
    from benchmarks.models import PLATES  # here, as what works in another checkout has no need of it

    wanted = [scene for scene in PLATES if not args.scenes or scene.stem in args.scenes.split(",")]
    jobs = {
        str(scene): (coarsened(scene, args.coarser), ways_of(number, args.sample))
        for number, scene in enumerate(wanted)
    }
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        different = compare(against, jobs, Path(folder))
    runs = sum(len(set(ways)) for _, ways in jobs.values())
    print(f"{runs} runs of {len(jobs)} scenes in {time.perf_counter() - began:.0f} s: {different} differ")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
