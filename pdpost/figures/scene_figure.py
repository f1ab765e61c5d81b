"""The scene of a run as a figure, nodes by spacing, pre-cracks and conditions; or its nodes alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pdmesh.model.node_arrays import selected
from pdmesh.model.suggestions import called
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdpost.figures import field_figure
from pdpost.figures.charts import WIDTH
from pdpost.figures.colours import at, prefixed
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Shape, Sheet, box_of, legend, mark, on_axes, paint, shape, sheet, tint
from pdpost.figures.style import COLOURS, SHADES
from pdsolve.measures.frame_steps import last_frame
from pdsolve.results import Nodes, Results

MOST_KEYS = 12  # conditions in the legend
FEW = 150  # spacings across the plate: more are drawn without gaps between the nodes
DOT = 0.62  # of the spacing


def scene(results: Results, model: dict[str, Any]) -> Figure:
    """Each node as its cell, grey by its spacing, or in the colour of the last condition that acts on it.

    `model` is the grid file as parsed JSON.
    """
    nodes = results.nodes(0)
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
        condition_nodes = acted_on(nodes, condition)
        acting |= condition_nodes
        colours[condition_nodes] = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
        keys.append(
            Patch(color=colour, label=f"{for_legend(called(condition.get('name'), number))} ({condition['kind']})")
        )
    if len(keys) > len(levels) + MOST_KEYS:
        left_out = len(keys) - len(levels) - MOST_KEYS
        keys = [*keys[: len(levels) + MOST_KEYS], Patch(alpha=0, label=f"and {left_out} more conditions")]
    where = shape(results, 0, 0.0)
    box = box_of([where])
    width, tall = box[2] - box[0], box[3] - box[1]
    figure = Figure(figsize=(WIDTH, float(np.clip(WIDTH * tall / width, 1.5, 8.0)) + 0.9), layout="constrained")
    on = on_axes(figure.add_subplot(), box)
    few = max(width, tall) / nodes.delta.min() < FEW
    edges = {"edgecolors": "white", "linewidths": 0.5} if few else {"linewidths": np.where(acting, 0.7, 0.4)}
    tint(on, where, colours, **edges)  # a row of small nodes is seen
    mark(on, where)
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    return figure


def acted_on(nodes: Nodes, condition: dict[str, Any]) -> NDArray[np.bool_]:
    """Mask (n,) of the nodes that a condition of the grid file acts on."""
    return selected(nodes, condition.get("nodes"), condition.get("box"))


def nodes(results: Results, step: int | None = None, *, scale: float = 0.0, window: Box | None = None) -> Figure:
    """The nodes after `step` (default: the last frame), displaced by `scale` times their displacement.

    Each spacing has a colour. More than 20000 nodes are drawn as squares instead of dots. More than eight spacings, as
    meshes have, get a colour bar instead of a legend. `window` is the part in view, m. Raises ResultsError.
    """
    step = last_frame(results) if step is None else step
    where = shape(results, step, scale)._replace(corners=None)
    spacings, level = np.unique(where.delta.round(12), return_inverse=True)
    few = len(spacings) <= len(SHADES)
    on = sheet(window or box_of([where]), bar=not few)
    if not few:
        factor, prefix = prefixed(float(spacings[-1]))
        colours = ScalarMappable(LogNorm(spacings[0] * factor, spacings[-1] * factor), "viridis")
        _place(on, where, where.delta * factor, colours)
        on.figure.colorbar(colours, cax=field_figure.beside(on), label=f"spacing, {prefix}m")
    else:
        map_of = ListedColormap(SHADES[: len(spacings)])
        _place(on, where, level.astype(float), ScalarMappable(Normalize(-0.5, len(spacings) - 0.5), map_of))
        for number, spacing in enumerate(spacings.tolist()):
            factor, prefix = prefixed(spacing)
            label = f"{spacing * factor:.4g} {prefix}m: {int((level == number).sum())} nodes"
            on.axes.plot([], [], "o", color=SHADES[number], markersize=4, label=label)
    mark(on, where)
    legend(on)
    on.axes.set_title(f"Nodes {at(results, step, scale)}")
    return on.figure


def _place(on: Sheet, where: Shape, values: Any, colours: ScalarMappable) -> None:
    if where.cells is None:
        paint(on, where, values, colours)
        return
    box = on.axes.get_position()
    points = 72 * box.width * on.figure.get_figwidth() / (on.box[2] - on.box[0])  # per metre
    size = np.clip(DOT * where.delta * points, 0.4, 12.0) ** 2
    x, y = where.position.T * on.factor
    on.axes.scatter(x, y, s=size, c=colours.to_rgba(values), linewidths=0, zorder=2)
