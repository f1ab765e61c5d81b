"""Numbers of numpy and the like as Python's own, so that every call of a scene takes them and every file holds them.

Arrays become tuples. Values are known by their `dtype`, so that reading a file does not import numpy.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec

PLAIN = frozenset({float, int, str, bool, type(None)})


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
