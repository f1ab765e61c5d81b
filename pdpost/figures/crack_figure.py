"""The crack of a run as a figure: its path over the plate, its length and its speed; or the paths of two runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import scaled, scaled_times
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Shape, Sheet, box_of, mark, on_axes, paint, shape
from pdpost.figures.style import narrow
from pdsolve.measures import crack_summary
from pdsolve.measures.crack_summary import CrackPathSummary
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.frame_steps import moment_text
from pdsolve.measures.paths import LONG, Polyline
from pdsolve.measures.speed import WINDOW
from pdsolve.measures.tips import CrackBranch
from pdsolve.results import Results

Numbered: TypeAlias = tuple[int, CrackBranch]  # a branch with its number, which is its colour, as in pictures of `sif`
Chart: TypeAlias = Callable[[list[Numbered], Axes, CrackPathSummary], None]

SHOWN = 6  # main branches with a curve of their own
SLOW = 0.25  # of the Rayleigh speed: slower cracks have an axis of their own
SHORT = "0.25"  # colour of branches without a curve of their own
PALE, DARK = 0.06, 0.66  # greys of what is whole and of what is broken


def crack(results: Results, summary: CrackPathSummary | None = None, window: Box | None = None) -> Figure:
    """Path, length over time and speed over time of the cracks in a summary; long branches have colours.

    `summary` is by default that of the whole run; `window` is the part of the plate in view, m. Raises
    ResultsError if there is no frame yet.
    """
    summary = crack_summary.crack(results) if summary is None else summary
    where = shape(results, summary.step, 0.0)
    box = window or box_of([where])
    charts: list[Chart] = []  # beside the plate: none if no crack grows, and no speed for a run at rest
    if summary.branches:
        knows_release = summary.cycles is None and np.isfinite(summary.energy_release.release_rate).any()
        released = [_released] if knows_release else []
        charts = [_lengths, *([] if summary.is_quasi_static else [_speeds]), *released]
    figure, plate, places = _panels(box, len(charts))
    on = on_grey_plate(plate, box, where, damage_without_pre_cracks_at(results, summary.step))
    when = moment_text(summary.step * summary.time_step, summary.counts_load_steps, micro="µs")
    if not summary.branches:
        plate.set_title(f"No crack has grown at {when}", fontsize="medium")
        return figure
    long = [branch for branch in summary.branches if branch.length >= LONG * summary.branches[0].length][:SHOWN]
    for branch in summary.branches[len(long) :]:
        _path(on, branch, color=SHORT, lw=1.0)
    shown = sorted(enumerate(long), key=lambda one: (one[1].length_along_crack[0], one[1].passing_time[-1]))
    for number, branch in shown:
        _path(on, branch, lw=1.5, **look(number))
    names = [f"branch {number}" for number in range(len(long))] if len(long) > 1 else ["path of the crack"]
    keys = [Line2D([], [], lw=1.5, label=name, **look(number)) for number, name in enumerate(names)]
    if len(summary.branches) > len(long):
        keys.append(Line2D([], [], color=SHORT, lw=1.0, label="short branches"))
    if summary.forks:
        forks = on.factor * np.array([fork.place for fork in summary.forks]).T
        circle: dict[str, Any] = {"ls": "", "marker": "o", "ms": 4.5, "mfc": "white", "mec": "black", "mew": 0.8}
        plate.plot(*forks, zorder=6, **circle)
        keys.append(Line2D([], [], label="fork", **circle))
    if not all(branch.is_narrow.all() for branch in summary.branches):
        keys.append(Line2D([], [], ls=":", color=SHORT, lw=1.0, label="wider than a crack"))
    drawn, _ = plate.get_legend_handles_labels()  # pre-cracks
    columns = 2 if narrow() else 4
    figure.legend(handles=[*drawn, *keys], loc="outside lower center", ncols=columns, frameon=False, fontsize="small")
    for draw, axes in zip(charts, places, strict=True):
        draw(shown, axes, summary)
        axes.set_xlim(places[0].get_xlim())
    plate.set_title(f"Damage and path of the crack at {when}", fontsize="medium")
    return figure


def comparison(
    first_run: Results,
    step: int,
    paths: tuple[list[Polyline], list[Polyline]],
    names: tuple[str, str],
    title: str,
    window: Box | None = None,
) -> Figure:
    """Two sets of paths over the plate of the first run, grey by its damage after `step`; `window` is in view, m."""
    where = shape(first_run, step, 0.0)
    box = window or box_of([where])
    height = float(np.clip(0.9 * WIDTH * _aspect(box), 2.0, 9.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    plate = figure.add_subplot()
    on = on_grey_plate(plate, box, where, damage_without_pre_cracks_at(first_run, step))
    for number, (lines, name) in enumerate(zip(paths, names, strict=True)):
        style = look(number) | {"lw": (2.2, 1.3)[number], "ls": ("-", (0, (4, 2)))[number]}
        for line in lines:
            plate.plot(*line.T * on.factor, label=for_legend(name) if line is lines[0] else None, zorder=5, **style)
    plate.set_title(title, fontsize="medium")
    if any(paths):
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _aspect(box: Box) -> float:
    return (box[3] - box[1]) / (box[2] - box[0])


def _panels(box: Box, count: int) -> tuple[Figure, Axes, list[Axes]]:
    """A figure with the plate and `count` charts: below a wide plate, to the right of a high one."""
    aspect = _aspect(box)
    if aspect <= 0.8 or not count:
        height = float(np.clip(0.85 * WIDTH * aspect, 0.17 * WIDTH, 6.5))
        if narrow() and count > 1:
            figure = Figure(figsize=(WIDTH, height + 0.5 + 3.2 * count), layout="constrained")
            grid = figure.add_gridspec(1 + count, 1, height_ratios=(height, *[2.9] * count))
            return figure, figure.add_subplot(grid[0]), [figure.add_subplot(grid[1 + at]) for at in range(count)]
        figure = Figure(figsize=(WIDTH, height + (2.9 if count else 0.6)), layout="constrained")
        grid = figure.add_gridspec(1 + bool(count), max(count, 1), height_ratios=(height, 2.4)[: 1 + bool(count)])
        return figure, figure.add_subplot(grid[0, :]), [figure.add_subplot(grid[1, at]) for at in range(count)]
    height = float(np.clip(2.9 * aspect, 2.1 * max(count, 2), 6.5))
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    grid = figure.add_gridspec(count, 2, width_ratios=(min(height / aspect, 3.6), 3.2))
    return figure, figure.add_subplot(grid[:, 0]), [figure.add_subplot(grid[at, 1]) for at in range(count)]


def on_grey_plate(axes: Axes, box: Box, where: Shape, damage: NDArray[np.float64]) -> Sheet:
    """Draw the plate in light grey, darker where it is damaged."""
    on = on_axes(axes, box)
    for artist in paint(on, where, PALE + (DARK - PALE) * damage, ScalarMappable(Normalize(0, 1), "Greys")):
        artist.set_rasterized(True)
    mark(on, where)
    return on


def _path(on: Sheet, branch: CrackBranch, **style: Any) -> None:
    """Draw a branch, dotted where the cracked region is too wide to be a line."""
    pieces = on.factor * np.stack([branch.points[:-1], branch.points[1:]], axis=1)
    line = branch.is_narrow[:-1] & branch.is_narrow[1:]
    for mask, more in ((line, {}), (~line, {"ls": ":"})):
        way = LineCollection(list(pieces[mask]), zorder=5, capstyle="round", **(style | more))
        on.axes.add_collection(way, autolim=False)


def _lengths(shown: list[Numbered], length: Axes, summary: CrackPathSummary) -> None:
    """Draw the length of the cracks over time."""
    second, when = scaled_times((branch.passing_time for _, branch in shown), summary.counts_load_steps)
    metre, metres = scaled((branch.length_along_crack for _, branch in shown), "m")
    for drawn_before, (number, branch) in enumerate(shown):
        length.plot(branch.passing_time * second, branch.length_along_crack * metre, **_style(number, drawn_before))
    length.set(ylabel=f"length, {metres}", xlabel=when)
    length.set_ylim(bottom=0)
    plain(length)


def _style(number: int, drawn_before: int) -> dict[str, Any]:
    style = look(number) | {"lw": 1.5}
    if drawn_before:  # of curves that lie on each other all are seen, in turns
        style["ls"] = (4 * (drawn_before - 1), (4, 4))
    return style


def _speeds(shown: list[Numbered], speed: Axes, summary: CrackPathSummary) -> None:
    """Draw speed over time with its confidence band."""
    limit = summary.limiting_speed
    second, when = scaled_times((branch.passing_time for _, branch in shown), summary.counts_load_steps)
    fastest = max(float(np.nanmax(branch.speed.high, initial=0.0)) for _, branch in shown)
    slow = 0 < fastest < SLOW * limit
    fast, unit = scaled([np.array([fastest if slow else limit])], "m/s")
    for drawn_before, (number, branch) in enumerate(shown):
        style = _style(number, drawn_before)
        sides = branch.speed.low * fast, branch.speed.high * fast
        speed.fill_between(branch.passing_time * second, *sides, color=style["color"], alpha=0.18, lw=0)
        speed.plot(branch.passing_time * second, branch.speed.value * fast, **style)
    if not fastest:
        speed.text(0.5, 0.5, "none: cracks too wide\nor too short", ha="center", transform=speed.transAxes)
    if slow:
        speed.text(
            1, 1, f"{summary.limiting_speed_name}: {limit:.0f} m/s", transform=speed.transAxes,
            ha="right", va="top", fontsize="small",
        )  # fmt: skip
    else:
        speed.axhline(limit * fast, color="black", ls="--", lw=0.9)
        speed.annotate(
            summary.limiting_speed_name, (1, limit * fast), (0, 2), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right", va="bottom", fontsize="small",
        )  # fmt: skip
    speed.set_ylim(0, 1.15 * fast * (fastest if slow else limit))
    speed.set_title(f"over {WINDOW:g} spacings, with its band", fontsize="small")
    speed.set(xlabel=when, ylabel=f"tip speed, {unit}")
    plain(speed)


def _released(shown: list[Numbered], energy: Axes, summary: CrackPathSummary) -> None:
    """Draw the energy dissipated per area of all cracks, beside G0."""
    spent = summary.energy_release
    second, when = scaled_times((branch.passing_time for _, branch in shown), summary.counts_load_steps)
    joule, unit = scaled([spent.release_rate, np.array([spent.G0])], "J/m²")
    energy.plot(spent.time * second, spent.release_rate * joule, color="black", lw=1.3)
    energy.axhline(spent.G0 * joule, color="black", ls="--", lw=0.9)
    energy.annotate(
        "G₀", (1, spent.G0 * joule), (0, 2), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", va="bottom", fontsize="small",
    )  # fmt: skip
    energy.set_ylim(bottom=0)
    energy.set_title("dissipated, over 10 spacings", fontsize="small")
    energy.set(xlabel=when, ylabel=f"energy / crack area, {unit}")
    plain(energy)
