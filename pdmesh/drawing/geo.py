"""Reads a .geo drawing, a STEP or a BREP file as a Scene: Gmsh reads it in a separate process (sandbox/).

`plate_of_groups` and `body_of_groups` interpret the groups and parameters. Parameters are ONELAB parameters below
``Peridynamics/``, so that Gmsh's own window edits them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely

from pdmesh.drawing.body_of_groups import body_of
from pdmesh.drawing.parameters import (
    OWN,
    PREFIX,
    Parameter,
    full_name,
    given,
    needed,
    refuse_unknown,
    unit_of,
    unit_of_parameter,
    unknown,
)
from pdmesh.drawing.part import OPEN_CASCADE_UNITS
from pdmesh.drawing.part_model import refuse_marks
from pdmesh.drawing.plate_of_groups import Group, face, in_metres, scene_of
from pdmesh.drawing.sandbox.child import read_copies, read_trusted
from pdmesh.drawing.sandbox.copies import Copy, cad_copy, drawing_bytes, drawing_copies
from pdmesh.drawing.sandbox.tokens import decoded
from pdmesh.files import FilePath
from pdmesh.quantities import UNITS
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import CHORD_TOLERANCE, SceneError, Surface, errors_at

TIME_LIMIT = 60.0  # s, for a drawing
CAD_SECONDS, CAD_SECONDS_PER_BYTE = 60.0, 1e-5  # a broken file may never end


def read_geo(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> Scene | Body:
    """The plate or the body drawn in the .geo file at `path`, with ONELAB parameters set by name before it is read.

    Parameter names may leave out ``Peridynamics/``. Parameters that the drawing does not define may be set too. `trust`
    also reads files that run commands. Raises SceneError naming the file, the place, what was found and what was
    expected.
    """
    text = decoded(drawing_bytes(path))
    refuse_marks(path, text)
    copies = {} if trust else drawing_copies(path)
    gmsh_output = _found(path, assignments, copies)
    values = {entry["name"]: _value(entry) for entry in gmsh_output["parameters"]}
    scene = _scene(path, gmsh_output, values, text)
    remarks = tuple(f"{path}: Gmsh says: {message}" for message in dict.fromkeys(gmsh_output["remarks"]))
    # words of drawings that have no effect
    notes = []
    for copy in copies.values():
        for words, what, why in (
            (copy.unused, "not used", "nodes are as far apart as Zones/NAME/Spacing says"),
            (copy.skipped, "left out", "a grid has no use for meshes, views and pictures of Gmsh"),
        ):
            if words:
                listed = ", ".join(f"{word} (line {line})" for word, line in words.items())
                notes.append(f"{copy.path}: {what}: {listed}; {why}")
    return replace(scene, notes=(*scene.notes, *notes, *remarks))


def _scene(path: Path, gmsh_output: Mapping[str, Any], values: Mapping[str, float | str], text: str) -> Scene | Body:
    with errors_at(path):
        if "points" in gmsh_output:
            return body_of(gmsh_output, values, path.name, text)
        return scene_of(_groups(gmsh_output), values, path.name, text, gmsh_output["zones"])


def read_parameters(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> list[Parameter]:
    """The parameters of the .geo file at `path`. Raises SceneError."""
    refuse_marks(path, decoded(drawing_bytes(path)))
    gmsh_output = _found(path, assignments, {} if trust else drawing_copies(path))
    return [
        Parameter(entry["name"], _value(entry), entry.get("attributes", {}).get("Units", ""), entry.get("help", ""))
        for entry in gmsh_output["parameters"]
    ]


def read_cad(path: Path, assignments: Sequence[tuple[str, str]] = ()) -> Scene | Body:
    """The plate in a STEP or BREP file as a scene with zone ``plate``, or its volumes as a body with zone ``body``.

    Parameters are those of a .geo file. A STEP file names the unit of its coordinates; those of a BREP file are in the
    unit of the parameters. Raises SceneError.
    """
    with errors_at(path):
        values = given(assignments)
        unit_of(values)
    spacings = [
        values[f"{PREFIX}Zones/{name}/Spacing"]
        for name in ("plate", "body")
        if f"{PREFIX}Zones/{name}/Spacing" in values
    ]
    spacing, unit = next(iter(spacings), None), str(values.get(f"{PREFIX}Units") or "m")
    gmsh_output = _shapes(path, CHORD_TOLERANCE * spacing if isinstance(spacing, float) else 0.0, unit)
    if not any(name.startswith(f"{PREFIX}Zones/") for name in values):
        zone = "body" if "points" in gmsh_output else "plate"
        raise SceneError(
            f"{path}: parameter '{PREFIX}Zones/{zone}/Spacing' is missing; give it (--set Zones/{zone}/Spacing=...),"
            f" or begin with pdmesh init {path}"
        )
    return _scene(path, gmsh_output, values, path.read_text(encoding="utf-8", errors="replace"))


def cad_parameters(path: Path, assignments: Sequence[tuple[str, str]] = ()) -> list[Parameter]:
    """The parameters that a STEP or BREP file needs, those without a value as "", and those that are set.

    Raises SceneError.
    """
    with errors_at(path):
        values = given(assignments)
        unit_of(values)
    unit = str(values.get(f"{PREFIX}Units") or "m")
    gmsh_output = _shapes(path, 0.0, unit)
    zone = "body" if "points" in gmsh_output else "plate"
    return needed(values, f"Zones/{zone}/Spacing", unit)


def read_outline(path: FilePath, spacing: float, unit: str = "m") -> Surface:
    """The plate in a STEP or BREP file, for a scene in Python with nodes of `spacing`, m.

    `unit` is that of a BREP file's coordinates; a STEP file names its own. Raises SceneError.
    """
    path = Path(path)
    gmsh_output = _shapes(path, CHORD_TOLERANCE * UNITS[unit].of(spacing), unit)
    if "points" in gmsh_output:
        raise SceneError(f"{path} has volumes, and a plate is needed; remove them")
    surfaces = [curves for group in _groups(gmsh_output) for curves in in_metres(group, UNITS[unit]).surfaces]
    return shapely.union_all([face(curves, str(path)) for curves in surfaces])


def _found(path: Path, assignments: Sequence[tuple[str, str]], copies: Mapping[str, Copy]) -> Mapping[str, Any]:
    """Output of Gmsh for a drawing: for its copies or, if there are none, for the trusted file. Raises SceneError."""
    named = [(full_name(name), text, unit_of_parameter(full_name(name))) for name, text in assignments]
    gmsh_output = read_copies(copies, named, TIME_LIMIT) if copies else read_trusted(path, named, TIME_LIMIT)
    # parameters that were set but are unknown to the drawing and to the mesher
    drawing_names = {entry["name"] for entry in gmsh_output["parameters"]} - set(gmsh_output["supplied"])
    with errors_at(path):
        refuse_unknown(
            [name for name in gmsh_output["supplied"] if not name.startswith(f"{PREFIX}{OWN}/")], from_drawing=True
        )
    for name in gmsh_output["supplied"]:
        if name.startswith(f"{PREFIX}{OWN}/"):
            raise SceneError(f"{path}: {unknown(name, drawing_names)}")
    for name, text, use in gmsh_output["not numbers"]:
        raise SceneError(f"{path}: parameter '{name}' is '{text}'; use {use}")
    _refuse_messages(path, gmsh_output)
    for entry in gmsh_output["parameters"]:
        value, low, high = _value(entry), entry.get("min", -1e200), entry.get("max", 1e200)
        if isinstance(value, float) and not low * (1 - 1e-12) <= value <= high * (1 + 1e-12):
            raise SceneError(f"{path}: parameter '{entry['name']}' is {value:g}; use a number from {low:g} to {high:g}")
    return gmsh_output


def _shapes(path: Path, tolerance: float, unit: str) -> Mapping[str, Any]:
    """Output of Gmsh for a CAD file, in a unit. Raises SceneError."""
    copies = cad_copy(path)
    limit = CAD_SECONDS + CAD_SECONDS_PER_BYTE * sum(len(copy.data) for copy in copies.values())
    gmsh_output = read_copies(copies, [], limit, tolerance, OPEN_CASCADE_UNITS.get(unit, unit.upper()))
    _refuse_messages(path, gmsh_output)
    if "points" not in gmsh_output and not any(group["surfaces"] for group in gmsh_output["groups"]):
        raise SceneError(f"{path} has no surface; draw a plate")
    return gmsh_output


def _refuse_messages(path: Path, gmsh_output: Mapping[str, Any]) -> None:
    for message in gmsh_output["messages"]:
        renumbered = " (Boolean operations number anew: Surface{:} is all, Surface In BoundingBox{...} some)"
        hint = renumbered if "unknown surface" in message or "unknown curve" in message else ""
        raise SceneError(f"{path}: Gmsh says: {message}{hint}")


def _groups(gmsh_output: Mapping[str, Any]) -> list[Group]:
    return [
        Group(
            group["name"],
            group["dimension"],
            tuple(group["curves"]),
            tuple(map(tuple, group["surfaces"])),
            group["number"],
        )
        for group in gmsh_output["groups"]
    ]


def _value(entry: Mapping[str, Any]) -> float | str:
    value = (entry.get("values") or [""])[0]
    return float(value) if entry["type"] == "number" else str(value)
