"""An existing mesh as a grid: a node at the centre of each cell, with the cell's area.

Reads every format of meshio. Groups of cells are named as in a drawing (`plate_of_groups`); a surface group without a
kind in its name is a region of material. A node's spacing is the square root of its cell's area. Values, including the
unit of the coordinates, come from ``--set``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing import mesh_checks
from pdmesh.drawing.additions import added
from pdmesh.drawing.mesh_checks import Mesh
from pdmesh.drawing.parameters import PREFIX, given, unit_of
from pdmesh.drawing.plate_of_groups import scene_of
from pdmesh.drawing.plate_places import Group
from pdmesh.grid.lattice import grid_of_nodes, settings_of
from pdmesh.model.document import Settings
from pdmesh.model.node_grid import Grid
from pdmesh.scene.checks import remarks
from pdmesh.scene.shapes import SceneError, parts

CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
LINES = ("line", "line3")
SOLID = ("tetra", "hexahedron", "wedge", "pyramid")
OVERLAP = 1e-6  # of the area
TAGS = ("gmsh:physical", "medit:ref", "cell_tags", "region", "material")  # cell data that number groups


@dataclass(frozen=True)
class _Cells:
    """Cells of one dimension as shapes, with the names of the groups each is in."""

    shapes: NDArray[Any]  # (k,) polygons or lines
    groups: list[set[str]]


def read_mesh(
    path: Path, assignments: Sequence[tuple[str, str]] = (), cracks: Sequence[str] = (), trust: bool = False
) -> tuple[Grid, Settings, tuple[str, ...]]:
    """The grid and settings of the mesh file at `path`, and remarks about them. Raises SceneError.

    `cracks` are added, ``x0,y0,x1,y1``.
    """
    mesh = mesh_checks.read(path, TAGS, trust)
    faces, lines, points = _cells(mesh, path)
    areas = np.asarray(shapely.area(faces.shapes))
    if not (areas > 0).all():
        raise SceneError(f"{path}: cell {int((areas <= 0).argmax())}: found no area, expected cells with an inside")
    delta = np.sqrt(areas)
    position = shapely.get_coordinates(shapely.centroid(faces.shapes))
    try:
        values = given(assignments)
        unit = unit_of(values)
        groups, notes = _groups(faces, lines, points, values)
        spacing = {f"{PREFIX}Zones/mesh/Spacing": float(delta.max())}
        scene = added(scene_of(groups, values | spacing, path.name), [], cracks)
        position, delta, areas = unit.metres(position), unit.metres(delta), unit.metres(unit.metres(areas))
        settings = settings_of(scene, position, delta)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    return grid_of_nodes(scene, position, delta, areas), settings, (*notes, *remarks(scene))


def _groups(
    faces: _Cells, lines: _Cells, points: _Cells, values: Mapping[str, float | str]
) -> tuple[list[Group], list[str]]:
    """The groups that are used, and remarks about the others."""
    materials = {name.split("/")[2] for name in values if name.startswith(f"{PREFIX}Materials/")}
    surfaces, curves = _named(faces), _named(lines)
    unused = [name for name in surfaces if ":" not in name and name not in materials]
    groups = [
        Group("zone:mesh", 2, surfaces=_outlines(_union(faces.shapes))),
        *(_surface_group(name, cells) for name, cells in surfaces.items() if name not in unused),
        *(Group(name, 1, curves=tuple(map(_points, cells))) for name, cells in curves.items() if ":" in name),
        *(Group(name, 0) for name in _named(points) if ":" in name),
    ]
    notes = [f"group '{name}': no material of its own (--set Materials/{name}/E=... gives one)" for name in unused]
    notes += [
        f"curve '{name}': not used (crack:, load:, fix: or move:{name} would be)" for name in curves if ":" not in name
    ]
    return groups, notes


def _cells(mesh: Mesh, path: Path) -> tuple[_Cells, _Cells, _Cells]:
    """Faces, lines and points of the mesh; of lines and points only those in groups."""
    points = np.asarray(mesh.points, dtype=float)
    if not np.isfinite(points).all():
        raise SceneError(f"{path}: points: found a coordinate that is not finite, expected metres")
    if points.shape[1] > 2 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points[:, :2], axis=0).max():
        raise SceneError(f"{path}: points: found z of several values, expected a plane mesh")
    found: dict[int, tuple[list[Any], list[set[str]]]] = {0: ([], []), 1: ([], []), 2: ([], [])}
    for block, groups in zip(mesh.cells, _names(mesh), strict=True):
        if block.type.startswith(SOLID):
            raise SceneError(f"{path}: found cells '{block.type}', expected a plane mesh of triangles and quads")
        dimension = _dimension(block.type)
        if dimension == 2:
            found[2][0].append(shapely.polygons(points[block.data[:, : CORNERS[block.type]], :2]))
        elif dimension == 1:
            found[1][0].append(shapely.linestrings(points[block.data[:, :2], :2]))
        elif dimension == 0:
            found[0][0].append(shapely.points(points[block.data[:, 0], :2]))
        if dimension is not None:
            found[dimension][1].extend(groups)
    if not found[2][0]:
        raise SceneError(f"{path}: found no triangle and no quad, expected some")
    faces, lines, places = (
        _Cells(np.concatenate(found[dimension][0] or [np.empty(0, dtype=object)]), found[dimension][1])
        for dimension in (2, 1, 0)
    )
    return faces, lines, places


def _dimension(kind: str) -> int | None:
    if kind in CORNERS:
        return 2
    return 1 if kind in LINES else 0 if kind == "vertex" else None


def _names(mesh: Mesh) -> list[list[set[str]]]:
    """The names of the groups of each cell, for each block."""
    names: list[list[set[str]]] = [[set() for _ in block.data] for block in mesh.cells]
    tag = next((name for name in TAGS if name in mesh.cell_data), None)
    known = {int(entry[0]): name for name, entry in mesh.field_data.items()}
    by_dimension: dict[tuple[int, int | None], str] = {
        (int(entry[0]), int(entry[1])): name for name, entry in mesh.field_data.items() if len(entry) > 1
    }
    for number, block in enumerate(mesh.cells):
        dimension = _dimension(block.type)
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
    full = name if ":" in name else f"material:{name}"
    return Group(full, 2, surfaces=_outlines(_union(cells)))


def _union(cells: NDArray[Any]) -> shapely.Geometry:
    """Union of the cells. Raises SceneError for cells that overlap."""
    with contextlib.suppress(shapely.errors.GEOSException):  # it is quick, and expects cells that share whole edges
        whole = shapely.coverage_union_all(cells)
        if whole.is_valid:
            return whole
    whole = shapely.union_all(cells)
    area = float(shapely.area(cells).sum())
    if not abs(whole.area - area) <= OVERLAP * area:
        raise SceneError(f"cells: found {area:g} of area in all, on {whole.area:g}, expected cells that do not overlap")
    return whole


def _outlines(shape: shapely.Geometry) -> tuple[tuple[Any, ...], ...]:
    return tuple(tuple(_points(ring) for ring in (part.exterior, *part.interiors)) for part in parts(shape))


def _points(line: shapely.Geometry) -> Any:
    flat = shapely.get_coordinates(line)
    return np.column_stack([flat, np.zeros(len(flat))])
