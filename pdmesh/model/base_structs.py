"""Base structs of grid files: plain numbers, selections of nodes, time profiles.

Numbers of numpy and the like become Python's own, so that every call of a scene takes them and every file holds them.
Arrays become tuples. Values are known by their `dtype`, so that reading a file does not import numpy.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import msgspec

PLAIN = frozenset({float, int, str, bool, type(None)})
Positive = Annotated[float, msgspec.Meta(gt=0)]
Id = Annotated[int, msgspec.Meta(ge=-(2**62), le=2**62)]
MOST_STEPS = 2**31 - 1  # what a broken bond can remember
PositiveInt = Annotated[int, msgspec.Meta(gt=0, le=MOST_STEPS)]
Amount = Annotated[float, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(gt=0, le=1)]
Point = tuple[float, float]
Vector = Annotated[tuple[float, ...], msgspec.Meta(min_length=2, max_length=3)]  # x, y and, in space, z
Box = Annotated[tuple[float, ...], msgspec.Meta(min_length=4, max_length=6)]  # its low corner, then its high one, m


def plain(value: Any) -> Any:
    """The value with Python's own numbers in place of those of numpy, also in sequences and tables."""
    if type(value) in PLAIN:
        return value
    if hasattr(value, "dtype") and hasattr(value, "tolist"):
        return _tuples(value.tolist())
    if type(value) in (tuple, list):
        return value if set(map(type, value)) <= PLAIN else type(value)(map(plain, value))
    if type(value) is dict:
        return {name: plain(item) for name, item in value.items()}
    return value


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


class PlainStruct(msgspec.Struct, frozen=True):
    """A struct that holds Python's own numbers, whatever numbers it is made of."""

    def __post_init__(self) -> None:
        for name, value in zip(self.__struct_fields__, msgspec.structs.astuple(self), strict=True):
            if type(value) not in PLAIN and (plain_value := plain(value)) is not value:
                msgspec.structs.force_setattr(self, name, plain_value)


class PlainFields:
    """A frozen dataclass that holds Python's own numbers, whatever numbers it is made of."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if type(value) not in PLAIN and (plain_value := plain(value)) is not value:
                object.__setattr__(self, field.name, plain_value)


class Selection(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """Some of a grid's nodes, listed by id or inside a box."""

    name: str = ""
    nodes: tuple[Id, ...] | None = None
    box: Box | None = None  # x0, y0, x1, y1 or x0, y0, z0, x1, y1, z1, m


class Timed(Selection, frozen=True, kw_only=True):
    """A condition on nodes whose values are multiplied by a factor in time.

    `profile` holds points (time in s, factor): linear between them, constant before the first and after the last; an
    empty profile is the constant 1.
    """

    profile: tuple[Point, ...] = ()
