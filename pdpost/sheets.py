"""The sheet a plate is drawn on: its size, its axes in handy units, and nodes on it, deformed or not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpost import raster
from pdpost.raster import Box
from pdpost.strain import fitted, intact
from pdsolve.results import Results

WIDTH, TALLEST, FLATTEST = 5.4, 6.5, 1.2  # inches, of the plate
LEFT, RIGHT, BELOW, ABOVE = 0.65, 0.95, 0.5, 0.4  # inches around it
SQUARES = 20_000  # nodes; more are painted as an image
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
SHOWN = 0.05  # of the plate: how far displacements move nodes where the scale is chosen for them
ROOM = 0.2  # of the plate, around it, for what is displaced
UNKNOWN = "#707070"  # nodes without a value
PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


class Shape(NamedTuple):
    """Nodes where they are drawn."""

    position: NDArray[np.float64]  # (n, 2) m
    delta: NDArray[np.float64]  # (n,) m
    turned: NDArray[np.float64] | None  # (n, 2, 2) what becomes of their squares; None: nothing


class Sheet(NamedTuple):
    """A figure with one plate."""

    figure: Figure
    axes: Axes
    box: Box  # m: what is seen
    factor: float  # from m to the axes' unit


def shape(results: Results, step: int, scale: float) -> Shape:
    """The nodes of a frame displaced by `scale` times their displacement, 0: the reference.

    Raises ResultsError if the frame does not hold displacements and `scale` is not 0.
    """
    nodes = results.nodes()
    if not scale:
        return Shape(nodes.position, nodes.delta, None)
    moved = displacement(results, step)
    turned = None
    if len(nodes.ids) <= SQUARES:
        turned = np.eye(2) + scale * fitted(results, moved, intact(results, results.families(), step))
        turned[~np.isfinite(turned).all(axis=(1, 2)) | (np.abs(turned).max(axis=(1, 2)) > 2)] = np.eye(2)
    return Shape(nodes.position + scale * moved, nodes.delta, turned)


def displacement(results: Results, step: int) -> NDArray[np.float64]:
    """The displacements (n, 2), m, of a frame, 0 for what is no number. Raises ResultsError if it holds none."""
    moved = np.column_stack([results.field("ux", step), results.field("uy", step)]).astype(float)
    return np.where(np.isfinite(moved), moved, 0.0)


def chosen_scale(results: Results, step: int) -> float:
    """1, 2 or 5 times a power of ten, at least 1, by which most displacements of a frame move nodes 5 % of the plate.

    Raises ResultsError if the frame does not hold displacements.
    """
    nodes = results.nodes()
    far = float(np.percentile(np.hypot(*displacement(results, step).T), 99))
    wanted = SHOWN * float(np.ptp(nodes.position, axis=0).max()) / far if far > 0 else 1.0
    power = 10.0 ** np.floor(np.log10(wanted)) if wanted > 1 else 1.0
    return float(max(power * max(n for n in (1, 2, 5) if n * power <= max(wanted, 1.0)), 1.0))


def box_of(results: Results, shapes: list[Shape]) -> Box:
    """What is to be seen so that all the shapes are, except for what is thrown far off the plate, m."""
    nodes = results.nodes()
    half = nodes.delta[:, None] / 2
    low, high = (nodes.position - half).min(axis=0), (nodes.position + half).max(axis=0)
    room = ROOM * (high - low).max()
    lowest = np.min([(one.position - half).min(axis=0) for one in shapes], axis=0)
    highest = np.max([(one.position + half).max(axis=0) for one in shapes], axis=0)
    x0, y0 = np.maximum(lowest, low - room).tolist()
    x1, y1 = np.minimum(highest, high + room).tolist()
    return x0, y0, x1, y1


def sheet(box: Box, bar: bool = True) -> Sheet:
    """An empty sheet for what is in `box`, m, with room for a bar of colours beside it."""
    width, height = box[2] - box[0], box[3] - box[1]
    across = min(WIDTH, TALLEST * width / height)
    tall = max(across * height / width, FLATTEST)
    size = (max(LEFT + across + RIGHT * bar, 4.0), BELOW + tall + ABOVE)
    figure = Figure(figsize=size)
    factor, prefix = prefixed(max(width, height))
    place = (LEFT / size[0], BELOW / size[1], across / size[0], tall / size[1])
    axes = figure.add_axes(place, aspect="equal", xlabel=f"x, {prefix}m", ylabel=f"y, {prefix}m")
    axes.set_xlim(box[0] * factor, box[2] * factor)
    axes.set_ylim(box[1] * factor, box[3] * factor)
    return Sheet(figure, axes, box, factor)


def paint(on: Sheet, nodes: Shape, values: NDArray[np.float64], colours: ScalarMappable) -> Artist:
    """Put each node's square on the sheet, coloured by its value (n,), in the numbers of `colours`."""
    if len(values) > SQUARES:
        return _image(on, nodes, values, colours)
    corners = nodes.delta[:, None, None] * CORNERS
    if nodes.turned is not None:
        corners = np.einsum("nab,ncb->nca", nodes.turned, corners)
    squares = PolyCollection(
        (nodes.position[:, None, :] + corners) * on.factor,
        array=np.ma.masked_invalid(values),
        cmap=colours.cmap,
        norm=colours.norm,
        edgecolors="face",
        linewidths=0.4,
    )
    on.axes.add_collection(squares, autolim=False)
    return squares


def _image(on: Sheet, nodes: Shape, values: NDArray[np.float64], colours: ScalarMappable) -> Artist:
    mean, there = raster.averages(nodes.position, nodes.delta, values, on.box, pixels(on))
    painted = colours.to_rgba(np.ma.masked_invalid(mean), bytes=True)
    painted[~there] = 0
    return show(on, painted)


def show(on: Sheet, painted: NDArray[np.uint8]) -> Artist:
    """Put an image (rows, columns, 4) of the sheet's box on it, lowest row first."""
    x0, y0, x1, y1 = (edge * on.factor for edge in on.box)
    return on.axes.imshow(
        painted, origin="lower", extent=(x0, x1, y0, y1), interpolation="nearest", aspect="equal", zorder=1
    )


def pixels(on: Sheet) -> int:
    """How many pixels across the sheet's box is, where it is saved."""
    dpi = rcParams["savefig.dpi"]
    dots = on.figure.dpi if dpi == "figure" else float(dpi)
    return max(round(on.axes.get_position().width * on.figure.get_figwidth() * dots), 16)


def prefixed(largest: float) -> tuple[float, str]:
    """A factor and an SI prefix that turn numbers up to `largest` into handy ones."""
    power = int(np.floor(np.log10(largest) / 3)) * 3 if largest > 0 else 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 10.0**-power, PREFIXES[power]
