"""Conditions of mechanics in grid files: loads, motions, layers that absorb waves, contact, springs and pins.

Their values may depend on the place (`pdmesh.model.values_of_place`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from pdmesh.model.base_structs import Amount, Id, PlainStruct, Point, Positive, PositiveInt, Selection, Share, Timed
from pdmesh.model.base_structs import Vector as NumbersAlongAxes
from pdmesh.model.values_of_place import Value, Vector

Spin = float | tuple[float, float, float]  # rad/s, anticlockwise; of a body in space about x, y, z
Restitution = Annotated[float, msgspec.Meta(ge=0.1, le=1)]  # the stable step falls with it
Face = Annotated[tuple[float, ...], msgspec.Meta(min_length=4, max_length=9)]  # corners, m
REST = "plate"  # the body of the nodes that no other has
Resistance = Annotated[tuple[Annotated[float, msgspec.Meta(ge=0)], ...], msgspec.Meta(min_length=2, max_length=3)]


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


class Condition(Timed, frozen=True, kw_only=True):
    """A condition on nodes. Their bonds do not break unless `breakable`."""

    breakable: bool = False


class Load(Condition, frozen=True, kw_only=True, tag="load", tag_field="kind"):
    """A body force: ``body_force`` (N/m^3), ``traction`` or ``pressure`` (Pa) over ``rows`` rows, or a total ``force``.

    A traction gives traction / (rows delta) at each node; ``length`` (m) of the loaded edge, if known, lets a solver
    make the total exact. With ``shares``, rows farther from an edge have less of a traction, as families there lack
    less. A force (N/m of a plate, N of a body in space) is shared by its nodes by area or volume.

    A pressure pushes against faces, along their normals. Each node has an area vector of them in ``area_vectors``, m or
    m^2, which points out of the material. That of a pre-crack, and one that is ``following``, which stays normal to its
    faces as they move and turn, have ``faces`` too: segments (x0, y0, x1, y1) with the material on their left, or
    triangles that turn anticlockwise as seen from outside, m.
    """

    body_force: Vector | None = None
    traction: Vector | None = None
    force: NumbersAlongAxes | None = None
    rows: PositiveInt = 1
    length: Positive | None = None
    surface: Positive | None = None  # m^2, of a loaded face in space, likewise
    shares: tuple[Share, ...] | None = None  # of each of `nodes`, of what a node on a loaded edge has of its traction
    pressure: Value | None = None
    area_vectors: tuple[NumbersAlongAxes, ...] | None = None  # of each of `nodes`
    following: bool = False
    faces: tuple[Face, ...] | None = None


class Grip(Condition, frozen=True, kw_only=True):
    """A condition that prescribes a motion.

    If it is `corrected`, bonds to its nodes make up for those that end beyond the edge that they are on, in a plate of
    bonds with fine nodes everywhere.
    """

    corrected: bool = False


class Displacement(Grip, frozen=True, kw_only=True, tag="displacement", tag_field="kind"):
    """Prescribed displacements, m; a missing component is free."""

    x: Value | None = None
    y: Value | None = None
    z: Value | None = None


class Velocity(Grip, frozen=True, kw_only=True, tag="velocity", tag_field="kind"):
    """Velocities prescribed throughout the run, m/s; a missing component is free."""

    x: Value | None = None
    y: Value | None = None
    z: Value | None = None


class Acceleration(Grip, frozen=True, kw_only=True, tag="acceleration", tag_field="kind"):
    """Accelerations prescribed throughout the run, m/s^2; a missing component is free."""

    x: Value | None = None
    y: Value | None = None
    z: Value | None = None


class InitialVelocity(Selection, frozen=True, kw_only=True, tag="initial velocity", tag_field="kind"):
    """Velocities at time 0, m/s; from then on the nodes are free. They turn about their centre of mass.

    Several combine: of a component that is missing, or 0 beside another that is not, an earlier condition counts. A
    spin sets those across it.
    """

    x: Value | None = None
    y: Value | None = None
    z: Value | None = None
    spin: Spin = 0.0


class InitialDisplacement(Selection, frozen=True, kw_only=True, tag="initial displacement", tag_field="kind"):
    """Displacements at time 0, m; from then on the nodes are free. Of a missing component an earlier one counts."""

    x: Value | None = None
    y: Value | None = None
    z: Value | None = None


class Absorb(Selection, frozen=True, kw_only=True, tag="absorb", tag_field="kind"):
    """An absorbing layer along an edge; damping grows with the distance from the nodes outside the layer."""

    depth: Positive | None = None  # m; None: as far as one of its nodes is from all that are not in it


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


def breakable_setting(condition: Condition) -> str:
    """How bonds of a condition are let break: in Python and settings, and by the parameter of a drawing."""
    moves = any(getattr(condition, axis, None) not in (None, 0.0) for axis in ("x", "y", "z"))
    still = isinstance(condition, Displacement) and not moves
    folder = "Loads" if isinstance(condition, Load) else "Fixes" if still else "Moves"
    return f"breakable=True, in a drawing {folder}/{condition.name or 'NAME'}/Breakable=1"
