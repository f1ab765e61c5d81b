"""Interfaces: bonds between two regions, or across drawn faces, with a toughness, strength and stiffness of their own.

What an interface does not give, its bonds have of the materials at their ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pdmesh.model.base_structs import PlainStruct, Positive
from pdmesh.model.mechanical_conditions import Face
from pdmesh.spelling import meant

REST, ANY = "rest", "*"  # in place of the name of a region: the nodes of no region; any nodes
FLAT = 1e-9  # of the longest edge squared: less is no triangle but a line
WORDS = {2: "a segment x0, y0, x1, y1", 3: "a triangle of three places"}


class Interface(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Bonds between two regions or across faces. G0 is spent by a cut along it, whatever its angle to the lattice."""

    name: str = ""
    between: tuple[str, str] | None = None  # names of regions; "rest": the nodes of no region, "*": any other nodes
    faces: tuple[Face, ...] = ()  # in place of regions: segments x0, y0, x1, y1, in space corners of triangles, m
    G0: Positive | None = None  # J/m^2: fracture energy; none: that of the materials
    f_t: Positive | None = None  # Pa: tensile strength of cohesive bonds; none: that of the materials
    stiffness: Positive = 1.0  # of its bonds, over that of the materials


def wrong_interface(interface: Interface, names: Sequence[str], dimension: int) -> str | None:
    """What is wrong with an interface of a model whose regions have these names: place below it and what to use."""
    if (interface.between is None) == (not interface.faces):
        return ": neither or both of between and faces are given; give one of them"
    if interface.G0 is interface.f_t is None and interface.stiffness == 1:
        return ": none of G0, f_t and stiffness is given; give one of them"
    for name in ("G0", "f_t", "stiffness"):
        value = getattr(interface, name)
        if value is not None and not math.isfinite(value):
            return f".{name} is {value}; use a finite number"
    if interface.between is None:
        return _wrong_face(interface, dimension)
    known = (*names, REST, ANY)
    for at, name in enumerate(interface.between):
        if name not in known or not name:
            near = meant(name, known)
            hint = f" (did you mean '{near}'?)" if near else ""
            return f".between[{at}]: no region is called '{name}'; use one of {', '.join(filter(None, known))}{hint}"
    first, second = interface.between
    if first == second != ANY and names.count(first) < 2:
        return f".between: no bond goes from '{first}' to another '{first}'; use two regions, or '{first}' and '*'"
    return None


def _wrong_face(interface: Interface, dimension: int) -> str | None:
    for at, face in enumerate(interface.faces):
        if len(face) != dimension**2:
            return f".faces[{at}] has {len(face)} numbers; use {WORDS[dimension]}"
        if not all(map(math.isfinite, face)):
            return f".faces[{at}] is {face}; use finite numbers, m"
        corners = [face[first : first + dimension] for first in range(0, len(face), dimension)]
        if len(set(corners)) < dimension:
            return f".faces[{at}]: two corners are in one place; use {WORDS[dimension]}"
        if dimension == 3 and _is_flat(corners):
            return f".faces[{at}]: its corners are on one line; use {WORDS[dimension]}"
    return None


def _is_flat(corners: Sequence[Sequence[float]]) -> bool:
    """Whether three corners in space are on one line."""
    (ax, ay, az), (bx, by, bz) = ([p - q for p, q in zip(each, corners[0], strict=True)] for each in corners[1:])
    area = math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    longest = max(math.dist(corners[at - 1], corners[at]) for at in range(3))
    return not area > FLAT * longest**2
