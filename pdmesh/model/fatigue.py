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

    A: Positive | None = None  # share of life that a cycle of unit strain takes, next to damage; None: A1 everywhere
    m: Exponent | None = None
    C: Positive | None = None  # cracks of particles: m a cycle at 1 Pa m^0.5
    threshold_K: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # Pa m^0.5: range of K without growth of particles
    A1: Positive | None = None  # elsewhere; None: bonds tire next to damage alone
    m1: Exponent | None = None
    endurance: Amount = 0.0  # range of stretch of which nothing away from damage tires
    threshold: Amount = 0.0  # the same next to damage
    damaged: Share = 0.25  # damage of a node from which bonds within a horizon of it grow the crack
    ratio: Annotated[float, msgspec.Meta(ge=-1, lt=1)] = 0.0  # of the least load of a cycle to the largest, R
    cycles: Annotated[float, msgspec.Meta(gt=0, le=MOST_CYCLES)] = MOST_CYCLES  # then the run ends
    blocks: tuple[tuple[Positive, Share], ...] = ()  # cycles and share of the loads, one after the other, repeated


class Cycled(NamedTuple):
    """What one step of jumps came to; checkpoints hold a row for each."""

    step: int
    iterations: int  # in all
    residual: float  # what is left of the forces over those from outside
    cycles: float  # since the start
    broken: int  # directed bonds since the start
