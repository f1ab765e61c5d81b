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

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias

import msgspec
import numpy as np
import shapely
from shapely import LineString, MultiLineString, Polygon, box

from pdmesh import checks
from pdmesh.conditions import Condition, MaterialRegion, Place, Profile, checked_profile, ramp
from pdmesh.grid import (
    Acceleration,
    AnyCondition,
    Displacement,
    InitialVelocity,
    Load,
    Material,
    Point,
    Region,
    Run,
    Velocity,
)
from pdmesh.shapes import Circle, Curve, Points, SceneError, Shape, Surface, parts, polyline, surface
from pdmesh.slits import Slit, slits_of

__all__ = [
    "Circle",
    "Crack",
    "Material",
    "Refinement",
    "Run",
    "Scene",
    "SceneError",
    "Zone",
    "box",
    "ramp",
]

DEFAULT_RUN = Run()
SIDES = {"left": (0, -1), "right": (0, 1), "bottom": (1, -1), "top": (1, 1)}  # axis, end

Where: TypeAlias = str | Curve | Surface | Circle | Points
Components: TypeAlias = tuple[float | None, float | None]


@dataclass(frozen=True)
class Zone:
    """A part of the plate whose nodes have at most this spacing; where zones overlap the finest counts.

    Grown by the horizon of the nodes it replaces, so that none outside sees it, unless `grown` is False: then the
    spacing changes where it is drawn.
    """

    name: str
    shape: Surface
    spacing: float  # m
    grown: bool = True


@dataclass(frozen=True)
class Refinement:
    """A zone without drawing: all that is within `distance` of the cracks, the notch roots or the holes."""

    target: Literal["crack", "notch", "hole"]
    distance: float  # m
    spacing: float | None = None  # m; None: half the finest of the scene


@dataclass(frozen=True)
class Crack:
    """A pre-crack as it is drawn: a polyline no bond may cross. `Scene.slits` has it as it is in the plate."""

    name: str
    line: LineString


@dataclass(frozen=True)
class Scene:
    """Everything an engineer says about a plate. Raises SceneError where the parts contradict each other."""

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
    conditions: tuple[Condition, ...] = ()
    source: str = ""  # file the scene comes from
    drawing: str = ""  # its text
    parameters: tuple[tuple[str, float | str], ...] = ()  # that it was read with
    notes: tuple[str, ...] = ()  # what there is to say of the file

    def __post_init__(self) -> None:
        checks.check(self)

    def hole(self, shape: Shape) -> Scene:
        """With a hole in it."""
        place = f"hole {len(self.cutouts) + 1}"
        if not surface(shape, self.finest, place).intersection(self.whole).area > 0:
            raise SceneError(f"{place}: found outside the plate, expected inside")
        return replace(self, cutouts=(*self.cutouts, shape))

    def notch(self, shape: Shape) -> Scene:
        """With a notch cut from its edge."""
        place = f"notch {len(self.cutouts) + 1}"
        cut = surface(shape, self.finest, place)
        if cut.disjoint(self.whole.boundary):
            raise SceneError(f"{place}: found no point of the plate's edge in it, expected some (else it is a hole)")
        if not cut.intersection(self.whole).area > 0:
            raise SceneError(f"{place}: found outside the plate, expected a shape that cuts from its edge")
        return replace(self, cutouts=(*self.cutouts, shape))

    def crack(self, points: LineString | Points, name: str = "") -> Scene:
        """With a pre-crack along a polyline."""
        name = name or f"{len(self.cracks) + 1}"
        line = polyline(points, f"crack '{name}'")
        if not isinstance(line, LineString):
            raise SceneError(f"crack '{name}': found several lines, expected one polyline")
        return replace(self, cracks=(*self.cracks, Crack(name, line)))

    def zone(self, shape: Shape, spacing: float, name: str = "", grown: bool = True) -> Scene:
        """With nodes of at most this spacing (m) in the shape; see Zone."""
        name = name or f"{len(self.zones) + 1}"
        return replace(self, zones=(*self.zones, Zone(name, surface(shape, spacing, f"zone '{name}'"), spacing, grown)))

    def refine(self, target: Literal["crack", "notch", "hole"], distance: float, spacing: float | None = None) -> Scene:
        """With finer nodes within `distance` (m) of all cracks, notch roots or holes; see Refinement."""
        return replace(self, refinements=(*self.refinements, Refinement(target, distance, spacing)))

    def region(self, shape: Shape, material: Material, name: str = "") -> Scene:
        """With another material in the shape."""
        name = name or f"{len(self.regions) + 1}"
        area = surface(shape, self.finest, f"material '{name}'")
        return replace(self, regions=(*self.regions, MaterialRegion(area, Region(name=name, material=material))))

    def load(
        self,
        where: Where,
        traction: Point | None = None,
        body_force: Point | None = None,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Scene:
        """With a traction (Pa) on a curve, or a body force (N/m^3) there or in a surface.

        `where` is "left", "right", "bottom" or "top" (of the plate's outline), points of a curve, or a shape. A
        curve means its `rows` nearest rows of nodes. `profile` holds points (time in s, factor).
        """
        values = {"traction": traction, "body_force": body_force}
        return self._with(Load, values, where, rows, name, profile=profile, breakable=breakable)

    def fix(
        self,
        where: Where,
        x: float | None = 0.0,
        y: float | None = 0.0,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Scene:
        """With displacements (m) held; None leaves a component free. For the rest see `load`."""
        return self._with(Displacement, {"x": x, "y": y}, where, rows, name, profile=profile, breakable=breakable)

    def move(
        self,
        where: Where,
        velocity: Components | None = None,
        acceleration: Components | None = None,
        initial_velocity: Components | None = None,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Scene:
        """With one of: a held velocity (m/s), a held acceleration (m/s^2), a velocity at time 0 (m/s).

        None leaves a component free. For the rest see `load`; an initial velocity has no profile.
        """
        given: list[tuple[type[AnyCondition], Components | None]] = [
            (Velocity, velocity),
            (Acceleration, acceleration),
            (InitialVelocity, initial_velocity),
        ]
        chosen = [(kind, value) for kind, value in given if value is not None]
        if len(chosen) != 1:
            raise SceneError(
                f"move '{name}': found {len(chosen)} of velocity, acceleration and initial_velocity, expected one"
            )
        ((kind, (x, y)),) = chosen
        if kind is InitialVelocity:
            if profile or breakable:
                raise SceneError(f"move '{name}': found a profile or breakable, expected none of an initial velocity")
            return self._with(kind, {"x": x or 0.0, "y": y or 0.0}, where, rows, name)
        return self._with(kind, {"x": x, "y": y}, where, rows, name, profile=profile, breakable=breakable)

    def _with(
        self, kind: type[AnyCondition], values: dict[str, Any], where: Where, rows: int, name: str, **more: Any
    ) -> Scene:
        name = name or (where if isinstance(where, str) else f"{len(self.conditions) + 1}")
        place = f"{kind.__struct_config__.tag} '{name}'"
        if "profile" in more:
            more["profile"] = checked_profile(more["profile"], f"{place}: profile")
        try:
            action = msgspec.convert({"kind": kind.__struct_config__.tag, "name": name} | values | more, kind)
        except msgspec.ValidationError as error:
            raise SceneError(f"{place}: {error}") from None
        condition = Condition(Place(self._place(where, place), rows), action)
        return replace(self, conditions=(*self.conditions, condition))

    def _place(self, where: Where, place: str) -> Curve | Surface:
        if isinstance(where, str):
            return self.side(where, place)
        if isinstance(where, Circle | Surface):
            return surface(where, self.finest, place)
        return polyline(where, place)

    def adapt(self, how: Literal["none", "hybrid"] = "hybrid") -> Scene:
        """To be solved with peridynamics where bonds may break and a compact lattice elsewhere, or everywhere alike."""
        return replace(self, run=msgspec.structs.replace(self.run, adapt=how))

    def side(self, name: str, place: str = "side") -> Curve:
        """The part of the plate's outline on its left, right, bottom or top. Raises SceneError."""
        if name not in SIDES:
            raise SceneError(f"{place}: found '{name}', expected one of {', '.join(SIDES)}, points or a shape")
        axis, end = SIDES[name]
        reach = self.shape.bounds[axis + (2 if end > 0 else 0)]
        kept = []
        for part in self.parts:
            ring = shapely.get_coordinates(part.exterior)
            on = np.abs(ring[:, axis] - reach) <= 1e-9 * self.finest + 1e-12 * abs(reach)
            kept += [ring[i : i + 2] for i in range(len(ring) - 1) if on[i] and on[i + 1]]
        if not kept:
            raise SceneError(f"{place}: found no straight edge at the {name} of the plate, expected one")
        merged = shapely.line_merge(MultiLineString(kept))
        return merged if isinstance(merged, Curve) else MultiLineString(kept)

    @cached_property
    def whole(self) -> Surface:
        """The plate without its holes and notches cut."""
        return surface(self.outline, self.finest, "outline")

    @cached_property
    def shape(self) -> Surface:
        """The plate as it is."""
        if not self.cutouts:
            return self.whole
        cut = [surface(shape, self.finest, f"cutout {number + 1}") for number, shape in enumerate(self.cutouts)]
        return self.whole.difference(shapely.union_all(cut))

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

    @cached_property
    def slits(self) -> tuple[Slit, ...]:
        """The cracks as they are in the plate, their ends on its edge where they were drawn to it."""
        return slits_of(self)

    def one_scale(self) -> Scene:
        """The same plate with the finest spacing everywhere."""
        return replace(self, spacing=self.finest, zones=(), refinements=())
