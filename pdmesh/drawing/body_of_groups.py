"""A drawing in space - volumes and surfaces in named groups, and parameters - as a Body.

    group                                      parameters below Peridynamics/
    Physical Volume("zone:NAME")               Zones/NAME/Spacing, Grown (1)
    Physical Surface("crack:NAME")             -
    Physical Surface or Volume("load:NAME")    Loads/NAME/Traction, Body force or (total) Force x, y, z; *
    Physical Surface or Volume("fix:NAME")     Fixes/NAME/Components (xyz), Displacement x, y, z; *
    Physical Surface or Volume("move:NAME")    Moves/NAME/Velocity, Acceleration or Initial velocity x, y, z; *
    Physical Surface or Volume("spring:NAME")  Springs/NAME/Stiffness x, y, z of a face, or Body stiffness x, y, z
    Physical Point("fix:NAME" or "load:NAME")  the same of the one node nearest to it, for loads Force x, y, z
    Physical Point("gap:NAME")                 - (two points, between which the opening is monitored)
    -                                          Load cells/NAME/Of "CONDITION, CONDITION", whose forces it sums
    * of each condition                        Rows (1), Profile (constant), Breakable (0); without a group
                                               Box "x0 y0 z0 x1 y1 z1", Face, words that pick one, or
                                               (`pdmesh.scene.faces`) Node "x,y,z" of loads and fixes
    Physical Volume("material:NAME")           Materials/NAME/ as in the plane: the values that differ
    Physical Volume("body:NAME")               Bodies/NAME/ as in the plane, with Velocity z; Spin is "x y z", rad/s

The body is the union of all zones; Contact/ is as in the plane. All other parameters are those of a plate
(`pdmesh.drawing.plate_of_groups`), except those that only plates have.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from pdmesh.drawing import diffusion_conditions, mechanical_conditions
from pdmesh.drawing import parameters as named
from pdmesh.drawing.bodies_beside import with_bodies, with_regions
from pdmesh.drawing.group_names import Physical, meaning, picked
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.drawing.shells import sheet_of, shell_of
from pdmesh.scene.body import Body, SolidZone, Where
from pdmesh.scene.edges import point_in
from pdmesh.scene.faces import face
from pdmesh.scene.shapes import SceneError, checked_spacing
from pdmesh.scene.solids import NodeSet, Sheet, Shell, brick

KINDS = {  # kind: dimensions, folder of its parameters
    "zone": ((3,), "Zones"),
    "crack": ((2,), None),
    "load": ((2, 3, 0), "Loads"),
    "fix": ((2, 3, 0), "Fixes"),
    "gap": ((0,), None),
    "move": ((2, 3), "Moves"),
    "spring": ((2, 3), "Springs"),
    "material": ((3,), "Materials"),
    "hold": ((2, 3), "Holds"),
    "supply": ((2, 3), "Supplies"),
    "exchange": ((2,), "Exchanges"),
    "begin": ((3,), "Begins"),
    "solid": ((3,), None),
    "medium": ((3,), "Media"),
    "body": ((3,), "Bodies"),
}
KINDS_OF_PLATES = ("absorb", "pin")
ON_PLATES = ("/Edge",)
OF_PLATES = ("Refine/", "Absorbs/", "Pins/", "Area rule", "Run/Adapt")
Placed = list[tuple[str, Where, str]]  # name, where, and the folder of its parameters


def body_of(gmsh_output: Mapping[str, Any], values: Mapping[str, float | str], source: str, text: str = "") -> Body:
    """The body that groups and parameters describe. Raises SceneError naming the group or the parameter."""
    named.refuse_unknown(values, from_drawing=True)
    for name in values:
        if name.removeprefix(PREFIX).startswith(OF_PLATES) or name.endswith(ON_PLATES):
            raise SceneError(f"parameter '{name}' is for plates only; leave it out for a body in space")
    parameters = Parameters(values, named.unit_of(values))
    raw_groups = gmsh_output["groups"]
    physical = [Physical(group["name"], group["dimension"], group["number"]) for group in raw_groups]
    meant = meaning(physical, gmsh_output["zones"], KINDS, parameters, KINDS_OF_PLATES)
    groups = {kind: {name: raw_groups[at] for name, at in places.items()} for kind, places in meant.groups.items()}
    spacings = {
        name: checked_spacing(parameters.length(f"Zones/{name}/Spacing"), f"zone '{name}': spacing")
        for name in groups["zone"]
    }
    if not spacings:
        raise SceneError("zones: there is none, and no volume in the drawing; add one, such as 'zone:NAME'")
    coarsest = max(spacings.values())
    body = Body(
        _shell(gmsh_output, gmsh_output["whole"], parameters),
        coarsest,
        notes=meant.notes,
        material=named.material(parameters, "Material", None),
        medium=named.medium(parameters),
        horizon=parameters.number("Horizon ratio", 3.0),
        run=named.run(parameters),
        touching=named.contact(parameters),
        source=source,
        drawing=text,
        parameters=tuple(values.items()),
        zones=tuple(
            SolidZone(
                name,
                _shell(gmsh_output, groups["zone"][name], parameters),
                spacing,
                parameters.flag(f"Zones/{name}/Grown", True),
            )
            for name, spacing in spacings.items()
            if spacing < coarsest
        ),
    )
    for name, group in groups["crack"].items():
        body = body.crack(_sheet(gmsh_output, group, parameters), name)
    kinds = (*mechanical_conditions.KINDS, *diffusion_conditions.KINDS)
    places = {kind: _places(gmsh_output, groups[kind], parameters, kind) for kind in kinds}
    body = mechanical_conditions.acted_on(body, places, parameters)
    gaps = {name: _points(group, parameters) for name, group in groups["gap"].items()}
    body = mechanical_conditions.monitored(body, gaps, parameters)
    shells = {
        kind: {name: _shell(gmsh_output, group, parameters) for name, group in groups[kind].items()}
        for kind in ("material", "medium", "solid", "body")
    }
    body = with_regions(body, shells["material"], shells["medium"], parameters)
    for name, shell in shells["solid"].items():
        body = body.dissolve(shell, name)
    body = with_bodies(body, shells["body"], parameters)
    return diffusion_conditions.diffusing(body, places, parameters)


def _shell(gmsh_output: Mapping[str, Any], group: Mapping[str, Any], parameters: Parameters) -> Shell:
    """Surface of a group, m, with its volume, m^3; or the nodes of one."""
    if "rows" in group:
        return NodeSet.of(parameters.unit.metres(gmsh_output["points"][group["rows"]]), group["rows"])
    shell, unit = shell_of(gmsh_output, group), parameters.unit
    return Shell(unit.metres(shell.triangles), shell.volume * float(unit.metres(1.0)) ** 3)


def _sheet(gmsh_output: Mapping[str, Any], group: Mapping[str, Any], parameters: Parameters) -> Sheet:
    return Sheet(parameters.unit.metres(sheet_of(gmsh_output, group).triangles))


def _points(group: Mapping[str, Any], parameters: Parameters) -> list[tuple[float, ...]]:
    """The points of a group, m."""
    return [tuple(parameters.unit.metres(np.array(curve[0], dtype=float)).tolist()) for curve in group["curves"]]


def _places(gmsh_output: Mapping[str, Any], groups: Mapping[str, Any], parameters: Parameters, kind: str) -> Placed:
    """Names, places and parameter folders of the conditions of a kind."""
    top = KINDS[kind][1]
    places: Placed = []
    for name, group in groups.items():
        if group["dimension"]:
            shape = _shell if group["dimension"] == 3 else _sheet
            where: Where = shape(gmsh_output, group, parameters)
        else:
            points = _points(group, parameters)
            if len(points) != 1:
                raise SceneError(
                    f'group "{group["name"]}" has {len(points)} points; use one, as it is a support at one node'
                )
            where = shapely.Point(points[0])
        places.append((name, where, f"{top}/{name}"))
    for name in sorted(parameters.below(str(top)) - set(groups)):
        word, *others = picked(parameters, f"{top}/{name}")
        if others:
            raise SceneError(
                f"parameter '{PREFIX}{top}/{name}/{others[0]}' cannot be combined with a {word}; use one of them"
            )
        places.append((name, _placed(gmsh_output, parameters, f"{top}/{name}/{word}"), f"{top}/{name}"))
    return places


def _placed(gmsh_output: Mapping[str, Any], parameters: Parameters, name: str) -> Where:
    if name.endswith("/Box"):
        text, place = parameters.text(name), PREFIX + name
        try:
            x0, y0, z0, x1, y1, z1 = (parameters.unit.metres(float(word)) for word in text.split())
        except ValueError:
            wanted = "use six numbers 'x0 y0 z0 x1 y1 z1' in a body"
            raise SceneError(f"parameter '{place}' is '{text}'; {wanted}") from None
        if not (x0 < x1 and y0 < y1 and z0 < z1):
            raise SceneError(f"parameter '{place}' is '{text}'; use x0 < x1, y0 < y1 and z0 < z1")
        return brick((x0, y0, z0), (x1, y1, z1))
    if name.endswith("/Node"):
        return shapely.Point(point_in(parameters.text(name), 3, f"parameter '{PREFIX}{name}'", parameters.unit))
    return face(
        _shell(gmsh_output, gmsh_output["whole"], parameters),
        parameters.text(name),
        f"parameter '{PREFIX}{name}'",
        parameters.unit,
    )
