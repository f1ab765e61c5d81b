"""The scene of a run as a figure: nodes by their spacing, pre-cracks, and where which condition acts."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pdpost import raster
from pdpost.charts import COLOURS, WIDTH
from pdpost.crack_figure import CORNERS, PIXELS
from pdpost.sheets import SQUARES
from pdsolve.results import Nodes, Results

FEW = 150  # spacings across the plate: more are drawn without gaps between the nodes


def scene(results: Results, model: dict[str, Any]) -> Figure:
    """Each node a square of its spacing, grey by its level, in the colour of the last condition that acts on it.

    `model` is the grid file as JSON has it.
    """
    nodes = results.nodes()
    levels = np.unique(nodes.delta)
    greys = np.linspace(0.82, 0.94, len(levels)) if len(levels) > 1 else np.array([0.9])
    colours = np.repeat(greys[np.searchsorted(levels, nodes.delta)][:, None], 3, axis=1)
    keys = [
        Patch(color=str(grey), label=f"{(nodes.delta == level).sum()} nodes, {level * 1e3:.4g} mm apart")
        for level, grey in zip(levels, greys, strict=True)
    ]
    acting = np.zeros(len(nodes.ids), dtype=bool)
    for number, condition in enumerate(model.get("conditions", [])):
        colour = COLOURS[number % len(COLOURS)]
        here = acted_on(nodes, condition)
        acting |= here
        colours[here] = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
        keys.append(
            Patch(color=colour, label=f"{condition.get('name') or f'condition {number}'} ({condition['kind']})")
        )
    few = np.ptp(nodes.position, axis=0).max() / nodes.delta.min() < FEW
    half = nodes.delta[:, None] / 2
    low, high = (nodes.position - half).min(axis=0) * 1e3, (nodes.position + half).max(axis=0) * 1e3
    height = float(np.clip(WIDTH * (high[1] - low[1]) / max(high[0] - low[0], 1e-300), 1.5, 8.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    plate = figure.add_subplot()
    if len(nodes.ids) > SQUARES:
        _paint(plate, nodes, colours, (low, high))
    else:
        squares = (nodes.position[:, None, :] + (0.88 if few else 1.0) * nodes.delta[:, None, None] * CORNERS) * 1e3
        thin = np.where(acting, 0.0 if few else 0.7, 0.0)  # points, so that a row of small nodes is seen
        plate.add_collection(PolyCollection(list(squares), facecolors=colours, edgecolors=colours, linewidths=thin))
    segments = results.cracks().reshape(-1, 2, 2) * 1e3
    plate.add_collection(LineCollection(list(segments), colors="black", linewidths=1.5))
    edge = 0.01 * float((high - low).max())
    plate.set(xlim=(low[0] - edge, high[0] + edge), ylim=(low[1] - edge, high[1] + edge), aspect="equal")
    plate.set(xlabel="x, mm", ylabel="y, mm")
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _paint(
    plate: Axes,
    nodes: Nodes,
    colours: NDArray[np.float64],
    ends: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """The nodes in their colours (n, 3) as an image between two corners, mm."""
    low, high = ends
    box = (low[0] / 1e3, low[1] / 1e3, high[0] / 1e3, high[1] / 1e3)
    layers = [raster.averages(nodes.position, nodes.delta, layer, box, PIXELS) for layer in colours.T]
    image = np.dstack([np.where(there, mean, 1.0) for mean, there in layers])
    plate.imshow(image, origin="lower", extent=(low[0], high[0], low[1], high[1]), interpolation="nearest")


def acted_on(nodes: Nodes, condition: dict[str, Any]) -> NDArray[np.bool_]:
    """Which nodes (n,) a condition of the grid file acts on."""
    if condition.get("nodes") is not None:
        return np.isin(nodes.ids, condition["nodes"])
    slack = 1e-9 * nodes.delta[:, None]
    corners = np.reshape(condition["box"], (2, 2))
    inside = (nodes.position >= corners[0] - slack) & (nodes.position <= corners[1] + slack)
    return np.asarray(inside.all(axis=1))
