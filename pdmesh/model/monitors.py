"""What a laboratory reads off a test: openings between two places, and load cells that sum forces."""

from __future__ import annotations

from pdmesh.model.plain_numbers import PlainStruct
from pdmesh.model.timed_selection import Vector

CRACK, ARC = "crack", "arc"  # controls: the length of cracks of particles; that of the path of an elastic body


class Gap(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A monitored opening: how much longer the distance between the nodes nearest to two places has become."""

    name: str
    ends: tuple[Vector, Vector]  # m


class LoadCell(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The sum of the forces of some conditions."""

    name: str
    of: tuple[str, ...]  # names of conditions
