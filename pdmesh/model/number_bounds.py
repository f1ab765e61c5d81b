"""Numbers that calculations can hold: neither so large nor so small that products of a few of them are lost."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import msgspec

from pdmesh.model.document import MOST

LEAST = 1e-100  # products of a few smaller ones are 0


def beyond(value: object, place: str, leave_out: Collection[str] = ()) -> str | None:
    """Place and value of the first number out of range (0 is allowed), with what was expected; None without one.

    `leave_out` names fields of the outermost struct that are not checked.
    """
    if not leave_out and _is_within(value):
        return None
    if isinstance(value, float):
        if value == 0 or LEAST <= abs(value) <= MOST:
            return None
        expected = f"a number from {-MOST:g} to {MOST:g}" if abs(value) > 1 or value != value else f"{LEAST:g} or more"
        return f"{place} is {value:g}; use {expected}"
    parts: Iterable[tuple[str, object]] = ()
    if isinstance(value, msgspec.Struct):
        names = (name for name in value.__struct_fields__ if name not in leave_out)
        parts = ((f"{place}.{name}", getattr(value, name)) for name in names)
    elif isinstance(value, tuple):
        parts = ((f"{place}[{at}]", part) for at, part in enumerate(value) if not isinstance(part, int))
    return next(filter(None, (beyond(part, at) for at, part in parts)), None)


def _is_within(value: object) -> bool:
    """Whether all numbers are in range; many regions are read in a tenth of the time that places would take."""
    if isinstance(value, float):
        return value == 0 or LEAST <= abs(value) <= MOST
    parts = value if isinstance(value, tuple) else ()
    if isinstance(value, msgspec.Struct):
        parts = msgspec.structs.astuple(value)
    return all(_is_within(part) for part in parts if not isinstance(part, int | str | None))
