"""Pictures of a grid with matplotlib: nodes by spacing, cracks, conditions; the bonds around a crack."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from pdmesh.model import selection
from pdmesh.model.amounts import pair_count
from pdmesh.model.document import Document, settings_of
from pdmesh.model.node_grid import Grid, grid_of
from pdmesh.model.visibility import plate_of
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdmesh.reports import body_preview
from pdmesh.reports.bonds_and_step import bonds_of_run
from pdmesh.reports.load_arrows import CRACK, DPI, MARGIN, marker, shades, symbols
from pdmesh.scene.shapes import SceneError

WIDTH, TALLEST = 8.0, 9.0  # inches
WINDOW = 2.6  # horizons to each side of a crack's tip, in a picture of bonds
CUT, HOLE = CRACK, "#1f5fbf"
BODIES = ("#777777", "#5b8fc9", "#c98f5b", "#7bb37b", "#a97bb3")


def draw(document: Document, name: str, with_bonds: bool = False) -> Figure:
    """The grid of the model called `name`; with `with_bonds`, the bonds around the end of its first crack.

    Raises GridError, and SceneError for the bonds of a body in space.
    """
    if document.dimension == 3:
        if with_bonds:
            raise SceneError(f"{name}: --bonds is for plates; leave it out for a body in space")
        return body_preview.draw(document, name)
    grid = grid_of(document, name)
    selection.check(document, grid, name)
    plate_of(grid, name)
    if with_bonds:
        # around the end of the first crack or, without one, around a node at a hole, or the centre
        at_hole = np.flatnonzero(grid.hole_id >= 0)
        centre = grid.position[at_hole[0]] if len(at_hole) else grid.position.mean(axis=0)
        if len(grid.cracks):
            ends = grid.cracks[0].reshape(2, 2)
            rings = [*grid.outline, *grid.holes]
            edge = shapely.multilinestrings([shapely.linestrings(ring) for ring in rings])
            centre = ends[int(np.argmax(shapely.distance(shapely.points(ends), edge)))] if rings else ends[1]
        nearest = int(np.argmin(np.hypot(*(grid.position - centre).T)))
        reach = WINDOW * document.horizon.ratio * float(grid.delta[nearest])
        window = centre - reach, centre + reach
    else:
        low, high = grid.position.min(axis=0), grid.position.max(axis=0)
        margin = MARGIN * float((high - low).max()) + float(grid.delta.max()) / 2
        window = low - margin, high + margin
    size = window[1] - window[0]
    height = float(np.clip(WIDTH * size[1] / size[0], 1.5, TALLEST))
    figure = Figure(figsize=(WIDTH, height + 1.1), dpi=DPI, layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x, mm", ylabel="y, mm")
    axes.set_xlim(window[0][0] * 1e3, window[1][0] * 1e3)
    axes.set_ylim(window[0][1] * 1e3, window[1][1] * 1e3)
    points = 72 * float(min(0.9 * WIDTH / size[0], height / size[1]))  # per metre
    if with_bonds:
        _bonds(axes, document, grid, name, window)
    _nodes(axes, grid, points)
    _conditions(axes, document, grid, points)
    for ring in (*grid.outline, *grid.holes):
        axes.plot(*(ring * 1e3).T, color="black", linewidth=0.7, zorder=4)
    if len(grid.cracks):
        lines = LineCollection(list(grid.cracks.reshape(-1, 2, 2) * 1e3), colors=CRACK, linewidths=1.4, zorder=5)
        axes.add_collection(lines)
        axes.plot([], [], color=CRACK, label="crack")
    axes.set_title(f"{for_legend(Path(document.source or name).stem)}: {len(grid)} nodes", fontsize=10)
    figure.legend(loc="outside lower center", ncols=4, fontsize=7, frameon=False, markerscale=1.2)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # which each drawing would change a little more
    return figure


def _nodes(axes: Axes, grid: Grid, points: float) -> None:
    spacings = np.unique(grid.delta)
    if len(spacings) > 16:  # a mesh
        shade = np.log2(grid.delta / spacings[0]) / max(np.log2(spacings[-1] / spacings[0]), 1e-9)
        size = np.clip(0.5 * grid.delta * points, 0.3, 8) ** 2
        x, y = grid.position.T * 1e3
        axes.scatter(x, y, s=size, c=shade, cmap="viridis", linewidths=0, zorder=2)
        return
    for number, name in enumerate(() if grid.bodies is None else grid.bodies.names):
        axes.plot([], [], "o", color=BODIES[number % len(BODIES)], markersize=3, label=f"body '{for_legend(name)}'")
    for spacing, shade in shades(grid.delta):
        at = grid.position[grid.delta == spacing] * 1e3
        style: dict[str, Any] = {
            "marker": "o",
            "markersize": marker(spacing, points),
            "linestyle": "",
            "markeredgewidth": 0,
        }
        axes.plot(*at.T, color=shade, label=f"{spacing * 1e3:g} mm: {len(at)} nodes", zorder=2, **style)
        if grid.bodies is not None:
            for number in range(len(grid.bodies.names)):
                body_position = grid.position[(grid.delta == spacing) & (grid.bodies.number == number)] * 1e3
                axes.plot(*body_position.T, color=BODIES[number % len(BODIES)], zorder=2.2, **style)
        near = grid.position[(grid.delta == spacing) & (grid.hole_id >= 0)] * 1e3
        axes.plot(*near.T, color=HOLE, zorder=2.5, **style)
    if (grid.hole_id >= 0).any():
        axes.plot([], [], "o", color=HOLE, markersize=3, label=f"at a hole: {int((grid.hole_id >= 0).sum())} nodes")


def _conditions(axes: Axes, document: Document, grid: Grid, points: float) -> None:
    squares = np.zeros(len(grid), dtype=int)  # around each node
    for number, (label, colour, rows) in enumerate(body_preview.marked(document, grid)):
        size = marker(float(np.median(grid.delta[rows])), points)
        around = float(np.median(squares[rows]))  # of these it is inside, as it would hide them
        squares[rows] += 1
        style: dict[str, Any] = {
            "linestyle": "",
            "markersize": max(1.3 - 0.5 * around, 0.3) * size,
            "markeredgewidth": max(0.25 * size, 0.3),
            "zorder": 3,
        }
        axes.plot(*(grid.position[rows] * 1e3).T, marker="s", color=colour, fillstyle="none", label=label, **style)
        if number < len(document.conditions):
            symbols(axes, document.conditions[number], grid, np.flatnonzero(rows), colour)


def _bonds(
    axes: Axes,
    document: Document,
    grid: Grid,
    name: str,
    window: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    inside = ((grid.position >= window[0]) & (grid.position <= window[1])).all(axis=1)
    counts = {"intact": 0, "cut": 0}
    for source, target, is_intact in bonds_of_run(grid, settings_of(document), name, np.flatnonzero(inside)):
        ends = np.stack([grid.position[source], grid.position[target]], axis=1) * 1e3
        for which, mask, colour, order in (("intact", is_intact, "#9db7d5", 1.0), ("cut", ~is_intact, CUT, 1.5)):
            counts[which] += int(mask.sum())
            axes.add_collection(
                LineCollection(list(ends[mask]), colors=colour, linewidths=0.3, alpha=0.7, zorder=order)
            )
    axes.plot([], [], color="#9db7d5", label=f"{pair_count(counts['intact'])} bonds")
    if counts["cut"]:
        axes.plot([], [], color=CUT, linewidth=0.5, label=f"{pair_count(counts['cut'])} bonds cut by a crack")
