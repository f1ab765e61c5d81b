"""A drawing as Gmsh or a mesh file has it - curves and surfaces in named groups, and parameters - as a Scene.

    group                                     parameters below Peridynamics/
    Physical Surface("zone:NAME")             Zones/NAME/Spacing, Grown (1)
    Physical Curve("crack:NAME")              -
    Physical Curve or Surface("load:NAME")    Loads/NAME/Traction x, y, Body force x, y or (total) Force x, y; *
    Physical Curve("load:NAME")               Loads/NAME/Pressure, Following (0), of an edge, or Edge "crack NAME"; *
    Physical Curve or Surface("fix:NAME")     Fixes/NAME/Components (xy), Displacement x, y; *
    Physical Point("fix:NAME" or "load:NAME") the same of the one node nearest to it, for loads Force x, y
    Physical Point("gap:NAME")                - (two points, between which the opening is monitored)
    Physical Curve or Surface("move:NAME")    Moves/NAME/Velocity, Acceleration or Initial velocity x, y; *
    Physical Curve or Surface("spring:NAME")  Springs/NAME/Stiffness x, y of an edge, Body stiffness x, y; Breakable
    Physical Curve("pin:NAME")                a hole's edge that turns about its centre: Pins/NAME/Breakable
    * of each condition                       Rows (1), Profile (constant), Breakable (0), Box, Edge; Node of load, fix
    Physical Curve or Surface("absorb:NAME")  Absorbs/NAME/Width (of a curve's layer: 12 horizons), Box
    Physical Surface("material:NAME")         Materials/NAME/ as below, what differs
    Physical Surface("body:NAME")             Bodies/NAME/Spacing (the coarsest zone's), Velocity x, y, and as Material
                                              or, with Rigid 1, Mass, Spin, Held (of "x y spin"), Profile, Radius
    -                                         Contact/Friction, Stiffness, Distance, Restitution
    -                                         Material/E, rho, G0, Force law and so on (`parameters.MATERIAL`)
    -                                         Medium/D, or k and c of heat (pdmesh.drawing.conditions)
    -                                         Load cells/NAME/Of "CONDITION, CONDITION", whose forces it sums
    -                                         Refine/crack, notch or hole/Distance, Spacing
    -                                         Horizon ratio, Area rule, Units, Run/Time step, Duration, Frame every
    -                                         Run/Solver (explicit, static), Start, Load steps, Control, Opening,
                                              Damping, Adapt, Collocation damped

Lengths - coordinates, Spacing, Distance, Displacement, Width, Box, Opening - are in the unit that Units names (m), all
else in SI units. A drawing's own numbers go below Peridynamics/Plate/. A component left out is free (of a fix, those
not in Components). ``Box``, "x0 y0 x1 y1", replaces a group. Profiles are "constant", "ramp SECONDS" or a table "TIME
FACTOR, TIME FACTOR, ...", or "friedlander SECONDS DECAY".

Where the groups and parameters of a plate's drawing place things: points, curves, surfaces, boxes and edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import LineString, MultiLineString

from pdmesh.drawing import conditions
from pdmesh.drawing import parameters as named
from pdmesh.drawing.conditions import single_point
from pdmesh.drawing.group_names import Physical, meaning
from pdmesh.drawing.parameters import Parameters
from pdmesh.quantities import Unit
from pdmesh.scene.plate import Refinement, Zone
from pdmesh.scene.pressed_edges import CRACK
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import Curve, SceneError, Surface, parts
from pdmesh.scene.slits import Crack

FLAT = 1e-6  # of a drawing's size: how far it may leave its plane
KINDS = {  # kind: dimensions, folder of its parameters
    "zone": ((2,), "Zones"),
    "crack": ((1,), None),
    "load": ((1, 0, 2), "Loads"),
    "fix": ((1, 0, 2), "Fixes"),
    "gap": ((0,), None),
    "move": ((1, 2), "Moves"),
    "spring": ((1, 2), "Springs"),
    "pin": ((1,), "Pins"),
    "absorb": ((1, 2), "Absorbs"),
    "material": ((2,), "Materials"),
    "body": ((2,), "Bodies"),
    "hold": ((1, 2), "Holds"),
    "supply": ((1, 2), "Supplies"),
    "exchange": ((1,), "Exchanges"),
    "begin": ((2,), "Begins"),
    "solid": ((2,), None),
    "medium": ((2,), "Media"),
}


@dataclass(frozen=True)
class Group:
    """A group: curves as points (k, 3) in the drawing's unit, and surfaces as lists of such curves."""

    name: str
    dimension: int
    curves: tuple[Any, ...] = ()
    surfaces: tuple[tuple[Any, ...], ...] = ()
    number: int = 0


def in_metres(group: Group, unit: Unit) -> Group:
    """The group with its coordinates in metres."""
    curves, *surfaces = (
        tuple(unit.to_si(np.asarray(curve, dtype=float)) for curve in curve_list)
        for curve_list in (group.curves, *group.surfaces)
    )
    return replace(group, curves=curves, surfaces=tuple(surfaces))


class PlateShapes:
    """Shapes of a plate's groups, m."""

    def __init__(self, scene: Scene, unit: Unit) -> None:
        self._scene, self._unit = scene, unit

    def area(self, group: Group, place: str) -> Surface:
        """The union of the faces of a group. Raises SceneError."""
        return surface_of(place, group)

    def where(self, group: Group, place: str) -> Curve | Surface | shapely.Point:
        """The surface, the curves or the point of a group. Raises SceneError."""
        if group.dimension == 0:
            return single_point(self.points(group), place)
        return surface_of(place, group) if group.dimension == 2 else MultiLineString(lines_of(place, group.curves))

    def points(self, group: Group) -> list[tuple[float, ...]]:
        """The first points of a group's curves, x and y."""
        return [tuple(np.asarray(curve)[0, :2].tolist()) for curve in group.curves]

    def part_of_boundary(self, words: str, place: str) -> Curve | str:
        """The edge that words pick; of a pre-crack the words, which a pressure knows. Raises SceneError."""
        return words if words.startswith(CRACK) else self._scene.edge(words, place, self._unit)


def lines_of(place: str, curves: Iterable[Any]) -> list[LineString]:
    """Curves, points (k, 3), as lines joined where they meet. Raises SceneError."""
    lines = [LineString(np.asarray(points)[:, :2]) for points in curves]
    lines = [line for line in lines if line.length > 0]
    if not lines:
        raise SceneError(f"{place} has no curve of any length; add one")
    merged = shapely.line_merge(MultiLineString(lines))
    return list(merged.geoms) if isinstance(merged, MultiLineString) else [merged]


def surface_of(place: str, group: Group) -> Surface:
    """The union of the faces of a group. Raises SceneError."""
    return shapely.union_all([face(curves, place) for curves in group.surfaces])


def face(curves: Iterable[Any], place: str) -> shapely.Polygon:
    """The face bounded by curves, points (k, 2 or 3). Raises SceneError if they do not close, or cross."""
    lines = lines_of(place, curves)
    polygons, cuts, dangles, _ = shapely.polygonize_full(lines)
    crossing = [line for line in lines if not line.is_simple]
    if crossing or not MultiLineString(lines).is_simple:
        reason = shapely.is_valid_reason(shapely.Polygon(crossing[0])) if crossing else "curves that cross"
        raise SceneError(f"{place}: {reason}; use an outline that does not cross itself")
    for loose in (dangles, cuts):
        if not loose.is_empty:
            x, y = shapely.get_coordinates(loose)[0]
            raise SceneError(f"{place}: the outline is open at ({x:g}, {y:g}) m; use closed curves")
    faces = parts(polygons)
    if not faces:
        raise SceneError(f"{place}: the outline does not close; use closed curves")
    return max(faces, key=lambda part: float(shapely.Polygon(part.exterior).area))


def scene_of(
    groups: Iterable[Group],
    values: Mapping[str, float | str],
    source: str,
    text: str = "",
    new_zones: Sequence[Mapping[str, Any]] = (),
) -> Scene:
    """The scene that groups and parameters describe. Raises SceneError naming the group or the parameter.

    `new_zones` are those that the reader made of other groups or of all surfaces (`sandbox.zone_groups`).
    """
    named.refuse_unknown(values, from_drawing=True)
    named.refuse_space(values)
    parameters = Parameters(values, named.unit_of(values))
    metric_groups = [in_metres(group, parameters.unit) for group in groups]
    physical = [Physical(group.name, group.dimension, group.number) for group in metric_groups]
    meant = meaning(physical, new_zones, KINDS, parameters)
    named_groups = {
        kind: {name: metric_groups[at] for name, at in places.items()} for kind, places in meant.groups.items()
    }
    _check_places(named_groups)
    zones = tuple(_zone(name, group, parameters) for name, group in named_groups["zone"].items())
    if not zones:
        raise SceneError("zones: there is none, and no surface in the drawing; add one, such as 'zone:NAME'")
    scene = Scene(
        outline=shapely.union_all([zone.shape for zone in zones]),
        notes=(*meant.notes, *_reaching_beyond(zones)),
        spacing=max(zone.spacing for zone in zones),
        zones=zones,
        area_rule=parameters.text("Area rule", of=("", "cells", "eq19", "square")) or None,  # type: ignore[arg-type]
        units="m" if parameters.text("Units") else None,
        refinements=tuple(
            Refinement(
                target,  # type: ignore[arg-type]
                parameters.length(f"Refine/{target}/Distance"),
                parameters.maybe_length(f"Refine/{target}/Spacing"),
            )
            for target in sorted(parameters.below("Refine"))
        ),
        cracks=tuple(
            Crack(name, line)
            for name, group in named_groups["crack"].items()
            for line in lines_of(f"crack '{name}'", group.curves)
        ),
        **named.of_scene(parameters, source, text, values),
    )
    scene = conditions.with_bodies(scene, named_groups, PlateShapes(scene, parameters.unit), parameters)
    shapes = PlateShapes(scene, parameters.unit)
    places = conditions.places_of(named_groups, shapes, parameters, 2)
    scene = conditions.acted_on(scene, places, parameters)
    for name, where, folder in places["pin"]:
        scene = scene.pin_hole(where, name=name, **conditions.rows(parameters, folder))
    for name, where, folder in places["absorb"]:
        scene = scene.absorb(where, parameters.maybe_length(f"{folder}/Width"), name)
    for name, group in named_groups["solid"].items():
        scene = scene.solid(surface_of(f"solid '{name}'", group), name)
    scene = conditions.with_monitors_and_regions(scene, named_groups, shapes, parameters)
    return conditions.diffusing(scene, places, parameters)


def _reaching_beyond(zones: Sequence[Zone]) -> tuple[str, ...]:
    """Warnings of zones that overlap coarser ones and extend beyond them, which enlarges the plate."""
    notes = []
    for zone in zones:
        coarser = shapely.union_all(
            [coarser_zone.shape for coarser_zone in zones if coarser_zone.spacing > zone.spacing]
        )
        beyond = zone.shape - coarser
        if all(not part.buffer(-zone.spacing / 2).is_empty for part in (zone.shape & coarser, beyond)):
            notes.append(
                f"warning: zone '{zone.name}': {beyond.area:.4g} m^2 of it are beyond the coarser zones and become"
                " plate too (if they should not: BooleanIntersection with the plate)"
            )
    return tuple(notes)


def _zone(name: str, group: Group, parameters: Parameters) -> Zone:
    shape, spacing = surface_of(f"zone '{name}'", group), parameters.length(f"Zones/{name}/Spacing")
    if not spacing > 0:
        raise SceneError(f"zone '{name}': spacing is {spacing:g} m; use more than 0 m")
    return Zone(name, shape, spacing, parameters.flag(f"Zones/{name}/Grown", True))


def _check_places(groups: dict[str, dict[str, Group]]) -> None:
    """Raise SceneError for places that are not finite, or not in one plane."""
    every = [group for kind in groups.values() for group in kind.values()]
    curves = [curve for group in every for boundary in (group.curves, *group.surfaces) for curve in boundary]
    points = [np.asarray(curve) for curve in curves]
    if points:
        cloud = np.concatenate(points)
        if not np.isfinite(cloud).all():
            raise SceneError("drawing: a coordinate is not finite; use metres")
        if np.ptp(cloud[:, 2]) > FLAT * max(np.ptp(cloud[:, 0]), np.ptp(cloud[:, 1])):
            raise SceneError(
                f"drawing: z goes from {cloud[:, 2].min():g} to {cloud[:, 2].max():g} m; draw a plane of one z"
                " (pdmesh init turns a plate of a CAD file)"
            )
