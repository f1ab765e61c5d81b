"""Edges of a plane mesh: where its cells end, and slits of double nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing.mesh_arrays import Block, Rows
from pdmesh.model.graphs import connected
from pdmesh.model.kd_trees import tree_of
from pdmesh.scene.shapes import near

COINCIDENT = 1e-9  # of the size of a mesh: points this near are at one place
ON = 1e-6  # of an edge: what counts as on a line
FEW = 3  # cells: fewer that have no common point may well be parts of their own


def joined(points: NDArray[np.float64]) -> Rows:
    """For each point (n, d) the first at its place."""
    size = float(np.ptp(points, axis=0).max())
    pairs = tree_of(points).query_pairs(COINCIDENT * size, output_type="ndarray")
    if not len(pairs):
        return np.arange(len(points))
    part = connected(len(points), *pairs.T)
    _, first = np.unique(part, return_index=True)
    return np.asarray(first[part], dtype=np.int64)


def ends_of(blocks: Iterable[Block], of_place: Rows) -> tuple[Rows, bool]:
    """Edges (k, 2), as points, that belong to one cell alone; and whether no two cells have a point in common.

    In the latter case cells that touch are joined, as such a file says nothing of slits.
    """
    sides = []
    for block in blocks:
        ends = np.stack([block.corners, np.roll(block.corners, -1, axis=1)], axis=2).reshape(-1, 2)
        sides.append(ends[ends[:, 0] != ends[:, 1]])
    edges = np.concatenate(sides)
    alone, shared = _once(edges)
    _, touching = _once(of_place[edges])
    if not shared and touching and sum(len(block.data) for block in blocks) >= FEW:
        return _once(of_place[edges])[0], True
    return alone, False


def _once(edges: Rows) -> tuple[Rows, bool]:
    """The edges that are there once, and whether there are others."""
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[np.sort(first[count == 1])], bool((count > 1).any())


def doubled(ends: Rows, of_place: Rows) -> NDArray[np.bool_]:
    """Which edges (k, 2) of one cell alone are at the place of another, of other points."""
    _, inverse, count = np.unique(np.sort(of_place[ends], axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()] > 1)


def along(places: NDArray[np.float64], ends: Rows, line: shapely.Geometry) -> NDArray[np.bool_]:
    """Which edges (k, 2), between `places` (n, 2), are on a line."""
    edges = places[ends]
    slack = ON * float(np.median(np.hypot(*(edges[:, 1] - edges[:, 0]).T)))
    on_line = near(edges.mean(axis=1), line, slack)
    for end in range(2):
        on_line &= near(edges[:, end], line, slack)
    return on_line


def slits(
    places: NDArray[np.float64], ends: Rows, plate: shapely.Geometry, cracks: Sequence[shapely.Geometry]
) -> list[NDArray[np.float64]]:
    """Lines, points (k, 2), of those edges (k, 2) between `places` (n, 2) that are inside a plate, and no `cracks`."""
    edge = plate.boundary
    ends = ends[~along(places, ends, edge)] if len(ends) else ends
    if not len(ends):
        return []
    lines = places[ends]
    slack = ON * float(np.median(np.hypot(*(lines[:, 1] - lines[:, 0]).T)))
    around = shapely.union_all([edge, *cracks]).buffer(2 * slack)
    inner = shapely.difference(shapely.linestrings(lines), around)
    inner = shapely.get_parts(inner)
    inner = inner[shapely.length(inner) > 10 * slack]
    if not len(inner):
        return []
    far, nearest = tree_of(places).query(shapely.get_coordinates(inner))
    onto_nodes = np.where((far <= 4 * slack)[:, None], places[nearest], shapely.get_coordinates(inner))
    inner = shapely.set_coordinates(inner, onto_nodes)  # ends are put back where they were cut off from
    merged = shapely.line_merge(shapely.union_all(inner))
    return [shapely.get_coordinates(line) for line in shapely.get_parts(merged)]


def slit_remark(lines: Sequence[NDArray[np.float64]], unit: str) -> list[str]:
    """One remark on the slits of a mesh, lengths in its `unit`."""
    if not lines:
        return []
    length = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines]
    longest = lines[int(np.argmax(length))]
    (x0, y0), (x1, y1) = longest[0], longest[-1]
    way = f"from ({x0:.6g}, {y0:.6g}) to ({x1:.6g}, {y1:.6g}) {unit}"
    if len(lines) == 1:
        return [f"double nodes {way}: a pre-crack of {sum(length):.6g} {unit}"]
    return [f"double nodes: {len(lines)} pre-cracks of {sum(length):.6g} {unit} in all, the longest {way}"]
