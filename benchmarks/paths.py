"""What a path of softening bonds costs: steps, solves, factors and CPU time against the errors of load and work.

`python -m benchmarks.paths` writes paths.json and paths.png. Petersson's notched beam (`geometries/notched_beam.py`),
at 11 spacings over the height in so many steps of a crack through it, and at others with 80 steps. The load's error is
that of its curve against the deflection, the largest over the peak, against 320 steps of the same spacing. That of work
is what work = stored + spent misses at most. CPU time of one thread, on a machine with other work.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdmesh import build, read_scene
from pdpost.figures import style
from pdpost.figures.charts import plain
from pdpost.measures.forces import chosen, reactions
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate
from pdsolve.steppers import old_factors
from pdsolve.steppers.old_factors import Solver

SCENE = Path(__file__).parent.parent / "geometries" / "notched_beam.py"
STEPS, LAYERS, MOST = (10, 20, 40, 80, 160), (7, 15), 320
WIDTH = 0.05  # m


class Row(NamedTuple):
    """What a path cost, and how wrong it is."""

    layers: int
    load_steps: int  # asked for
    steps: int  # taken
    solves: int  # right sides
    factors: int
    seconds: float  # CPU time
    peak: float  # N
    load: float | None  # error of the curve, over the peak
    work: float  # error of the books, over the work


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """Counts factors and right sides while it lasts."""
    count: Counter[str] = Counter()
    makes, solves = old_factors._factors, Solver.solve

    def factors(*given: Any) -> Callable[..., Any]:
        count["factors"] += 1
        return makes(*given)

    def solve(self: Solver, matrix: Any, right: NDArray[np.float64], anew: bool) -> NDArray[np.float64]:
        count["solves"] += right.size // len(right)
        return solves(self, matrix, right, anew)

    old_factors._factors, Solver.solve = factors, solve  # type: ignore[method-assign,assignment]
    try:
        yield count
    finally:
        old_factors._factors, Solver.solve = makes, solves  # type: ignore[method-assign]


def measured(layers: int, load_steps: int) -> tuple[Row, NDArray[np.float64], NDArray[np.float64]]:
    """A path, its deflection, m, and its load, N."""
    built = build(read_scene(SCENE, [("layers", str(layers))], trust=True))
    model = Model(built.grid, built.settings)
    static = msgspec.structs.replace(model.settings.run.static, load_steps=load_steps)
    run = msgspec.structs.replace(model.settings.run, static=static)
    model = Model(built.grid, msgspec.structs.replace(model.settings, run=run))
    begin = time.process_time()
    with counted() as count, simulate(model, None, Options(threads=1)) as results:
        seconds = time.process_time() - begin
        middle, books = chosen(reactions(results), ["middle"])[0], results.history()
    way, load = np.abs(middle.displacement[:, 1]), np.abs(middle.force[:, 1]) * WIDTH
    missed = float(np.abs(books["strain"] + books["dissipated"] - books["work"]).max() / books["work"].max())
    found = Row(layers, load_steps, len(load) - 1, count["solves"], count["factors"], seconds, load.max(), None, missed)
    return found, way, load


def rows() -> Iterator[Row]:
    """All paths; deflections never go back, so that loads are compared at the same ones."""
    _, way, exact = measured(11, MOST)
    for load_steps in STEPS:
        row, there, load = measured(11, load_steps)
        off = np.abs(np.interp(there, way, exact) - load).max() / exact.max()
        yield row._replace(load=float(off))
    for layers in LAYERS:
        yield measured(layers, 80)[0]


def chart(found: list[Row]) -> Figure:
    """Errors against solves; beside each path are its steps, factors and CPU time."""
    figure = Figure(figsize=(7.0, 5.2), layout="constrained")
    same = [row for row in found if row.load is not None]
    for axes, name, said in zip(figure.subplots(2, 1), ("load", "work"), ("load, over the peak", "work"), strict=True):
        axes.semilogy([row.solves for row in same], [getattr(row, name) for row in same], "o", ms=5)
        for row in same:
            text = f"{row.load_steps} steps: {row.factors} factors, {row.seconds:.1f} s"
            off, side = ((-7, -2), "right") if row in (same[1], same[3]) else ((7, -2), "left")
            at = row.solves, getattr(row, name)
            axes.annotate(text, at, off, textcoords="offset points", ha=side, fontsize=8)
        axes.set(xlabel="solves", ylabel=f"error of {said}", xlim=(150, 460))
        plain(axes)
    return figure


def main() -> None:
    """Measure, write the numbers and the chart, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "paths.json")
    output = parser.parse_args().output
    found = []
    for row in rows():
        found.append(row)
        off = "" if row.load is None else f"{row.load:.1%}"
        cells = (f"{row.seconds:.1f}", f"{row.peak:.0f}", off, f"{row.work:.1e}")
        print("|", " | ".join(map(str, (*row[:5], *cells))), "|", flush=True)
    output.write_text(json.dumps([row._asdict() for row in found], indent=1) + "\n", encoding="utf-8")
    style.save(chart(found), output.with_suffix(".png"))


if __name__ == "__main__":
    main()
