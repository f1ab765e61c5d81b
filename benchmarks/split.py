"""Cells that split where energy is, by threshold and by how often it is looked: python -m benchmarks.split.

The Duran plate of the thesis from 1020 nodes 2 mm apart, whose cells split once, beside uniform runs of 2 and of 1 mm:
when the crack starts, when and where it branches, and what the runs cost. A crack that branches is known no better than
runs that differ by the time step alone differ from each other, so all are medians of several, with their range. Draws
the chart, the nodes of one run at several times, in the manner of the thesis's figures 70 to 75, and writes a table of
docs/verification/adaptivity.md.
"""

from __future__ import annotations

import itertools
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import msgspec
import numpy as np
from matplotlib.axes import Axes

from benchmarks.models import grid_of_nodes, with_run
from benchmarks.pages import DOCS, markdown_table, write_block
from pdmesh.model.document import Horizon, Load, Material, Run, Settings, Split
from pdpost import figures
from pdsolve.model import Model, ModelWarning
from pdsolve.run.simulation import Options, simulate

PAGE = DOCS / "verification" / "adaptivity.md"
GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
COARSE, DURATION, LOOK = 2e-3, 36e-6, 0.25e-6  # m; s; s between two frames
STEPS = (25e-9, 24.5e-9, 24e-9)  # s
MODES = ("conservative", "thesis")
THRESHOLDS, EVERY = (0.15, 0.3, 0.6), (5, 10, 40)
TIMES = (8e-6, 16e-6, 24e-6, 28e-6, 32e-6, 36e-6)  # s: of the pictures
CRACKED, GAP = 0.35, 2 * COARSE  # damage; m between the arms of a crack, of the coarse grid in all runs

NONE = (np.nan, np.nan, np.nan, 0)
SHOWN = {
    "start": "start, us",
    "branch": "branches after, us",
    "place": "at, mm",
    "updates": "bonds times steps, of 1 mm",
}


class Way(NamedTuple):
    """How the plate is solved."""

    spacing: float  # m
    threshold: float | None = None  # None: cells stay
    every: int = 10
    mode: str = "conservative"
    by: str = "energy"
    merge: float = 0.1

    @property
    def name(self) -> str:
        """In words."""
        if self.threshold is None:
            return f"uniform, {1e3 * self.spacing:g} mm"
        what = "largest energy" if self.by == "energy" else "critical stretch"
        return f"split above {self.threshold:g} of the {what}, every {self.every} steps"


class Measured(NamedTuple):
    """What came of one run."""

    start: float  # us; not a number where it did not
    branch: float  # us; likewise
    place: float  # mm
    tip: float  # mm, at 30 us
    updates: float  # bonds times steps
    coarse: int  # broken bonds between two coarse nodes
    refinement: float  # energy that splitting and merging made, over the work
    balance: float


def plate(way: Way, dt: float, **more: object) -> Model:
    """The plate: 102 x 40 mm, notched to its middle, 12 MPa on both edges, carried by 6 mm that do not break."""
    n = round(COARSE / way.spacing)
    y, x = np.mgrid[0 : 20 * n, 0 : 51 * n] + 0.5
    position = way.spacing * np.column_stack([x.ravel(), y.ravel()]) - (COARSE / 2, 20e-3)
    grid = grid_of_nodes(position, way.spacing, [(-COARSE, 0.0, 50e-3, 0.0)])
    pull = 12e6 / 6e-3
    ends = (
        Load(box=(-1.0, 14e-3, 1.0, 1.0), body_force=(0.0, pull), breakable=False),
        Load(box=(-1.0, -1.0, 1.0, -14e-3), body_force=(0.0, -pull), breakable=False),
    )
    every = round(LOOK / dt)
    run = Run(time_step=dt, steps=round(DURATION / dt / every) * every, every=every, fields=("damage",))
    if way.threshold is not None:
        split = Split(threshold=way.threshold, every=way.every, by=way.by, merge=way.merge)  # type: ignore[arg-type]
        run = msgspec.structs.replace(run, adapt="split", split=split)
    settings = Settings(material=GLASS, horizon=Horizon(4.0), conditions=ends, run=run)
    return Model(grid, settings, "duran")


def solved(way: Way, dt: float) -> Measured:
    """One run."""
    with simulate(plate(way, dt), options=Options(way.mode, threads=1)) as results:
        start, branch, tip = np.nan, (np.nan, np.nan), np.nan
        for step in results.frames()[0].tolist():
            time, nodes = 1e6 * step * dt, results.nodes(step)
            ahead = (results.field("damage", step) > CRACKED) & (nodes.position[:, 0] > 50.2e-3)
            x, y = nodes.position[ahead].T
            if np.isnan(start) and x.max(initial=0.0) > 51.4e-3:
                start = time
            if np.isnan(branch[0]):
                place = _branch(x, y)
                branch = branch if place is None else (time, 1e3 * place)
            tip = 1e3 * x.max(initial=0.0) if time <= 30.0 + 1e-6 else tip
        breaks, lives, summary = results.breaks(), results.lives(), results.summary()
        deltas = [lives.nodes.delta[lives.at(end, breaks.step)] for end in (breaks.node, breaks.neighbour)]
        coarse = int(np.count_nonzero(np.min(deltas, axis=0) > 0.75 * COARSE))
        updates = float(results.bond_updates(summary["steps"]))
        refinement = summary.get("split", {}).get("refinement", 0.0) / summary["energy"]["work"]
        return Measured(start, *branch, tip, updates, coarse, refinement, summary["balance"])


def _branch(x: np.ndarray, y: np.ndarray) -> float | None:
    """The first column, m, whose cracked nodes are in two groups."""
    column = np.floor((x + COARSE / 2) / COARSE).astype(int)
    order = np.lexsort((y, column))
    apart = (np.diff(column[order]) == 0) & (np.diff(y[order]) > GAP * (1 + 1e-6))
    return float(COARSE * column[order][1:][apart].min()) if apart.any() else None


def several(way: Way) -> list[Measured]:
    """Runs that differ by the step alone."""
    runs = [solved(way, dt) for dt in STEPS]
    print(way.mode, way.name, *runs, sep="\n  ", file=sys.stderr, flush=True)
    return runs


def median_and_range(runs: list[Measured], what: str) -> tuple[float, float, float, int]:
    """Median, least and most of those runs in which it happened, and how many they are."""
    values = np.array([getattr(run, what) for run in runs])
    values = values[~np.isnan(values)]
    return (*(float(each) for each in np.quantile(values, [0.5, 0, 1])), len(values)) if len(values) else NONE


def chart(runs: dict[Way, list[Measured]], path: Path) -> None:
    """Each of what is shown against the threshold, a column for each mode."""
    figure, panels = plt.subplots(4, 2, figsize=(9.0, 11.0), layout="constrained", sharex=True, sharey="row")
    for column, mode in zip(panels.T, MODES, strict=True):
        for axes, (what, words) in zip(column, SHOWN.items(), strict=True):
            _panel(axes, runs, mode, what)
            if mode == MODES[0]:
                axes.set_ylabel(words)
        column[0].set_title(f"{mode} mode")
        column[-1].set_xlabel("threshold, of the largest energy density")
    panels[1, 1].legend(fontsize=8)
    figure.suptitle("Duran's plate, cells of 2 mm that split once: runs that differ by the time step, median and range")
    figure.savefig(path, dpi=100)


def _panel(axes: Axes, runs: dict[Way, list[Measured]], mode: str, what: str) -> None:
    """A line for each interval between two looks; uniform runs as bands."""
    fine, coarse = (runs[Way(spacing, mode=mode)] for spacing in (COARSE / 2, COARSE))
    unit = median_and_range(fine, "updates")[0] if what == "updates" else 1.0
    for uniform, colour, label in ((fine, "0.35", "uniform, 1 mm"), (coarse, "0.75", "uniform, 2 mm")):
        median, least, most = (value / unit for value in median_and_range(uniform, what)[:3])
        axes.axhspan(least, most, color=colour, alpha=0.4, linewidth=0)
        axes.axhline(median, color=colour, label=label)
    for number, every in enumerate(EVERY):
        ranges = [median_and_range(runs[Way(COARSE, threshold, every, mode)], what) for threshold in THRESHOLDS]
        median, least, most, count = np.array(ranges).T
        place = np.array(THRESHOLDS) + 0.012 * (number - 1)
        spread = np.array([median - least, most - median]) / unit
        style = {"marker": "o", "markersize": 4, "capsize": 2, "linewidth": 1, "color": f"C{number}"}
        axes.errorbar(place, median / unit, spread, label=f"every {every} steps", **style)
        for at, happened in zip(place, count, strict=True):
            if happened < len(STEPS):
                where = {"xycoords": ("data", "axes fraction"), "rotation": 90, "ha": "center", "fontsize": 7}
                words = f"{happened:g} of {len(STEPS)}" if happened else "none"
                axes.annotate(words, (at, 0.03), color=f"C{number}", **where)


def table(runs: dict[Way, list[Measured]]) -> str:
    """The table of the page: a row for each way."""
    header = ["mode", "run", "start, us", "branches after, us", "at, mm", "tip at 30 us, mm"]
    header += ["bonds times steps, of 1 mm", "coarse bonds broken", "made by splitting, % of the work", "balance, %"]
    rows = []
    for way, of_way in runs.items():
        share = median_and_range(of_way, "updates")[0]
        share /= median_and_range(runs[Way(COARSE / 2, mode=way.mode)], "updates")[0]
        cells = [_words(median_and_range(of_way, what)) for what in ("start", "branch", "place", "tip")]
        refinement, balance = (100 * median_and_range(of_way, what)[0] for what in ("refinement", "balance"))
        coarse = max(run.coarse for run in of_way) if way.threshold is not None else "-"
        rows.append([way.mode, way.name, *cells, f"{share:.2f}", coarse, f"{refinement:+.2f}", f"{balance:+.3f}"])
    return markdown_table(header, rows)


def _words(values: tuple[float, float, float, int]) -> str:
    median, least, most, count = values
    if not count:
        return "none"
    return f"{median:.4g} ({least:.4g} to {most:.4g})" + (f", {count} of {len(STEPS)}" if count < len(STEPS) else "")


def pictures(folder: Path) -> list[Path]:
    """The nodes of one run at several times."""
    folder.mkdir(parents=True, exist_ok=True)
    model = with_run(plate(Way(COARSE, 0.3), STEPS[0]), fields=("ux", "uy", "damage"))
    paths = [folder / f"nodes_{1e6 * time:.0f}.png" for time in TIMES]
    with simulate(model, options=Options(threads=1)) as results:
        for time, path in zip(TIMES, paths, strict=True):
            figures.save(figures.nodes(results, round(time / STEPS[0])), path)
    return paths


def ways(mode: str) -> Iterator[Way]:
    """All that are compared in a mode."""
    yield from (Way(COARSE, mode=mode), Way(COARSE / 2, mode=mode))
    yield from (Way(COARSE, *each, mode) for each in itertools.product(THRESHOLDS, EVERY))
    yield Way(COARSE, 0.9, mode=mode, by="stretch")


def main() -> int:
    """Measure, draw, write."""
    warnings.simplefilter("ignore", ModelWarning)
    runs = {way: several(way) for mode in MODES for way in ways(mode)}
    chart(runs, PAGE.with_name("split.png"))
    drawn = pictures(PAGE.with_name("split"))
    links = [f"[{1e6 * time:.0f} us](split/{path.name})" for time, path in zip(TIMES, drawn, strict=True)]
    after = f"Nodes of a run above 0.3, every 10 steps, as in the thesis's figures 70 to 75: {', '.join(links)}."
    write_block(PAGE, "split", f"{table(runs)}\n{after}")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
