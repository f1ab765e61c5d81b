"""A drawing as Gmsh or a mesh file has it - curves and surfaces in named groups, and parameters - as a Scene.

    group                                     parameters below Peridynamics/
    Physical Surface("zone:NAME")             Zones/NAME/Spacing, Grown (1)
    Physical Curve("crack:NAME")              -
    Physical Curve or Surface("load:NAME")    Loads/NAME/Traction x, y, Body force x, y or (total) Force x, y; *
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
from typing import Any

import numpy as np
import shapely

from pdmesh.drawing import diffusion_conditions, mechanical_conditions
from pdmesh.drawing import parameters as named
from pdmesh.drawing.bodies_beside import with_bodies, with_regions
from pdmesh.drawing.group_names import Physical, meaning
from pdmesh.drawing.parameters import Parameters
from pdmesh.drawing.plate_places import Group, in_metres, lines_of, places, point_of, surface_of
from pdmesh.scene.plate import Refinement, Zone
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.slits import Crack

FLAT = 1e-6  # of a drawing's size: how far it may leave its plane
GROUPS = {  # kind: dimensions, folder of its parameters
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
    meant = meaning(physical, new_zones, GROUPS, parameters)
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
        material=named.material(parameters, "Material", None),
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
            for line in lines_of(f"crack '{name}'", group.curves)
        ),
        source=source,
        drawing=text,
        parameters=tuple(values.items()),
    )
    scene = with_bodies(
        scene,
        {name: surface_of(f"body '{name}'", group) for name, group in named_groups["body"].items()},
        parameters,
    )
    return _with_conditions(scene, named_groups, parameters)


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
            )


def _with_conditions(scene: Scene, groups: dict[str, dict[str, Group]], parameters: Parameters) -> Scene:
    """The scene with regions of other materials and media, solids, and all that acts on it."""
    kinds = (*mechanical_conditions.KINDS, *diffusion_conditions.KINDS)
    placed = {kind: places(scene, groups[kind], parameters, kind, str(GROUPS[kind][1])) for kind in kinds}
    scene = mechanical_conditions.acted_on(scene, placed, parameters)
    for name, where, folder in places(scene, groups["pin"], parameters, "pin", "Pins"):
        scene = scene.pin_hole(where, name=name, **mechanical_conditions.rows(parameters, folder))
    for name, where, folder in places(scene, groups["absorb"], parameters, "absorb", "Absorbs"):
        scene = scene.absorb(where, parameters.maybe_length(f"{folder}/Width"), name)
    gaps = {name: [point_of(curve) for curve in group.curves] for name, group in groups["gap"].items()}
    scene = mechanical_conditions.monitored(scene, gaps, parameters)
    surfaces = {
        kind: {name: surface_of(f"{kind} '{name}'", group) for name, group in groups[kind].items()}
        for kind in ("material", "medium", "solid")
    }
    scene = with_regions(scene, surfaces["material"], surfaces["medium"], parameters)
    for name, surface in surfaces["solid"].items():
        scene = scene.solid(surface, name)
    return diffusion_conditions.diffusing(scene, placed, parameters)
