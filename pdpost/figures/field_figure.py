"""Pictures of a field: which colours, which unit, what is written. A figure is never shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdmesh.model.fields import CRACKED
from pdpost.figures.labels import prefixed, unit
from pdpost.figures.raster import Box
from pdpost.figures.sheets import Sheet, border, box_of, legend, mark, paint, seen, shape, sheet
from pdpost.figures.style import TORN, UNKNOWN, narrow
from pdpost.measures import fields
from pdpost.reading.frames import last_frame
from pdsolve.results import Results

USUAL = 99.5  # per cent of the nodes; colours end there where the others reach more than twice as far
PARTS = {"x": "x", "y": "y", "largest": "largest principal", "smallest": "smallest principal", "mises": "von Mises"}


class Colours(NamedTuple):
    """How a field's numbers are shown."""

    low: float  # SI
    high: float
    cmap: str
    factor: float  # from SI to the unit of the label
    label: str
    beyond: str  # which ends are arrows: "neither", "min", "max", "both"


class Shown(NamedTuple):
    """A component of a field as it is drawn."""

    values: NDArray[np.float64]  # (n,) SI; NaN: none
    torn: NDArray[np.bool_]  # (n,) nodes whose value says nothing, see `fields.torn`


def field(
    results: Results,
    name: str = "damage",
    step: int | None = None,
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    window: Box | None = None,
    shown: Shown | None = None,
) -> Figure:
    """The field called `name` after `step`, by default the last frame's.

    Each node is a cell of the plate, what is nearer to it than to any other. `part` is the field's component, `scale`
    what displacements are multiplied by (0: the reference), `largest` where the colours end, in SI units, `window`
    what is seen, m, `shown` the component if it is known already. Raises FieldError, and ResultsError, naming what
    there is.
    """
    part = fields.component(name, part)
    step = last_frame(results) if step is None else step
    shown = values_of(results, name, step, part) if shown is None else shown
    where = shape(results, step, scale)
    on = sheet(window or box_of([where]))
    range_of = colours(name, part, shown.values[~shown.torn & seen(where.position, on.box)], largest)
    mappable = bar(on, range_of)
    paint(on, where, shown.values * range_of.factor, mappable, shown.torn)
    border(on, where)
    mark(on, where)
    legend(on, *explained(shown, seen(where.position, on.box)))
    on.axes.set_title(title(results, name, part, step, scale))
    return on.figure


def values_of(results: Results, name: str, step: int, part: str) -> Shown:
    """A component of a field after `step`, as it is drawn. Raises ResultsError."""
    return Shown(fields.values(results, name, step, part or None), fields.torn(results, name, step))


def explained(shown: Shown, where: NDArray[np.bool_] | bool = True) -> list[tuple[str, str]]:
    """Colours and words for the nodes without a place on the bar of colours, among those `where` (n,) is true."""
    unknown = where & ~shown.torn & ~np.isfinite(shown.values)
    found = []
    for colour, nodes, words in (
        (TORN, where & shown.torn, f"left out, damage above {CRACKED:g}"),
        (UNKNOWN, unknown, "too few bonds for a value"),
    ):
        if nodes.any():
            found.append((colour, f"{words}: {int(nodes.sum())} nodes"))
    return found


def colours(name: str, part: str, values: NDArray[np.float64], largest: float | None = None) -> Colours:
    """Damage from 0 to 1, signed values from minus to plus, others from 0; up to `largest`, or the usual largest."""
    finite = values[np.isfinite(values)]
    high = largest or (1.0 if name == "damage" else usual(finite))
    signed = fields.signed(name, part)
    low = -high if signed else 0.0
    above, below = bool((finite > high).any()), bool((finite < low).any())
    beyond = ("both" if below else "max") if above else ("min" if below else "neither")
    factor, label = unit(fields.FIELDS[name].unit, high)
    if name == "damage":
        factor, label = 1.0, ""
    cmap = "magma_r" if name == "damage" else "coolwarm" if signed else "viridis"
    text = caption(name, part)
    text = text[0].lower() + text[1:]
    return Colours(low, high, cmap, factor, f"{text}, {label}" if label else text, beyond)


def usual(values: NDArray[np.float64]) -> float:
    """The largest size of values (k,), or, where a few are far above the others, what 99.5 % stay below."""
    size = np.abs(values)
    largest = float(size.max(initial=0.0))
    most = float(np.percentile(size, USUAL)) if len(size) else 0.0
    return most if 0 < 2 * most < largest else largest


def bar(on: Sheet, shown: Colours) -> ScalarMappable:
    """Put a bar of colours beside the plate; what it returns turns numbers in the label's unit into colours."""
    low, high = shown.low * shown.factor, shown.high * shown.factor
    cmap = colormaps[shown.cmap].with_extremes(bad=UNKNOWN)
    mappable = ScalarMappable(Normalize(low, high if high > low else low + 1.0), cmap)
    arrow = 0.1 / (on.axes.get_position().height * on.figure.get_figheight())
    label = shown.label.replace(", ", ",\n") if narrow() else shown.label
    on.figure.colorbar(mappable, cax=beside(on), label=label, extend=shown.beyond, extendfrac=arrow)
    return mappable


def beside(on: Sheet) -> Axes:
    """A place for a bar of colours at the right of the plate."""
    place = on.axes.get_position()
    width = on.figure.get_figwidth()
    return on.figure.add_axes((place.x1 + 0.12 / width, place.y0, 0.13 / width, place.height))


def caption(name: str, part: str) -> str:
    """What a component is called."""
    text = fields.FIELDS[name].title
    return text if part in ("", "magnitude") else f"{text}, {PARTS.get(part, part)}"


def title(results: Results, name: str, part: str, step: int, scale: float) -> str:
    """What is written above a picture."""
    return ("\n" if narrow() else " ").join([caption(name, part), at(results, step, scale)])


def at(results: Results, step: int, scale: float = 0.0) -> str:
    """When a picture is, and how deformed, in the unit of the run's last frame."""
    time_step = float(results.meta()["time_step"])
    _, times = results.frames()
    factor, prefix = prefixed(float(times[-1]) if len(times) else step * time_step)
    when = f"at {step * time_step * factor:.4g} {prefix}s (step {step})"
    return when if scale in (0.0, 1.0) else f"{when}, {scale:g} times the displacement"
