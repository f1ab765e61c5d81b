"""Fatigue of bonds under a load that repeats, after S. A. Silling and A. Askari, SAND2014-18590 (2014).

Every bond begins with a remaining life of 1, and breaks when none is left. A cycle of N takes of it

    growth:      A eps^m      next to damage
    initiation:  A1 eps^m1    elsewhere

where eps is the range of the bond's stretch within a cycle; up to `threshold` and `endurance`, nothing. The first is
Paris's line da/dN = C dK^m with the same exponent, whose C is proportional to A; the second is the line of Wöhler's
diagram, with the life 1 / (A1 eps^m1).

Cracks of particles grow by that line itself: C and m are given, and K is that of the tip.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import msgspec

from pdmesh.model.plain_numbers import PlainStruct
from pdmesh.model.timed_selection import Amount, Positive, Share

Exponent = Annotated[float, msgspec.Meta(ge=1, le=100)]
MOST_CYCLES = 1e15


class Fatigue(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How bonds tire, and the cycle of the loads."""

    A: Positive | None = None  # life that a bond next to damage loses in a cycle is A eps^m, with the range eps of its
    # stretch; none: A1 eps^m1 everywhere
    m: Exponent | None = None  # exponent of the range in A eps^m, and of dK in C dK^m
    C: Positive | None = (
        None  # m/cycle: growth of crack particles per cycle at dK = 1 Pa m^0.5; the C of da/dN = C dK^m
    )
    threshold_K: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # Pa m^0.5: range of K up to which crack particles do not
    # grow
    A1: Positive | None = None  # life that a bond not next to damage loses in a cycle is A1 eps^m1; none: such a bond
    # loses none
    m1: Exponent | None = None  # exponent of the range in A1 eps^m1
    endurance: Amount = 0.0  # range of stretch up to which a bond not next to damage loses no life
    threshold: Amount = 0.0  # range of stretch up to which a bond next to damage loses no life
    damaged: Share = 0.25  # damage of a node from which the bonds within a horizon of it are next to damage
    ratio: Annotated[float, msgspec.Meta(ge=-1, lt=1)] = 0.0  # load ratio R: smallest loads of a cycle divided by the
    # largest
    cycles: Annotated[float, msgspec.Meta(gt=0, le=MOST_CYCLES)] = MOST_CYCLES  # number of cycles at which the run ends
    blocks: tuple[tuple[Positive, Share], ...] = ()  # load blocks: pairs of a number of cycles and a factor on the
    # loads, applied one after the other and repeated


class Cycled(NamedTuple):
    """What one step of jumps came to; checkpoints hold a row for each."""

    step: int
    iterations: int  # in all
    residual: float  # what is left of the forces over those from outside
    cycles: float  # since the start
    broken: int  # directed bonds since the start
