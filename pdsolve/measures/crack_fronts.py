"""Fronts of the cracks of a body: lines, their speed, their arcs, normals and directions of growth, and their room.

Until cracks grow, fronts are those edges of the triangles of pre-cracks that belong to one triangle, where they are
inside the body. Then they are the ends of the surface of `crack_faces`. An arc is a circle fitted to the front within
`WINDOW` horizons of a point; the normal is that of the plane that fits the crack's surface best there.

The undisturbed room around a point of a front reaches to the first obstacle beside it: anything that is not elastic
body with one crack in the plane of the arc. Only what is beside the piece of front that a tube belongs to counts.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from pdmesh.model.visibility import TOUCH, front
from pdsolve.fracture.front_integrals import FrontPlace, across
from pdsolve.measures.crack_faces import (
    NEAR,
    CrackSurface,
    build_crack_surface,
    face_neighbour_pairs,
    find_opened_face_neighbours,
)
from pdsolve.measures.strain import elastic_constants_of_nodes
from pdsolve.measures.tip_surroundings import UndisturbedRoom, nodes_of_loads_and_grips
from pdsolve.results import Nodes, Results

AROUND = 4.0  # face sizes: how far faces are that a speed is fitted to
FEWEST_FACES = 12  # faces that a speed is fitted to
FLAT = 0.1  # of the widest scatter of faces: across the surface times have no slope
KNOWN = 0.5  # share of the scatter of times that a plane must explain
Polyline = NDArray[np.float64]  # (k, 3) m
EVERY = 2.0  # spacings between points of a front
WINDOW = 1.5  # horizons to both sides of a point: what an arc and a normal are fitted to
FEWEST_POINTS = 6  # points that an arc or a plane is fitted to
BESIDE, SLANT = 1.5, 0.1  # spacings beside an arc's plane or circle, and of the distance: what is nearer is on it
AXIS = 0.95  # of an arc's radius


def front_edges_at(cracks: CrackSurface, time: float) -> NDArray[np.int64]:
    """The edges (k,) inside the body where the surface that is open at `time`, s, ends."""
    open_now = cracks.opening_time <= time
    uses = np.bincount(cracks.face_edges[open_now].ravel(), minlength=len(cracks.edge_corners))
    return np.flatnonzero((uses == 1) & cracks.edge_is_inside_body)


def front_lines_at(cracks: CrackSurface, time: float) -> list[Polyline]:
    """The front at `time`, s, as lines; the longest first, closed ones end where they begin."""
    edges = cracks.edge_corners[front_edges_at(cracks, time)]
    lines = [cracks.corners[chain] for chain in chain_edges(edges)]
    return sorted((line for line in lines if line_length(line) > 0), key=lambda line: -line_length(line))


def line_length(line: Polyline) -> float:
    """The length of a line, m."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def chain_edges(edges: NDArray[np.int64]) -> list[list[int]]:
    """Edges (k, 2) between corners as chains of corners; each edge is in one, chains end where not two edges meet."""
    at: dict[int, list[int]] = {}
    for number, ends in enumerate(edges.tolist()):
        for corner in ends:
            at.setdefault(corner, []).append(number)
    used, corner_chains = set(), []
    ends_first = sorted(at, key=lambda corner: (len(at[corner]) == 2, corner))
    for start in ends_first:
        for number in at[start]:
            if number in used:
                continue
            chain, end_corner, way = [start], start, number
            while True:
                used.add(way)
                first_corner, second_corner = edges[way].tolist()
                end_corner = second_corner if end_corner == first_corner else first_corner
                chain.append(end_corner)
                further = [edge for edge in at[end_corner] if edge not in used]
                if len(at[end_corner]) != 2 or not further:
                    break
                way = further[0]
            corner_chains.append(chain)
    return corner_chains


def estimate_front_speed_at_faces(cracks: CrackSurface) -> NDArray[np.float64]:
    """The speed (f,) at which the front went over each face, m/s: one over the slope of the opening times around it.

    NaN of pre-cracks, and where a plane through these times explains less than half of their scatter.
    """
    speed, new_faces = np.full(len(cracks.face_corners), np.nan), np.flatnonzero(cracks.face_opened_during_run)
    if len(new_faces) < FEWEST_FACES:
        return speed
    place, time = cracks.face_centres[new_faces], cracks.opening_time[new_faces]
    size = float(np.sqrt(np.median(cracks.face_area[new_faces])))
    near = cKDTree(place).query_pairs(AROUND * size, output_type="ndarray")
    face, neighbour = np.concatenate([near, near[:, ::-1]]).T
    face_numbers = np.arange(len(new_faces))
    graph = csr_array(
        (np.ones(2 * len(near) + len(face_numbers)), (np.r_[face, face_numbers], np.r_[neighbour, face_numbers])),
        shape=(len(face_numbers),) * 2,
    )
    count = graph.sum(axis=1)
    columns = np.column_stack([place, time])
    mean = (graph @ columns) / count[:, None]
    products = (columns[:, :, None] * columns[:, None, :]).reshape(-1, 16)
    scatter = (graph @ products / count[:, None]).reshape(-1, 4, 4) - mean[:, :, None] * mean[:, None, :]
    spread, late = scatter[:, :3, :3], scatter[:, :3, 3]
    values, axes = np.linalg.eigh(spread)
    flat = values <= FLAT * values[:, 2:]
    inverse = np.where(flat, 0.0, 1 / np.where(flat, 1.0, values))
    slope = np.einsum("fij,fj,fkj,fk->fi", axes, inverse, axes, late)
    explained = (slope * late).sum(axis=1)
    steepness = np.linalg.norm(slope, axis=1)
    sure = (count >= FEWEST_FACES) & (explained > KNOWN * scatter[:, 3, 3]) & (steepness > 0)
    speed[new_faces[sure]] = 1 / steepness[sure]
    return speed


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
        if min(len(near_front), len(near_crack)) < FEWEST_POINTS:
            continue
        place = _fit_arc(point, near_front, near_crack, before)
        before = place.frame[1]
        arc_lengths.append(s)
        places.append(place)
        spacings.append(spacing)
    return FrontPoints(np.array(arc_lengths), places, np.array(spacings))


def _fit_arc(
    point: NDArray[np.float64],
    near_front: NDArray[np.float64],
    near_crack: NDArray[np.float64],
    last_normal: NDArray[np.float64] | None,
) -> FrontPlace:
    """The circle through points (k, 3) of a front, in the plane of those and of points (l, 3) of the crack.

    The normal is on the side of the last one, that of the first along its longest component.
    """
    normal = np.linalg.svd(np.concatenate([near_crack, near_front]) - point, full_matrices=False)[2][2]
    normal *= np.sign(normal[np.abs(normal).argmax()] if last_normal is None else normal @ last_normal)
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
    return FrontPlace(point + shift * unit * growth, frame, float(bend / unit))


def _interpolate_points_along_line(
    line: Polyline, length_at_corners: NDArray[np.float64], lengths: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.column_stack([np.interp(lengths, length_at_corners, column) for column in line.T])


class FrontObstacles:
    """Obstacles to the fields around fronts after a step."""

    def __init__(self, results: Results, step: int, cracks: CrackPointsAndFronts) -> None:
        nodes = results.nodes(step)
        self._nodes, self._cracks, self._tree = nodes, cracks, cKDTree(nodes.position)
        self._elastic = elastic_constants_of_nodes(results, step)
        # those faces of nodes' cubes that other cubes do not cover
        pairs, count = face_neighbour_pairs(nodes), len(nodes.ids)
        way = nodes.position[pairs[:, 1]] - nodes.position[pairs[:, 0]]
        axis = np.abs(way).argmax(axis=1)
        ahead = way[np.arange(len(pairs)), axis] > 0
        shared = nodes.delta[pairs].min(axis=1) ** 2
        covered = np.zeros((6, count))
        for side in range(6):
            for end in (0, 1):
                side_pairs = (axis == side % 3) & (ahead == ((side < 3) == (end == 0)))
                covered[side] += np.bincount(pairs[side_pairs, end], shared[side_pairs], count)
        sides, row = np.nonzero(covered < (1 - NEAR) * nodes.delta**2)
        middles = nodes.position[row]
        middles[np.arange(len(row)), sides % 3] += np.where(sides < 3, 0.5, -0.5) * nodes.delta[row]
        self._held, self._surface = nodes_of_loads_and_grips(results, nodes), middles

    def find_undisturbed_room(
        self, front_place: FrontPlace, half_length: float, largest_radius: float
    ) -> UndisturbedRoom:
        """The room around a point of a front, `largest_radius` m at most, for a tube of the half length `half_length`,
        m."""
        near = np.array(
            self._tree.query_ball_point(front_place.place, np.hypot(largest_radius, half_length + largest_radius)),
            dtype=np.int64,
        )
        nodes, nearest = self._nodes, int(self._tree.query(front_place.place)[1])
        spacing = float(nodes.delta[nearest])
        other_material = self._elastic.differs_from(nearest)[near]
        rooms = [UndisturbedRoom(largest_radius, "")]
        if front_place.curvature:
            rooms.append(UndisturbedRoom(AXIS / abs(front_place.curvature), "the middle of the front's arc"))
        points = self._cracks.surface_points
        x, y, _, _ = across(points, front_place)
        slack = np.maximum(BESIDE * spacing, SLANT * np.hypot(x, y))
        behind = (np.abs(y) < slack) & (x < slack)  # of the crack whose front has the arc
        ahead = np.concatenate(self._cracks.front_lines)
        x, y, s, _ = across(ahead, front_place)
        on_arc = np.hypot(x, y) < np.maximum(BESIDE * spacing, SLANT * np.abs(s))
        for places, what in (
            (self._surface, "the surface of the body"),
            (points[~behind], "another crack or a bend of this one"),
            (ahead[~on_arc], "another front or a bend of this one"),
            (nodes.position[near[self._held[near]]], "nodes of a load or grip"),
            (nodes.position[near[other_material]], "another material"),
        ):
            x, y, s, _ = across(places, front_place)
            in_tube = np.abs(s) < half_length
            if in_tube.any():
                rooms.append(UndisturbedRoom(float(np.hypot(x, y)[in_tube].min()), what))
        return min(rooms)
