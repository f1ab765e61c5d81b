"""Selections of nodes with a time profile: the base structs of grid files."""

from __future__ import annotations

from typing import Annotated

import msgspec

from pdmesh.model.plain_numbers import PlainStruct

Positive = Annotated[float, msgspec.Meta(gt=0)]
Id = Annotated[int, msgspec.Meta(ge=-(2**62), le=2**62)]
MOST_STEPS = 2**31 - 1  # what a broken bond can remember
PositiveInt = Annotated[int, msgspec.Meta(gt=0, le=MOST_STEPS)]
Amount = Annotated[float, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(gt=0, le=1)]
Point = tuple[float, float]
Vector = Annotated[tuple[float, ...], msgspec.Meta(min_length=2, max_length=3)]  # x, y and, in space, z
Box = Annotated[tuple[float, ...], msgspec.Meta(min_length=4, max_length=6)]  # its low corner, then its high one, m


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
