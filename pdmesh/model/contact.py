"""Bodies that bonds do not join, and how they touch: parts of the grid file."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from pdmesh.model.plain_numbers import PlainStruct
from pdmesh.model.timed_selection import Amount, Id, Positive, Share, Timed

Spin = float | tuple[float, float, float]  # rad/s, anticlockwise; of a body in space about x, y, z
Restitution = Annotated[float, msgspec.Meta(ge=0.1, le=1)]  # the stable step falls with it

REST = "plate"  # the body of the nodes that no other has


class BodyNodes(PlainStruct, frozen=True, forbid_unknown_fields=True):
    """A body besides the first one, by the ids of its nodes."""

    name: str
    nodes: tuple[Id, ...]


class Contact(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How bodies, and the faces of cracks, push each other apart."""

    stiffness: Positive = 15.0  # of a pair of nodes, in micromoduli over their horizon
    distance: Share = 1.0  # at which pairs begin to touch, in spacings
    friction: Amount = 0.0  # Coulomb's coefficient
    restitution: Restitution = 1.0  # of pairs of nodes: rigid bodies show it, those that deform rebound with more


class RigidBody(Timed, frozen=True, kw_only=True, tag="rigid", tag_field="kind"):
    """A body that moves as one: its nodes, all those of a body, have no bonds.

    What is `held` keeps its velocity, times the factor of the profile; what is not moves freely from time 0 on.
    """

    mass: Positive | None = None  # kg/m, of a body in space kg, shared by its cells; None: only if all is held
    x: float = 0.0  # m/s, of the centre of mass at time 0
    y: float = 0.0
    z: float = 0.0
    spin: Spin = 0.0
    held: tuple[Literal["x", "y", "z", "spin"], ...] = ()
    radius: Positive | None = None  # m: its surface is a circle or sphere about its centre of mass; None: its nodes'

    def ways(self, dimension: int) -> tuple[str, ...]:
        """What it can have `held` in the plane (2) or in space (3)."""
        return (*"xyz"[:dimension], "spin")


def wrong_spin(spin: Spin, dimension: int) -> str | None:
    """What is wrong with a spin in the plane (2) or in space (3): place, found and expected."""
    if dimension == 2 and isinstance(spin, tuple):
        return f"spin has {len(spin)} numbers; give one in a plate"
    if dimension == 3 and not isinstance(spin, tuple) and spin:
        return "spin is one number; give those about x, y and z in a body in space"
    return None
