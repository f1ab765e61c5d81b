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

    stiffness: Positive = 15.0  # factor f of the penalty stiffness f c V^2 / (3 spacings) of two nodes, with the
    # micromodulus c and the volume V of a cell
    distance: Share = 1.0  # distance below which two nodes repel each other, divided by the mean of their spacings
    friction: Amount = 0.0  # Coulomb's coefficient of friction
    restitution: Restitution = 1.0  # coefficient of restitution of pairs of nodes; bodies that deform rebound faster


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
