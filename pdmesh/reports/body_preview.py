"""Pictures of a body in space with matplotlib: three orthogonal sections through its centre, and its outline."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from pdmesh.model import node_arrays, selection
from pdmesh.model.document import Document
from pdmesh.model.node_grid import Grid, grid_of
from pdmesh.model.suggestions import called
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdmesh.reports.load_arrows import CONDITIONS, CRACK, DPI, MARGIN, marker, shades, total

SIDE = 4.2  # inches, of each of the four at most
LEAST, FLATTEST = 0.4, 0.7  # of that, how low a row of them is, and that with the outline
SHARP = 0.35  # radians between two triangles, whose edge is drawn
MOST_EDGES, MOST_FACES, MOST_MARKS = 20_000, 5_000, 2_000  # that are drawn
WAYS = ((0, 1), (0, 2), (1, 2))  # axes of the sections


def draw(document: Document, name: str) -> Figure:
    """The sections and the outline of the model called `name`. Raises GridError."""
    grid = grid_of(document, name)
    selection.check(document, grid, name)
    x, y, z = np.ptp(grid.position, axis=0) + grid.delta.max()
    rows = [float(np.clip(share, LEAST, 1)) for share in (max(y, z) / x, max(z / y, FLATTEST))]
    figure = Figure(figsize=(2 * SIDE, sum(rows) * SIDE + 0.8), dpi=DPI, layout="constrained")
    places = figure.add_gridspec(2, 2, height_ratios=rows)
    middle = (grid.position.min(axis=0) + grid.position.max(axis=0)) / 2
    for number, way in enumerate(WAYS):
        _section(figure.add_subplot(places[number], aspect="equal"), document, grid, way, middle, number == 0)
    _outline(figure.add_subplot(places[3], projection="3d"), document, grid)
    figure.suptitle(f"{for_legend(Path(document.source or name).stem)}: {len(grid)} nodes", fontsize=10)
    figure.legend(loc="outside lower center", ncols=4, fontsize=7, frameon=False, markerscale=1.2)
    return figure


def _section(
    axes: Axes, document: Document, grid: Grid, way: tuple[int, int], middle: NDArray[np.float64], named: bool
) -> None:
    """Draw the nodes whose cubes the plane through the centre cuts, those nearest to it on one side."""
    a, b = way
    across = 3 - a - b
    away = grid.position[:, across] - middle[across]
    near = np.flatnonzero((away >= -1e-6 * grid.delta) & (away < grid.delta * (1 - 1e-6)))
    place = grid.position[:, [a, b]] * 1e3
    low, high = place.min(axis=0), place.max(axis=0)
    margin = MARGIN * float((high - low).max()) + float(grid.delta.max()) * 500
    axes.set(xlabel=f"{'xyz'[a]}, mm", ylabel=f"{'xyz'[b]}, mm")
    axes.set_title(f"{'xyz'[across]} = {middle[across] * 1e3:.4g} mm", fontsize=8)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    points = 72 * 0.8 * SIDE / (float((high - low).max()) + 2 * margin) * 1e3  # per metre
    plain: dict[str, Any] = {"linestyle": "", "markeredgewidth": 0}
    for spacing, shade in shades(grid.delta):
        node_rows = near[np.isclose(grid.delta[near], spacing)]
        label = f"{spacing * 1e3:g} mm: {int(np.isclose(grid.delta, spacing).sum())} nodes" if named else None
        size = marker(spacing, points)
        axes.plot(*place[node_rows].T, marker="o", markersize=size, color=shade, label=label, **plain)
    for said, colour, rows in marked(document, grid):
        node_rows = near[rows[near]]
        size = marker(float(np.median(grid.delta[rows])), points)
        label = said if named else None
        axes.plot(
            *place[node_rows].T, "s", fillstyle="none", color=colour, markersize=1.3 * size, label=label, zorder=3
        )
    # segments (k, 2, 3) in which the plane cuts the cracks
    segments = []
    for triangle in grid.cracks.reshape(-1, 3, 3):
        side = triangle[:, across] - float(middle[across])
        ends = []
        for p, q in ((0, 1), (1, 2), (2, 0)):
            if side[p] * side[q] < 0 or (side[p] == 0) != (side[q] == 0):
                share = side[p] / (side[p] - side[q])
                ends.append(triangle[p] + share * (triangle[q] - triangle[p]))
        if len(ends) >= 2:
            segments.append(ends[:2])
    lines = np.array(segments).reshape(-1, 2, 3)[:, :, [a, b]] * 1e3
    axes.add_collection(LineCollection(list(lines), colors=CRACK, linewidths=1.4, zorder=5))
    if named and len(grid.cracks):
        axes.plot([], [], color=CRACK, label="crack")


def marked(document: Document, grid: Grid) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    """Names, colours and nodes (n,) of conditions and of material regions; with the names what loads add up to."""
    entries: list[tuple[str, str, Any]] = [
        (str(item.__struct_config__.tag), called(item.name, at), item) for at, item in enumerate(document.conditions)
    ]
    entries += [("material", called(item.name, at, "region"), item) for at, item in enumerate(document.regions)]
    for number, (kind, name, entry) in enumerate(entries):
        rows = node_arrays.selected(grid, entry.nodes, entry.box)
        sums = total(entry, grid, np.flatnonzero(rows))
        yield f"{kind} '{for_legend(name)}': {int(rows.sum())} nodes{sums}", CONDITIONS[number % len(CONDITIONS)], rows


def _outline(axes: Any, document: Document, grid: Grid) -> None:
    """Draw the transparent surface, its sharp edges, the cracks, and the nodes with conditions."""
    faces, cracks = grid.faces * 1e3, grid.cracks.reshape(-1, 3, 3) * 1e3
    low, high = grid.position.min(axis=0) * 1e3, grid.position.max(axis=0) * 1e3
    # edges (k, 2, 3) at which triangles meet at a sharp angle
    corners, number = np.unique(faces.reshape(-1, 3), axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.maximum(np.sqrt((normal**2).sum(axis=1)), 1e-300)[:, None]
    ends = np.sort(np.concatenate([number[:, [0, 1]], number[:, [1, 2]], number[:, [2, 0]]]), axis=1)
    face = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(ends.T)
    ends, face = ends[order], face[order]
    same = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    turn = np.abs((normal[face[same]] * normal[face[same + 1]]).sum(axis=1))
    edges = np.asarray(corners[ends[same[turn < np.cos(SHARP)]]])
    if len(edges):  # a sphere has none
        sample = edges[:: len(edges) // MOST_EDGES + 1]
        axes.add_collection3d(Line3DCollection(sample, colors="#555555", linewidths=0.5))
    sample = faces[:: len(faces) // MOST_FACES + 1]
    axes.add_collection3d(Poly3DCollection(sample, facecolors="#1f5fbf", edgecolors="none", alpha=0.1))
    if len(cracks):
        axes.add_collection3d(Poly3DCollection(cracks, facecolors=CRACK, alpha=0.5))
    for _, colour, rows in marked(document, grid):
        node_rows = np.flatnonzero(rows)
        node_rows = node_rows[:: len(node_rows) // MOST_MARKS + 1]
        axes.scatter(*(grid.position[node_rows] * 1e3).T, s=2, color=colour, alpha=0.5, linewidths=0)
    axes.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), (high - low) / (high - low).max(), strict=True):
        axis.set_major_locator(MaxNLocator(1 + round(6 * share)))
    axes.set_box_aspect(np.maximum(high - low, 1e-9), zoom=0.8)
    axes.tick_params(labelsize=6)
