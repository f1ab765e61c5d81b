"""Pictures of a field, with matplotlib: which colours, which unit, what is written. A figure is never shown."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdmesh.files import write_atomically
from pdpost import fields
from pdpost.sheets import UNKNOWN, Sheet, box_of, paint, prefixed, shape, sheet
from pdsolve.results import Results

STYLE = {
    "font.size": 9,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.titlesize": 9,
    "savefig.dpi": 200,
}
USUAL = 99.5  # per cent of the nodes; colours end there where the others reach more than twice as far
PARTS = {"x": "x", "y": "y", "largest": "largest principal", "smallest": "smallest principal", "mises": "von Mises"}
POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class FigureError(ValueError):
    """A picture that cannot be drawn; the message says what was found and what was expected."""


class Colours(NamedTuple):
    """How a field's numbers are shown."""

    low: float  # SI
    high: float
    cmap: str
    factor: float  # from SI to the unit of the label
    label: str
    beyond: str  # which ends are arrows: "neither", "min", "max", "both"


def styled(style: Mapping[str, str]) -> dict[str, object]:
    """The house style with a user's matplotlib settings over it. Raises FigureError for one it does not know."""
    for name, value in style.items():
        if name not in matplotlib.rcParams:
            raise FigureError(f"--set {name}: found no such matplotlib setting, expected one such as savefig.dpi")
        try:
            matplotlib.RcParams({name: value})
        except ValueError as error:
            raise FigureError(f"--set {name}={value}: {error}") from None
    return STYLE | dict(style)


def draw(
    results: Results,
    name: str,
    step: int,
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    values: NDArray[np.float64] | None = None,
) -> Figure:
    """The field called `name` after `step`: each node a square the size of its spacing.

    `part` is the field's component, `scale` what displacements are multiplied by (0: the reference), `largest` where
    the colours end, in SI units, `values` (n,) the component's if they are known already. Raises FieldError, and
    ResultsError, naming what there is.
    """
    part = fields.component(name, part)
    if values is None:
        values = fields.values(results, name, step, part or None)
    where = shape(results, step, scale)
    on = sheet(box_of(results, [where]))
    shown = colours(name, part, values, largest)
    mappable = bar(on, shown)
    paint(on, where, values * shown.factor, mappable)
    on.axes.set_title(title(results, name, part, step, scale))
    return on.figure


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


def unit(name: str, largest: float) -> tuple[float, str]:
    """A factor and a unit for numbers up to `largest`: with a prefix, or a power of ten where none is usual."""
    factor, prefix = prefixed(largest)
    power = -round(np.log10(factor))
    if power and (not name or (power > 0 and name.startswith("m/"))):
        return factor, f"10{str(power).translate(POWERS)} {name}".rstrip()
    return factor, prefix + name


def bar(on: Sheet, shown: Colours) -> ScalarMappable:
    """Put a bar of colours beside the plate; what it returns turns numbers in the label's unit into colours."""
    low, high = shown.low * shown.factor, shown.high * shown.factor
    cmap = colormaps[shown.cmap].with_extremes(bad=UNKNOWN)
    mappable = ScalarMappable(Normalize(low, high if high > low else low + 1.0), cmap)
    arrow = 0.1 / (on.axes.get_position().height * on.figure.get_figheight())
    on.figure.colorbar(mappable, cax=beside(on), label=shown.label, extend=shown.beyond, extendfrac=arrow)
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
    return f"{caption(name, part)} {at(results, step, scale)}"


def at(results: Results, step: int, scale: float = 0.0) -> str:
    """When a picture is, and how deformed, in the unit of the run's last frame."""
    time_step = float(results.meta()["time_step"])
    _, times = results.frames()
    factor, prefix = prefixed(float(times[-1]) if len(times) else step * time_step)
    when = f"at {step * time_step * factor:.4g} {prefix}s (step {step})"
    return when if scale in (0.0, 1.0) else f"{when}, {scale:g} times the displacement"


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's suffix, the same bytes each time. Raises FigureError."""
    kind = check_format(path)
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}
    picture = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "pdpost"}):
        figure.savefig(picture, format=kind, bbox_inches="tight", metadata=undated.get(kind))
    write_atomically(path, picture.getvalue())


def check_format(path: Path) -> str:
    """The format of the path's suffix. Raises FigureError, naming those there are, if there is none."""
    formats = Figure().canvas.get_supported_filetypes()
    kind = path.suffix.lower().removeprefix(".")
    if kind not in formats:
        raise FigureError(f"{path}: found suffix '{path.suffix}', expected one of .{', .'.join(sorted(formats))}")
    return kind
