"""What rest costs: relaxation, Newton's method and slow loading in time, on a plate with a hole and a slow crack.

`python -m benchmarks.rest` writes rest.json and rest.png. (a) A plate with a hole in tension, its displacements against
those at rest to 1e-11, as results keep them, in single precision; in time, the load grows over so many transits of a P
wave, and motion is free or damped at the slowest mode's rate. (b) The compact tension specimen to beyond its largest
load, that load against Newton's in load steps half as long; in time, the pins move apart at so many m/s.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy import machine
from pdmesh import Circle, Material, Run, Scene, Static, box, ramp, read_scene
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Condition
from pdmesh.model.material_constants import pressure_speed
from pdpost.figures.tradeoff_figure import draw
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

GLASS = Material(E=65e9, rho=2235, G0=1e9)  # it never breaks
SIDE, RADIUS, SPACING = 0.08, 0.01, 1.25e-3  # m, of (a)
OPENING, LOAD_STEPS = 3.75e-4, 15  # m and of that, of (b)
QUIET = 2e4  # 1/s, the damping of (b)


class Row(NamedTuple):
    """What a way cost, and how wrong it is."""

    problem: str
    way: str
    wall: float  # s
    iterations: int  # or steps in time
    error: float


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.rest", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("rest.json"))
    args = parser.parse_args(arguments)
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for problem in (hole, compact):
            for row in problem():
                rows.append(row)
                print(
                    f"{row.problem}: {row.way}: {row.wall:.3g} s, {row.iterations} steps, {row.error:.2e}", flush=True
                )
    here = machine()
    args.output.write_text(json.dumps({"machine": here, "rows": [row._asdict() for row in rows]}, indent=1) + "\n")
    chart(rows, f"{here['date']}, {here['threads']} threads of {here['processor']}", args.output.with_suffix(".png"))
    return 0


def solved(model: Model, run: Run) -> Results:
    """The results of a model in this run."""
    return simulate(dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run)), None)


def row_of(problem: str, way: str, results: Results, error: float) -> Row:
    """The row of a run."""
    summary = results.summary()
    taken = sum(step["iterations"] for step in summary.get("load_steps", ())) or summary["steps"]
    return Row(problem, way, summary["wall_time"], taken, error)


def hole() -> Iterator[Row]:
    """A square plate with a hole, held on its left and pulled on its right."""
    half, quarter = SIDE / 2, SPACING / 4
    scene = (
        Scene(box(-half, -half, half, half), SPACING, GLASS, 4)
        .hole(Circle(0, 0, RADIUS))
        .fix("left", x=0, y=None)
        .fix(box(-half - quarter, -quarter, -half + quarter, quarter), x=None, y=0, name="middle")
        .load("right", traction=(1e3, 0))
    )
    grid, settings, _ = build_grid(scene)
    model = Model(grid, settings)

    def displacement(results: Results) -> NDArray[np.float64]:
        step = int(results.frames()[0][-1])
        return np.concatenate([results.field(name, step).astype(float) for name in ("ux", "uy")])

    with solved(model, static(tolerance=1e-11)) as results:
        exact = displacement(results)

    def error(results: Results) -> float:
        return float(np.linalg.norm(displacement(results) - exact) / np.linalg.norm(exact))

    for tolerance in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
        for method in ("relaxation", "newton"):
            with solved(model, static(method=method, tolerance=tolerance)) as results:
                yield row_of("hole in tension", f"{method} to {tolerance:g}", results, error(results))
    transit, slowest = SIDE / pressure_speed(GLASS), float(2 * np.pi * np.sqrt(GLASS.E / GLASS.rho) / (4 * SIDE))
    for transits in (10, 30, 100, 300, 1000):
        for damping in (0.0, 2 * slowest):
            load = settings.conditions[-1]
            assert isinstance(load, Condition)
            loaded = msgspec.structs.replace(load, profile=ramp(transits * transit))
            slow = dataclasses.replace(
                model, settings=msgspec.structs.replace(settings, conditions=(*settings.conditions[:-1], loaded))
            )
            run = in_time(slow, transits * transit, damping)
            with solved(slow, run) as results:
                damped = ", damped" if damping else ""
                yield row_of("hole in tension", f"in {transits} transits{damped}", results, error(results))


def compact() -> Iterator[Row]:
    """The compact tension specimen that ships."""
    scene = read_scene(Path(__file__).parent.parent / "geometries" / "compact_tension.py", [], [], True)
    grid, settings, _ = build_grid(scene)

    def pulled(speed: float | None) -> Model:
        seconds = 1.0 if speed is None else OPENING / speed
        conditions = tuple(
            msgspec.structs.replace(one, y=float(np.sign(one.y)) * OPENING / 2, profile=ramp(seconds))  # type: ignore[union-attr]
            for one in settings.conditions
        )
        return Model(grid, msgspec.structs.replace(settings, conditions=conditions))

    def largest(results: Results) -> float:
        table = results.reactions()
        return float(table[table["condition"] == 0]["force_y"].max())

    with solved(pulled(None), static(load_steps=2 * LOAD_STEPS)) as results:
        exact = largest(results)
    for method, tolerance in (("newton", 1e-8), ("newton", 1e-5), ("relaxation", 1e-5)):
        with solved(pulled(None), static(method=method, tolerance=tolerance, load_steps=LOAD_STEPS)) as results:
            off = abs(largest(results) / exact - 1)
            yield row_of("slow crack", f"{method} to {tolerance:g} in {LOAD_STEPS}", results, off)
    for speed in (3.0, 1.0, 0.3, 0.1):
        for damping in (0.0, QUIET):
            model = pulled(speed)
            with solved(model, in_time(model, OPENING / speed, damping)) as results:
                damped = ", damped" if damping else ""
                yield row_of("slow crack", f"{speed:g} m/s{damped}", results, abs(largest(results) / exact - 1))


def static(**settings: object) -> Run:
    """A run at rest."""
    return Run(solver="static", static=Static(**settings))  # type: ignore[arg-type]


def in_time(model: Model, seconds: float, damping: float) -> Run:
    """A run in time, of some hundred entries in the ledger."""
    from pdsolve.run.estimate import estimate_run

    step = estimate_run(model, Options()).stable_time_step
    steps = int(np.ceil(seconds / step))
    return Run(time_step=step, steps=steps, every=steps, ledger=max(1, steps // 300), damping=damping)


def chart(rows: list[Row], said: str, path: Path) -> None:
    """Time against the error, a panel for each problem."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row.problem for row in rows))
    what: dict[str, str] = {"hole in tension": "displacement", "slow crack": "the largest load"}
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    for panel, name in zip(figure.subplots(1, len(names)), names, strict=True):
        mine = [row for row in rows if row.problem == name]
        wall, error = (np.array([getattr(row, field) for row in mine]) for field in ("wall", "error"))
        draw(panel, wall, error, [row.way for row in mine])
        panel.set(xlabel="wall time, s", ylabel=f"error of {what[name]}", title=name)
    figure.suptitle(said, fontsize=8)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
