"""The crack of a run as a figure: its path over the plate, its length and its speed; two cracks over each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.labels import scaled
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Shape, Sheet, box_of, mark, on_axes, paint, shape
from pdpost.measures import crack_summary
from pdpost.measures.crack_summary import Summary
from pdpost.measures.cracked import damage_at
from pdpost.measures.paths import LONG, Polyline
from pdpost.measures.speed import WINDOW
from pdpost.measures.tips import Branch
from pdpost.reading.times import told
from pdsolve.results import Results

SHOWN = 6  # main branches with a curve of their own
PALE, DARK = 0.06, 0.66  # greys of what is whole and of what is broken


def crack(results: Results, found: Summary | None = None, window: Box | None = None) -> Figure:
    """Path, length over time and speed over time of the cracks in a summary; long branches in colours.

    `found` is by default that of the whole run; of the plate, `window` is seen, m. Raises ResultsError if there is no
    frame yet.
    """
    found = crack_summary.crack(results) if found is None else found
    where = shape(results, found.step, 0.0)
    box = window or box_of([where])
    figure, plate, length, speed = _panels(box)
    on = on_grey_plate(plate, box, where, damage_at(results, found.step))
    when = told(found.step * found.time_step, micro="µs")
    if not found.branches:
        length.remove()
        speed.remove()
        plate.set_title(f"No crack has grown at {when}", fontsize="medium")
        return figure
    shown = [one for one in found.branches if one.length >= LONG * found.branches[0].length][:SHOWN]
    for one in found.branches[len(shown) :]:
        _path(on, one, color="0.25", lw=1.0)
    shown.sort(key=lambda one: (one.along[0], one.time[-1]))
    for number, one in enumerate(shown):
        _path(on, one, lw=1.5, **look(number))
    if found.forks:
        places = on.factor * np.array([fork.place for fork in found.forks]).T
        plate.plot(*places, "o", ms=4.5, mfc="white", mec="black", mew=0.8, zorder=6)
    if not all(one.line.all() for one in found.branches):
        plate.plot([], [], ":", color="0.25", lw=1.0, label="wider than a crack")
        plate.legend(loc="best", frameon=True, fontsize="small")
    _lengths(shown, length)
    if found.at_rest:
        _give_way(speed, length)
    else:
        _speeds(shown, speed, found.rayleigh_speed)
        speed.set_xlim(length.get_xlim())
    plate.set_title(f"Damage and path of the crack at {when}", fontsize="medium")
    return figure


def comparison(
    one: Results,
    step: int,
    paths: tuple[list[Polyline], list[Polyline]],
    names: tuple[str, str],
    title: str,
    window: Box | None = None,
) -> Figure:
    """Two sets of paths over the plate of the first, grey with its damage after `step`; `window` is seen, m."""
    where = shape(one, step, 0.0)
    box = window or box_of([where])
    height = float(np.clip(0.9 * WIDTH * _aspect(box), 2.0, 9.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    plate = figure.add_subplot()
    on = on_grey_plate(plate, box, where, damage_at(one, step))
    for number, (lines, name) in enumerate(zip(paths, names, strict=True)):
        style = look(number) | {"lw": (2.2, 1.3)[number], "ls": ("-", (0, (4, 2)))[number]}
        for line in lines:
            plate.plot(*line.T * on.factor, label=name if line is lines[0] else None, zorder=5, **style)
    plate.set_title(title, fontsize="medium")
    if any(paths):
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _aspect(box: Box) -> float:
    return (box[3] - box[1]) / (box[2] - box[0])


def _panels(box: Box) -> tuple[Figure, Axes, Axes, Axes]:
    """A plate, and two charts: below a wide plate, to the right of a high one."""
    aspect = _aspect(box)
    if aspect <= 0.8:
        height = 0.85 * WIDTH * max(aspect, 0.2)
        figure = Figure(figsize=(WIDTH, height + 2.9), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(height, 2.4))
        plate, length, speed = (figure.add_subplot(place) for place in (grid[0, :], grid[1, 0], grid[1, 1]))
    else:
        height = float(np.clip(2.9 * aspect, 4.2, 6.5))
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(min(height / aspect, 3.6), 3.2))
        plate, length, speed = (figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1]))
    return figure, plate, length, speed


def _give_way(gone: Axes, other: Axes) -> None:
    """Remove a chart; the one beside or above it gets its room."""
    first, last = other.get_subplotspec(), gone.get_subplotspec()
    assert first is not None
    assert last is not None
    rows = slice(first.rowspan.start, last.rowspan.stop)
    other.set_subplotspec(first.get_gridspec()[rows, first.colspan.start : last.colspan.stop])
    gone.remove()


def on_grey_plate(axes: Axes, box: Box, where: Shape, damage: NDArray[np.float64]) -> Sheet:
    """The plate in a light grey, darker where it is damaged."""
    on = on_axes(axes, box)
    for artist in paint(on, where, PALE + (DARK - PALE) * damage, ScalarMappable(Normalize(0, 1), "Greys")):
        artist.set_rasterized(True)
    mark(on, where)
    return on


def _path(on: Sheet, branch: Branch, **style: Any) -> None:
    """The way of a tip, dotted where it is no line."""
    pieces = on.factor * np.stack([branch.place[:-1], branch.place[1:]], axis=1)
    line = branch.line[:-1] & branch.line[1:]
    for some, more in ((line, {}), (~line, {"ls": ":"})):
        way = LineCollection(list(pieces[some]), zorder=5, capstyle="round", **(style | more))
        on.axes.add_collection(way, autolim=False)


def _lengths(shown: list[Branch], length: Axes) -> None:
    """Length over time."""
    second, seconds = scaled((one.time for one in shown), "s")
    metre, metres = scaled((one.along for one in shown), "m")
    for number, one in enumerate(shown):
        length.plot(one.time * second, one.along * metre, **_style(number))
    length.set(ylabel=f"length of the crack, {metres}", xlabel=f"time, {seconds}")
    length.set_ylim(bottom=0)
    plain(length)


def _style(number: int) -> dict[str, Any]:
    style = look(number) | {"lw": 1.5}
    if number:  # of curves that lie on each other all are seen, in turns
        style["ls"] = (4 * (number - 1), (4, 4))
    return style


def _speeds(shown: list[Branch], speed: Axes, limit: float) -> None:
    """Speed, with the band it is sure to be in, over time."""
    second, seconds = scaled((one.time for one in shown), "s")
    fast, unit = scaled([np.array([limit])], "m/s")
    for number, one in enumerate(shown):
        style = _style(number)
        sides = one.speed.low * fast, one.speed.high * fast
        speed.fill_between(one.time * second, *sides, color=style["color"], alpha=0.18, lw=0)
        speed.plot(one.time * second, one.speed.value * fast, **style)
    speed.axhline(limit * fast, color="black", ls="--", lw=0.9)
    speed.annotate(
        "Rayleigh speed", (1, limit * fast), (0, 2), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", va="bottom", fontsize="small",
    )  # fmt: skip
    speed.set_ylim(0, 1.15 * limit * fast)
    speed.set_title(f"over {WINDOW:g} spacings, with its band", fontsize="small")
    speed.set(xlabel=f"time, {seconds}", ylabel=f"speed of the tip, {unit}")
    plain(speed)
