"""Supports that push back: springs to the ground, and pins on which a hole turns. Parts of the grid file."""

from __future__ import annotations

from typing import Annotated

import msgspec

from pdmesh.model.timed_selection import Point, Positive, PositiveInt, Selection

Resistance = Annotated[tuple[Annotated[float, msgspec.Meta(ge=0)], ...], msgspec.Meta(min_length=2, max_length=3)]


class Spring(Selection, frozen=True, kw_only=True, tag="spring", tag_field="kind"):
    """An elastic bed (Winkler): springs between nodes and the ground, without force where nothing has moved.

    ``stiffness``, traction over displacement along each axis, N/m^3, acts over ``rows`` rows of nodes;
    ``body_stiffness``, body force over displacement, N/m^4, in a surface or a solid. ``length`` (m) of the supported
    edge, or ``surface`` (m^2) of a face, makes the total exact. Their nodes' bonds do not break unless ``breakable``.
    """

    stiffness: Resistance | None = None
    body_stiffness: Resistance | None = None
    rows: PositiveInt = 1
    length: Positive | None = None
    surface: Positive | None = None
    breakable: bool = False


class Pin(Selection, frozen=True, kw_only=True, tag="pin", tag_field="kind"):
    """A pin in a hole of a plate: the nodes move as a rigid ring that turns freely about ``centre``, m, which stays.

    Their bonds do not break unless ``breakable``.
    """

    centre: Point = (0.0, 0.0)
    breakable: bool = False


def wrong_spring(spring: Spring, dimension: int) -> str | None:
    """What a spring support cannot be: place, found and expected; None if it can."""
    stiffnesses = {"stiffness": spring.stiffness, "body_stiffness": spring.body_stiffness}
    present = {name: along for name, along in stiffnesses.items() if along is not None}
    if len(present) != 1:
        return f": {' and '.join(present) or 'none'} given; give one of {', '.join(stiffnesses)}"
    ((name, along),) = present.items()
    if len(along) != dimension:
        return f".{name} has {len(along)} numbers; give {dimension}"
    if not any(along):
        return f".{name} is 0 along every axis; use more along one"
    extent = "surface" if dimension == 2 else "length"
    if getattr(spring, extent) is not None:
        return f".{extent} cannot be used in {'a plate' if dimension == 2 else 'a body in space'}; leave it out"
    return None
