"""Interfaces: bonds between two regions, or across drawn faces, with a toughness, strength and stiffness of their own.

What an interface does not give, its bonds have of the materials at their ends.
"""

from __future__ import annotations

from collections.abc import Sequence

from pdmesh.model.base_structs import PlainStruct, Positive
from pdmesh.model.mechanical_conditions import Face
from pdmesh.spelling import meant

REST, ANY = "rest", "*"  # in place of the name of a region: the nodes of no region; any nodes
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
    known = (*names, REST, ANY)
    for at, name in enumerate(interface.between or ()):
        if name not in known or not name:
            near = meant(name, known)
            hint = f" (did you mean '{near}'?)" if near else ""
            return f".between[{at}]: no region is called '{name}'; use one of {', '.join(filter(None, known))}{hint}"
    for at, face in enumerate(interface.faces):
        if len(face) != dimension**2:
            return f".faces[{at}] has {len(face)} numbers; use {WORDS[dimension]}"
        corners = [face[first : first + dimension] for first in range(0, len(face), dimension)]
        if len(set(corners)) < dimension:
            return f".faces[{at}]: two corners are in one place; use {WORDS[dimension]}"
    return None
