"""Pictures of a field of a plate or of a body in space. A figure is returned, never shown.

A notebook shows the last frame of results.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from numpy.typing import NDArray

from pdmesh.model.cracked_damage import CRACKED
from pdmesh.plain_figure import Figure
from pdpost.figures import slice_figure
from pdpost.figures.colours import Colours, colours, mappable, title
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Sheet, border, box_of, hidden, legend, mark, paint, seen, shape, sheet
from pdpost.figures.style import TORN, UNKNOWN, narrow, styled, written
from pdsolve.measures import fields
from pdsolve.measures.cracked_nodes import cracked_damage_of
from pdsolve.measures.frame_steps import last_frame
from pdsolve.results import Results

DPI = 110


class Shown(NamedTuple):
    """A component of a field as it is drawn."""

    values: NDArray[np.float64]  # (n,) SI; NaN: none
    torn: NDArray[np.bool_]  # (n,) nodes whose value says nothing, see `fields.find_unreliable_nodes`
    cracked_damage: float = CRACKED  # damage above which this is so


def field(
    results: Results,
    name: str | None = None,
    step: int | None = None,
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    window: Box | None = None,
    shown: Shown | None = None,
    hide: Collection[str] = (),
) -> Figure:
    """The field `name` (default: damage, or the amount that diffuses) after `step` (default: the last frame).

    Each node is drawn as its Voronoi cell. `part` is the field's component, `scale` the factor on displacements (0:
    undeformed), `largest` the end of the colour range in SI units, `window` the part in view, m, `shown` the component
    if the caller has it, `hide` the lines left out: cracks, zone. A body in space is drawn whole and undeformed on
    three planes through its middle; each node that a plane cuts is a square. Raises FieldError, and ResultsError naming
    what is available.
    """
    step = last_frame(results) if step is None else step
    name = name or fields.default_field_name(results, step)
    part = fields.choose_component(name, part, results.dimension)
    shown = values_of(results, name, step, part) if shown is None else shown
    if results.dimension == 3:
        return slice_figure.sections(results, name, step, part, np.where(shown.torn, np.nan, shown.values), largest)
    where = hidden(shape(results, step, scale), hide)
    on = sheet(window or box_of([where]))
    range_of = colours(name, part, shown.values[~shown.torn & seen(where.position, on.box)], largest)
    paint(on, where, shown.values * range_of.factor, bar(on, range_of), shown.torn)
    border(on, where)
    mark(on, where)
    legend(on, *explained(shown, seen(where.position, on.box)))
    on.axes.set_title(title(results, name, part, step, scale))
    return on.figure


def values_of(results: Results, name: str, step: int, part: str) -> Shown:
    """A component of a field after `step`, with the nodes where it is unreliable. Raises ResultsError."""
    values, torn = (
        fields.field_values(results, name, step, part or None),
        fields.find_unreliable_nodes(results, name, step),
    )
    return Shown(values, torn, cracked_damage_of(results)) if torn.any() else Shown(values, torn)


def explained(shown: Shown, where: NDArray[np.bool_] | bool = True) -> list[tuple[str, str]]:
    """Legend entries (colour, words) for the nodes in `where` (n,) whose value is not on the colour bar."""
    unknown = where & ~shown.torn & ~np.isfinite(shown.values)
    entries = []
    for colour, nodes, words in (
        (TORN, where & shown.torn, f"left out, more than {shown.cracked_damage:.2g} of the bonds gone"),
        (UNKNOWN, unknown, "too few bonds for a value"),
    ):
        if nodes.any():
            entries.append((colour, f"{words}: {int(nodes.sum())} nodes"))
    return entries


def bar(on: Sheet, shown: Colours) -> ScalarMappable:
    """Put a colour bar beside the plate; returns the mappable from numbers, in the label's unit, to colours."""
    painted = mappable(shown)
    arrow = 0.1 / (on.axes.get_position().height * on.figure.get_figheight())
    label = shown.full_label.replace(", ", ",\n") if narrow() else shown.full_label
    on.figure.colorbar(painted, cax=beside(on), label=label, extend=shown.beyond, extendfrac=arrow)
    return painted


def beside(on: Sheet) -> Axes:
    """Axes for a colour bar, to the right of the plate."""
    place = on.axes.get_position()
    width = on.figure.get_figwidth()
    return on.figure.add_axes((place.x1 + 0.12 / width, place.y0, 0.13 / width, place.height))


def notebook_png(results: Results) -> bytes | None:
    """PNG of the damage, or of the amount that diffuses, in the last frame; None without a frame."""
    if not len(results.frames()[0]):
        return None
    with styled():
        return written(field(results), "png", DPI)
