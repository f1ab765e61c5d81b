"""Numbers beside axes in units with a convenient prefix."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
MICRO = re.compile(r"(?<=[0-9] )u(?=s\b|m\b)")  # of a number's unit
POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
    """A factor and a unit for numbers up to `largest`: with a prefix, or a power of ten where no prefix is usual."""
    factor, prefix = prefixed(largest)
    power = -round(np.log10(factor))
    if power and (not name or (power > 0 and name.startswith("m/"))):
        return factor, f"{ten_to(power)} {name}".rstrip()
    return factor, prefix + name


def scaled(values: Iterable[np.ndarray], unit: str) -> tuple[float, str]:
    """A factor for values and their unit with its prefix, such as 1e3 and "mm"."""
    sizes = [float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) for array in values]
    largest = max(sizes, default=0.0)
    factor, prefix = prefixed(min(largest, 1.0) if unit == "s" else largest)  # thousands of seconds have no prefix
    return factor, prefix + unit
