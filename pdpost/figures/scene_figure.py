"""The scene of a run as a figure: nodes by spacing, pre-cracks, and the nodes each condition acts on."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pdmesh.model.node_arrays import selected
from pdmesh.model.suggestions import called
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdpost.figures.charts import WIDTH
from pdpost.figures.sheets import box_of, mark, on_axes, shape, tint
from pdpost.figures.style import COLOURS
from pdsolve.results import Nodes, Results

FEW = 150  # spacings across the plate: more are drawn without gaps between the nodes


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
