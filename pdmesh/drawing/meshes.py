"""An existing mesh as a grid: a node at the centre of each cell of a plate, with its area; or as a body.

Groups of cells are named as in a drawing (`plate_of_groups`); a surface group without a kind in its name is a region
of material. A node's spacing is the square root of its cell's area. Values, including the unit of the coordinates, come
from ``--set``. Meshes of solids become bodies (`solid_meshes`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing import mesh_checks
from pdmesh.drawing.additions import added
from pdmesh.drawing.mesh_arrays import (
    Mesh,
    Rows,
    along,
    doubled,
    ends_of,
    group_names,
    joined,
    slit_remark,
    slits,
    unused,
    with_plane,
)
from pdmesh.drawing.parameters import PREFIX, Parameter, given, needed, unit_of
from pdmesh.drawing.plate_of_groups import KINDS, Group, scene_of
from pdmesh.drawing.point_cells import with_cells
from pdmesh.drawing.point_cloud import body_of_points
from pdmesh.drawing.solid_meshes import SLIT, body_of_mesh
from pdmesh.grid.lattice import grid_of_nodes, settings_of
from pdmesh.model.document import Settings
from pdmesh.model.node_grid import Grid
from pdmesh.scene.body import Body
from pdmesh.scene.checks import remarks
from pdmesh.scene.shapes import SceneError, errors_at, parts

OVERLAP = 1e-6  # of the area
FLAT = 1e-9  # of the size of a mesh: z that still counts as one
FARTHEST = 1e60  # coordinate: its fourth power is a finite number


@dataclass(frozen=True)
class _Cells:
    """Cells of one dimension as shapes, and by name which of them are in a set."""

    shapes: NDArray[Any]  # (k,) polygons, lines or points
    sets: dict[str, Rows]

    @classmethod
    def of(cls, mesh: Mesh, dimension: int, places: NDArray[np.float64]) -> _Cells:
        """The cells of a mesh whose points are at these places (n, 2)."""
        blocks, sets = mesh.of_dimension(dimension)
        make = (lambda points: shapely.points(points[:, 0]), shapely.linestrings, shapely.polygons)[dimension]
        first = np.cumsum([0, *(len(block.data) for block in blocks)])
        shapes = [np.empty(0, dtype=object), *(make(places[block.corners]) for block in blocks if len(block.data))]
        members = {
            name: np.concatenate([first[:0], *(at + rows for at, rows in zip(first[:-1], block_rows, strict=True))])
            for name, block_rows in sorted(sets.items())
        }
        return cls(np.concatenate(shapes), {name: rows for name, rows in members.items() if len(rows)})

    def named(self, name: str) -> NDArray[Any]:
        """The cells of a set."""
        return self.shapes[self.sets[name]]


def read_mesh(
    path: Path, assignments: Sequence[tuple[str, str]] = (), cracks: Sequence[str] = (), trust: bool = False
) -> tuple[Grid, Settings, tuple[str, ...]] | Body:
    """The grid and settings of the plate in the mesh file at `path`, and remarks about them; or the body of its solids.

    `cracks` are added to a plate, ``x0,y0,x1,y1``. Raises SceneError.
    """
    mesh = mesh_checks.read(path, trust)
    with errors_at(path):
        for row, axis in np.argwhere(~(np.abs(mesh.points) < FARTHEST))[:1].tolist():
            value = f"{mesh.points[row, axis]:g}"  # of which no area or distance can be computed
            raise SceneError(f"points: point {row} has the coordinate {value}; use a finite one below {FARTHEST:g}")
        mesh = with_cells(mesh)
        values = given(assignments)
        cloud = bool(mesh.volumes) and not mesh.of_dimension(2)[0]
        if cloud or mesh.of_dimension(3)[0]:
            if cracks:
                raise SceneError("--crack is for plates; leave it out for a body in space")
            return (body_of_points if cloud else body_of_mesh)(mesh, values, path.name)
        return _plate(mesh, values, path, cracks)


def mesh_parameters(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> list[Parameter]:
    """The parameters that the mesh at `path` needs, one for each of its groups, and those that are set.

    Raises SceneError.
    """
    mesh = mesh_checks.read(path, trust)
    with errors_at(path):
        values = given(assignments)
        unit_of(values)
    top = 3 if mesh.of_dimension(3)[0] else 2
    groups = {}
    for dimension, folder, last, unit in ((top, "Materials", "E", "Pa"), (top - 1, "Loads", "Traction x", "Pa")):
        for name, rows in sorted(mesh.of_dimension(dimension)[1].items()):
            kind, _, own = name.rpartition(":")
            if any(map(len, rows)) and kind in ("", folder[:-1].lower()):
                groups[f"{folder}/{own}/{last}"] = unit, f"of the group '{name}'"
    spacing = "Zones/body/Spacing" if mesh.of_dimension(3)[0] else ""
    return needed(values, spacing, str(values.get(f"{PREFIX}Units") or "m"), groups)


def _plate(
    mesh: Mesh, values: dict[str, float | str], path: Path, cracks: Sequence[str]
) -> tuple[Grid, Settings, tuple[str, ...]]:
    """The nodes of a plane mesh. Raises SceneError."""
    if mesh.points.shape[1] > 2 and np.ptp(mesh.points[:, 2]) > FLAT * np.ptp(mesh.points[:, :2], axis=0).max():
        raise SceneError(
            "points: z has several values; use a plane mesh, one of solids, or for a closed STL surface pdmesh init"
        )
    if not mesh.of_dimension(2)[0]:
        raise SceneError("the mesh has no triangle and no quad; add some")
    of_place = joined(mesh.points)
    places = mesh.points[of_place, :2]
    faces, lines, points = (_Cells.of(mesh, dimension, places) for dimension in (2, 1, 0))
    areas = np.asarray(shapely.area(faces.shapes))
    if not (areas > 0).all():
        raise SceneError(f"cell {int((areas <= 0).argmax())} has no area; use cells with an inside")
    for cell in np.flatnonzero(~shapely.is_valid(faces.shapes))[:1].tolist():
        raise SceneError(f"cell {cell}: its sides cross; list its corners one after the other around it")
    delta = np.sqrt(areas)
    if mesh.volumes:
        areas = np.concatenate(mesh.volumes)
    position = shapely.get_coordinates(shapely.centroid(faces.shapes))
    values, notes = with_plane(values, mesh.plane)
    unit = unit_of(values)
    plate = _union(faces.shapes)
    ends, apart = ends_of(mesh.of_dimension(2)[0], of_place)
    crack_lines = [shapely.union_all(lines.named(name)) for name in lines.sets if name.startswith("crack:")]
    # edges where a part of the mesh ends, of one that has parts
    on_part_edge = np.zeros(len(ends), dtype=bool)
    if mesh.parts is not None:
        of_face = np.concatenate([mesh.parts[block.data[:, 0]] for block in mesh.of_dimension(2)[0]])
        for part in np.unique(of_face).tolist():
            part_edges = np.flatnonzero(mesh.parts[ends[:, 0]] == part)
            on_part_edge[part_edges] = along(places, ends[part_edges], _union(faces.shapes[of_face == part]).boundary)
    free = doubled(ends, of_place) | on_part_edge
    slit = slits(places, ends[free], plate, crack_lines)
    notes += ["no two cells have a node in common: those that touch are joined"] if apart else []
    notes += slit_remark(slit, str(values.get(f"{PREFIX}Units") or "m"))
    groups, more = _groups(faces, lines, points, values)
    groups += _groups_of_points(mesh, ends, places, values)
    spacing = {f"{PREFIX}Zones/mesh/Spacing": float(delta.max())}
    groups += [Group("zone:mesh", 2, surfaces=_outlines(plate))]
    groups += [Group(SLIT, 1, curves=tuple(np.pad(line, ((0, 0), (0, 1))) for line in slit))] if slit else []
    scene = added(scene_of(groups, values | spacing, path.name), [], cracks)
    position, delta, areas = unit.to_si(position), unit.to_si(delta), unit.to_si(unit.to_si(areas))
    grid = grid_of_nodes(scene, position, delta, areas)
    return grid, settings_of(scene, grid), (*mesh.notes, *notes, *more, *remarks(scene))


def _groups(
    faces: _Cells, lines: _Cells, points: _Cells, values: Mapping[str, float | str]
) -> tuple[list[Group], list[str]]:
    """The groups that are used, and remarks about the others."""
    groups, bare, loose = [], [], []
    for name in faces.sets:
        names = group_names(name, 2, KINDS, values)
        groups += [Group(full, 2, surfaces=_outlines(_union(faces.named(name)))) for full in names]
        bare += [name] * (not names)
    for name in lines.sets:
        names = group_names(name, 1, KINDS, values)
        groups += [Group(full, 1, curves=tuple(map(_points, lines.named(name)))) for full in names]
        loose += [name] * (not names)
    groups += [
        Group(full, 0, curves=tuple(map(_points, points.named(name))))
        for name in points.sets
        for full in group_names(name, 0, KINDS, values)
    ]
    notes = unused("group", bare, "no material of its own (--set Materials/NAME/E=... gives one)")
    return groups, notes + unused("curve", loose, "not used (crack:, load:, fix: or move:NAME would be)")


def _groups_of_points(mesh: Mesh, ends: Rows, places: NDArray[np.float64], values: Iterable[str]) -> list[Group]:
    """Groups of sets of nodes: the edges between them, or the one node."""
    groups = []
    for name, rows in sorted(mesh.point_sets.items()):
        inside = np.zeros(len(places), dtype=bool)
        inside[rows] = True
        curves = [np.pad(places[edge], ((0, 0), (0, 1))) for edge in ends[inside[ends].all(axis=1)]]
        dimension = 0 if len(rows) == 1 else 1
        if dimension == 0:
            curves = [np.pad(places[rows], ((0, 0), (0, 1)))]
        if curves:
            groups += [Group(full, dimension, tuple(curves)) for full in group_names(name, dimension, KINDS, values)]
    return groups


def _union(cells: NDArray[Any]) -> shapely.Geometry:
    """Union of the cells. Raises SceneError for cells that overlap."""
    with contextlib.suppress(shapely.errors.GEOSException):  # it is quick, and expects cells that share whole edges
        union = shapely.coverage_union_all(cells)
        if union.is_valid:
            return union
    union = shapely.union_all(cells)
    area = float(shapely.area(cells).sum())
    if not abs(union.area - area) <= OVERLAP * area:
        raise SceneError(f"cells overlap: {area:g} of area in all, on {union.area:g}; use cells that do not overlap")
    return union


def _outlines(shape: shapely.Geometry) -> tuple[tuple[Any, ...], ...]:
    return tuple(tuple(_points(ring) for ring in (part.exterior, *part.interiors)) for part in parts(shape))


def _points(line: shapely.Geometry) -> Any:
    flat = shapely.get_coordinates(line)
    return np.column_stack([flat, np.zeros(len(flat))])
