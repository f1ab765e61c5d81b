"""Faces that a pressure acts on, in small pieces, and the nodes that carry each corner of them.

A face is a segment (2, 2) of a plate with the material on its left, or a triangle (3, 3) of a body whose corners turn
anticlockwise as seen from outside, m. Each corner of a piece is carried by the nodes of the condition behind it, within
a spacing along the face, in proportion to their cells and to how near they are, so that a uniform pressure is uniform
at the nodes, and so that what it does in all is p times the area of the faces, whatever nodes there are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import tree_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Faces = tuple[tuple[float, ...], ...]  # corners one after the other, m: four numbers in a plate, nine in a body

PIECE = {2: 0.25, 3: 0.5}  # of a spacing: the longest side of a piece, by dimension
BEHIND = 0.25  # of a spacing: how far a node may be in front of a corner of an edge that curves
EVENED = 32  # rounds; what is left at the end of a straight edge is 1 %
OPPOSITE = -0.5  # cosine of normals that belong to the two faces of a crack
ROUND_OFF = 1e-9  # of the extent of the faces: corners this near to each other are one


class FacePieces(NamedTuple):
    """Pieces of faces with p corners, and what carries them of k nodes."""

    corners: Array  # (p, d) m
    pieces: NDArray[np.int64]  # (f, d) their corners
    weights: csr_array  # (p, k): how much of each corner each node carries, 1 in all


def pieces_of(faces: Faces, position: Array, delta: Array, cells: Array) -> FacePieces:
    """The pieces of faces that nodes (k, d) carry, with spacings `delta` (k,), m, and `cells` (k,), which may be less
    by the share that each has in a load."""
    corners, pieces, is_crack = _divided(np.array(faces), tree_of(position), delta)
    areas = area_vectors(corners, pieces)
    normal = np.zeros_like(corners)
    for column in pieces.T:
        np.add.at(normal, column, areas)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    size = np.zeros(len(corners))
    np.add.at(size, pieces, np.linalg.norm(areas, axis=1)[:, None])
    near = _near(corners, -normal, is_crack, position, delta)
    # nodes begin with a part in proportion to how near they are and to their cells; those that get more or less per
    # cell than others around, as half cells at the end of an edge do, then take less or more
    part, reached = np.array(cells), near.T @ np.ones(len(size))
    reached = np.where(reached > 0, reached, np.inf)  # nodes that carry nothing
    for _ in range(EVENED):
        weights = near.multiply(part / (near @ part)[:, None])
        per_cell = (weights.T @ size) / cells
        around = (near @ (per_cell * cells)) / (near @ cells)
        part *= np.where(per_cell > 0, (near.T @ around) / reached / np.maximum(per_cell, 1e-300), 1.0)
    return FacePieces(corners, pieces, near.multiply(part / (near @ part)[:, None]).tocsr())


def area_vectors(corners: Array, pieces: NDArray[np.int64]) -> Array:
    """The area vectors (f, d) of pieces with these corners (p, d), outwards, m or m^2."""
    first, second, *third = (corners[column] for column in pieces.T)
    way = second - first
    if not third:
        return np.column_stack([way[:, 1], -way[:, 0]])
    return np.asarray(np.cross(way, third[0] - first) / 2)


def rim_of(pieces: FacePieces) -> NDArray[np.bool_]:
    """Which corners (p,) are where faces end: of segments those of one, of triangles those of a side of one."""
    d = pieces.corners.shape[1]
    ends = np.sort(np.stack([np.roll(pieces.pieces, -at, axis=1) for at in range(d - 1)], axis=2), axis=2)
    each, count = np.unique(ends.reshape(-1, d - 1), axis=0, return_counts=True)
    at_rim = np.zeros(len(pieces.corners), dtype=bool)
    at_rim[each[count == 1]] = True
    return at_rim


def carried(pieces: FacePieces, areas: Array) -> Array:
    """What the nodes (k, d) carry of these area vectors (f, d) of the pieces, each of whose corners has as much."""
    at_corners = np.zeros(pieces.corners.shape)
    for column in pieces.pieces.T:
        np.add.at(at_corners, column, areas / pieces.pieces.shape[1])
    return np.asarray(pieces.weights.T @ at_corners)


def nodal_areas(faces: Faces, position: Array, delta: Array, cells: Array) -> Array:
    """The area vectors (k, d) that nodes carry of faces, outwards, m or m^2; arguments as of `pieces_of`."""
    pieces = pieces_of(faces, position, delta, cells)
    return carried(pieces, area_vectors(pieces.corners, pieces.pieces))


def _divided(numbers: Array, tree: object, delta: Array) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Corners (p, d) of pieces no longer than nodes there allow, the pieces (f, d), and which corners (p,) are on a
    crack, whose two faces have corners of their own."""
    d = 2 if numbers.shape[1] == 4 else 3
    faces = numbers.reshape(-1, d, d)
    while True:  # halves of the longest side of what is too large, on which neighbours agree
        sides = np.roll(faces, -1, axis=1) - faces
        length = np.linalg.norm(sides, axis=2)
        longest = length.argmax(axis=1)
        every = np.arange(len(faces))
        nearest = tree.query(faces.mean(axis=1))[1]  # type: ignore[attr-defined]
        large = length[every, longest] > PIECE[d] * delta[nearest] * (1 + 1e-6)
        if not large.any():
            break
        whole, at = faces[large], longest[large]
        rows = np.arange(len(whole))
        middle = (whole[rows, at] + whole[rows, (at + 1) % d]) / 2
        first, second = whole.copy(), whole.copy()
        first[rows, (at + 1) % d], second[rows, at] = middle, middle
        faces = np.concatenate([faces[~large], first, second])
    # corners at one place are joined, except those of the opposite face of a crack
    points = faces.reshape(-1, d)
    extent = float(np.ptp(points, axis=0).max())
    cell = np.round((points - points.min(axis=0)) / (ROUND_OFF * extent)).astype(np.int64)
    place = np.unique(cell, axis=0, return_inverse=True)[1].reshape(-1)
    areas = area_vectors(points, np.arange(len(points)).reshape(-1, d))
    normal = np.repeat(areas / np.linalg.norm(areas, axis=1)[:, None], d, axis=0)
    first = np.full(place.max() + 1, -1)
    first[place[::-1]] = np.arange(len(points))[::-1]
    other = (normal * normal[first[place]]).sum(axis=1) < OPPOSITE
    number, kept, corner = np.unique(2 * place + other, return_index=True, return_inverse=True)
    has_other = np.bincount(place, other, len(first)) > 0
    return points[kept], corner.reshape(-1, d), has_other[number // 2]


def _near(corners: Array, inward: Array, is_crack: NDArray[np.bool_], position: Array, delta: Array) -> csr_array:
    """How near (p, k) nodes behind each corner are along the faces, of which `inward` (p, d) are the normals into the
    material: 1 to 0 a spacing away."""
    from scipy.sparse import csr_array

    tree = tree_of(position)
    depth = tree.query(corners)[0].max() + float(delta.max())
    reach = max(depth, float(tree_of(corners).query(position)[0].max()) + float(delta.max()))
    near = tree.query_ball_point(corners, reach)
    corner = np.repeat(np.arange(len(corners)), [len(rows) for rows in near])
    node = np.concatenate([np.asarray(rows, dtype=np.int64) for rows in near])
    way = position[node] - corners[corner]
    deep = (way * inward[corner]).sum(axis=1)
    along = np.sqrt(np.maximum((way**2).sum(axis=1) - deep**2, 0.0))
    behind = deep >= np.where(is_crack[corner], 0.0, -BEHIND * delta[node])
    weight = np.where(behind, np.maximum(1 - along / delta[node], 0.0), 0.0)
    # a corner that no node is behind is carried by the nearest one, on its own side of a crack if there is one
    lonely = np.flatnonzero(np.bincount(corner, weight, len(corners)) == 0)
    far = along + np.where(behind, 0.0, 2 * reach)
    order = np.lexsort((far, corner))
    nearest = order[np.searchsorted(corner[order], lonely)]
    weight[nearest] = 1.0
    is_near = weight > 0
    return csr_array((weight[is_near], (corner[is_near], node[is_near])), shape=(len(corners), len(position)))
