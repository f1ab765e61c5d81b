"""A scene: shapes with meaning, before any node exists; drawn in Gmsh or in a few lines of Python.

    scene = (
        Scene(box(0, 0, 0.1, 0.04), spacing=1e-3, material=Material(E=65e9, rho=2235, G0=204), horizon=4)
        .crack([(0, 0.0205), (0.05, 0.0205)])
        .zone(box(0.04, 0.01, 0.1, 0.03), spacing=5e-4)
        .load("top", traction=(0, 12e6), rows=4)
        .load("bottom", traction=(0, -12e6), rows=4)
    )

Frozen: every method returns a new scene. Lengths in metres, SI units throughout.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, TypeAlias

import msgspec
import shapely
from shapely import LineString, MultiLineString

from pdmesh.model.document import (
    LARGEST,
    Absorb,
    Adapt,
    AnyCondition,
    Contact,
    Material,
    Pin,
    Region,
    Solid,
)
from pdmesh.model.mechanical_conditions import Grip
from pdmesh.model.pressed_faces import Faces
from pdmesh.scene import actions, checks
from pdmesh.scene.conditions import (
    MaterialRegion,
    Place,
    PlacedCondition,
    PlacedRegion,
    Profile,
    Pulls,
    name_of,
    pulls_of,
    unchecked,
)
from pdmesh.scene.diffusion_conditions import DiffusionConditions
from pdmesh.scene.functions_of_place import ValueOfPlace, without_functions
from pdmesh.scene.mechanical_conditions import MechanicalConditions
from pdmesh.scene.plate import BodyBeside, Plate, Refinement, Zone
from pdmesh.scene.pressed_edges import CRACK, faces_of_crack, faces_of_edge, named_crack
from pdmesh.scene.shapes import Circle, Curve, Points, SceneError, Shape, Surface, coordinates, polyline, surface
from pdmesh.scene.slits import Crack

DEEP = 12.0  # horizons: of a layer that absorbs
ON_EDGE = 1e-3  # of a spacing: a curve this near to the edge is on it
PLAIN = Material(E=1.0, rho=1.0, G0=1.0)  # where a scene has none yet: only its micromodulus matters

Where: TypeAlias = str | Curve | Surface | Circle | shapely.Point | Points


@dataclass(frozen=True)
class Scene(Plate, MechanicalConditions[Where], DiffusionConditions[Where]):
    """A description of a plate. Raises SceneError for parts that contradict each other."""

    AXES: ClassVar[str] = "xy"

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.check(self)

    def hole(self, shape: Shape) -> Scene:
        """The scene with a hole. Raises SceneError."""
        place = f"hole {len(self.cutouts) + 1}"
        if not surface(shape, self.finest, place).intersection(self.whole).area > 0:
            raise SceneError(f"{place} is outside the plate; put it inside")
        return replace(self, cutouts=(*self.cutouts, shape))

    def notch(self, shape: Shape) -> Scene:
        """The scene with a notch cut from its edge."""
        place = f"notch {len(self.cutouts) + 1}"
        cut = surface(shape, self.finest, place)
        if cut.disjoint(self.whole.boundary):
            raise SceneError(f"{place}: no point of the plate's edge is in it; move it to the edge (else it is a hole)")
        if not cut.intersection(self.whole).area > 0:
            raise SceneError(f"{place} is outside the plate; use a shape that cuts from its edge")
        return replace(self, cutouts=(*self.cutouts, shape))

    def crack(self, points: LineString | Points, name: str = "") -> Scene:
        """The scene with a pre-crack along a polyline."""
        name = name or f"{len(self.cracks) + 1}"
        line = polyline(points, f"crack '{name}'")
        if not isinstance(line, LineString):
            raise SceneError(f"crack '{name}' has several lines; use one polyline")
        return replace(self, cracks=(*self.cracks, Crack(name, line)))

    def zone(self, shape: Shape, spacing: float, name: str = "", grown: bool = True) -> Scene:
        """The scene with nodes of at most this spacing (m) in the shape; see Zone."""
        name = name or f"{len(self.zones) + 1}"
        return replace(self, zones=(*self.zones, Zone(name, surface(shape, spacing, f"zone '{name}'"), spacing, grown)))

    def refine(self, target: Literal["crack", "notch", "hole"], distance: float, spacing: float | None = None) -> Scene:
        """The scene with finer nodes within `distance` (m) of all cracks, notch roots or holes; see Refinement."""
        return replace(self, refinements=(*self.refinements, Refinement(target, distance, spacing)))

    def region(self, shape: Shape, material: Material, name: str = "") -> Scene:
        """The scene with another material in the shape."""
        name = name or name_of(shape, "material")
        area = surface(shape, self.finest, f"material '{name}'")
        part = MaterialRegion(area, Region(name=name, material=material))
        checks.check_region(part, self)
        return unchecked(self, regions=(*self.regions, part))

    def body(
        self,
        shape: Shape,
        name: str,
        spacing: float | None = None,
        material: Material | None = None,
        velocity: tuple[float, float] = (0.0, 0.0),
        spin: float = 0.0,
    ) -> Scene:
        """The scene with another body, which no bond joins to the plate and which pushes what it touches.

        It has a lattice of its own with this `spacing` (m), a material, and a `velocity` (m/s) and a `spin` (rad/s,
        anticlockwise about its centre of mass) at time 0; without `spacing` and `material` it has the plate's. All
        nodes are then half a spacing inside their body's outline.
        """
        spacing = self.spacing if spacing is None else spacing
        body = BodyBeside(name, surface(shape, spacing, f"body '{name}'"), spacing, material, velocity, spin)
        return replace(self, bodies=(*self.bodies, body), touching=self.touching or Contact())

    def rigid(
        self,
        shape: Shape,
        name: str,
        mass: float | None = None,
        velocity: tuple[float, float] = (0.0, 0.0),
        spin: float = 0.0,
        held: str | Sequence[str] = (),
        profile: Profile = (),
        spacing: float | None = None,
        *,
        radius: float | None = None,
    ) -> Scene:
        """The scene with a rigid body of a `mass` (kg per metre of thickness), which moves as one.

        `velocity` (m/s) and `spin` (rad/s, anticlockwise) are those at time 0. Of "x", "y" and "spin" those `held` keep
        theirs, times the `profile`. A body that is wholly held needs no mass. It pushes what touches it as one of the
        plate's material would; with a `radius` (m) along a circle about its centre, not the steps of its nodes.
        `pdpost reaction` draws its force and the way of its centre of mass.
        """
        rigid_body = self._rigid(name, velocity, held, mass=mass, spin=spin, profile=profile, radius=radius)
        spacing = self.spacing if spacing is None else spacing
        body = BodyBeside(name, surface(shape, spacing, f"body '{name}'"), spacing, rigid=rigid_body)
        return replace(self, bodies=(*self.bodies, body), touching=self.touching or Contact())

    def fix(
        self,
        where: Where,
        x: ValueOfPlace | None = 0.0,
        y: ValueOfPlace | None = 0.0,
        rows: int | None = None,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Scene:
        """The scene with prescribed displacements (m); None leaves a component free.

        Other arguments are those of `load`.
        """
        return self._fixed(where, (x, y), rows, profile, name, breakable)

    def pin(self, x: float, y: float, name: str = "") -> Scene:
        """The scene with a pin: the node nearest to (x, y), m, does not move, and the plate turns about it."""
        return self.fix(shapely.Point(x, y), name=name)

    def pin_hole(self, where: Where, rows: int = 1, name: str = "", breakable: bool = False) -> Scene:
        """The scene with a pin in a hole, "hole nearest X,Y" or its edge: the edge moves as a rigid ring that turns
        freely about its centre, which stays."""
        name = name or name_of(where, "pin")
        edge = self._place(where, f"pin '{name}'")
        if not isinstance(edge, Curve) or not shapely.is_closed(edge := shapely.line_merge(edge)):
            raise SceneError(f"pin '{name}' has no closed edge; use that of a hole, 'hole nearest X,Y'")
        centre = shapely.Polygon(edge).centroid
        values = {"centre": (centre.x, centre.y), "breakable": breakable}
        return self._with(Pin, values, edge, rows, name)

    def roller(self, x: float, y: float, along: Literal["x", "y"] = "x", name: str = "") -> Scene:
        """The scene with a roller: the node nearest to (x, y), m, moves along one axis alone."""
        return self._rolling((x, y), along, name)

    def absorb(self, where: Where, width: float | None = None, name: str = "") -> Scene:
        """The scene with an absorbing layer, `width` (m) deep from a curve, or all of a shape.

        The default depth is 12 horizons of the coarsest nodes, enough for a pulse two horizons wide. Other arguments
        are those of `load`.
        """
        if isinstance(where, Circle | Surface):
            if width is not None:
                raise SceneError(f"absorb '{name}' has a width and a surface; use one of them")
            return self._with(Absorb, {}, where, 1, name)
        name = name or name_of(where, "absorb")
        width = DEEP * self.horizon * self.spacing if width is None else width
        if not 0 < width <= LARGEST:
            raise SceneError(f"absorb '{name}': width is {width:g} m; use more than 0 m")
        layer = self._place(where, f"absorb '{name}'").buffer(width, cap_style="flat", join_style="mitre")
        return self._with(Absorb, {"depth": width}, layer, 1, name)

    def solid(self, shape: Shape, name: str = "") -> Scene:
        """The scene with a dissolving solid in the shape."""
        return self._with(Solid, {}, shape, 1, name)

    def diffusivity(self, shape: Shape, D: float, name: str = "") -> Scene:
        """The scene with another diffusivity (m^2/s) in the shape."""
        name = name or name_of(shape, "medium")
        region, area = actions.medium(name, D), surface(shape, self.finest, f"medium '{name}'")
        return replace(self, media=(*self.media, PlacedRegion(area, region)))

    _named = staticmethod(name_of)

    def _size(self, where: Where, place: str) -> dict[str, float]:
        curve = self._place(where, place)
        if not isinstance(curve, Curve):
            raise SceneError(f"{place} is a {curve.geom_type.lower()}; use a curve that the flux goes through")
        return {"length": float(curve.length)}

    def _with(
        self, kind: type[AnyCondition], values: dict[str, Any], where: Where, rows: int | None, name: str, **more: Any
    ) -> Scene:
        name = name or name_of(where, str(kind.__struct_config__.tag))
        plain, functions = without_functions(values)
        pulls: Pulls
        faces: Faces
        at, faces, pulls = f"{kind.__struct_config__.tag} '{name}'", (), ()
        if "pressure" in plain:
            place, faces = self._pressed(where, at)
        else:
            place = self._place(where, at)
        if rows is None and issubclass(kind, Grip) and self._is_edge(place):
            more["corrected"] = True
        # as bonds of the material know of it, a traction or a pressure on faces is shared by rows
        is_shared = "traction" in plain or (bool(faces) and (self.material or PLAIN).model == "bond")
        if rows is None and is_shared and self._is_edge(place):
            pulls = pulls_of(self.material or PLAIN, self.horizon)
        action = actions.action(kind, name, plain | more, len(self.AXES))
        rows = (len(pulls) or 1) if rows is None else rows
        of_crack = isinstance(where, str) and where.startswith(CRACK)
        condition = PlacedCondition(Place(place, rows), action, functions, pulls, faces, of_crack)
        return replace(self, conditions=(*self.conditions, condition))

    def _pressed(self, where: Where, place: str) -> tuple[Curve, Faces]:
        """The edge or the pre-crack that a pressure acts on, and its faces. Raises SceneError."""
        if isinstance(where, str) and where.startswith(CRACK):
            lines = MultiLineString([slit.line for slit in named_crack(where, self.slits, place)])
            return lines, faces_of_crack(lines)
        curve = self._place(where, place)
        if not isinstance(curve, Curve):
            raise SceneError(
                f"{place}: a pressure acts on edges, not on a shape or a point; use an edge or 'crack NAME'"
            )
        return curve, faces_of_edge(curve, self.everything, self.finest, place)

    def _faces_along(self, along: LineString | Points, place: str) -> Faces:
        lines = shapely.get_parts(polyline(along, place))
        places = map(shapely.get_coordinates, lines)
        return tuple((*a, *b) for points in places for a, b in itertools.pairwise(points.tolist()))

    def _is_edge(self, place: Curve | Surface | shapely.Point) -> bool:
        """Whether a place is a curve along the edge of the plate or of a hole."""
        if not isinstance(place, Curve):
            return False
        return bool(self.everything.boundary.buffer(ON_EDGE * self.finest).covers(place))

    def _place(self, where: Where, place: str) -> Curve | Surface | shapely.Point:
        if isinstance(where, str):
            return self.edge(where, place)
        if isinstance(where, shapely.Point):
            ((x, y),) = coordinates([(where.x, where.y)], 1, place)
            return shapely.Point(x, y)
        if isinstance(where, Circle | Surface):
            return surface(where, self.finest, place)
        return polyline(where, place)

    def adapt(self, how: Adapt = "hybrid", damped: bool | None = None) -> Scene:
        """The scene with an adaptive method: "none", "auto", "hybrid", "split" or "collocation".

        "hybrid" and "collocation" solve peridynamics only where bonds may break, "split" divides cells of high energy;
        `damped` is that of `run.collocation`.
        """
        more = {}
        if damped is not None:
            more["collocation"] = msgspec.structs.replace(self.run.collocation, damped=damped)
        return self._run(adapt=how, **more)

    def one_scale(self) -> Scene:
        """The scene with the finest spacing everywhere."""
        return replace(self, spacing=self.finest, zones=(), refinements=())
