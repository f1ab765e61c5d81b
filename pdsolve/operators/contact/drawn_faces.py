"""Drawn surfaces of bodies beside their nodes: how deep nodes lie under them, and their normals.

The nodes of a round or an inclined body are steps, its drawn surface is smooth. Contact counts the gap of the drawn
surfaces: a node next to one has its normal, and its depth d under it along this normal. Nodes deeper than a spacing lie
behind others and do not touch, so that on a face of any direction a spacing of depth carries, one node a cell on the
mean. Nodes of a flat face along the axes, and those at an edge, are as they are without a drawing: half a spacing deep,
with the normal of their bonds.

A circle or a sphere is drawn by chords; where all corners of a body are on one, that is its surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_grid import Grid
from pdmesh.model.triangulated_surface import outward

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

FINEST = {2: 1 / 16, 3: 1 / 2}  # spacings: longest side of a piece
NEAR = 2.0  # spacings: a node deeper than that is not at the surface
SMOOTH = 0.95  # mean normal within a spacing that is longer than that is of no edge: one of 90 degrees has .71
CHORD, ARC = 0.25, 0.02  # of a spacing, of a radius: the most that a chord cuts off of a circle or a sphere
STRAIGHT = 1e-9  # mean normal within a spacing that is shorter than 1 by more is of a curve
ON_AXIS, ROUND_OFF = 1e-9, 1e-6  # of a normal; of a spacing, or of a radius


class DrawnFaces(NamedTuple):
    """What the drawing says of n nodes."""

    normal: Array  # (n, d) out of the drawn surface; 0 of nodes that have that of their bonds
    beyond: Array  # (n,) how much deeper than half a spacing they lie under it, m
    behind: NDArray[np.bool_]  # (n,) at a drawn surface but behind other nodes
    round: NDArray[np.bool_]  # (n,) at a curved one


class Pieces(NamedTuple):
    """Small pieces of facets, s of them."""

    middle: Array  # (s, d) m
    normal: Array  # (s, d) of length 1, out of the body
    facet: Rows  # (s,) number of the facet


class Surface(NamedTuple):
    """The surface of one body beside k nodes."""

    normal: Array  # (k, d) of length 1, at the nearest place
    depth: Array  # (k,) m; infinite far from it
    smooth: NDArray[np.bool_]  # (k,) whether it has no edge there
    round: NDArray[np.bool_]  # (k,) whether it is curved there


def drawn_faces(grid: Grid, surface: NDArray[np.bool_]) -> DrawnFaces:
    """The drawn faces of several bodies; `surface` (n,) masks the nodes that lack neighbours to one side."""
    nodes, d = len(grid), grid.dimension
    faces = DrawnFaces(np.zeros((nodes, d)), np.zeros(nodes), *np.zeros((2, nodes), dtype=np.bool_))
    rows = np.flatnonzero(surface)
    if grid.bodies is None or not grid.outline or not len(rows):
        return faces
    if grid.dimension == 3:
        facets = outward(grid.faces)
    else:
        sides = []
        for place, ring in enumerate((*grid.outline, *grid.holes)):
            ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
            clockwise = np.linalg.det(ends - ring[0]).sum() < 0
            sides.append(ends[:, ::-1] if clockwise == (place < len(grid.outline)) else ends)
        facets = np.concatenate(sides)
        facets = np.asarray(facets[(facets[:, 0] != facets[:, 1]).any(axis=1)])
    number, near = grid.bodies.number[rows], NEAR * float(grid.delta[rows].max())
    pieces = _pieces(facets, grid.position[rows], near, FINEST[d] * float(grid.delta[rows].min()))
    # The body of each facet, that of the node that is nearest inside of most of its pieces; else -1
    nearest, body_of = np.full(len(pieces.facet), np.inf), np.zeros(len(pieces.facet), dtype=np.int64)
    for candidate in np.unique(grid.bodies.number[rows]):
        candidate_rows = rows[grid.bodies.number[rows] == candidate]
        way, at = tree_of(grid.position[candidate_rows]).query(pieces.middle)
        inside = ((pieces.middle - grid.position[candidate_rows[at]]) * pieces.normal).sum(axis=1) > 0
        inside &= (way < NEAR * grid.delta[candidate_rows[at]]) & (way < nearest)
        nearest[inside], body_of[inside] = way[inside], candidate + 1
    bodies, facet_count = len(grid.bodies.names) + 1, int(pieces.facet.max(initial=-1)) + 1
    votes = np.bincount(pieces.facet * bodies + body_of, minlength=facet_count * bodies).reshape(facet_count, bodies)
    body_of = np.asarray(np.where(votes[:, 1:].any(axis=1), votes[:, 1:].argmax(axis=1), -1))
    for body in np.unique(number):
        body_rows = rows[number == body]
        mine = Pieces(*(column[body_of[pieces.facet] == body] for column in pieces))
        if len(mine.facet):
            ball = _on_ball(grid, body_rows, facets[np.unique(mine.facet)])
            normal, depth, smooth, curved = ball or _on_pieces(grid, body_rows, mine)
            delta = grid.delta[body_rows]
            along_axis = np.abs(normal).max(axis=1) > 1 - ON_AXIS
            laid = smooth & (curved | ~along_axis) & (np.abs(depth) < NEAR * delta)
            covered = laid & (depth > (1 + ROUND_OFF) * delta)
            faces.behind[body_rows[covered]] = True
            laid &= ~covered
            faces.normal[body_rows[laid]], faces.beyond[body_rows[laid]] = normal[laid], (depth - delta / 2)[laid]
            faces.round[body_rows[laid]] = curved[laid]
    return faces


def _on_ball(grid: Grid, rows: Rows, facets: Array) -> Surface | None:
    """The circle or sphere that has facets (f, d, d) for chords, beside nodes of these rows (k,); None if none has."""
    corners = facets.reshape(-1, facets.shape[-1])
    if len(corners) <= 2 * corners.shape[1]:
        return None
    middle = corners.mean(axis=0)
    apart = corners - middle
    columns = np.column_stack([2 * apart, np.ones(len(apart))])
    fit, _, rank, _ = np.linalg.lstsq(columns, (apart**2).sum(axis=1), rcond=None)
    if rank < columns.shape[1]:  # in a line, or in a plane
        return None
    radius = np.sqrt(((apart - fit[:-1]) ** 2).sum(axis=1))
    cut = radius.mean() - np.sqrt(((facets.mean(axis=1) - middle - fit[:-1]) ** 2).sum(axis=1).min())
    if np.ptp(radius) > ROUND_OFF * radius.mean() or cut > min(CHORD * grid.delta[rows].min(), ARC * radius.mean()):
        return None
    arm = grid.position[rows] - middle - fit[:-1]
    far = np.sqrt((arm**2).sum(axis=1))
    return Surface(arm / np.maximum(far, 1e-300)[:, None], radius.mean() - far, far > 0, far > 0)


def _on_pieces(grid: Grid, rows: Rows, pieces: Pieces) -> Surface:
    """The surface of these pieces beside the nodes of one body, of these rows (k,)."""
    middles, normals = pieces.middle, pieces.normal
    places, delta, tree = grid.position[rows], grid.delta[rows], tree_of(middles)
    nearest = tree.query(places)[1]
    depth = ((middles[nearest] - places) * normals[nearest]).sum(axis=1)
    mean = normals[nearest]
    for spacing in np.unique(delta):  # trees find all within one distance
        near_nodes = np.flatnonzero((delta == spacing) & (np.abs(depth) < spacing))
        pairs = tree_of(places[near_nodes]).sparse_distance_matrix(tree, spacing, output_type="ndarray")
        count = np.maximum(np.bincount(pairs["i"], minlength=len(near_nodes)), 1)
        for axis, column in enumerate(normals.T):
            mean[near_nodes, axis] = np.bincount(pairs["i"], column[pairs["j"]], len(near_nodes)) / count
    length = np.sqrt((mean**2).sum(axis=1))
    return Surface(mean / np.maximum(length, 1e-300)[:, None], depth, length > SMOOTH, length < 1 - STRAIGHT)


def _pieces(facets: Array, places: Array, reach: float, finest: float) -> Pieces:
    """Facets (f, d, d) halved until no side is longer than `finest`, m, as far as they are near places (k, d)."""
    tree, sides = tree_of(places), np.diff(facets, axis=1)
    across = np.cross(sides[:, 0], sides[:, 1]) if facets.shape[1] == 3 else sides[:, 0] @ np.array([[0, -1], [1, 0]])
    normal = across / np.sqrt((across**2).sum(axis=1))[:, None]  # of length 1, out of the body
    first, second = np.triu_indices(facets.shape[1], 1)
    facet, small_facets, of = np.arange(len(facets)), [facets[:0]], [np.zeros(0, dtype=np.int64)]
    while len(facets):
        middle = facets.mean(axis=1)
        radius = np.sqrt(((facets - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
        near = tree.query(middle)[0] <= reach + radius
        facets, facet = facets[near], facet[near]
        long = np.sqrt(((facets[:, first] - facets[:, second]) ** 2).sum(axis=2))
        small = long.max(axis=1, initial=0.0) <= finest
        small_facets.append(facets[small])
        of.append(facet[small])
        rest, side = facets[~small], long[~small].argmax(axis=1)
        index = np.arange(len(rest))
        half = (rest[index, first[side]] + rest[index, second[side]]) / 2
        first_half, second_half = rest, rest.copy()
        first_half[index, first[side]], second_half[index, second[side]] = half, half
        facets, facet = np.concatenate([first_half, second_half]), np.tile(facet[~small], 2)
    number = np.concatenate(of)
    return Pieces(np.concatenate(small_facets).mean(axis=1), normal[number], number)
