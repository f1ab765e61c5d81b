"""A picture of the nodes by level: where they are, and the spacing of each."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure

from pdpost import figures
from pdpost.sheets import SQUARES, Shape, Sheet, box_of, paint, prefixed, shape, sheet
from pdsolve.results import Results

SHADES = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#000000")  # Okabe and Ito's
DOT = 0.62  # of the spacing
CRACK = "#d55e00"


def draw(results: Results, step: int, scale: float) -> Figure:
    """The nodes after `step`, displaced by `scale` times their displacement, a colour for each spacing.

    Above 20000 nodes squares stand for dots; above eight spacings, those of a mesh, a bar of colours for the legend.
    Raises ResultsError.
    """
    where = shape(results, step, scale)._replace(turned=None)
    spacings, level = np.unique(where.delta.round(12), return_inverse=True)
    few = len(spacings) <= len(SHADES)
    on = sheet(box_of(results, [where]), bar=not few)
    if not few:
        factor, prefix = prefixed(float(spacings[-1]))
        colours = ScalarMappable(LogNorm(spacings[0] * factor, spacings[-1] * factor), "viridis")
        _place(on, where, where.delta * factor, colours)
        on.figure.colorbar(colours, cax=figures.beside(on), label=f"spacing, {prefix}m")
    else:
        map_of = ListedColormap(SHADES[: len(spacings)])
        _place(on, where, level.astype(float), ScalarMappable(Normalize(-0.5, len(spacings) - 0.5), map_of))
        for number, spacing in enumerate(spacings.tolist()):
            factor, prefix = prefixed(spacing)
            label = f"{spacing * factor:.4g} {prefix}m: {int((level == number).sum())} nodes"
            on.axes.plot([], [], "o", color=SHADES[number], markersize=4, label=label)
    cracks(on, results)
    legend(on)
    on.axes.set_title(f"Nodes {figures.at(results, step, scale)}")
    return on.figure


def cracks(on: Sheet, results: Results) -> None:
    """The pre-cracks, where they were drawn."""
    for number, (x0, y0, x1, y1) in enumerate((results.cracks() * on.factor).tolist()):
        label = "" if number else "pre-crack"
        on.axes.plot([x0, x1], [y0, y1], color="black", linewidth=0.9, zorder=4, label=label)


def legend(on: Sheet) -> None:
    """What the colours mean, in a line below the plate."""
    handles, labels = on.axes.get_legend_handles_labels()
    if handles:
        place = on.axes.get_position()
        low = place.y0 - 0.42 / on.figure.get_figheight()
        middle = (place.x0 + place.x1) / 2
        on.figure.legend(
            handles, labels, loc="upper center", bbox_to_anchor=(middle, low), ncols=3, frameon=False, fontsize=8
        )


def _place(on: Sheet, where: Shape, values: Any, colours: ScalarMappable) -> None:
    if len(where.delta) > SQUARES:
        paint(on, where, values, colours)
        return
    box = on.axes.get_position()
    points = 72 * box.width * on.figure.get_figwidth() / (on.box[2] - on.box[0])  # per metre
    size = np.clip(DOT * where.delta * points, 0.4, 12.0) ** 2
    x, y = where.position.T * on.factor
    on.axes.scatter(x, y, s=size, c=colours.to_rgba(values), linewidths=0, zorder=2)
