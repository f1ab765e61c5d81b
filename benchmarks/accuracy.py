"""What accuracy costs: five problems, each solved in many ways; cost against error, on one chart.

`python -m benchmarks.accuracy` writes accuracy.json and accuracy.png; benchmarks/README.md says how each number is
made. (a) A plate with a hole in tension, against the classical solution; (b) a pulse through a change of spacing,
against the pulse; and those of `cracked.py`, of which cracks run. A problem that is not measured anew keeps what the
file has.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.cracked import PLATES, Row, Stopped, cracks
from benchmarks.variants import BASE, OTHER_GRIDS, STATE_BASED, VARIANTS, Variant
from pdmesh import VERSION, Circle, Scene, box
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Material, Run, Settings
from pdmesh.model.node_grid import Grid
from pdpost.figures.tradeoff_figure import draw
from pdpost.measures import tradeoff
from pdsolve.model import Model
from pdsolve.run.system import Prepared

sys.path.append(str(Path(__file__).parent.parent / "tests"))
sys.path.append(str(Path(__file__).parent.parent / "tests" / "verification"))

SAMPLE = 0.2  # s of marching that stand for a run of (a) and (b)
TRANSITS = 10  # of a wave across the plate of (a): what a slow load would take
HALF, RADIUS, FINE_ZONE = 4.0, 1.0, 2.0  # of (a), m
WIDTH = 8e-3  # of the pulse of (b), m


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.accuracy", description=__doc__)
    parser.add_argument("--problems", default=",".join(PROBLEMS), help="some of " + ", ".join(PROBLEMS))
    parser.add_argument("-o", "--output", type=Path, default=Path("accuracy.json"))
    args = parser.parse_args(arguments)
    rows, stopped = before(args.output)
    for name in args.problems.split(","):
        found: list[Row | Stopped] = []
        for one in PROBLEMS[name]():
            found.append(one)
            print(told(one), flush=True)
        rows = [row for row in rows if row.problem != found[0].problem]
        stopped = [row for row in stopped if row.problem != found[0].problem]
        rows += [one for one in found if isinstance(one, Row)]
        stopped += [one for one in found if isinstance(one, Stopped)]
        written(rows, stopped, args.output)
    return 0


def told(one: Row | Stopped) -> str:
    """A line about a variant."""
    if isinstance(one, Stopped):
        return f"{one.problem}: {one.variant}: {one.said}"
    errors = ", ".join(f"{what} {value:.3g}" for what, value in one.errors.items())
    return f"{one.problem}: {one.variant}: {one.updates:.3g} bond updates, {one.wall:.3g} s; {errors}"


def before(path: Path) -> tuple[list[Row], list[Stopped]]:
    """What was measured before: problems that are not measured anew keep it."""
    if not path.exists():
        return [], []
    found = json.loads(path.read_text())
    return [Row(**row) for row in found["rows"]], [Stopped(**row) for row in found.get("stopped", [])]


def written(rows: list[Row], stopped: list[Stopped], path: Path) -> None:
    """Write the file and the chart."""
    here = machine()
    result = {
        "machine": here,
        "rows": [row._asdict() for row in rows],
        "stopped": [row._asdict() for row in stopped],
        "front": fronts(rows),
        "front on the two-scale grid": fronts([row for row in rows if row.variant not in OTHER_GRIDS]),
    }
    path.write_text(json.dumps(result, indent=1) + "\n")
    chart(rows, here, path.with_suffix(".png"))


def machine() -> dict[str, Any]:
    """What this was measured on."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "threads": numba.get_num_threads(),
        "python": platform.python_version(),
        "numba": numba.__version__,
        "numpy": np.__version__,
        "pdsuite": VERSION,
    }


def fronts(rows: list[Row]) -> dict[str, list[str]]:
    """The variants of each problem that none beats in both cost and error, cheapest first."""
    found = {}
    for problem in dict.fromkeys(row.problem for row in rows):
        mine = [row for row in rows if row.problem == problem]
        best = tradeoff.front(np.array([row.updates for row in mine]), np.array([row.error for row in mine]))
        found[problem] = [mine[at].variant for at in best]
    return found


def marched(problem: Prepared, steps: int) -> float:
    """Seconds that so many steps take, by some of them."""
    problem.march(1, 3)
    began, taken = time.perf_counter(), 0
    while time.perf_counter() - began < SAMPLE:
        problem.march(3 + taken, 13 + taken)
        taken += 10
    return (time.perf_counter() - began) / taken * steps


# (a) A plate with a hole


def kirsch(name: str, variants: tuple[Variant, ...], nu: float | None = None) -> Iterator[Row]:
    """Displacements of the classical solution held at the edge, equilibrium inside."""
    from kirsch import classical
    from systems import equilibrium

    unit = Material(E=1.0, rho=1.0, G0=1.0, nu=nu)
    for variant in variants:
        spacing = variant.fine / 8
        scene = Scene(box(-HALF, -HALF, HALF, HALF), variant.ratio * spacing, unit, variant.m)
        scene = scene.hole(Circle(0.0, 0.0, RADIUS))
        if variant.ratio > 1:
            scene = scene.zone(box(-FINE_ZONE, -FINE_ZONE, FINE_ZONE, FINE_ZONE), spacing, grown=False)
        grid, settings, _ = build_grid(scene)
        problem = variant.prepared(Model(grid, settings))
        exact = classical(grid.position, 1 / 3 if nu is None else nu, "stress")
        layer = (variant.m + 0.5) * grid.delta
        outer = np.abs(grid.position).max(axis=1) > HALF - layer
        found = equilibrium(problem, np.column_stack([outer, outer]), exact)
        inside = np.abs(grid.position).max(axis=1) < FINE_ZONE
        error = relative(found[inside], exact[inside], problem.system.area[inside])
        edge = np.hypot(*grid.position.T) < RADIUS + grid.delta
        largest = float(np.hypot(*found[edge].T).max() / np.hypot(*exact[edge].T).max() - 1)
        steps = round(TRANSITS * 2 * HALF / np.sqrt(1.125) / problem.system.time_step)
        errors = {"displacement": error, "at the hole": abs(largest)}
        yield row_of(name, variant, problem, steps, marched(problem, steps), error, errors)


def relative(found: NDArray[np.float64], exact: NDArray[np.float64], area: NDArray[np.float64]) -> float:
    """L2 norm of the error over that of the solution."""
    return float(np.sqrt(np.sum(area[:, None] * (found - exact) ** 2) / np.sum(area[:, None] * exact**2)))


def row_of(
    name: str, variant: Variant, problem: Prepared, steps: int, wall: float, error: float, errors: dict[str, float]
) -> Row:
    """The row of a variant that takes so many steps."""
    nodes = len(problem.system.model.grid)
    updates = float(problem.system.bonds) * steps
    return Row(name, variant.name, nodes, problem.system.bonds, updates, wall, error, errors, error, error)


# (b) A pulse through a change of spacing


def strip(delta: float, ratio: int, m: float, length: float) -> tuple[Grid, float]:
    """Nodes `delta` apart left of x = 0 and `ratio` times as far to its right, and the height of their period, m."""
    rows = 2 * int(np.ceil(m + 1)) + 2
    wide = ratio * delta
    columns, coarse_columns = round(length / delta), round(length / wide)
    y, x = np.mgrid[0 : ratio * rows, 0:columns]
    fine = delta * np.column_stack([x.ravel() - columns + 1.0, y.ravel()])
    y, x = np.mgrid[0:rows, 0:coarse_columns]
    coarse = wide * np.column_stack([x.ravel(), y.ravel()]) + [delta * (1 + ratio) / 2, delta * (ratio - 1) / 2]
    nodes = len(fine) + len(coarse)
    grid = Grid(
        ids=np.arange(1, nodes + 1),
        position=np.concatenate([fine, coarse]),
        delta=np.concatenate([np.full(len(fine), delta), np.full(len(coarse), wide)]),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.empty((0, 4)),
    )
    return grid, wide


def pulse() -> Iterator[Row]:
    """A P pulse from far left of x = 0 to as far right of it, in a strip that repeats itself upwards."""
    from periodic import joined
    from plates import GLASS
    from systems import accelerate

    speed = float(np.sqrt(1.125 * GLASS.E / GLASS.rho))
    way = 6 * WIDTH
    for variant in VARIANTS:
        grid, period = strip(variant.fine * 1e-3, variant.ratio, variant.m, 2.2 * way)
        settings = Settings(material=GLASS, run=Run(time_step=1e-9, steps=1))
        y0 = period * int(np.ceil(variant.m + 1))
        whole = variant.prepared(Model(grid, settings))
        time_step = whole.system.time_step
        problem = joined(whole, (-np.inf, y0, np.inf, y0 + period))
        x, state = problem.system.model.grid.position[:, 0], problem.state
        s = (x + way) / WIDTH
        state.value[:, 0] = 1e-6 * np.exp(-(s**2))
        state.rate[:, 0] = 1e-6 * speed * 2 * s / WIDTH * np.exp(-(s**2))
        accelerate(problem)
        sent = float(np.abs(state.rate).max())
        steps = round(2 * way / speed / time_step)
        share = 2e-3 / period  # of the strip, so that all are of one height
        problem.march(1, steps + 1)
        s = (x + way - speed * steps * time_step) / WIDTH
        exact = np.column_stack([1e-6 * speed * 2 * s / WIDTH * np.exp(-(s**2)), np.zeros(len(x))])
        errors = {
            "velocity": relative(state.rate.astype(float), exact, problem.system.area),
            "sent back": float(np.abs(state.rate[x < -way / 3, 0]).max()) / sent,
        }
        row = row_of("pulse", variant, problem, steps, marched(whole, steps), errors["sent back"], errors)
        yield row._replace(
            updates=share * row.updates, wall=row.wall * share * problem.system.bonds / whole.system.bonds
        )


PROBLEMS: dict[str, Callable[[], Iterator[Row | Stopped]]] = {
    "kirsch": lambda: kirsch("hole in tension", VARIANTS),
    "kirsch 0.3": lambda: kirsch("hole in tension, nu = 0.3", STATE_BASED, 0.3),
    "pulse": pulse,
    **{name: partial(cracks, plate) for name, plate in PLATES.items()},
}
WHAT = {
    "hole in tension": "displacement",
    "hole in tension, nu = 0.3": "displacement",
    "pulse": "velocity sent back",
    "Kalthoff-Winkler": "the path",
    "Kalthoff-Winkler, steel": "the path",
    "Duran plate": "the time of branching",
}


def chart(rows: list[Row], machine: dict[str, Any], path: Path) -> None:
    """Bond updates against the error of each problem, the defaults in red, the range of several runs in grey."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row.problem for row in rows))
    figure = Figure(figsize=(11, 4.4 * -(-len(names) // 2)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(-(-len(names) // 2), min(len(names), 2), squeeze=False)).ravel()
    for panel, name in zip(panels, names, strict=False):
        mine = [row for row in rows if row.problem == name]
        cost, error = np.array([row.updates for row in mine]), np.array([row.error for row in mine])
        draw(panel, cost, error, [row.variant for row in mine])
        panel.vlines(
            cost, [row.least for row in mine], [min(row.most, 1.0) for row in mine], color="0.8", lw=1, zorder=0
        )
        usual = [row for row in mine if row.variant == BASE.name]
        panel.plot(
            [row.updates for row in usual], [row.error for row in usual], "o", ms=11, mfc="none", mec="#D55E00", mew=1.5
        )
        panel.set(xlabel="bond updates", ylabel=f"error of {WHAT[name]}", title=name)
    figure.suptitle(f"{machine['date']}, {machine['threads']} threads of {machine['processor']}", fontsize=8)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
