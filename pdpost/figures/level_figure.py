"""A picture of the nodes, coloured by their spacing."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize

from pdmesh.plain_figure import Figure
from pdpost.figures import field_figure
from pdpost.figures.colours import at
from pdpost.figures.labels import prefixed
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Shape, Sheet, box_of, legend, mark, paint, shape, sheet
from pdpost.figures.style import SHADES
from pdpost.reading.frame_steps import last_frame
from pdsolve.results import Results

DOT = 0.62  # of the spacing


def nodes(results: Results, step: int | None = None, *, scale: float = 0.0, window: Box | None = None) -> Figure:
    """The nodes after `step` (default: the last frame), displaced by `scale` times their displacement.

    Each spacing has a colour. More than 20000 nodes are drawn as squares instead of dots. More than eight spacings, as
    meshes have, get a colour bar instead of a legend. `window` is the part in view, m. Raises ResultsError.
    """
    step = last_frame(results) if step is None else step
    where = shape(results, step, scale)._replace(turned=None)
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
