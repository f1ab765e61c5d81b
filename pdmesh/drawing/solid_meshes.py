"""A mesh of solids as a body: the faces of its cells that are no other's, closed, and its groups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.body_of_groups import KINDS, SPACING, body_of
from pdmesh.drawing.mesh_arrays import FEW, SIDES, Block, Mesh, Rows, group_names, joined, unused
from pdmesh.drawing.parameters import PREFIX, unit_of
from pdmesh.grid.cubic import THINNEST
from pdmesh.model.neighbours import connected
from pdmesh.scene.body import Body
from pdmesh.scene.shapes import SceneError

ROUND_OFF = 1e-9  # of a number of nodes
SLIT = "crack:double nodes"  # the group that slits are put in; in space it begins the names of several


class _Faces(NamedTuple):
    """Faces of all cells; those of three corners repeat the last."""

    nodes: Rows  # (f, 4) points
    cell: Rows  # (f,) that each belongs to


def body_of_mesh(mesh: Mesh, values: Mapping[str, float | str], source: str) -> Body:
    """The body of a mesh of solids. Raises SceneError."""
    blocks, sets = mesh.of_dimension(3)
    of_place = joined(mesh.points)
    faces, places = _faces(blocks), mesh.points
    alone, count = _once(faces.nodes)
    _refuse_crowded(count, faces)
    by_place = of_place[faces.nodes]
    outer, touching = _once(by_place)
    _refuse_crowded(touching, faces)
    apart = not (count == 2).any() and (touching == 2).any() and int(faces.cell.max()) + 1 >= FEW
    slit = np.zeros(len(alone), dtype=bool) if apart else alone & ~outer
    volume = _volumes(places, by_place, faces)
    first = np.cumsum([0, *(len(block.data) for block in blocks)])
    zones = [_volume_group("body", by_place[outer], float(volume.sum()))]
    groups, bare = [], []
    for name, members in sorted(sets.items()):
        chosen = np.concatenate([at + rows for at, rows in zip(first[:-1], members, strict=True)])
        if not len(chosen):
            continue
        inside = np.isin(faces.cell, chosen)
        set_faces = by_place[inside]
        names = [name] if name.startswith("zone:") else group_names(name, 3, KINDS, values)
        groups += [_volume_group(full, set_faces[_once(set_faces)[0]], float(volume[chosen].sum())) for full in names]
        bare += [name] * (not names)
    if not any(group["name"].startswith("zone:") for group in groups):
        zones.append(zones[0] | {"name": "zone:body"})
    surfaces, notes = _surfaces(mesh, by_place, outer, of_place, values)
    cracks = _slits(by_place[slit])
    numbered = enumerate([*zones[1:], *groups, *surfaces, *cracks], start=1)
    geometry = {
        "points": places,
        "groups": [group | {"number": number} for number, group in numbered],
        "zones": [],  # none is made of groups without a kind
        "whole": zones[0],
    }
    spacing = mesh.spacing
    if not spacing:  # about the width of a cell, so that whole nodes, and enough, are across the body
        across, width = float(np.ptp(places, axis=0).min()), (float(volume.sum()) / len(volume)) ** (1 / 3)
        spacing = float(f"{across / max(THINNEST, np.ceil(across / width * (1 - ROUND_OFF))):.12g}")
    unit = str(values.get(f"{PREFIX}Units") or "m")
    unit_of(values)
    said = [f"nodes are {spacing:.6g} {unit} apart, from the size of the cells (Zones/body/Spacing)"]
    said = said if zones[1:] and SPACING not in values else []
    notes += ["no two cells have a node in common: those that touch are joined"] if apart else []
    notes += [
        f"double nodes: {int(slit.sum()) // 2} faces of touching cells without common nodes are a pre-crack"
    ] * bool(slit.any())
    notes += unused("group", bare, "no material of its own (--set Materials/NAME/E=... gives one)")
    body = body_of(geometry, {SPACING: spacing} | dict(values) if zones[1:] else values, source)
    return replace(body, notes=(*body.notes, *mesh.notes, *said, *notes))


def _faces(blocks: list[Block]) -> _Faces:
    nodes, cells, first = [], [], 0
    for block in blocks:
        corners = block.corners
        for side in SIDES[block.shape]:
            nodes.append(corners[:, [*side, *side[-1:]][:4]])
            cells.append(first + np.arange(len(corners)))
        first += len(corners)
    return _Faces(np.concatenate(nodes), np.concatenate(cells))


def _keys(nodes: Rows) -> Rows:
    """Corners (f, 4) in order, -1 for repeated ones, so that the same corners have the same key."""
    key = np.sort(nodes, axis=1)
    key[:, 1:][key[:, 1:] == key[:, :-1]] = -1
    return np.sort(key, axis=1)


def _once(nodes: Rows) -> tuple[NDArray[np.bool_], Rows]:
    """Which faces (f,) of at least three corners have no other at their place, and how many are at each."""
    key = _keys(nodes)
    _, inverse, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    count = np.where(key[:, 1] < 0, 0, count[inverse.ravel()])  # of two corners or one: no face
    return count == 1, count


def _refuse_crowded(count: Rows, faces: _Faces) -> None:
    if count.max(initial=0) > 2:
        cell = int(faces.cell[int(count.argmax())])
        raise SceneError(f"cell {cell}: one face belongs to {int(count.max())} cells; use cells that do not overlap")


def _triangles(nodes: Rows) -> Rows:
    """Faces (f, 4) as triangles (t, 3); a face is divided from its first corner, so that all cells divide it alike."""
    least = nodes.argmin(axis=1)
    turned = np.take_along_axis(nodes, (least[:, None] + np.arange(4)) % 4, axis=1)
    halves = np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
    a, b, c = halves.T
    return np.asarray(halves[(a != b) & (b != c) & (c != a)])


def _volumes(places: NDArray[np.float64], nodes: Rows, faces: _Faces) -> NDArray[np.float64]:
    """The volume (c,) of each cell between its faces as triangles. Raises SceneError for one without."""
    least = nodes.argmin(axis=1)
    turned = places[np.take_along_axis(nodes, (least[:, None] + np.arange(4)) % 4, axis=1)]
    start = np.zeros((int(faces.cell.max()) + 1, 3))
    start[faces.cell] = turned[:, 0]
    turned = turned - start[faces.cell][:, None]
    a, b, c, d = turned.transpose(1, 0, 2)
    part = (a * (np.cross(b, c) + np.cross(c, d))).sum(axis=1) / 6
    volume = np.abs(np.bincount(faces.cell, part))
    size = np.zeros(len(volume))
    np.maximum.at(size, faces.cell, np.abs(turned).max(axis=(1, 2)))
    for cell in np.flatnonzero(volume <= 1e-12 * size**3)[:1].tolist():
        raise SceneError(f"cell {cell} has no volume; use cells with an inside")
    return np.asarray(volume)


def _volume_group(name: str, nodes: Rows, volume: float) -> dict[str, Any]:
    return {"name": name, "dimension": 3, "curves": [], "triangles": _triangles(nodes).ravel(), "volume": volume}


def _surface_group(name: str, nodes: Rows) -> dict[str, Any]:
    return {"name": name, "dimension": 2, "curves": [], "triangles": _triangles(nodes).ravel(), "volume": 0.0}


def _slits(nodes: Rows) -> list[dict[str, Any]]:
    """A group for each slit: of two faces at a place one, joined where they have an edge in common."""
    _, first = np.unique(_keys(nodes), axis=0, return_index=True)
    nodes = nodes[first]
    ends = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(nodes)), 4)[ends[:, 0] != ends[:, 1]]
    _, edge = np.unique(ends[ends[:, 0] != ends[:, 1]], axis=0, return_inverse=True)
    if not len(nodes):
        return []
    part = connected(len(nodes) + int(edge.max()) + 1, face, len(nodes) + edge.ravel())[: len(nodes)]
    names = {part_number: f"{SLIT} {number}" for number, part_number in enumerate(np.unique(part).tolist(), start=1)}
    return [_surface_group(name, nodes[part == part_number]) for part_number, name in names.items()]


def _surfaces(
    mesh: Mesh, faces: Rows, outer: NDArray[np.bool_], of_place: Rows, values: Mapping[str, float | str]
) -> tuple[list[dict[str, Any]], list[str]]:
    """Groups of surfaces, from faces and nodes in sets, and remarks about what is not used."""
    blocks, sets = mesh.of_dimension(2)
    padded = [np.pad(block.corners, ((0, 0), (0, 4 - block.corners.shape[1])), mode="edge") for block in blocks]
    first = np.cumsum([0, *map(len, padded)])
    nodes = of_place[np.concatenate([np.zeros((0, 4), dtype=np.int64), *padded])]
    groups, loose, used = [], [], np.zeros(len(nodes), dtype=bool)
    for name, members in sorted(sets.items()):
        rows = np.concatenate(
            [first[:0], *(at + block_rows for at, block_rows in zip(first[:-1], members, strict=True))]
        )
        if not len(rows):
            continue
        names = group_names(name, 2, KINDS, values)
        groups += [_surface_group(full, nodes[rows]) for full in names]
        used[rows] |= bool(names)
        loose += [name] * (not names)
    face_keys = {key.tobytes() for key in _keys(faces)}
    shells = sum(key.tobytes() not in face_keys for key in _keys(nodes[~used]))
    notes = [f"warning: {shells} triangles and quads are no faces of the solids: not used"] * (shells > 0)
    notes += unused("surface", loose, "not used (crack:, load:, fix: or move:NAME would be)")
    for name, rows in sorted(mesh.point_sets.items()):
        set_faces = faces[outer & np.isin(faces, of_place[rows]).all(axis=1)]
        if len(set_faces):
            groups += [_surface_group(full, set_faces) for full in group_names(name, 2, KINDS, values)]
        elif len(rows) == 1:
            point = {"dimension": 0, "curves": [mesh.points[rows].tolist()], "triangles": [], "volume": 0.0}
            groups += [point | {"name": full} for full in group_names(name, 0, KINDS, values)]
    return groups, notes
