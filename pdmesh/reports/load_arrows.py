"""Symbols and style of pictures of grids: arrows of loads, and marks of what is held."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from numpy.typing import NDArray

from pdmesh.model.document import AnyCondition, Displacement, Load, Pin, Spring
from pdmesh.model.load_resultants import nodal_forces, pressure_forces
from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_grid import Grid
from pdmesh.model.values_at_places import values_at, vectors_at

LENGTH = 0.08  # of the larger side of the plate: the longest arrow
HEAD = 0.3  # of the longest arrow: the length of a head
MOST = 12  # arrows or marks of a condition
HELD = {(True, True): "^", (False, True): "o", (True, False): ">"}  # marks, by whether x and y are held
COIL = Path([(0, 0), (0, -2), (-3, -3), (3, -5), (-3, -7), (3, -9), (0, -10), (0, -12), (-4, -12), (4, -12)])
PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))
DPI = 200  # dots per inch
MARGIN = 0.02  # of what is drawn
CRACK = "#d62728"
CONDITIONS = ("#ff7f0e", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#bcbd22")


def symbols(axes: Axes, condition: AnyCondition, grid: Grid, rows: NDArray[np.int64], colour: str) -> None:
    """Draw a load, or what is held, on its nodes, rows (k,), in mm."""
    # at most MOST of the nodes, evenly along their longer side
    position = grid.position[rows]
    order = np.argsort(position[:, int(np.ptp(position, axis=0).argmax())], kind="stable")
    ranks = np.linspace(0, len(order) - 1, min(MOST, len(order))).round().astype(int)
    sample_rows = rows[np.sort(order[ranks])]
    at = grid.position[sample_rows] * 1e3
    if isinstance(condition, Displacement):
        mark = HELD[condition.x is not None, condition.y is not None]
        axes.plot(*at.T, mark, color=colour, markersize=6, markeredgecolor="white", markeredgewidth=0.5, zorder=6)
    if isinstance(condition, Spring):
        outward = grid.position[rows].mean(axis=0) - (grid.position.min(axis=0) + grid.position.max(axis=0)) / 2
        quarters = round(float(np.degrees(np.arctan2(outward[1], outward[0]))) / 90) + 1
        coil = MarkerStyle(COIL, fillstyle="none").rotated(deg=90 * quarters)
        axes.plot(*at[::2].T, linestyle="", marker=coil, color=colour, markersize=14, zorder=6)
    if isinstance(condition, Pin):
        x, y = np.array(condition.centre) * 1e3
        axes.plot(x, y, marker="$\\odot$", color=colour, markersize=12, zorder=6)
    if not isinstance(condition, Load):
        return
    # a value that is the same everywhere has arrows of one length, however large the cells are that it acts on
    if condition.pressure is not None:
        pressure = values_at(condition.pressure, grid.position[sample_rows])
        force = pressure_forces(condition, pressure, grid.ids[sample_rows])
        pull = force * (np.abs(pressure) / np.maximum(np.hypot(*force.T), 1e-300))[:, None]
    else:
        value = condition.traction or condition.body_force or condition.force
        assert value is not None
        pull = vectors_at(value, grid.position[sample_rows])
    if not pull.any():
        return
    way = LENGTH * 1e3 * float(np.ptp(grid.position, axis=0).max()) * pull / np.hypot(*pull.T).max()
    outside = tree_of(grid.position).query((at + way) / 1e3)[0] > float(grid.delta.max())
    start = at if outside.mean() > 0.5 else at - way  # what pulls begins at its nodes, what pushes ends there
    # outlines (k, 7, 2), their widths in shares of the longest
    length = np.hypot(*way.T)[:, None]
    along = way / np.where(length > 0, length, 1.0)
    across, size = np.column_stack([-along[:, 1], along[:, 0]]), float(length.max())
    neck, half, head = start + way - HEAD * size * along, 0.025 * size * across, 0.1 * size * across
    corners = (start - half, neck - half, neck - head, start + way, neck + head, neck + half, start + half)
    arrows = np.stack(corners, axis=1)
    axes.add_collection(PolyCollection(list(arrows), facecolors=colour, linewidths=0, zorder=6))
    ends = arrows.reshape(-1, 2)
    axes.set_xlim(min(axes.get_xlim()[0], ends[:, 0].min()), max(axes.get_xlim()[1], ends[:, 0].max()))
    axes.set_ylim(min(axes.get_ylim()[0], ends[:, 1].min()), max(axes.get_ylim()[1], ends[:, 1].max()))


def total(condition: AnyCondition, grid: Grid, rows: NDArray[np.int64]) -> str:
    """What a load adds up to, in words, ", 1.2 MN/m"; empty of other conditions."""
    if not isinstance(condition, Load):
        return ""
    value = float(np.linalg.norm(nodal_forces(condition, grid, rows).sum(axis=0)))
    size, prefix = next((scale for scale in PREFIXES if value >= scale[0]), PREFIXES[-1])
    return f", {value / size:.4g} {prefix}{'N/m' if grid.dimension == 2 else 'N'}"


def shades(delta: NDArray[np.float64]) -> list[tuple[float, Any]]:
    """Each spacing, m, with its shade of grey."""
    spacings = np.unique(delta)
    return list(zip(spacings.tolist(), colormaps["Greys_r"](np.linspace(0.15, 0.62, len(spacings))), strict=True))


def marker(spacing: float, points: float) -> float:
    """Size of a node's mark in points, with `points` points to a metre."""
    return float(np.clip(0.6 * spacing * points, 0.25, 5))
