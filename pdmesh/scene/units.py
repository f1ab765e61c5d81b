"""Units of length of a drawing."""

from __future__ import annotations

from typing import Any, NamedTuple


class Unit(NamedTuple):
    """A unit of length, `over` / `under` metres: two numbers that keep a decimal fraction exact to rounding."""

    over: int
    under: int

    def metres(self, length: Any) -> Any:
        """A length in this unit, or an array of them, in metres."""
        return length * self.over / self.under

    def of(self, metres: float) -> float:
        """A length in metres, expressed in this unit."""
        return metres * self.under / self.over


UNITS = {
    "m": Unit(1, 1),
    "cm": Unit(1, 100),
    "mm": Unit(1, 1000),
    "um": Unit(1, 1_000_000),
    "in": Unit(254, 10_000),
    "ft": Unit(3048, 10_000),
}
