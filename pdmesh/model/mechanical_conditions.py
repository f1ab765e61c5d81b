"""Conditions of mechanics on nodes: loads, prescribed and initial motions, and layers that absorb waves.

Their values may depend on the place (`pdmesh.model.values_of_place`).
"""

from __future__ import annotations

from pdmesh.model.contact import Spin
from pdmesh.model.timed_selection import Positive, PositiveInt, Selection, Share, Timed
from pdmesh.model.timed_selection import Vector as NumbersAlongAxes
from pdmesh.model.values_of_place import Value, Vector


class Condition(Timed, frozen=True, kw_only=True):
    """A condition on nodes. Their bonds do not break unless `breakable`."""

    breakable: bool = False


class Load(Condition, frozen=True, kw_only=True, tag="load", tag_field="kind"):
    """A body force: ``body_force`` (N/m^3), ``traction`` (Pa) over ``rows`` rows of nodes, or a total ``force``.

    A traction gives traction / (rows delta) at each node; ``length`` (m) of the loaded edge, if known, lets a solver
    make the total exact. With ``shares``, rows farther from an edge have less of a traction, as families there lack
    less. A force (N/m of a plate, N of a body in space) is shared by its nodes by area or volume.
    """

    body_force: Vector | None = None
    traction: Vector | None = None
    force: NumbersAlongAxes | None = None
    rows: PositiveInt = 1
    length: Positive | None = None
    surface: Positive | None = None  # m^2, of a loaded face in space, likewise
    shares: tuple[Share, ...] | None = None  # of each of `nodes`, of what a node on a loaded edge has of its traction


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
