"""Points with volumes, on no lattice in space, as a body: its nodes are the points, its surface is around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.body_of_groups import KINDS, SPACING, body_of
from pdmesh.drawing.mesh_arrays import Mesh, group_names, unused
from pdmesh.drawing.parameters import PREFIX, unit_of
from pdmesh.model.neighbours import tree_of
from pdmesh.scene.body import Body
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import NodeCloud

AROUND = 27  # nodes whose mean volume is that of the cubes around one of them
WIDEST = 1.5  # spacings: radius of a sphere that may be between four nodes of a body
FEWEST = 8  # nodes of a body in space
CLEAR = 0.02  # spacings from the outer nodes to the surface: those on it would have no bonds
HALVINGS = 50  # of an interval, to round-off


def body_of_points(mesh: Mesh, values: Mapping[str, float | str], source: str) -> Body:
    """The body whose nodes are the points of a mesh, with their volumes. Raises SceneError."""
    if SPACING in values:
        raise SceneError(f"parameter '{SPACING}' has no use where the points are the nodes; leave it out")
    rows = np.concatenate([block.data[:, 0] for block in mesh.cells])
    places, volumes, unit = mesh.points[rows], np.concatenate(mesh.volumes), unit_of(values)
    if len(places) < FEWEST:
        raise SceneError(f"points: {len(places)} on no lattice are too few; use {FEWEST} or more in space")
    near = tree_of(places).query(places, k=min(AROUND, len(places)))[1]
    spacing = np.asarray(volumes[near].mean(axis=1) ** (1 / 3))  # the width of a cube of the mean volume around
    triangles = surface_of(places, spacing)
    corners, outside = _around(places, triangles, float(volumes.sum()), float(np.median(spacing)))
    outer = triangles + len(places)
    body_group = {"name": "zone:body", "dimension": 3, "triangles": outer, "volume": float(volumes.sum()), "cones": []}
    first = np.cumsum([0, *(len(block.data) for block in mesh.cells)])
    groups, bare = [], []
    for name, members in sorted(mesh.cell_sets.items()):
        set_rows = np.concatenate([at + some for at, some in zip(first[:-1], members, strict=True)])
        names = group_names(name, 3, KINDS, values) if len(set_rows) else []
        groups += [{"name": full, "dimension": 3, "rows": set_rows} for full in names]
        bare += [name] * (not names and len(set_rows) > 0)
    geometry = {
        "points": np.concatenate([places, corners]),
        "groups": [group | {"number": number} for number, group in enumerate([body_group, *groups], start=1)],
        "zones": [],
        "whole": body_group,
    }
    middle = float(np.median(spacing))
    body = body_of(geometry, {SPACING: middle} | dict(values), source)
    length = float(unit.to_si(1.0))
    cloud = NodeCloud(unit.to_si(places), unit.to_si(spacing), volumes * length**3)
    word = values.get(f"{PREFIX}Units") or "m"
    said = (
        f"points: on no lattice: they are the nodes, {middle:.6g} {word} wide; the surface is {outside:.4g} {word}"
        " outside the outer ones"
    )
    notes = (*body.notes, *mesh.notes, said, *unused("group", bare, "no material of its own"))
    return replace(body, nodes=cloud, parameters=tuple(values.items()), notes=notes)


def _around(
    places: NDArray[np.float64], triangles: NDArray[np.int64], whole: float, spacing: float
) -> tuple[NDArray[np.float64], float]:
    """The corners (n, 3) of the surface, moved out until it has the volume of all nodes; and how far.

    They move by at most a spacing, and not quite by 0.
    """
    a, b, c = places[triangles].transpose(1, 0, 2)
    normal = np.zeros_like(places)
    np.add.at(normal, triangles.ravel(), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0, length, 1.0)
    low, high = CLEAR * spacing, spacing
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        a, b, c = (places - places[:1] + middle * normal)[triangles].transpose(1, 0, 2)
        less = float((a * np.cross(b, c)).sum()) < 6 * whole
        low, high = (middle, high) if less else (low, middle)
    return places + low * normal, low


def surface_of(places: NDArray[np.float64], spacing: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles (t, 3) of the outermost nodes, which close around all nodes, seen counterclockwise from outside.

    Raises SceneError.

    They bound the tetrahedra of Delaunay whose sphere is no wider than between neighbours (an alpha shape).
    """
    from scipy.spatial import Delaunay, QhullError

    scale = np.ptp(places, axis=0).max()
    try:
        cells = Delaunay((places - places.mean(axis=0)) / scale).simplices.astype(np.int64)
    except (QhullError, ValueError):
        raise SceneError(f"points: {len(places)} lie in one plane or on one line; use those of a body") from None
    corner = places[cells]
    sides = corner[:, 1:] - corner[:, :1]
    six = np.linalg.det(sides)
    flat = np.abs(six) <= 1e-9 * spacing[cells].min(axis=1) ** 3
    squared = (sides**2).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = np.linalg.norm(
            squared[:, :1] * np.cross(sides[:, 1], sides[:, 2])
            + squared[:, 1:2] * np.cross(sides[:, 2], sides[:, 0])
            + squared[:, 2:] * np.cross(sides[:, 0], sides[:, 1]),
            axis=1,
        ) / np.abs(2 * six)
    inside = ~flat & (radius <= WIDEST * spacing[cells].max(axis=1))
    if not inside.any():
        raise SceneError(f"points are farther apart than their volumes, {np.median(spacing):.4g} wide; use neighbours")
    cells, six = cells[inside], six[inside]
    cells[six < 0] = cells[six < 0][:, [0, 2, 1, 3]]
    faces = np.concatenate([cells[:, side] for side in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[count == 1]])
