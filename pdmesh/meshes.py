"""An existing mesh as a grid: the centres of its cells are the nodes, their areas the areas.

Any format meshio reads. Groups of cells are named as in a drawing (drawing.py); a surface group of another name is
a region of material. A node's spacing is the root of its cell's area. Numbers come from ``--set``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh import meshreading
from pdmesh.drawing import GROUPS, Group, scene_of
from pdmesh.grid import Grid, Settings
from pdmesh.lattice import grid_of_nodes, settings_of
from pdmesh.meshreading import Mesh
from pdmesh.parameters import PREFIX
from pdmesh.shapes import SceneError, parts

CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
LINES = ("line", "line3")
SOLID = ("tetra", "hexahedron", "wedge", "pyramid")
TAGS = ("gmsh:physical", "medit:ref", "cell_tags", "region", "material")  # cell data that number groups


@dataclass(frozen=True)
class _Cells:
    """Cells of a kind: as shapes, and the names of the groups each is in."""

    shapes: NDArray[Any]  # (k,) polygons or lines
    groups: list[set[str]]


def read_mesh(
    path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False
) -> tuple[Grid, Settings, tuple[str, ...]]:
    """The grid and settings of the mesh file at `path`, and what else there is to say. Raises SceneError."""
    mesh = meshreading.read(path, TAGS, trust)
    faces, lines = _cells(mesh, path)
    values: dict[str, float | str] = {}
    for name, text in assignments:
        try:
            values[name if name.startswith(PREFIX) else PREFIX + name] = float(text)
        except ValueError:
            values[name if name.startswith(PREFIX) else PREFIX + name] = text
    areas = np.asarray(shapely.area(faces.shapes))
    if not (areas > 0).all():
        raise SceneError(f"{path}: cell {int((areas <= 0).argmax())}: found no area, expected cells with an inside")
    delta = np.sqrt(areas)
    position = shapely.get_coordinates(shapely.centroid(faces.shapes))
    materials = {name.split("/")[2] for name in values if name.startswith(f"{PREFIX}Materials/")}
    surfaces = _named(faces)
    unused = sorted(name for name in surfaces if ":" not in name and name not in materials)
    spacing = {f"{PREFIX}Zones/mesh/Spacing": float(delta.max())}
    curves = _named(lines)
    try:
        groups = [
            Group("zone:mesh", 2, surfaces=_outlines(_union(faces.shapes))),
            *(_surface_group(name, cells) for name, cells in surfaces.items() if name not in unused),
            *(Group(name, 1, curves=tuple(map(_points, cells))) for name, cells in curves.items() if ":" in name),
        ]
        scene = scene_of(groups, values | spacing, path.name)
        settings = settings_of(scene, position, delta)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    notes = (f"group '{name}': no material of its own (--set Materials/{name}/E=... gives one)" for name in unused)
    return grid_of_nodes(scene, position, delta, areas), settings, tuple(notes)


def _cells(mesh: Mesh, path: Path) -> tuple[_Cells, _Cells]:
    """The mesh's faces and its lines."""
    points = np.asarray(mesh.points, dtype=float)
    if not np.isfinite(points).all():
        raise SceneError(f"{path}: points: found a coordinate that is not finite, expected metres")
    if points.shape[1] > 2 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points[:, :2], axis=0).max():
        raise SceneError(f"{path}: points: found z of several values, expected a plane mesh")
    names = _names(mesh)
    found: dict[str, tuple[list[Any], list[set[str]]]] = {"face": ([], []), "line": ([], [])}
    for block, groups in zip(mesh.cells, names, strict=True):
        if block.type.startswith(SOLID):
            raise SceneError(f"{path}: found cells '{block.type}', expected a plane mesh of triangles and quads")
        if block.type in CORNERS:
            rings = points[block.data[:, : CORNERS[block.type]], :2]
            found["face"][0].append(shapely.polygons(rings))
            found["face"][1].extend(groups)
        elif block.type in LINES:
            found["line"][0].append(shapely.linestrings(points[block.data[:, :2], :2]))
            found["line"][1].extend(groups)
    if not found["face"][0]:
        raise SceneError(f"{path}: found no triangle and no quad, expected some")
    faces, lines = (
        _Cells(np.concatenate(shapes) if shapes else np.empty(0, dtype=object), groups)
        for shapes, groups in found.values()
    )
    return faces, lines


def _names(mesh: Mesh) -> list[list[set[str]]]:
    """The groups of each cell of each block."""
    names: list[list[set[str]]] = [[set() for _ in block.data] for block in mesh.cells]
    tag = next((name for name in TAGS if name in mesh.cell_data), None)
    known = {int(entry[0]): name for name, entry in mesh.field_data.items()}
    by_dimension = {(int(entry[0]), int(entry[1])): name for name, entry in mesh.field_data.items() if len(entry) > 1}
    for number, block in enumerate(mesh.cells):
        dimension = 1 if block.type in LINES else 2
        if tag:
            for cell, value in enumerate(np.asarray(mesh.cell_data[tag][number]).ravel().astype(int)):
                if value:
                    names[number][cell].add(by_dimension.get((value, dimension)) or known.get(value) or str(value))
    for name, members in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):
            for number, cells in enumerate(members):
                for cell in () if cells is None else np.asarray(cells, dtype=int):
                    names[number][cell].add(name)
    return names


def _named(cells: _Cells) -> dict[str, NDArray[Any]]:
    names = sorted(set().union(*cells.groups)) if cells.groups else []
    return {name: cells.shapes[[name in groups for groups in cells.groups]] for name in names}


def _surface_group(name: str, cells: NDArray[Any]) -> Group:
    full = name if name.partition(":")[0] in GROUPS else f"material:{name}"
    return Group(full, 2, surfaces=_outlines(_union(cells)))


def _union(cells: NDArray[Any]) -> shapely.Geometry:
    """What cells cover. Raises SceneError for cells that overlap."""
    try:
        return shapely.coverage_union_all(cells)
    except shapely.errors.GEOSException:
        raise SceneError("cells: found some that overlap, expected cells side by side") from None


def _outlines(shape: shapely.Geometry) -> tuple[tuple[Any, ...], ...]:
    return tuple(tuple(_points(ring) for ring in (part.exterior, *part.interiors)) for part in parts(shape))


def _points(line: shapely.Geometry) -> Any:
    flat = shapely.get_coordinates(line)
    return np.column_stack([flat, np.zeros(len(flat))])
