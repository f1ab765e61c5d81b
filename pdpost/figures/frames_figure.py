"""Several frames of a field, of one run or of several, on one sheet with one colour range."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import matplotlib
import numpy as np

from pdmesh.plain_figure import Figure
from pdpost.figures import colours, field_figure
from pdpost.figures.raster import Box
from pdpost.figures.sheets import border, box_of, hidden, mark, on_axes, paint, patch, seen, shape
from pdpost.figures.style import narrow
from pdsolve.measures import fields
from pdsolve.measures.embedded_model import moment
from pdsolve.results import Results

TITLE, AROUND = 0.25, 0.9  # inches: above each picture; for axes and legend
BAR = 0.9  # inches, of the bar of colours
LABEL = 0.6  # inches, of numbers and words beside the first column


class Panel(NamedTuple):
    """A frame of a run and what stands above it."""

    results: Results
    step: int
    title: str


def frames(
    results: Results,
    name: str,
    steps: Sequence[int],
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    window: Box | None = None,
    hide: Collection[str] = (),
) -> Figure:
    """The field `name` after each of `steps` of one run; see `panels`."""
    shown = [Panel(results, step, moment(results, step, "µs")) for step in steps]
    return panels(shown, name, part=part, scale=scale, largest=largest, window=window, hide=hide)


def panels(
    panels: Sequence[Panel],
    name: str,
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    window: Box | None = None,
    hide: Collection[str] = (),
) -> Figure:
    """The field `name` of frames, in rows and columns; other arguments are those of `field_figure.field`.

    The colour range ends at the usual largest value of all frames. Raises FieldError, and ResultsError naming what is
    available.
    """
    part = fields.choose_component(name, part)
    shots = [field_figure.values_of(panel.results, name, panel.step, part) for panel in panels]
    shapes = [hidden(shape(panel.results, panel.step, scale), hide) for panel in panels]
    box = window or box_of(shapes)
    visible_values = [
        shot.values[~shot.torn & seen(where.position, box)] for shot, where in zip(shots, shapes, strict=True)
    ]
    range_of = colours.colours(name, part, np.concatenate(visible_values), largest)
    mappable = colours.mappable(range_of)
    figure, columns = _figure(box, len(panels))
    rows = -(-len(panels) // columns)
    panel_axes = [figure.add_subplot(rows, columns, number + 1) for number in range(len(panels))]
    for number, (panel, shot, where) in enumerate(zip(panels, shots, shapes, strict=True)):
        on = on_axes(panel_axes[number], box)
        paint(on, where, shot.values * range_of.factor, mappable, shot.torn)
        border(on, where)
        mark(on, where)
        on.axes.set_title(panel.title)
        if number % columns:
            on.axes.set_ylabel("")
            on.axes.tick_params(labelleft=False)
        if number + columns < len(panels):
            on.axes.set_xlabel("")
            on.axes.tick_params(labelbottom=False)
    figure.colorbar(
        mappable, ax=panel_axes, label=range_of.full_label, extend=range_of.beyond, fraction=0.05, aspect=25
    )
    handles, _ = panel_axes[0].get_legend_handles_labels()
    patches = [(colour, words.split(":")[0]) for shot in shots for colour, words in field_figure.explained(shot)]
    handles += [patch(colour, words) for colour, words in dict.fromkeys(patches)]
    if handles:
        columns = 1 if narrow() else 3
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize="small")
    return figure


def _figure(box: Box, count: int) -> tuple[Figure, int]:
    """A figure for `count` plates and its number of columns: wide plates are stacked, high ones stand side by side."""
    width = float(matplotlib.rcParams["figure.figsize"][0])
    aspect = (box[3] - box[1]) / (box[2] - box[0])
    flat = 0.7 if narrow() else 0.25
    most = 1 if aspect < flat else 2 if aspect < 1.2 or narrow() else 3
    columns = min(count, most)
    tall = -(-count // columns) * ((width - BAR - LABEL) / columns * aspect + TITLE) + AROUND
    return Figure(figsize=(width, tall), layout="compressed"), columns
