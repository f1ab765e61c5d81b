"""A picture of a plane through a body: each node that it cuts is a square."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from pdpost.figures.field_figure import at, usual
from pdpost.figures.labels import scaled, unit
from pdpost.figures.style import UNKNOWN
from pdpost.measures import fields
from pdpost.measures.slices import Cut
from pdsolve.results import Results

CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
WIDTH, TALLEST = 6.0, 7.0  # inches


def plane(results: Results, found: Cut, name: str, part: str, step: int, largest: float | None = None) -> Figure:
    """The field `name` on a plane, its colours up to `largest` (SI) or the usual largest."""
    known = found.values[np.isfinite(found.values)]
    high = largest or (1.0 if name in ("damage", "solid") else usual(known))
    low = -high if part in ("x", "y", "z") else 0.0
    factor, label = unit(fields.FIELDS[name].unit, high)
    metre, metres = scaled([found.place], "m")
    size = np.ptp(found.place, axis=0) + found.delta.max()
    figure = Figure(figsize=(WIDTH, min(TALLEST, 1.0 + (WIDTH - 1.5) * size[1] / size[0])), layout="constrained")
    axes = figure.add_subplot(aspect="equal")
    colours = colormaps["coolwarm" if low else "viridis"].with_extremes(bad=UNKNOWN)
    mappable = ScalarMappable(Normalize(low * factor, high * factor if high > low else low * factor + 1.0), colours)
    squares = (found.place[:, None, :] + found.delta[:, None, None] * CORNERS) * metre
    paint = mappable.to_rgba(np.ma.masked_invalid(found.values * factor))
    axes.add_collection(PolyCollection(squares, facecolors=paint, edgecolors=paint, linewidths=0.2))
    axes.autoscale_view()
    axes.margins(0.01)
    title = fields.FIELDS[name].title + (f", {part}" if part else "")
    figure.colorbar(mappable, ax=axes, label=f"{title.lower()}, {label}" if label else title.lower())
    third = next(axis for axis in "xyz" if axis not in found.axes)
    axes.set(xlabel=f"{found.axes[0]}, {metres}", ylabel=f"{found.axes[1]}, {metres}")
    axes.set_title(f"{title} at {third} = {found.at * metre:.4g} {metres} {at(results, step)}")
    return figure
