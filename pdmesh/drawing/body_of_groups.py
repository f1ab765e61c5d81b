"""A drawing in space - volumes and surfaces in named groups, and parameters - as a Body.

    group                                      parameters below Peridynamics/
    Physical Volume("zone:NAME")               Zones/NAME/Spacing, Grown (1)
    Physical Surface("crack:NAME")             -
    Physical Surface or Volume("load:NAME")    Loads/NAME/Traction, Body force or (total) Force x, y, z; *
    Physical Surface("load:NAME")              Loads/NAME/Pressure, Following (0), of a face, or Face "crack NAME"; *
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

Triangles of Gmsh as shells and sheets, and whether they are the surfaces of its volumes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pdmesh.drawing import conditions, plate_of_groups
from pdmesh.drawing import parameters as named
from pdmesh.drawing.conditions import single_point
from pdmesh.drawing.group_names import Physical, meaning
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.model.triangulated_surface import gap, orientation, volume
from pdmesh.quantities import Unit
from pdmesh.scene.body import Body, SolidZone, Where
from pdmesh.scene.faces import face
from pdmesh.scene.pressed_edges import CRACK
from pdmesh.scene.shapes import SceneError, checked_spacing
from pdmesh.scene.solids import NodeSet, Sheet, Shell

EXACT = 1e-3  # relative: a volume of Gmsh this near to that of curved triangles is right
ROUND_OFF = 1e-9  # relative, of volumes
SPACING = f"{PREFIX}Zones/body/Spacing"
KINDS_OF_PLATES = ("absorb", "pin")
KINDS = {  # as in a plate, of shapes with a dimension more; points stay points
    kind: (tuple(sorted((number and number + 1 for number in dimensions), key=bool, reverse=True)), folder)
    for kind, (dimensions, folder) in plate_of_groups.KINDS.items()
    if kind not in KINDS_OF_PLATES
}
ON_PLATES = ("/Edge",)
OF_PLATES = ("Refine/", "Absorbs/", "Pins/", "Area rule", "Run/Adapt")


def shell_of(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> Shell:
    """The shell of a group of volumes.

    Its volume is that of Gmsh. Where Gmsh has none, or another than its own curved triangles, it is theirs.
    """
    triangles, volume_of_gmsh = sheet_of(geometry, group).triangles, float(group["volume"])
    if group.get("cones"):
        curved = float(orientation(triangles) @ np.array(group["cones"]))
        return Shell(triangles, volume_of_gmsh if abs(volume_of_gmsh - curved) <= EXACT * abs(curved) else curved)
    return Shell(triangles, volume_of_gmsh or volume(triangles))


def sheet_of(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> Sheet:
    """The triangles of a group of surfaces or volumes."""
    points = np.array(geometry["points"], dtype=float).reshape(-1, 3)
    return Sheet(points[np.array(group["triangles"], dtype=np.int64).reshape(-1, 3)])


def closes(geometry: Mapping[str, Any]) -> bool:
    """Whether triangles close around all volumes."""
    return all(gap(sheet_of(geometry, group).triangles) is None for group in _volumes(geometry))


def fits(geometry: Mapping[str, Any]) -> bool:
    """Whether triangles close around all volumes, and enclose what Gmsh says that they do."""
    return closes(geometry) and all(_agrees(geometry, group) for group in _volumes(geometry))


def with_own_volumes(geometry: Mapping[str, Any]) -> dict[str, Any]:
    """Triangles whose groups have no volume of Gmsh where the triangles enclose a different one."""
    *groups, zone_union = (
        group | ({} if group["dimension"] != 3 or _agrees(geometry, group) else {"volume": 0.0})
        for group in [*geometry["groups"], geometry["whole"]]
    )
    return {**geometry, "groups": groups, "whole": zone_union}


def _volumes(geometry: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [group for group in [*geometry["groups"], geometry["whole"]] if group["dimension"] == 3]


def _agrees(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> bool:
    sheet, group_volume = sheet_of(geometry, group), float(group["volume"])
    if group["cones"] or not group_volume:
        return True
    return bool(
        abs(group_volume - volume(sheet.triangles)) <= geometry["tolerance"] * sheet.area + ROUND_OFF * group_volume
    )


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
    shapes = BodyShapes(gmsh_output, parameters.unit)
    body = Body(
        shapes.shell(gmsh_output["whole"]),
        coarsest,
        notes=meant.notes,
        zones=tuple(
            SolidZone(
                name,
                shapes.shell(groups["zone"][name]),
                spacing,
                parameters.flag(f"Zones/{name}/Grown", True),
            )
            for name, spacing in spacings.items()
            if spacing < coarsest
        ),
        **named.of_scene(parameters, source, text, values),
    )
    for name, group in groups["crack"].items():
        body = body.crack(shapes.sheet(group), name)
    body = conditions.with_bodies(body, groups, shapes, parameters)
    places = conditions.places_of(groups, shapes, parameters, 3)
    body = conditions.acted_on(body, places, parameters)
    for name, group in groups["solid"].items():
        body = body.dissolve(shapes.shell(group), name)
    body = conditions.with_monitors_and_regions(body, groups, shapes, parameters)
    return conditions.diffusing(body, places, parameters)


class BodyShapes:
    """Shapes of a body's groups, m."""

    def __init__(self, gmsh_output: Mapping[str, Any], unit: Unit) -> None:
        self._gmsh_output, self._unit = gmsh_output, unit

    def shell(self, group: Mapping[str, Any]) -> Shell:
        """Surface of a group with its volume, m^3; or the nodes of one."""
        if "rows" in group:
            return NodeSet.of(self._unit.to_si(self._gmsh_output["points"][group["rows"]]), group["rows"])
        shell = shell_of(self._gmsh_output, group)
        return Shell(self._unit.to_si(shell.triangles), shell.volume * float(self._unit.to_si(1.0)) ** 3)

    def sheet(self, group: Mapping[str, Any]) -> Sheet:
        """The triangles of a group."""
        return Sheet(self._unit.to_si(sheet_of(self._gmsh_output, group).triangles))

    def area(self, group: Mapping[str, Any], place: str) -> Shell:
        """The shell of a group."""
        return self.shell(group)

    def where(self, group: Mapping[str, Any], place: str) -> Where:
        """The shell, the sheet or the point of a group. Raises SceneError."""
        if group["dimension"] == 0:
            return single_point(self.points(group), place)
        return self.shell(group) if group["dimension"] == 3 else self.sheet(group)

    def points(self, group: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """The points of a group."""
        return [tuple(self._unit.to_si(np.array(curve[0], dtype=float)).tolist()) for curve in group["curves"]]

    def part_of_boundary(self, words: str, place: str) -> Where:
        """The face that words pick; of a pre-crack the words, which a pressure knows. Raises SceneError."""
        if words.startswith(CRACK):
            return words
        return face(self.shell(self._gmsh_output["whole"]), words, place, self._unit)
