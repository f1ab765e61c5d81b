"""The description of a plate and the shapes derived from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import shapely
from shapely import Polygon

from pdmesh.model.base_structs import PlainFields
from pdmesh.model.document import Contact, Material, MediumRegion, RigidBody, Run
from pdmesh.model.interfaces import Interface
from pdmesh.model.medium import Medium
from pdmesh.model.svg_picture import svg
from pdmesh.quantities import Unit
from pdmesh.scene.conditions import MaterialRegion, PlacedCondition, PlacedRegion
from pdmesh.scene.edges import METRE, edge
from pdmesh.scene.heat import Heat, Physics, physics_of
from pdmesh.scene.node_fields import PlacedField
from pdmesh.scene.shapes import Curve, Shape, Surface, parts, surface
from pdmesh.scene.slits import Crack, Slit, slits_of

DEFAULT_RUN = Run()


@dataclass(frozen=True)
class Zone(PlainFields):
    """A part of the plate whose nodes have at most this spacing; where zones overlap, the finest counts.

    With `grown`, it is grown by the horizon of the nodes it replaces, so that no outside node interacts with it;
    otherwise the spacing changes where the zone is drawn.
    """

    name: str
    shape: Surface
    spacing: float  # m
    grown: bool = True


@dataclass(frozen=True)
class Refinement(PlainFields):
    """A zone without a drawing: everything within `distance` of the cracks, the notch roots or the holes."""

    target: Literal["crack", "notch", "hole"]
    distance: float  # m
    spacing: float | None = None  # m; None: half the finest of the scene


@dataclass(frozen=True)
class BodyBeside(PlainFields):
    """A body besides the plate, on a lattice of its own."""

    name: str
    shape: Surface
    spacing: float  # m
    material: Material | None = None  # None: the plate's
    velocity: tuple[float, float] = (0.0, 0.0)  # m/s, at time 0
    spin: float = 0.0  # rad/s, at time 0
    rigid: RigidBody | None = None  # without nodes; None: it deforms


@dataclass(frozen=True)
class Plate(PlainFields):
    """An engineer's description of a plate, not yet checked; see Scene."""

    outline: Shape
    spacing: float  # m, of the coarsest nodes
    material: Material | None = None
    horizon: float = 3.0  # m = horizon / spacing of a node
    run: Run = DEFAULT_RUN
    area_rule: Literal["cells", "eq19", "square"] | None = None  # None: as the solver's mode has it
    units: Literal["m"] | None = None  # "m": metres are meant, even where the plate is large
    cutouts: tuple[Shape, ...] = ()  # holes and notches
    zones: tuple[Zone, ...] = ()
    refinements: tuple[Refinement, ...] = ()
    cracks: tuple[Crack, ...] = ()
    regions: tuple[MaterialRegion, ...] = ()
    conditions: tuple[PlacedCondition, ...] = ()
    fields: tuple[PlacedField, ...] = ()  # constants of the material by node
    interfaces: tuple[Interface, ...] = ()  # between regions, or along lines
    bodies: tuple[BodyBeside, ...] = ()  # no bonds join them to the plate or to each other
    touching: Contact | None = None  # how bodies and faces of cracks push each other apart
    medium: Medium | Heat | None = None  # what a substance or heat diffuses through
    media: tuple[PlacedRegion[MediumRegion], ...] = ()  # parts of another diffusivity
    source: str = ""  # file the scene comes from
    drawing: str = ""  # its text
    parameters: tuple[tuple[str, float | str], ...] = ()  # that it was read with
    notes: tuple[str, ...] = ()  # what there is to say of the file

    @property
    def physics(self) -> Physics:
        """The physics of its material, regions and medium. Raises SceneError for half of it."""
        return physics_of(self.medium, self.material, (part.region for part in self.regions))

    def edge(self, words: str, place: str = "edge", unit: Unit = METRE) -> Curve:
        """The part of the plate's outline that the words pick; see `pdmesh.scene.edges`. Raises SceneError."""
        return edge(self.shape, self.finest, words, place, unit)

    @cached_property
    def whole(self) -> Surface:
        """The plate without holes and notches."""
        return surface(self.outline, self.finest, "outline")

    @cached_property
    def shape(self) -> Surface:
        """The plate with its holes and notches cut out. Raises SceneError."""
        if not self.cutouts:
            return self.whole
        cut = [surface(shape, self.finest, f"cutout {number + 1}") for number, shape in enumerate(self.cutouts)]
        return self.whole.difference(shapely.union_all(cut))

    @cached_property
    def everything(self) -> Surface:
        """The plate and all other bodies."""
        return shapely.union_all([self.shape, *(body.shape for body in self.bodies)])

    @cached_property
    def finest(self) -> float:
        """The smallest spacing, m."""
        smallest = min([self.spacing, *(zone.spacing for zone in self.zones)])
        return min([smallest, *(request.spacing or smallest / 2 for request in self.refinements)])

    @cached_property
    def parts(self) -> tuple[Polygon, ...]:
        """The connected parts of the plate."""
        return parts(self.shape)

    @cached_property
    def holes(self) -> tuple[Polygon, ...]:
        """The holes of all parts, from left to right; a node's hole_id counts them from 0."""
        holes = [Polygon(ring) for part in self.parts for ring in part.interiors]
        return tuple(sorted(holes, key=lambda hole: hole.bounds))

    def _repr_svg_(self) -> str:
        """SVG for a notebook: the plate and its pre-cracks."""
        rings = [ring for part in self.parts for ring in (part.exterior, *part.interiors)]
        return svg(map(shapely.get_coordinates, rings), (shapely.get_coordinates(slit.line) for slit in self.slits))

    @cached_property
    def slits(self) -> tuple[Slit, ...]:
        """The cracks as trimmed to the plate, with ends on its edge where they were drawn to it."""
        return slits_of(self.cracks, self.shape, self.spacing, self.finest)
