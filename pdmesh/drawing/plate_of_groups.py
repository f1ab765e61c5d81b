"""A drawing as Gmsh or a mesh file has it - curves and surfaces in named groups, and parameters - as a Scene.

    group                                     parameters below Peridynamics/
    Physical Surface("zone:NAME")             Zones/NAME/Spacing, Grown (1)
    Physical Curve("crack:NAME")              -
    Physical Curve or Surface("load:NAME")    Loads/NAME/Traction x, y or Body force x, y; *
    Physical Curve or Surface("fix:NAME")     Fixes/NAME/Components (xy), Displacement x, y; *
    Physical Point("fix:NAME")                the same of the one node nearest to it
    Physical Point("gap:NAME")                - (two points, between which the opening is monitored)
    Physical Curve or Surface("move:NAME")    Moves/NAME/Velocity, Acceleration or Initial velocity x, y; *
    * of each condition                       Rows (1), Profile (constant), Breakable (0), Box
    Physical Curve or Surface("absorb:NAME")  Absorbs/NAME/Width (of a curve's layer: 12 horizons), Box
    Physical Surface("material:NAME")         Materials/NAME/ as below, what differs
    Physical Surface("body:NAME")             Bodies/NAME/Spacing (the coarsest zone's), Velocity x, y, and as Material
    -                                         Contact/Friction, Stiffness, Distance
    -                                         Material/E, rho, G0, Force law and so on (`parameters.MATERIAL`)
    -                                         Medium/D, or k and c of heat (pdmesh.drawing.diffusion_conditions)
    -                                         Load cells/NAME/Of "CONDITION, CONDITION", whose forces it sums
    -                                         Refine/crack, notch or hole/Distance, Spacing
    -                                         Horizon ratio, Area rule, Units, Run/Time step, Duration, Frame every
    -                                         Run/Solver (explicit, static), Start, Load steps, Control, Opening,
                                              Damping, Adapt, Collocation damped

Lengths - coordinates, Spacing, Distance, Displacement, Width, Box, Opening - are in the unit that Units names (m), all
else in SI units. A drawing's own numbers go below Peridynamics/Plate/. A component left out is free (of a fix, those
not in Components). ``Box``, "x0 y0 x1 y1", replaces a group. Profiles are "constant", "ramp SECONDS" or a table "TIME
FACTOR, TIME FACTOR, ...".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import LineString, MultiLineString

from pdmesh.drawing import diffusion_conditions
from pdmesh.drawing import parameters as named
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.drawing.units import Unit
from pdmesh.model.document import LARGEST
from pdmesh.scene.plate import Refinement, Zone
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import Curve, SceneError, Surface, parts
from pdmesh.scene.slits import Crack
from pdmesh.spelling import nearest

FLAT = 1e-6  # of a drawing's size: how far it may leave its plane
GROUPS = {  # kind: dimensions, folder of its parameters
    "zone": ((2,), "Zones"),
    "crack": ((1,), None),
    "load": ((1, 2), "Loads"),
    "fix": ((0, 1, 2), "Fixes"),
    "gap": ((0,), None),
    "move": ((1, 2), "Moves"),
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
# kinds of conditions, which may have a box instead of a group
PLACED = ("load", "fix", "move", "absorb", "hold", "supply", "begin")
SHAPES = ("Point", "Curve", "Surface", "Volume")


@dataclass(frozen=True)
class Group:
    """A named group: curves as points (k, 3) in the drawing's unit, and surfaces as lists of such curves."""

    name: str
    dimension: int
    curves: tuple[Any, ...] = ()
    surfaces: tuple[tuple[Any, ...], ...] = ()


def scene_of(groups: Iterable[Group], values: Mapping[str, float | str], source: str, text: str = "") -> Scene:
    """The scene that groups and parameters describe. Raises SceneError naming the group or the parameter."""
    named.refuse_unknown(values, own=True)
    named.refuse_space(values)
    parameters = Parameters(values, named.unit_of(values))
    named_groups = _sorted_out(in_metres(group, parameters.unit) for group in groups)
    _check_groups(named_groups, parameters)
    zones = tuple(
        Zone(
            name,
            _surface(f"zone '{name}'", group),
            _spacing(parameters, name),
            parameters.flag(f"Zones/{name}/Grown", True),
        )
        for name, group in named_groups["zone"].items()
    )
    if not zones:
        raise SceneError("zones: found none, expected at least one (a surface in a group 'zone:NAME')")
    material = named.material(parameters, "Material", None)
    scene = Scene(
        outline=shapely.union_all([zone.shape for zone in zones]),
        notes=_reaching_beyond(zones),
        spacing=max(zone.spacing for zone in zones),
        zones=zones,
        material=material,
        touching=named.contact(parameters),
        medium=named.medium(parameters),
        horizon=parameters.number("Horizon ratio", 3.0),
        run=named.run(parameters),
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
            for line in _lines(f"crack '{name}'", group.curves)
        ),
        source=source,
        drawing=text,
        parameters=tuple(values.items()),
    )
    scene = _with_monitors(scene, named_groups["gap"], parameters)
    scene = _with_bodies(scene, named_groups["body"], parameters)
    scene = _with_regions(_with_conditions(scene, named_groups, parameters), named_groups, parameters)
    return _with_diffusion(scene, named_groups, parameters)


def _reaching_beyond(zones: Sequence[Zone]) -> tuple[str, ...]:
    """Warnings of zones that overlap coarser ones and extend beyond them, which enlarges the plate."""
    notes = []
    for zone in zones:
        coarser = shapely.union_all([other.shape for other in zones if other.spacing > zone.spacing])
        beyond = zone.shape - coarser
        if all(not part.buffer(-zone.spacing / 2).is_empty for part in (zone.shape & coarser, beyond)):
            notes.append(
                f"warning: zone '{zone.name}': found {beyond.area:.4g} m^2 of it beyond the coarser zones, which become"
                " plate too (if they should not: BooleanIntersection with the plate)"
            )
    return tuple(notes)


def in_metres(group: Group, unit: Unit) -> Group:
    """The group with its coordinates in metres."""
    curves, *surfaces = (
        tuple(unit.metres(np.asarray(curve, dtype=float)) for curve in some) for some in (group.curves, *group.surfaces)
    )
    return replace(group, curves=curves, surfaces=tuple(surfaces))


def _spacing(parameters: Parameters, name: str) -> float:
    spacing = parameters.length(f"Zones/{name}/Spacing")
    if not spacing > 0:
        raise SceneError(f"zone '{name}': spacing: found {spacing:g} m, expected more than 0 m")
    return spacing


def _sorted_out(groups: Iterable[Group]) -> dict[str, dict[str, Group]]:
    found: dict[str, dict[str, Group]] = {kind: {} for kind in GROUPS}
    for group in groups:
        kind, _, name = group.name.partition(":")
        if kind not in GROUPS or not name or group.dimension not in GROUPS[kind][0]:
            raise SceneError(f'Physical {SHAPES[group.dimension]}("{group.name}"): expected {_meant(kind, name)}')
        if name in found[kind]:
            raise SceneError(f'group "{group.name}": found as a curve and as a surface, expected one of them')
        found[kind][name] = group
    return found


def _meant(kind: str, name: str) -> str:
    """The valid names most like an invalid group name."""
    near = nearest(kind, GROUPS)
    forms = {
        kind: " or ".join(SHAPES[dimension] for dimension in dimensions) for kind, (dimensions, _) in GROUPS.items()
    }
    others = ", ".join(f'{forms[other]} "{other}:NAME"' for other in GROUPS if other != near)
    return f'Physical {forms[near]}("{near}:{name or "NAME"}"), or {others}'


def _check_groups(groups: dict[str, dict[str, Group]], parameters: Parameters) -> None:
    for kind, (dimensions, folder) in GROUPS.items():
        for name in groups[kind]:
            if kind in PLACED and parameters.text(f"{folder}/{name}/Box"):
                raise SceneError(
                    f"parameter '{PREFIX}{folder}/{name}/Box': found a group '{kind}:{name}' too, expected one of them"
                )
        for name in sorted(parameters.below(folder or "") - set(groups[kind])) if folder else ():
            if kind in PLACED and parameters.text(f"{folder}/{name}/Box"):
                continue
            group = f'Physical {SHAPES[dimensions[0]]}("{kind}:{name}")'
            near = nearest(name, groups[kind])
            meant = f" (or is {PREFIX}{folder}/{near} meant?)" if near else ""
            raise SceneError(f"{group}: found none, expected one for {PREFIX}{folder}/{name}{meant}")
    points = [np.asarray(curve) for group in _all(groups) for curve in _curves_of(group)]
    if points:
        cloud = np.concatenate(points)
        if not np.isfinite(cloud).all():
            raise SceneError("drawing: found a coordinate that is not finite, expected metres")
        if np.ptp(cloud[:, 2]) > FLAT * max(np.ptp(cloud[:, 0]), np.ptp(cloud[:, 1])):
            raise SceneError(
                f"drawing: found z from {cloud[:, 2].min():g} to {cloud[:, 2].max():g} m, expected a plane of one z"
            )


def _all(groups: dict[str, dict[str, Group]]) -> list[Group]:
    return [group for kind in groups.values() for group in kind.values()]


def _curves_of(group: Group) -> list[Any]:
    return [*group.curves, *(curve for surface in group.surfaces for curve in surface)]


def _with_conditions(scene: Scene, groups: dict[str, dict[str, Group]], parameters: Parameters) -> Scene:
    for name, where, folder in _places(groups, parameters, "load"):
        traction, force = (_filled(parameters.pair(f"{folder}/{key}")) for key in ("Traction", "Body force"))
        if traction is None and force is None:
            raise SceneError(f"parameter '{PREFIX}{folder}/Traction x': found none, expected a number (or Traction y)")
        scene = scene.load(where, traction=traction, body_force=force, name=name, **_shared(parameters, folder))
    for name, where, folder in _places(groups, parameters, "fix"):
        x, y = (parameters.maybe_length(f"{folder}/Displacement {axis}") for axis in "xy")
        held = parameters.text(f"{folder}/Components", "xy", of=("xy", "x", "y"))
        for axis, value in (("x", x), ("y", y)):
            if value and axis not in held:
                raise SceneError(
                    f"parameter '{PREFIX}{folder}/Displacement {axis}': found one, expected none of a component that is"
                    f" not held (Components '{held}')"
                )
        x, y = (x or 0.0) if "x" in held else None, (y or 0.0) if "y" in held else None
        scene = scene.fix(where, x, y, name=name, **_shared(parameters, folder))
    for name, where, folder in _places(groups, parameters, "move"):
        moves: dict[str, Any] = {
            key.lower().replace(" ", "_"): pair
            for key in ("Velocity", "Acceleration", "Initial velocity")
            if (pair := parameters.pair(f"{folder}/{key}")) != (None, None)
        }
        scene = scene.move(where, name=name, **moves, **_shared(parameters, folder))
    for name, where, folder in _places(groups, parameters, "absorb"):
        scene = scene.absorb(where, parameters.maybe_length(f"{folder}/Width"), name)
    return scene


def _with_monitors(scene: Scene, gaps: Mapping[str, Group], parameters: Parameters) -> Scene:
    for name, group in gaps.items():
        if len(group.curves) != 2:
            raise SceneError(f"gap '{name}': found {len(group.curves)} points, expected two")
        scene = scene.gap(name, *(_point(curve) for curve in group.curves))
    for name in sorted(parameters.below("Load cells")):
        words = parameters.text(f"Load cells/{name}/Of").split(",")
        scene = scene.load_cell(name, *filter(None, map(str.strip, words)))
    return scene


def _point(curve: Any) -> tuple[float, float]:
    x, y = np.asarray(curve)[0, :2].tolist()
    return x, y


def _with_diffusion(scene: Scene, groups: dict[str, dict[str, Group]], parameters: Parameters) -> Scene:
    """The scene with regions of other media, solids and the conditions of diffusion."""
    for name, group in groups["medium"].items():
        scene = scene.diffusivity(_surface(f"medium '{name}'", group), parameters.number(f"Media/{name}/D"), name)
    for name, group in groups["solid"].items():
        scene = scene.solid(_surface(f"solid '{name}'", group), name)
    places = {kind: _places(groups, parameters, kind) for kind in diffusion_conditions.KINDS}
    return diffusion_conditions.diffusing(scene, places, parameters)


def _places(
    groups: dict[str, dict[str, Group]], parameters: Parameters, kind: str
) -> list[tuple[str, Curve | Surface | shapely.Point, str]]:
    """Name, place and parameter folder of each condition of a kind."""
    top = GROUPS[kind][1]
    found: list[tuple[str, Curve | Surface | shapely.Point, str]] = []
    for name, group in groups[kind].items():
        found.append((name, _where(f"{kind} '{name}'", group), f"{top}/{name}"))
    for name in sorted(parameters.below(str(top)) - set(groups[kind])):
        found.append((name, _box(parameters, f"{top}/{name}/Box"), f"{top}/{name}"))
    return found


def _where(place: str, group: Group) -> Curve | Surface | shapely.Point:
    if group.dimension == 2:
        return _surface(place, group)
    if group.dimension == 1:
        return MultiLineString(_lines(place, group.curves))
    if len(group.curves) != 1:
        raise SceneError(f"{place}: found {len(group.curves)} points, expected one: a support at one node")
    return shapely.Point(_point(group.curves[0]))


def _box(parameters: Parameters, name: str) -> Surface:
    text, place = parameters.text(name), PREFIX + name
    try:
        x0, y0, x1, y1 = (parameters.unit.metres(float(word)) for word in text.split())
    except ValueError:
        raise SceneError(f"parameter '{place}': found '{text}', expected four numbers 'x0 y0 x1 y1'") from None
    if not (-LARGEST <= x0 < x1 <= LARGEST and -LARGEST <= y0 < y1 <= LARGEST):
        raise SceneError(f"parameter '{place}': found '{text}', expected x0 < x1 and y0 < y1, at most {LARGEST:g} m")
    return shapely.box(x0, y0, x1, y1)


def _shared(parameters: Parameters, folder: str) -> dict[str, Any]:
    """Rows, profile and breakable of a condition, from its parameters."""
    return {
        "rows": parameters.whole(f"{folder}/Rows", 1),
        "profile": parameters.profile(f"{folder}/Profile"),
        "breakable": parameters.flag(f"{folder}/Breakable", False),
    }


def _filled(pair: tuple[float | None, float | None]) -> tuple[float, float] | None:
    return None if pair == (None, None) else (pair[0] or 0.0, pair[1] or 0.0)


def _with_bodies(scene: Scene, groups: dict[str, Group], parameters: Parameters) -> Scene:
    for name, group in groups.items():
        folder, known = f"Bodies/{name}", parameters.below(f"Bodies/{name}")
        own = known - {"Spacing", "Velocity x", "Velocity y"}
        scene = scene.body(
            _surface(f"body '{name}'", group),
            name,
            parameters.maybe_length(f"{folder}/Spacing"),
            named.material(parameters, folder, scene.material) if own else None,
            _filled(parameters.pair(f"{folder}/Velocity")) or (0.0, 0.0),
        )
    return scene


def _with_regions(scene: Scene, groups: dict[str, dict[str, Group]], parameters: Parameters) -> Scene:
    for name, group in groups["material"].items():
        material = named.material(parameters, f"Materials/{name}", scene.material)
        if material is None:
            raise SceneError(f"parameter '{PREFIX}Materials/{name}/E': found none, expected a number")
        scene = scene.region(_surface(f"material '{name}'", group), material, name)
    return scene


# ---- curves


def _lines(place: str, curves: Iterable[Any]) -> list[LineString]:
    lines = [LineString(np.asarray(points)[:, :2]) for points in curves]
    lines = [line for line in lines if line.length > 0]
    if not lines:
        raise SceneError(f"{place}: found no curve of any length, expected at least one")
    merged = shapely.line_merge(MultiLineString(lines))
    return list(merged.geoms) if isinstance(merged, MultiLineString) else [merged]


def _surface(place: str, group: Group) -> Surface:
    return shapely.union_all([face(curves, place) for curves in group.surfaces])


def face(curves: Iterable[Any], place: str) -> shapely.Polygon:
    """The face bounded by curves, points (k, 2 or 3). Raises SceneError if they do not close, or cross."""
    lines = _lines(place, curves)
    polygons, cuts, dangles, _ = shapely.polygonize_full(lines)
    crossing = [line for line in lines if not line.is_simple]
    if crossing or not MultiLineString(lines).is_simple:
        reason = shapely.is_valid_reason(shapely.Polygon(crossing[0])) if crossing else "curves that cross"
        raise SceneError(f"{place}: found {reason}, expected an outline that does not cross itself")
    for loose in (dangles, cuts):
        if not loose.is_empty:
            x, y = shapely.get_coordinates(loose)[0]
            raise SceneError(f"{place}: found an outline open at ({x:g}, {y:g}) m, expected closed curves")
    faces = parts(polygons)
    if not faces:
        raise SceneError(f"{place}: found an outline that does not close, expected closed curves")
    return max(faces, key=lambda part: float(shapely.Polygon(part.exterior).area))
