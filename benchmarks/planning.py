"""What `pdmesh plan --within` promises: errors against spacing of three problems, and how far it held on two others.

`python -m benchmarks.planning` measures the first and writes pdmesh/reports/accuracy.json; `--check` then asks for
proposals for two scenes that were not used, solves them and uniform runs of half their finest spacing, and says what
the error was. Of cracks, which scatter, errors are medians of several runs. docs/developers/benchmarks.md says how
each number is made.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from benchmarks.models import GEOMETRIES, model_of, with_run
from pdmesh import Circle, Scene, box
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Horizon, Material
from pdmesh.reports.accuracy_estimate import changed, feature, proposal
from pdsolve.measures import tradeoff
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate

TESTS = Path(__file__).parent.parent / "tests"
sys.path += [str(TESTS), str(TESTS / "verification")]

HALF, RADIUS, FINE_ZONE = 4.0, 1.0, 2.0  # m, of the plate with a hole
RUNS, SHORTER = 5, 0.01  # of each proposal and of the reference; by which share of a step each further run is shorter
RATIOS = {"none": (3.0, 4.0), "hybrid": (4.0,)}
FRAMES = 20
WITHIN = (0.1, 0.05, 0.03)
MOVING = {"duran50.geo": (2e-3, 1e-3, 5e-4), "kalthoff_winkler_steel.py": (1e-3,)}  # 2 mm of steel is stopped
CHECKED = ("oblique_crack.geo", "v_notch.geo")
MEASURED = {"kalthoff_winkler.geo": (2e-3, 1e-3, 5e-4, 2.5e-4), "duran50.geo": (2e-3, 1e-3, 5e-4, 2.5e-4)}
REFERENCE = 0.5  # of the finest spacing measured


def solved(scene: Scene, path: Path, number: int = 0) -> Path:
    """The results of a scene; those of a further run, by its `number`, take somewhat shorter steps."""
    model = model_of(scene)
    run, share = model.settings.run, 1 - SHORTER * number
    assert run.time_step is not None
    steps = round(run.steps / share)
    model = with_run(model, steps=steps, every=max(1, steps // FRAMES), time_step=share * run.time_step)
    simulate(model, path, Options()).close()
    return path


def uniform(scene: Scene, finest: float, ratio: float) -> Scene:
    """The scene with one spacing."""
    flat = dataclasses.replace(scene, spacing=scene.finest, zones=(), refinements=())
    conditions = []
    for condition in scene.conditions:
        rows = max(1, round(condition.place.rows * scene.spacing / scene.finest))
        conditions.append(dataclasses.replace(condition, place=dataclasses.replace(condition.place, rows=rows)))
    return changed(dataclasses.replace(flat, conditions=tuple(conditions)), finest, ratio)


def errors(scene: Scene, references: list[Path], folder: Path) -> list[float]:
    """The displacement errors of as many runs of a scene, each against a reference of its own."""
    of_runs = []
    for number, reference in enumerate(references):
        path = solved(scene, folder / f"run {number}", number)
        with Results.open(path) as results, Results.open(reference) as finer:
            off = tradeoff.relative_displacement_error(results, finer)
        path.unlink()
        of_runs.append(np.nan if off is None else off)
    return of_runs


def kirsch() -> Iterator[dict[str, Any]]:
    """The plate with a hole, on two scales, against the classical solution."""
    from system_checks import equilibrium
    from test_kirsch import classical

    unit = Material(E=1.0, rho=1.0, G0=1.0)
    for ratio in RATIOS["none"]:
        for fineness in (4, 8, 16, 32):
            spacing = RADIUS / fineness
            scene = Scene(box(-HALF, -HALF, HALF, HALF), 2 * spacing, unit, ratio).hole(Circle(0.0, 0.0, RADIUS))
            scene = scene.zone(box(-FINE_ZONE, -FINE_ZONE, FINE_ZONE, FINE_ZONE), spacing, grown=False)
            grid, settings, _ = build_grid(scene)
            settings = msgspec.structs.replace(settings, horizon=Horizon(ratio))
            problem = prepare(Model(grid, settings), Options())
            exact = classical(grid.position)
            outer = np.abs(grid.position).max(axis=1) > HALF - (ratio + 0.5) * grid.delta
            u = equilibrium(problem, np.column_stack([outer, outer]), exact)
            inside = np.abs(grid.position).max(axis=1) < FINE_ZONE
            weight = problem.system.area[inside, None]
            error, whole = (float(np.sum(weight * way**2)) for way in (u[inside] - exact[inside], exact[inside]))
            off = float(np.sqrt(error / whole))
            yield {"problem": "hole in tension", "ratio": ratio, "spacing_over_feature": 1 / fineness, "error": off}


def cracks(adapt: str = "none") -> Iterator[dict[str, Any]]:
    """Scenes with cracks, on two scales or with a fine zone that moves, against uniform runs; medians, as cracks
    scatter."""
    for name, spacings in (MEASURED if adapt == "none" else MOVING).items():
        scene = read_scene(GEOMETRIES / name, [], [], True)
        size, _ = feature(scene)
        with tempfile.TemporaryDirectory() as folder:
            finer = uniform(scene, REFERENCE * min(spacings), 4.0)
            references = [solved(finer, Path(folder) / f"{number}", number) for number in range(RUNS)]
            for ratio in RATIOS[adapt]:
                for spacing in spacings:
                    of_runs = errors(changed(scene, spacing, ratio, adapt), references, Path(folder))
                    off = float(np.median(of_runs))
                    point = {"problem": name, "ratio": ratio, "spacing_over_feature": spacing / size, "error": off}
                    yield point | ({} if adapt == "none" else {"adapt": adapt})


def checks() -> Iterator[dict[str, Any]]:
    """What was promised for other scenes, and what came of it."""
    for name in CHECKED:
        scene = read_scene(GEOMETRIES / name, [], [], True)
        with tempfile.TemporaryDirectory() as folder:
            proposals = {within: proposal(scene, within) for within in WITHIN}
            finer = uniform(scene, REFERENCE * min(plan.scene.finest for plan in proposals.values()), 4.0)
            references = [solved(finer, Path(folder) / f"{number}", number) for number in range(RUNS)]
            for within, proposed in proposals.items():
                of_runs = errors(proposed.scene, references, Path(folder))
                yield {
                    "scene": name,
                    "within": within,
                    "promised": proposed.error,
                    "spacing": proposed.scene.finest,
                    "ratio": proposed.scene.horizon,
                    "adapt": proposed.adapt,
                    "error": float(np.median(of_runs)),
                    "least": min(of_runs),
                    "most": max(of_runs),
                }


PROBLEMS = (kirsch, cracks, partial(cracks, "hybrid"))


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.planning", description=__doc__)
    parser.add_argument("--check", action="store_true", help="only check the promises on two other scenes")
    parser.add_argument("--adapt", choices=("hybrid",), help="measure these errors alone, and keep the others")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path(__file__).parent.parent / "pdmesh" / "reports" / "accuracy.json"
    )
    parser.add_argument("--report", type=Path, default=Path(__file__).parent / "planning.json")
    args = parser.parse_args(arguments)
    if not args.check:
        points = [] if args.adapt is None else json.loads(args.output.read_text())["points"]
        points = [point for point in points if point.get("adapt", "none") != args.adapt]
        for problem in PROBLEMS if args.adapt is None else (partial(cracks, args.adapt),):
            for point in problem():
                points.append(point)
                print(point, flush=True)
        table = {"date": datetime.now(UTC).date().isoformat(), "mode": "conservative", "points": points}
        args.output.write_text(json.dumps(table, indent=1) + "\n")
    if args.adapt is not None:
        return 0
    promises = []
    for row in checks():
        promises.append(row)
        print(row, flush=True)
    args.report.write_text(json.dumps(promises, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
