"""Pictures of a part with the numbers of its faces or edges: of a body from four sides, of a plate from above.

A body is drawn pixel by pixel: the nearest face counts, so that a number stands only where its face is seen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from pdmesh.drawing.part import CadPart
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend

SIDE = 4.5  # inches of a view
PIXELS = 500  # along the longer side of a view
DPI = 160
VIEWS = ((1, -1, 0.8), (-1, 1, 0.8), (1, 1, -0.8), (-1, -1, -0.8))  # from where a body is seen
LIGHT = 0.35  # of a face that is seen edgewise
LEAST = 2.0  # pixels from the border of a face: room for a number
GREY = "#555555"
WHITE = [withStroke(linewidth=2, foreground="white")]


def draw(part: CadPart) -> Figure:
    """The part with the numbers of its faces, or of its edges."""
    if part.dimension == 2:
        width, height = (part.high - part.low)[:2]
        inches = 2 * SIDE * np.array([1.0, height / width]) / max(1.0, height / width)
        figure = Figure(figsize=(max(inches[0], SIDE), max(inches[1], SIDE / 2) + 0.6), dpi=DPI, layout="constrained")
        axes = figure.add_subplot(aspect="equal", xlabel=f"x, {part.unit}", ylabel=f"y, {part.unit}")
        colours = colormaps["tab10"].colors  # type: ignore[attr-defined]
        for at, shape in enumerate(part.shapes):
            line, colour = shape.points[:, :2], colours[at % len(colours)]
            axes.plot(*line.T, color=colour, linewidth=2.5)
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
            middle = [np.interp(along[-1] / 2, along, line[:, axis]) for axis in (0, 1)]
            _number(axes, middle, shape.number)
        axes.set_title(f"{for_legend(Path(part.path).name)}: edges", fontsize=10)
        axes.margins(0.08)
        return figure
    figure = Figure(figsize=(2 * SIDE, 2 * SIDE), dpi=DPI, layout="constrained")
    corners = np.concatenate([shape.points for shape in part.shapes])
    face = np.repeat(np.arange(len(part.shapes)), [len(shape.points) for shape in part.shapes])
    seen = set()
    for number, view in enumerate(VIEWS):
        seen |= _view(figure.add_subplot(2, 2, number + 1), part, corners, face, np.array(view))
    hidden = [str(shape.number) for at, shape in enumerate(part.shapes) if at not in seen]
    title = f"{for_legend(Path(part.path).name)}: faces" + (f"; not seen: {', '.join(hidden)}" if hidden else "")
    figure.suptitle(title, fontsize=10)
    return figure


def _number(axes: Axes, at: list[float], number: int) -> None:
    axes.text(at[0], at[1], str(number), ha="center", va="center", fontsize=8, weight="bold", path_effects=WHITE)


def _view(
    axes: Axes, part: CadPart, corners: NDArray[np.float64], face: NDArray[np.int64], towards: NDArray[np.float64]
) -> set[int]:
    """Draw the body as seen from a direction; returns the rows of the faces that have a number there."""
    depth = towards / np.linalg.norm(towards)
    across = np.cross([0.0, 0.0, 1.0], depth)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(depth, across), depth])
    placed = corners @ frame.T  # right, up, towards the viewer
    low = placed[..., :2].min(axis=(0, 1))
    scale = PIXELS / float(np.ptp(placed[..., :2].reshape(-1, 2), axis=0).max())
    placed[..., :2] = (placed[..., :2] - low) * scale
    shape = np.ceil(placed[..., 1::-1].max(axis=(0, 1))).astype(int) + 1
    normal = np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0])
    sizes = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    shine = LIGHT + (1 - LIGHT) * np.abs(normal[:, 2]) / np.maximum(sizes * scale**2, 1e-300)
    nearest, owner, light = np.full(shape, -np.inf), np.full(shape, -1), np.ones(shape)
    for triangle, row, brightness in zip(placed, face, shine, strict=True):
        low, high = np.ceil(triangle[:, :2].min(axis=0)), np.floor(triangle[:, :2].max(axis=0))
        columns, rows = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        (ax, ay), (bx, by), (cx, cy) = triangle[:, :2]
        double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if double == 0:
            double = np.inf  # seen edgewise: its weights are 0, 0 and 1
            columns, rows = columns[:0], rows[:0]
        second = ((columns - ax) * (cy - ay) - (cx - ax) * (rows - ay)) / double
        third = ((bx - ax) * (rows - ay) - (columns - ax) * (by - ay)) / double
        inside = (second >= -1e-9) & (third >= -1e-9) & (second + third <= 1 + 1e-9)
        height = triangle[0, 2] + second * (triangle[1, 2] - triangle[0, 2]) + third * (triangle[2, 2] - triangle[0, 2])
        rows, columns, height = rows[inside].astype(np.int64), columns[inside].astype(np.int64), height[inside]
        front = height > nearest[rows, columns]
        rows, columns = rows[front], columns[front]
        nearest[rows, columns], owner[rows, columns], light[rows, columns] = height[front], row, brightness
    tints = np.array(colormaps["Pastel1"].colors)  # type: ignore[attr-defined]
    image = np.where(owner[..., None] >= 0, tints[owner % len(tints)] * np.clip(light, 0, 1)[..., None], 1.0)
    for axis in (0, 1):  # lines between faces
        border = np.flatnonzero(np.diff(owner, axis=axis).ravel())
        at = np.unravel_index(border, np.diff(owner, axis=axis).shape)
        image[at] = 0.25
    axes.imshow(image, origin="lower", interpolation="nearest")
    axes.set_axis_off()
    # the directions of x, y and z in the lower left corner
    length = 0.09 * max(shape)
    for name, way in zip("xyz", frame[:2].T * length, strict=True):
        start = -0.6 * length
        x, y = (start + way).tolist()
        axes.annotate("", xy=(x, y), xytext=(start, start), arrowprops={"arrowstyle": "->", "color": GREY})
        x, y = (start + 1.25 * way).tolist()
        axes.text(x, y, name, ha="center", va="center", fontsize=8, color=GREY)
    axes.set_xlim(-2 * length, shape[1])
    axes.set_ylim(-2 * length, shape[0])
    seen = set()
    for row in np.unique(owner[owner >= 0]).tolist():
        room = distance_transform_edt(np.pad(owner == row, 1))[1:-1, 1:-1]
        y, x = np.unravel_index(int(room.argmax()), room.shape)
        if room[y, x] >= LEAST:
            _number(axes, [float(x), float(y)], part.shapes[row].number)
            seen.add(row)
    return seen
