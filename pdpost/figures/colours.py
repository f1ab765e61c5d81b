"""How a field is shown: colours, unit with a convenient prefix, and title; faces of cracks by when they opened."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from pdpost.figures.style import UNKNOWN, narrow
from pdsolve.measures import fields
from pdsolve.measures.embedded_model import counts_load_steps, moment
from pdsolve.results import Results

if TYPE_CHECKING:
    from pdsolve.measures.crack_faces import CrackSurface  # which SciPy comes with

PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
MICRO = re.compile(r"(?<=[0-9] )u(?=s\b|m\b)")  # of a number's unit
POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SHARES = ("damage", "separation")  # fields of bonds that are gone
STEPS = (0.05, 0.1, 0.2, 0.5, 1.0)  # ends of the colours of shares
WHOLE = 1e-3  # Pa: smaller pressures have a power of ten
USUAL = 99.5  # per cent of the nodes; colours end there where the others reach more than twice as far
ROUND_OFF = 1e-6  # of the largest: what is so little beyond the colours is not told of
PARTS = {"largest": "largest principal", "smallest": "smallest principal", "mises": "von Mises"}
CMAP = "viridis"
NEARLY = 0.9  # of the area: what opens later has the last colour


def spelled(text: str) -> str:
    """A text of the terminal with the units spelled for pictures and pages: mm², µs, MPa m^½."""
    return MICRO.sub("µ", text).replace("m^0.5", "m^½").replace("^2", "²").replace("^3", "³")


def ten_to(power: int) -> str:
    """A power of ten, such as 10⁻³."""
    return f"10{str(power).translate(POWERS)}"


def prefixed(largest: float) -> tuple[float, str]:
    """A factor and an SI prefix for numbers up to `largest`."""
    power = int(np.floor(np.log10(largest) / 3)) * 3 if largest > 0 else 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 10.0**-power, PREFIXES[power]


def unit(name: str, largest: float) -> tuple[float, str]:
    """A factor and a unit for numbers up to `largest`: with a prefix, or a power of ten where no prefix is usual.

    No prefix is usual for temperatures, for 1000 s and more, for speeds of 1000 m/s and more, and for pressures and
    stress intensities below 1 Pa.
    """
    if name == "K" or (name == "s" and largest >= 1):
        return 1.0, name
    if name.startswith("Pa") and WHOLE <= largest < 1:
        return 1.0, name
    factor, prefix = prefixed(largest)
    power = -round(np.log10(factor))
    unusual = not name or (power > 0 and name.startswith("m/")) or (power < 0 and name.startswith("Pa"))
    if power and unusual:
        return factor, f"{ten_to(power)} {name}".rstrip()
    return factor, prefix + name


def scaled(values: Iterable[np.ndarray], name: str) -> tuple[float, str]:
    """A factor for values and their unit with its prefix, such as 1e3 and "mm"; see `unit`."""
    sizes = [float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) for array in values]
    return unit(name, max(sizes, default=0.0))


def scaled_times(times: Iterable[np.ndarray], counts_load_steps: bool) -> tuple[float, str]:
    """A factor for times and the label of their axis, "load step" where times are those of load steps."""
    factor, unit = (1.0, "") if counts_load_steps else scaled(times, "s")
    return factor, "load step" if counts_load_steps else f"time, {unit}"


class Colours(NamedTuple):
    """How a field's values are shown."""

    low: float  # SI
    high: float
    cmap: str
    factor: float  # from SI to the unit of the label
    label: str
    beyond: str  # which ends are arrows: "neither", "min", "max", "both"
    ends: str = ""  # what the field reaches beyond the colours, in words

    @property
    def full_label(self) -> str:
        """The label of a bar: of what the colours are, and what the field reaches where they end before."""
        return f"{self.label}\n({self.ends})" if self.ends else self.label


def colours(name: str, part: str, values: NDArray[np.float64], largest: float | None = None) -> Colours:
    """Range and palette of a component: signed values symmetric about 0, temperatures from the lowest, others from 0.

    The range ends at `largest` or, without it, at the usual largest value, for damage at a round number from the
    largest value up; the label names what is beyond.
    """
    finite = values[np.isfinite(values)]
    high = largest or (share_end(finite) if name in SHARES else usual(finite))
    signed = fields.component_is_signed(name, part)
    low = -high if signed else float(finite.min(initial=high)) if name == "temperature" else 0.0
    slack = ROUND_OFF * high
    above, below = bool((finite > high + slack).any()), bool((finite < low - slack).any())
    beyond = ("both" if below else "max") if above else ("min" if below else "neither")
    factor, label = unit(fields.FIELDS[name].unit, high)
    if name in SHARES:
        factor, label = 1.0, ""
    cmap = "magma_r" if name in SHARES else "coolwarm" if signed else "viridis"
    text = caption(name, part)
    text = text[0].lower() + text[1:]
    extremes = ("smallest", finite.min(initial=np.inf), below), ("largest", finite.max(initial=-np.inf), above)
    ends = [f"{word} {factor * value:.4g}" for word, value, far in extremes if far]
    return Colours(low, high, cmap, factor, f"{text}, {label}" if label else text, beyond, ", ".join(ends))


def usual(values: NDArray[np.float64]) -> float:
    """Upper end of a colour range: the largest |value| (k,), or the 99.5 % quantile if a few are far above."""
    size = np.abs(values)
    largest = float(size.max(initial=0.0))
    most = float(np.percentile(size, USUAL)) if len(size) else 0.0
    return most if 0 < 2 * most < largest else largest


def share_end(values: NDArray[np.float64]) -> float:
    """Upper end of the colours of shares (k,): the first of `STEPS` that none exceeds; 1 where all are 0."""
    largest = float(values.max(initial=0.0))
    return next((end for end in STEPS if 0 < largest <= end * (1 + ROUND_OFF)), 1.0)


def mappable(shown: Colours) -> ScalarMappable:
    """A matplotlib mappable from numbers, in the label's unit, to colours."""
    low, high = shown.low * shown.factor, shown.high * shown.factor
    cmap = colormaps[shown.cmap].with_extremes(bad=UNKNOWN)
    return ScalarMappable(Normalize(low, high if high > low else low + 1.0), cmap)


def caption(name: str, part: str) -> str:
    """Name of a component as the title shows it."""
    text = fields.FIELDS[name].title
    return text if part in ("", "magnitude") else f"{text}, {PARTS.get(part, part)}"


def title(results: Results, name: str, part: str, step: int, scale: float) -> str:
    """Title of a picture."""
    return ("\n" if narrow() else " ").join([caption(name, part), at(results, step, scale)])


def at(results: Results, step: int, scale: float = 0.0) -> str:
    """When a picture is, and its deformation scale."""
    if counts_load_steps(results):
        when = moment(results, step)
    else:  # in the time unit of the run's last frame
        time_step = float(results.meta()["time_step"])
        _, times = results.frames()
        factor, prefix = prefixed(min(float(times[-1]) if len(times) else step * time_step, 1.0))  # no ks
        time = step * time_step * factor
        when = f"{time:{'.4g' if time < 9999.5 else '.0f'}} {prefix}s (step {step})"
    return f"at {when}" if scale in (0.0, 1.0) else f"at {when}, {scale:g} times the displacement"


class Opening(NamedTuple):
    """The colours of opening times, and their unit."""

    painted: ScalarMappable  # of times in that unit
    factor: float  # of that unit in a second
    label: str


def opening_colours(surface: CrackSurface, counts_load_steps: bool = False) -> Opening:
    """Colours from the first opening until nearly all of the area was open."""
    time = surface.opening_time[surface.face_opened_during_run]
    area = np.cumsum(surface.face_area[surface.face_opened_during_run])
    factor, unit = (1.0, "load step") if counts_load_steps else scaled([time], "s")
    first, last = 0.0, 1.0
    if len(time):
        first, end = float(time[0]), float(time[np.searchsorted(area, NEARLY * area[-1])])
        last = end if end > first else first + 1.0
    return Opening(ScalarMappable(Normalize(first * factor, last * factor), CMAP), factor, f"opened at, {unit}")
