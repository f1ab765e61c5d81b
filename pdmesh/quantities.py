"""Numbers with units, as people type them: lengths, times and stresses become metres, seconds and pascals."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple


class Unit(NamedTuple):
    """A unit, `over` / `under` of the SI unit: two numbers that keep a decimal fraction exact to rounding."""

    over: int
    under: int

    def to_si(self, value: Any) -> Any:
        """A number in this unit, or an array of them, in the SI unit."""
        return value * self.over / self.under

    def of(self, metres: float) -> float:
        """A length in metres, expressed in this unit."""
        return metres * self.under / self.over


UNITS = {  # of lengths
    "m": Unit(1, 1),
    "cm": Unit(1, 100),
    "mm": Unit(1, 1000),
    "um": Unit(1, 1_000_000),
    "in": Unit(254, 10_000),
    "ft": Unit(3048, 10_000),
}
TIMES = {
    "s": Unit(1, 1),
    "ms": Unit(1, 1000),
    "us": Unit(1, 1_000_000),
    "ns": Unit(1, 1_000_000_000),
    "min": Unit(60, 1),
    "h": Unit(3600, 1),
}
STRESSES = {"Pa": Unit(1, 1), "kPa": Unit(1000, 1), "MPa": Unit(1_000_000, 1), "GPa": Unit(1_000_000_000, 1)}
KINDS = {  # units by the SI unit that they are converted to
    "m": UNITS,
    "s": TIMES,
    "Pa": STRESSES,
    "m/s": {"m/s": Unit(1, 1), "mm/s": Unit(1, 1000), "km/s": Unit(1000, 1)},
    "kg/m^3": {"kg/m^3": Unit(1, 1), "g/cm^3": Unit(1000, 1)},
    "J/m^2": {"J/m^2": Unit(1, 1), "N/m": Unit(1, 1), "N/mm": Unit(1000, 1), "kJ/m^2": Unit(1000, 1)},
}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?:[^\W\d_][\w/^]*)?)\s*")


def quantities(text: str, units: Mapping[str, Unit], usual: Unit | None = None) -> tuple[float, ...]:
    """The SI values of numbers between commas, such as ``0,0,50,20mm``.

    A unit counts for all numbers before it that have none; without one, numbers are in the `usual` unit, by default
    the SI unit. Raises ValueError for what is no number and for another unit.
    """
    values, unit = [], usual
    for word in reversed(text.split(",")):
        match = _number_and_unit(word)
        if match is None or (match[2] and match[2] not in units):
            raise ValueError(text)
        unit = units[match[2]] if match[2] else unit
        value = float(match[1])
        values.append(value if unit is None else float(unit.to_si(value)))
    if any(abs(value) == float("inf") for value in values):
        raise ValueError(text)
    return tuple(reversed(values))


def quantity(text: str, units: Mapping[str, Unit], usual: Unit | None = None) -> float:
    """The SI value of one number, such as ``20us``. Raises ValueError."""
    (value,) = quantities(text, units, usual) if "," not in text else ()
    return value


def number_in(text: str, unit: str) -> float:
    """The number in a text such as ``0.5mm``, in the unit of this name; a number without a unit has it already.

    The unit "" is that of pure numbers. Raises ValueError, whose message is what to use.
    """
    with suppress(ValueError):
        return float(text)
    match, units = _number_and_unit(text), next((units for units in KINDS.values() if unit in units), {})
    if match is None or match[2] not in (unit, *units):
        raise ValueError(usable(unit))
    if match[2] == unit:
        return float(match[1])
    (over, under), (own_over, own_under) = units[match[2]], units[unit]
    over, under = over * own_under, under * own_over
    common = math.gcd(over, under)
    return float(match[1]) * (over // common) / (under // common)


def usable(unit: str) -> str:
    """What a number of a unit may be, in words."""
    words = [f"in {unit}"] if unit else []
    words += [f"or with one of the units {', '.join(units)}" for units in KINDS.values() if unit in units]
    return ", ".join(["a number", *words])


def _number_and_unit(text: str) -> re.Match[str] | None:
    return NUMBER.fullmatch(text.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u"))
