"""Pieces of a plate that bonds connect."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.graphs import connected
from pdmesh.model.kd_trees import tree_of
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, chosen
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import SLACK, cracks_of, sight_of
from pdmesh.scene.shapes import near, parts

PAIRS = 2**20  # looked at together
NEXT = 4  # nodes around one of a mesh
SLIVER = 1e-3  # of a spacing squared: parts of a plate below are round-off


def faces_of(plate: shapely.Geometry, grid: Grid) -> list[shapely.Polygon]:
    """The parts into which pre-cracks divide a grid's plate."""
    if not len(grid.cracks):
        return list(parts(plate))
    # Ends are extended to cross the edges they are on; segments extended one by one overlap where they are short, and
    # overlaps take time squared
    by = SLACK * float(grid.delta.min())
    merged = shapely.line_merge(shapely.multilinestrings(grid.cracks.reshape(-1, 2, 2)))
    chains = []
    for line in shapely.get_parts(merged):
        points = shapely.get_coordinates(line)
        for end, inner in ((0, 1), (-1, -2)):
            way = points[end] - points[inner]
            length = float(np.hypot(*way))
            points[end] += by / length * way if length > 0 else 0.0
        chains.append(shapely.LineString(points))
    lines = shapely.union_all([plate.boundary, *chains])
    least = SLIVER * float(grid.delta.min()) ** 2
    shapely.prepare(plate)
    faces = [face for face in parts(shapely.polygonize(shapely.get_parts(lines))) if face.area > least]
    return [face for face in faces if plate.contains(face.representative_point())]


def pieces(grid: Grid, reach: float) -> NDArray[np.int64]:
    """The piece number (n,) of each node, from 0; bonds connect the nodes of a piece.

    A bond is at most `reach` mean spacings of its nodes long, as in the conservative mode, stays in the plate and
    crosses no pre-crack.
    """
    from scipy.ndimage import label

    neighbours = Neighbours(grid.position, grid.delta, reach * grid.delta, mutual=True)
    # Pieces from bonds that surely exist: those of nodes farther than a spacing from edges and cracks to the next
    # nodes, of at most two spacings. The bonds of all others, and of those at a lattice's edge, need checking.
    inner = ~(grid.border | near(grid.position, cracks_of(grid), grid.delta))
    number, needs_check = np.arange(len(grid)), np.ones(len(grid), dtype=bool)
    alone = np.ones(len(grid), dtype=bool)
    for rows in neighbours.maps():
        has_node = np.pad(rows >= 0, 1)
        full = (
            has_node[1:-1, 1:-1] & has_node[:-2, 1:-1] & has_node[2:, 1:-1] & has_node[1:-1, :-2] & has_node[1:-1, 2:]
        )
        alone[rows[has_node[1:-1, 1:-1]]] = False
        full[full] = inner[rows[full]]
        islands, count = label(full)
        inner_rows, island = rows[full], islands[full]
        first = np.zeros(count + 1, dtype=np.int64)
        first[island[::-1]] = inner_rows[::-1]
        number[inner_rows], needs_check[inner_rows] = first[island], False
    lone_rows = np.flatnonzero(alone & inner)
    if len(lone_rows) > NEXT:
        length, place = tree_of(grid.position[lone_rows]).query(grid.position[lone_rows], NEXT + 1)
        delta = grid.delta[lone_rows]
        sure = length <= np.minimum(2 * np.minimum(delta[:, None], delta[place]), reach * delta[:, None])
        piece = connected(len(lone_rows), np.repeat(np.arange(len(lone_rows)), sure.sum(axis=1)), place[sure])
        largest = piece == np.bincount(piece).argmax()
        number[lone_rows[largest]], needs_check[lone_rows[largest]] = lone_rows[largest][0], False
    rows_to_check = np.flatnonzero(needs_check)
    sight, links = sight_of(grid), [np.zeros((2, 0), dtype=np.int64)]
    for chunk in np.array_split(rows_to_check, int(len(rows_to_check) * (2 * reach) ** 2 / PAIRS) + 1):
        pairs = neighbours.pairs(chunk)
        mean = (grid.delta[pairs.source] + grid.delta[pairs.target]) / 2
        pairs = chosen(pairs, pairs.length <= reach * mean * (1 + ROUND_OFF))
        in_sight = sight.inside(pairs) & ~sight.cut(pairs)
        links.append(number[np.stack([pairs.source[in_sight], pairs.target[in_sight]])])
    piece = connected(len(grid), *np.concatenate(links, axis=1))[number]
    is_used = np.zeros(len(grid), dtype=bool)
    is_used[piece] = True
    return np.asarray((np.cumsum(is_used) - 1)[piece], dtype=np.int64)
