"""The crack of a run as a figure: its path over the plate, its length and its speed; two cracks over each other."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpost import raster
from pdpost.charts import WIDTH, look, plain, scaled
from pdpost.crack_summary import Summary
from pdpost.cracks import damage_at
from pdpost.paths import LONG, Polyline
from pdpost.sheets import SQUARES
from pdpost.speed import speeds
from pdsolve.results import Nodes, Results

PIXELS = 1400  # across the plate, where it has too many nodes to draw them one by one
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
SHOWN = 6  # main branches with a curve of their own


def crack(results: Results, found: Summary) -> Figure:
    """Path, length over time and speed over time of the cracks in a summary; long branches in colours."""
    nodes, time_step, limit = results.nodes(), found.time_step, found.rayleigh_speed
    figure, plate, length, speed = _panels(nodes)
    _damage(plate, nodes, damage_at(results, found.step))
    _pre_cracks(plate, results)
    when = f"{found.step * time_step * 1e6:.4g} µs"
    if not found.branches:
        length.remove()
        speed.remove()
        plate.set_title(f"No crack has grown at {when}", fontsize="medium")
        return figure
    shown = [one for one in found.branches if one.length >= LONG * found.branches[0].length][:SHOWN]
    rest = [one.points * 1e3 for one in found.branches[len(shown) :]]
    plate.add_collection(LineCollection(rest, colors="0.25", linewidths=1.0))
    shown.sort(key=lambda one: (one.along[0], one.since[-1]))
    times = [one.since[one.since >= 0] * time_step for one in shown]
    second, seconds = scaled(times, "s")
    metre, metres = scaled((one.along for one in shown), "m")
    fast, unit = scaled([np.array([limit])], "m/s")
    for number, one in enumerate(shown):
        known = one.since >= 0
        style = look(number) | {"lw": 1.5}
        if number:  # of curves that lie on each other all are seen, in turns
            style["ls"] = (4 * (number - 1), (4, 4))
        plate.plot(*one.points.T * 1e3, lw=1.5, solid_capstyle="round", **look(number))
        length.plot(times[number] * second, one.along[known] * metre, **style)
        fastness = speeds(one, time_step)[known] * fast
        speed.plot(times[number] * second, fastness, **style)
    if found.forks:
        plate.plot(
            *np.array([fork.place for fork in found.forks]).T * 1e3, "o", ms=4.5, mfc="white", mec="black", mew=0.8
        )
    speed.axhline(limit * fast, color="black", ls="--", lw=0.9)
    speed.annotate(
        "Rayleigh speed", (1, limit * fast), (0, 2), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", va="bottom", fontsize="small",
    )  # fmt: skip
    speed.set_ylim(0, 1.15 * limit * fast)
    length.set(ylabel=f"length of the crack, {metres}", xlabel=f"time, {seconds}")
    length.set_ylim(bottom=0)
    speed.set(xlabel=f"time, {seconds}", ylabel=f"speed of the tip, {unit}")
    for panel in (length, speed):
        plain(panel)
    plate.set_title(f"Damage and path of the crack at {when}", fontsize="medium")
    return figure


def comparison(
    one: Results, step: int, paths: tuple[list[Polyline], list[Polyline]], names: tuple[str, str], title: str
) -> Figure:
    """Two sets of paths over the plate of the first, grey with its damage after `step`."""
    nodes = one.nodes()
    size = np.ptp(nodes.position, axis=0)
    height = float(np.clip(0.9 * WIDTH * size[1] / max(size[0], 1e-300), 2.0, 9.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    plate = figure.add_subplot()
    _damage(plate, nodes, damage_at(one, step))
    _pre_cracks(plate, one)
    for number, (lines, name) in enumerate(zip(paths, names, strict=True)):
        style = look(number) | {"lw": (2.2, 1.3)[number], "ls": ("-", (0, (4, 2)))[number]}
        for line in lines:
            plate.plot(*line.T * 1e3, label=name if line is lines[0] else None, **style)
    plate.set_title(title, fontsize="medium")
    if any(paths):
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def _panels(nodes: Nodes) -> tuple[Figure, Axes, Axes, Axes]:
    """A plate, and two charts: below a wide plate, to the right of a high one."""
    size = np.ptp(nodes.position, axis=0)
    aspect = float(size[1] / max(size[0], 1e-300))
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


def _damage(plate: Axes, nodes: Nodes, damage: NDArray[np.float64]) -> None:
    """The plate in a light grey, darker where it is damaged."""
    half = nodes.delta[:, None] / 2
    low, high = (nodes.position - half).min(axis=0) * 1e3, (nodes.position + half).max(axis=0) * 1e3
    if len(damage) > SQUARES:
        box = (low[0] / 1e3, low[1] / 1e3, high[0] / 1e3, high[1] / 1e3)
        mean, _ = raster.averages(nodes.position, nodes.delta, damage, box, PIXELS)
        seen = (low[0], high[0], low[1], high[1])
        plate.imshow(0.06 + 0.6 * mean, cmap="Greys", clim=(0, 1), origin="lower", extent=seen, interpolation="nearest")
    else:
        squares = (nodes.position[:, None, :] + nodes.delta[:, None, None] * CORNERS) * 1e3
        cells = PolyCollection(list(squares), array=0.06 + 0.6 * damage, cmap="Greys", clim=(0, 1))
        cells.set(edgecolors="face", linewidths=0.2, rasterized=True)
        plate.add_collection(cells)
    plate.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x, mm", ylabel="y, mm")


def _pre_cracks(plate: Axes, results: Results) -> None:
    segments = results.cracks().reshape(-1, 2, 2) * 1e3
    plate.add_collection(LineCollection(list(segments), colors="black", linewidths=1.5))
