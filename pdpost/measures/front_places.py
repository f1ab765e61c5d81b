"""Fronts of the cracks of a body, and the arc, normal and direction of growth at points along them.

Until cracks grow, fronts are those edges of the triangles of pre-cracks that belong to one triangle, where they are
inside the body. Then they are the ends of the surface of `crack_faces`. An arc is a circle fitted to the front within
`WINDOW` horizons of a point; the normal is that of the plane that fits the crack's surface best there.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdmesh.model.crack_surfaces import TOUCH, front
from pdpost.measures.crack_faces import build_crack_surface, find_opened_face_neighbours
from pdpost.measures.crack_fronts import Polyline, chain_edges, front_lines_at, line_length
from pdpost.measures.lattice_neighbours import NEAR
from pdsolve.fracture.front_integrals import FrontPlace
from pdsolve.results import Nodes, Results

EVERY = 2.0  # spacings between points of a front
WINDOW = 1.5  # horizons to both sides of a point: what an arc and a normal are fitted to
FEWEST = 6  # points that an arc or a plane is fitted to


class CrackPointsAndFronts(NamedTuple):
    """The surface of all cracks as points about a spacing apart, and their fronts inside the body."""

    surface_points: NDArray[np.float64]  # (p, 3) m
    front_lines: list[Polyline]  # the longest first; closed ones end where they begin


class FrontPoints(NamedTuple):
    """Points of a front, from its first end on."""

    length_along_front: NDArray[np.float64]  # (k,) m
    front_places: list[FrontPlace]
    node_spacing: NDArray[np.float64]  # (k,) m, of the nodes there


def crack_points_and_fronts_at(results: Results, step: int) -> CrackPointsAndFronts:
    """The cracks of a body after `step`."""
    nodes = results.nodes(step)
    triangles = results.cracks().reshape(-1, 3, 3)
    if (results.breaks().step <= step).any():
        parted_pairs = find_opened_face_neighbours(results, step)
        if (parted_pairs.opening_step >= 0).any():
            cracks, now = build_crack_surface(results, step, parted_pairs), step * float(results.meta()["time_step"])
            return CrackPointsAndFronts(cracks.face_centres[cracks.opening_time <= now], front_lines_at(cracks, now))
    if not len(triangles):
        return CrackPointsAndFronts(np.zeros((0, 3)), [])
    spacing, edges = float(nodes.delta.min()), front(triangles)
    ends = edges.reshape(-1, 3)
    size = TOUCH * float(np.ptp(ends, axis=0).max())
    _, first, number = np.unique(np.round(ends / size), axis=0, return_index=True, return_inverse=True)
    places = ends[first]
    lines = [
        part
        for chain in chain_edges(number.reshape(-1, 2))
        for part in _line_parts_inside_body(nodes, places[chain], spacing)
    ]
    # the middles of pieces no longer than a spacing
    low, high = _bounding_box(nodes)
    points = []
    while len(triangles):
        near = (triangles.max(axis=1) >= low).all(axis=1) & (triangles.min(axis=1) <= high).all(axis=1)
        triangles = triangles[near]
        turned = np.roll(triangles, -1, axis=1)
        small = ((turned - triangles) ** 2).sum(axis=2).max(axis=1, initial=0.0) <= spacing**2
        points.append(triangles[small].mean(axis=1))
        corner, middle = triangles[~small], ((triangles + turned) / 2)[~small]
        of_corners = [np.stack([corner[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(3)]
        triangles = np.concatenate([middle, *of_corners])
    return CrackPointsAndFronts(np.concatenate(points), sorted(lines, key=lambda line: -line_length(line)))


def _line_parts_inside_body(nodes: Nodes, line: Polyline, spacing: float) -> list[Polyline]:
    """The parts of a line, as points at most half a spacing apart, that are in the cubes of nodes."""
    low, high = _bounding_box(nodes)
    pieces = []
    for a, b in itertools.pairwise(line):
        # the part (2, 3) of the segment in the box
        way = b - a
        with np.errstate(divide="ignore", invalid="ignore"):
            at_low, at_high = (low - a) / way, (high - a) / way
        still = way == 0
        if (still & ((a < low) | (a > high))).any():
            piece = None
        else:
            first = np.where(still, 0.0, np.minimum(at_low, at_high)).max(initial=0.0)
            last = np.where(still, 1.0, np.maximum(at_low, at_high)).min(initial=1.0)
            piece = np.array([a + first * way, a + last * way]) if first < last else None
        count = 0 if piece is None else int(np.ceil(2 * np.linalg.norm(piece[1] - piece[0]) / spacing))
        if piece is not None and count:
            pieces.append(piece[0] + np.arange(count + 1)[:, None] / count * (piece[1] - piece[0]))
    if not pieces:
        return []
    every = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
    away, nearest = cKDTree(nodes.position).query(every, p=np.inf)
    inside = away <= (0.5 + NEAR) * nodes.delta[nearest]
    inside[1:] &= np.linalg.norm(np.diff(every, axis=0), axis=1) < spacing
    parts = np.split(np.arange(len(every)), np.flatnonzero(~inside))
    inner_parts = [every[part[inside[part]]] for part in parts]
    return [part for part in inner_parts if len(part) > 1]


def _bounding_box(nodes: Nodes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    half = nodes.delta[:, None] / 2
    return (nodes.position - half).min(axis=0), (nodes.position + half).max(axis=0)


def sample_front_points(
    nodes: Nodes, cracks: CrackPointsAndFronts, line: Polyline, horizon_ratio: float
) -> FrontPoints:
    """Points of a front about two spacings apart, with their arcs; `horizon_ratio` is the horizon in spacings.

    Points are left out where too little of the front or of the crack is around them for an arc or a normal.
    """
    distances = np.linalg.norm(np.diff(line, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(distances)])
    total_length, closed = float(at[-1]), bool(np.allclose(line[0], line[-1]))
    tree, surface_tree = cKDTree(nodes.position), cKDTree(cracks.surface_points)
    grain = float(nodes.delta.min())
    count = max(round(total_length / (EVERY * grain)), 1)
    along = (np.arange(count) + (0.0 if closed else 0.5)) * total_length / count
    fine = np.arange(0.0, total_length, min(grain / 2, total_length / 64))
    points = _interpolate_points_along_line(line, at, fine)
    arc_lengths, places, spacings, before = [], [], [], None
    for s in along.tolist():
        point = _interpolate_points_along_line(line, at, np.array([s]))[0]
        spacing = float(nodes.delta[tree.query(point)[1]])
        off = np.abs(fine - s)
        off = np.minimum(off, total_length - off) if closed else off
        near_front = points[off <= WINDOW * horizon_ratio * spacing]
        near_crack = cracks.surface_points[surface_tree.query_ball_point(point, WINDOW * horizon_ratio * spacing)]
        if len(near_front) < FEWEST or len(near_crack) < FEWEST:
            continue
        # a circle through the points of the front, in the plane of those and of the crack; the normal is on the side
        # of the one before, of the first one along its longest component
        normal = np.linalg.svd(np.concatenate([near_crack, near_front]) - point, full_matrices=False)[2][2]
        side = normal if before is None else before
        normal = normal * np.sign((normal @ side) if before is not None else normal[np.abs(normal).argmax()])
        tangent = np.linalg.svd(near_front - near_front.mean(axis=0), full_matrices=False)[2][0]
        tangent -= (tangent @ normal) * normal
        tangent /= np.linalg.norm(tangent)
        growth = np.cross(normal, tangent)
        if growth @ (near_crack.mean(axis=0) - near_front.mean(axis=0)) > 0:
            growth, tangent = -growth, -tangent
        x, w = (near_front - point) @ growth, (near_front - point) @ tangent
        unit = float(np.abs(w).max())
        terms = np.column_stack([-(x * x + w * w) / (2 * unit**2), w / unit, np.ones(len(x))])
        bend, slant, shift = np.linalg.lstsq(terms, x / unit, rcond=None)[0]
        tangent = (tangent + slant * growth) / np.hypot(1.0, slant)
        frame = np.array([np.cross(normal, tangent), normal, tangent])
        place = FrontPlace(point + shift * unit * growth, frame, float(bend / unit))
        before = place.frame[1]
        arc_lengths.append(s)
        places.append(place)
        spacings.append(spacing)
    return FrontPoints(np.array(arc_lengths), places, np.array(spacings))


def _interpolate_points_along_line(
    line: Polyline, length_at_corners: NDArray[np.float64], lengths: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.column_stack([np.interp(lengths, length_at_corners, column) for column in line.T])
