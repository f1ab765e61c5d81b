"""Builds the grid of a scene in Python: Gmsh triangulates its solids, and its functions of place become tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from pdmesh.drawing.body_of_groups import shell_of
from pdmesh.drawing.sandbox.child import read_trusted
from pdmesh.drawing.scratch import scratch
from pdmesh.grid import building
from pdmesh.grid.building import Built
from pdmesh.model.values_of_place import replaced, varying
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import Box, Cylinder, Joined, Shell, Solid, Sphere

TIME_LIMIT = 300.0  # s
BODY = "zone:body"
S = TypeVar("S", bound=Scene | Body)


def build(scene: Scene | Body) -> Built:
    """The grid of a plate or a body. Gmsh triangulates the solids of a body first, in a process of its own.

    Raises SceneError if the grid does not represent the scene, or if Gmsh fails.
    """
    if isinstance(scene, Body):
        from pdmesh.drawing.building import meshed

        scene = meshed(scene)
    return building.build(scene)


def meshed(body: Body) -> Body:
    """The body with shells in place of its solids. Raises SceneError for an invalid solid and if Gmsh fails."""
    wanted: dict[str, Solid] = {BODY: body.solid}
    wanted |= {f"zone '{zone.name}'": zone.solid for zone in body.zones}
    wanted |= {f"material '{part.region.name}'": part.solid for part in body.regions}
    wanted |= {f"medium '{part.region.name}'": part.solid for part in body.media}
    wanted |= {
        f"{number}: {condition.action.name}": condition.where
        for number, condition in enumerate(body.conditions)
        if isinstance(condition.where, Solid)
    }
    shells = _shells({name: solid for name, solid in wanted.items() if not isinstance(solid, Shell)}, body.finest)

    def found(name: str) -> Solid:
        return shells.get(name, wanted[name])

    return replace(
        body,
        bodies=tuple(replace(other_body, body=meshed(other_body.body)) for other_body in body.bodies),
        solid=found(BODY),
        zones=tuple(replace(zone, solid=found(f"zone '{zone.name}'")) for zone in body.zones),
        regions=tuple(replace(part, solid=found(f"material '{part.region.name}'")) for part in body.regions),
        media=tuple(replace(part, solid=found(f"medium '{part.region.name}'")) for part in body.media),
        conditions=tuple(
            replace(condition, where=found(f"{number}: {condition.action.name}"))
            if isinstance(condition.where, Solid)
            else condition
            for number, condition in enumerate(body.conditions)
        ),
    )


def _shells(solids: Mapping[str, Solid], spacing: float) -> dict[str, Shell]:
    if not solids:
        return {}
    lines = [
        'SetFactory("OpenCASCADE");',
        f'DefineConstant[ h = {{{spacing!r}, Name "Peridynamics/Zones/body/Spacing"}} ];',
    ]
    groups = {}
    for number, (name, solid) in enumerate(solids.items()):
        group = groups[name] = name if name == BODY else f"solid:{number}"
        tags = _said(solid, lines, name)
        lines.append(f'Physical Volume("{group}") = {{{tags}()}};')
    with scratch() as folder:
        path = folder / "solids.geo"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        gmsh_output = read_trusted(path, [], TIME_LIMIT)
    for message in gmsh_output["messages"]:
        raise SceneError(f"body: Gmsh says: {message}")
    groups_by_name = {group["name"]: group for group in gmsh_output["groups"]}
    shells = {}
    for name, group in groups.items():
        if group not in groups_by_name:
            raise SceneError(f"{name}: nothing is left of it; use a solid with an inside")
        shells[name] = shell_of(gmsh_output, groups_by_name[group])
    return shells


def _said(solid: Solid, lines: list[str], place: str) -> str:
    """Append statements that make a solid to `lines`; returns the name of the list of its volumes."""
    name = f"s{len(lines)}"
    if isinstance(solid, Joined):
        first, second = _said(solid.first, lines, place), _said(solid.second, lines, place)
        name = f"s{len(lines)}"
        lines.append(f"{name}() = {solid.how}{{ Volume{{{first}()}}; Delete; }}{{ Volume{{{second}()}}; Delete; }};")
        return name
    if isinstance(solid, Box):
        size = np.subtract(solid.high, solid.low)
        said = f"Box(v) = {{{_words(*solid.low, *size)}}};"
    elif isinstance(solid, Sphere):
        said = f"Sphere(v) = {{{_words(*solid.centre, solid.radius)}}};"
    elif isinstance(solid, Cylinder):
        ends = *solid.start, *np.subtract(solid.end, solid.start), solid.radius
        if solid.end_radius is None or solid.end_radius == solid.radius:
            said = f"Cylinder(v) = {{{_words(*ends)}}};"
        else:
            said = f"Cone(v) = {{{_words(*ends, solid.end_radius)}}};"
    else:
        raise SceneError(f"{place} is {type(solid).__name__}; use Box, Cylinder, Sphere, or some of them")
    lines.append(f"v = newv; {said} {name}() = {{v}};")
    return name


def _words(*numbers: float) -> str:
    return ", ".join(repr(float(number)) for number in numbers)


def tabulated(scene: S) -> S:
    """The scene with tables in place of functions, which other processes do not know. Raises SceneError."""
    if isinstance(scene, Body) and any(_functions(other_body.body) for other_body in scene.bodies):
        bodies = tuple(replace(other_body, body=tabulated(other_body.body)) for other_body in scene.bodies)
        scene = replace(scene, bodies=bodies)
    if any(callable(field.value) for field in scene.fields):
        plain: Any = replace(scene, fields=())
        places = build(plain).grid.position
        scene = replace(scene, fields=tuple(field.tabulated(places) for field in scene.fields))
    if not _functions(scene):
        return scene
    alone = replace(scene, bodies=()) if isinstance(scene, Body) else scene
    built = build(alone).settings.conditions[-len(scene.conditions) :]
    changed: list[Any] = []
    conditions: tuple[Any, ...] = scene.conditions
    for condition, built_condition in zip(conditions, built, strict=True):
        tables = {(name, at): value for name, at, value in varying(built_condition)}
        action = condition.action
        for function in condition.functions:
            action = replaced(action, function.name, function.number, tables[function.name, function.number])
        changed.append(replace(condition, action=action, functions=()))
    return replace(scene, conditions=tuple(changed))  # type: ignore[arg-type]


def _functions(scene: Scene | Body) -> bool:
    """Whether a condition of the scene has a function."""
    return any(condition.functions for condition in scene.conditions)
