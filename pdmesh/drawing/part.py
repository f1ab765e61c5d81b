"""A part from a CAD program: the statements of a drawing that reads it, and its faces or edges with their numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.plate_of_groups import FLAT, face
from pdmesh.drawing.sandbox.child import read_copies
from pdmesh.drawing.sandbox.copies import MERGED, STEP, cad_bytes, drawing_copies, stl_bytes
from pdmesh.drawing.scratch import scratch
from pdmesh.file_kinds import OF_PROGRAMS, SAVE_AS_STEP
from pdmesh.model.triangulated_surface import orientation, volume
from pdmesh.scene.shapes import SceneError

SECONDS = 300.0  # of processor time for Gmsh
STL = ".stl"
PLAIN_NAME = re.compile(r"[^\\/:*?\"<>|]+")  # of a file that a drawing names
PLANE = 1 - 1e-6  # length of the mean normal of a face that is plane
OPEN_CASCADE_UNITS = {"in": "INCH"}  # that do not go by their own name in capitals
OF_TRIANGLES = (  # an STL file is one surface, which is cut where it turns by more than 40 degrees
    "ClassifySurfaces{40 * Pi / 180, 1, 0};",
    "Surface Loop(1) = {Surface{:}};",
    "Volume(1) = {1};",
)
TURNS = {  # of a plate that lies in another plane than x-y, by the axis across it
    0: "Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Surface{:}; }",
    1: "Rotate {{1, 0, 0}, {0, 0, 0}, -Pi / 2} { Surface{:}; }",
}


@dataclass(frozen=True)
class Shape:
    """A face of a body or an edge of a plate, in the part's unit."""

    number: int  # by which a drawing names it
    kind: str  # as Gmsh calls it, such as plane, cylinder, line
    size: float  # area or length
    centre: NDArray[np.float64]  # (3,)
    normal: NDArray[np.float64] | None  # (3,) outward, of a plane face
    points: NDArray[np.float64]  # triangles (t, 3, 3) of a face, or points (k, 3) along an edge


@dataclass(frozen=True)
class CadPart:
    """A plate or a body whose faces or edges have numbers."""

    path: Path
    dimension: int
    unit: str  # of its coordinates
    statements: tuple[str, ...]  # of the drawing that reads it
    shapes: tuple[Shape, ...]
    size: float  # volume or area
    count: int  # of its solids or surfaces
    low: NDArray[np.float64]  # (3,) corners of the box around it
    high: NDArray[np.float64]


def read_part(path: Path, unit: str | None = None) -> CadPart:
    """The part in a STEP, BREP or STL file, in a unit of length; of a STEP file mm by default.

    Raises SceneError, for a file of another kind and for one that names no unit if none is given too.
    """
    refuse_other_kinds(path)
    suffix = path.suffix.lower()
    name, data = f"part{suffix}", stl_bytes(path) if suffix == STL else cad_bytes(path)
    length = unit or "mm"
    statements = ['SetFactory("OpenCASCADE");'] * (suffix != STL)
    if suffix in STEP:  # which names a unit
        statements.append(f'Geometry.OCCTargetUnit = "{OPEN_CASCADE_UNITS.get(length, length.upper())}";')
    statements += [f'Merge "{name}";', *(OF_TRIANGLES if suffix == STL else ())]
    with scratch() as folder:
        (folder / name).write_bytes(data)
        gmsh_output = _read(folder, statements, path)
        if "points" not in gmsh_output:
            points = np.concatenate([curve for surface in gmsh_output["surfaces"] for curve in surface])
            sides = np.ptp(points, axis=0)
            across = int(sides.argmin())
            if sides[2] > FLAT * sides.max():  # a plate that does not lie in the plane x-y
                if sides[across] > FLAT * sides.max() or not gmsh_output["flat"]:
                    raise SceneError(
                        f"{path} has surfaces in space and no volume; save a solid, or a flat plate along two axes"
                    )
                statements.append(TURNS[across])
                gmsh_output = _read(folder, statements, path)
    statements = [line.replace(f'"{name}"', f'"{path.name}"') for line in statements]
    part = _part(path, length, tuple(statements), gmsh_output)
    if unit is None and suffix not in STEP:
        size = " x ".join(f"{side:.4g}" for side in (part.high - part.low)[: part.dimension])
        raise SceneError(f"{path} names no unit of length, and is {size}; give its unit, such as --unit mm")
    return part


def refuse_other_kinds(path: Path) -> None:
    """Raise SceneError for a file that no drawing can read as a part, by its name."""
    if path.suffix.lower() in OF_PROGRAMS:
        raise SceneError(f"{path}: suffix '{path.suffix}' is not known; {SAVE_AS_STEP}")
    if path.suffix not in MERGED:
        kinds = ", ".join(dict.fromkeys(suffix.lower() for suffix in MERGED))
        raise SceneError(f"{path}: suffix '{path.suffix}' is not that of a part; use one of {kinds}")
    if not PLAIN_NAME.fullmatch(path.name) or not path.name.isprintable():
        raise SceneError(f"{path}: a drawing cannot name this file; use a name of letters and digits")


def _read(folder: Path, statements: list[str], path: Path) -> Mapping[str, Any]:
    """The numbered shapes of a drawing of these statements. Raises SceneError."""
    drawing = folder / "part.geo"
    drawing.write_text("\n".join(statements) + "\n", encoding="utf-8")
    try:
        gmsh_output = read_copies(drawing_copies(drawing), [], SECONDS, numbered=True)
    except SceneError as error:
        raise SceneError(str(error).replace(str(drawing), str(path))) from None
    for message in gmsh_output["messages"]:
        raise SceneError(f"{path}: Gmsh says: {message.replace(str(drawing), str(path))}")
    if not gmsh_output.get("count"):
        raise SceneError(f"{path} has no surface and no volume; save a plate or a solid")
    return gmsh_output


def _part(path: Path, unit: str, statements: tuple[str, ...], gmsh_output: Mapping[str, Any]) -> CadPart:
    kinds = {int(number): str(kind).lower() for number, kind in gmsh_output["types"].items()}
    shapes: list[Shape] = []
    if "points" in gmsh_output:
        places = np.array(gmsh_output["points"], dtype=float).reshape(-1, 3)
        groups = [group for group in gmsh_output["groups"] if group["dimension"] == 2]
        faces = [places[np.array(group["triangles"], dtype=np.int64).reshape(-1, 3)] for group in groups]
        way = np.split(orientation(np.concatenate(faces)), np.cumsum([len(face) for face in faces])[:-1])
        for group, triangles, signs in zip(groups, faces, way, strict=True):
            a, b, c = triangles.transpose(1, 0, 2)
            across = signs[:, None] * np.cross(b - a, c - a) / 2  # counterclockwise from outside where a sign is 1
            areas = np.linalg.norm(across, axis=1)
            area = float(areas.sum())
            centre = areas @ triangles.mean(axis=1) / areas.sum()
            normal = across.sum(axis=0) / areas.sum()
            flat_normal = normal if np.linalg.norm(normal) > PLANE else None
            shapes.append(Shape(group["number"], kinds[group["number"]], area, centre, flat_normal, triangles))
        size = float(gmsh_output["whole"]["volume"]) or volume(np.concatenate(faces))
    else:
        size = float(sum(face(curves, str(path)).area for curves in gmsh_output["surfaces"]))
        for group in gmsh_output["groups"]:
            line = np.array(group["curves"][0], dtype=float)
            lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
            centre = lengths @ (line[1:] + line[:-1]) / 2 / lengths.sum()
            shapes.append(Shape(group["number"], kinds[group["number"]], float(lengths.sum()), centre, None, line))
    corners = np.concatenate([shape.points.reshape(-1, 3) for shape in shapes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    dimension = 3 if "points" in gmsh_output else 2
    return CadPart(path, dimension, unit, statements, tuple(shapes), size, gmsh_output["count"], low, high)
