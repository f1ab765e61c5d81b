"""The surface of the cracks of a body: faces between neighbouring nodes that parted, smoothed.

Two nodes whose cubes touch share a face. It is open once their bond is broken and their mean damage is that of a
cracked node. Bonds break in a band some nodes thick, and more than one layer of faces opens there; the crack is the
layer in its middle. A cracked node belongs to the sound node that is nearest along the lattice, where a way over an
open face counts more. A face is in the middle if the nodes on its two sides belong to sound nodes at least two spacings
apart (the medial axis of what is sound; H. Blum, 1967).

The faces of an inclined crack are stairs, whose area is up to sqrt(3) times too large. Their corners are moved to and
fro until they are smooth (G. Taubin, SIGGRAPH 95, 351-358). A free edge is smoothed along itself; where a front meets
the body's surface, and on edges of the body, corners stay.

Symbols: n nodes, b pairs of neighbours, f faces, p corners, e edges.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from pdmesh.model.neighbours import Pairs
from pdmesh.model.triangulated_surface import Screen
from pdsolve.measures.cracked_nodes import cracked_damage_of, damage_with_pre_cracks_at
from pdsolve.results import Nodes, Results

NEAR = 1e-3  # of a spacing: by how much a cube may be off
OPEN = 3.0  # what a way over an open face counts, in ways over a closed one
ON_EDGE = 2  # of the eight cubes around a corner: it is on an edge of the body
APART = 1.9  # spacings between the sound nodes that the sides of a crack belong to
FORTH, BACK, ROUNDS = 0.5, -0.53, 30  # Taubin's smoothing
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
BEFORE = -1.0  # s: a face of a pre-crack
PRE_CRACK, CLOSED = -1, -2  # steps in which neighbours parted


def face_neighbour_pairs(nodes: Nodes) -> NDArray[np.int64]:
    """Pairs (b, 2) of rows of nodes whose cubes share a face, the smaller row first, sorted."""
    levels = [np.flatnonzero(nodes.delta == spacing) for spacing in np.unique(nodes.delta)]
    trees = [cKDTree(nodes.position[rows]) for rows in levels]
    level_pairs = [np.zeros((0, 2), dtype=np.int64)]
    for rows, tree in zip(levels, trees, strict=True):
        level_pairs.append(rows[tree.query_pairs((1 + NEAR) * nodes.delta[rows[0]], output_type="ndarray")])
    for (rows, tree), (others, second_tree) in itertools.combinations(zip(levels, trees, strict=True), 2):
        first_spacing, second_spacing = nodes.delta[rows[0]], nodes.delta[others[0]]
        reach = np.hypot((first_spacing + second_spacing) / 2, np.sqrt(2) * (second_spacing - first_spacing) / 2)
        near = tree.sparse_distance_matrix(second_tree, (1 + NEAR) * reach, output_type="ndarray")
        level_pairs.append(np.column_stack([rows[near["i"]], others[near["j"]]]))
    pairs = np.sort(np.concatenate(level_pairs), axis=1)
    half = nodes.delta[pairs].sum(axis=1)[:, None] / 2
    way = np.sort(np.abs(np.diff(nodes.position[pairs], axis=1)[:, 0]), axis=1) / half
    pairs = pairs[(np.abs(way[:, 2] - 1) < NEAR) & (way[:, 1] < 1 - NEAR)]  # touch along one axis, overlap along others
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])])


class CrackSurface(NamedTuple):
    """Cracks as faces, those that opened first before the others."""

    corners: NDArray[np.float64]  # (p, 3) m, smoothed; where they were at the start of the run
    face_corners: NDArray[np.int64]  # (f, 4) corners around each face
    opening_time: NDArray[np.float64]  # (f,) s, when it opened; BEFORE of a pre-crack
    face_area: NDArray[np.float64]  # (f,) m^2
    edge_corners: NDArray[np.int64]  # (e, 2) corners
    face_edges: NDArray[np.int64]  # (f, 4) edges of each face
    edge_is_inside_body: NDArray[np.bool_]  # (e,) cubes are all round the edge: a crack that ends there has a front

    @property
    def face_opened_during_run(self) -> NDArray[np.bool_]:
        """Mask (f,) of the faces that opened during the run."""
        return np.asarray(self.opening_time > BEFORE)

    @property
    def face_centres(self) -> NDArray[np.float64]:
        """The middles (f, 3) of the faces, m."""
        return np.asarray(self.corners[self.face_corners].mean(axis=1))

    def grown_area_at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """The area (t,) that opened during the run until times (t,), s, in m^2."""
        new_faces = self.face_opened_during_run
        total_area = np.concatenate([[0.0], np.cumsum(self.face_area[new_faces])])
        return np.asarray(total_area[np.searchsorted(self.opening_time[new_faces], time, side="right")])


class FaceNeighbourPairs(NamedTuple):
    """Pairs of neighbours and when they parted."""

    node_rows: NDArray[np.int64]  # (b, 2) rows of nodes
    opening_step: NDArray[np.int64]  # (b,) in which they parted; PRE_CRACK by a pre-crack, CLOSED not at all
    node_is_uncracked: NDArray[np.bool_]  # (n,) nodes that are not cracked

    @property
    def is_opened(self) -> NDArray[np.bool_]:
        """Mask (b,) of the pairs that are parted."""
        return np.asarray(self.opening_step != CLOSED)


def find_opened_face_neighbours(results: Results, step: int, threshold: float | None = None) -> FaceNeighbourPairs:
    """Which neighbours in a body parted until `step`: their bond is broken and their mean damage is above `threshold`,
    or a pre-crack is between them. Nodes are cracked above the same damage."""
    nodes, breaks, threshold = results.nodes(step), results.breaks(), cracked_damage_of(results, threshold)
    pairs, past, count = face_neighbour_pairs(nodes), breaks.step <= step, len(nodes.ids)
    order, when = np.argsort(nodes.ids), breaks.step[past]
    ends = [order[np.searchsorted(nodes.ids, side[past], sorter=order)] for side in (breaks.node, breaks.neighbour)]
    broken, pair_keys = np.minimum(*ends) * count + np.maximum(*ends), pairs[:, 0] * count + pairs[:, 1]
    place = np.searchsorted(pair_keys, broken).clip(max=len(pair_keys) - 1)
    matched = pair_keys[place] == broken
    parting_step = np.full(len(pairs), CLOSED)
    np.maximum.at(parting_step, place[matched], when[matched])
    damage = NodeDamageHistory(nodes, ends[0], when)
    parted_rows = np.flatnonzero(parting_step != CLOSED)
    # the first step after which their mean damage is above `threshold`; `step` + 1 for none
    first, second = pairs[parted_rows].T
    low, high = np.zeros(len(first), dtype=np.int64), np.full(len(first), step + 1)
    for _ in range(int(step + 1).bit_length()):
        middle_step = (low + high) // 2
        cracked = (damage.damage_at(first, middle_step) + damage.damage_at(second, middle_step)) / 2 > threshold
        low = np.where(cracked, low, np.minimum(middle_step + 1, high))
        high = np.where(cracked, np.minimum(middle_step, high), high)
    parting_step[parted_rows] = np.maximum(parting_step[parted_rows], high)
    parting_step[parting_step > step] = CLOSED
    triangles = results.cracks().reshape(-1, 3, 3)
    if len(triangles):
        a, b = (nodes.position[pairs[:, side]] for side in (0, 1))
        reach = float(nodes.delta.max())
        lowest, highest = triangles.min(axis=(0, 1)) - reach, triangles.max(axis=(0, 1)) + reach
        near = np.flatnonzero(((a >= lowest) & (a <= highest)).all(axis=1))
        near_pairs = Pairs(pairs[near, 0], pairs[near, 1], np.linalg.norm(b[near] - a[near], axis=1))
        parting_step[near[Screen(triangles, nodes.position, nodes.delta).met(near_pairs)]] = PRE_CRACK
    return FaceNeighbourPairs(pairs, parting_step, damage_with_pre_cracks_at(results, step) <= threshold)


class NodeDamageHistory:
    """The damage of nodes at any step, from the rows (k,) whose bonds broke and the steps (k,) in which they did."""

    def __init__(self, nodes: Nodes, broken_bond_rows: NDArray[np.int64], broken_bond_steps: NDArray[np.int64]) -> None:
        self._nodes, self._steps = nodes, int(broken_bond_steps.max(initial=0)) + 1
        self._keys = np.sort(broken_bond_rows * self._steps + broken_bond_steps)

    def damage_at(self, rows: NDArray[np.int64], step: NDArray[np.int64]) -> NDArray[np.float64]:
        """The damage (k,) of `rows` (k,) after `step` (k,), which is not negative."""
        first = rows * self._steps
        last = first + step.clip(max=self._steps - 1)
        broken_count = np.searchsorted(self._keys, last, side="right") - np.searchsorted(self._keys, first)
        return np.asarray((self._nodes.cut[rows] + broken_count) / np.maximum(self._nodes.family[rows], 1))


def build_crack_surface(results: Results, step: int, neighbour_pairs: FaceNeighbourPairs) -> CrackSurface:
    """The cracks of a body after `step` from the neighbours that parted, its pre-cracks included."""
    nodes = results.nodes(step)
    crack = np.flatnonzero(
        (neighbour_pairs.opening_step == PRE_CRACK)
        | (neighbour_pairs.is_opened & _pairs_are_inside_cracked_region(nodes, neighbour_pairs))
    )
    crack = crack[np.argsort(neighbour_pairs.opening_step[crack], kind="stable")]
    when = neighbour_pairs.opening_step[crack]
    time = np.where(when == PRE_CRACK, BEFORE, when * float(results.meta()["time_step"]))
    return mesh_faces_between_pairs(nodes, neighbour_pairs.node_rows[crack], time)


def triangles_of_grown_faces(cracks: CrackSurface) -> NDArray[np.float64]:
    """Two triangles (t, 9), m, for each face that opened during the run."""
    corners = cracks.corners[cracks.face_corners[cracks.face_opened_during_run]]
    return np.asarray(corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 9))


def _pairs_are_inside_cracked_region(nodes: Nodes, neighbour_pairs: FaceNeighbourPairs) -> NDArray[np.bool_]:
    """Mask (b,) of pairs whose nodes belong to sound nodes far from each other, or to none."""
    pairs, sound = neighbour_pairs.node_rows, np.flatnonzero(neighbour_pairs.node_is_uncracked)
    if not len(sound):
        return np.ones(len(pairs), dtype=bool)
    cost = np.where(neighbour_pairs.is_opened, OPEN, 1.0)
    graph = csr_array((np.tile(cost, 2), (pairs.T.ravel(), pairs[:, ::-1].T.ravel())), shape=(len(nodes.ids),) * 2)
    _, _, home = dijkstra(graph, indices=sound, min_only=True, return_predecessors=True)
    sound_a, sound_b = home[pairs].T
    way = nodes.position[sound_a] - nodes.position[sound_b]
    spacing = nodes.delta[pairs].min(axis=1)
    return np.asarray((sound_a < 0) | (sound_b < 0) | ((way * way).sum(axis=1) > (APART * spacing) ** 2))


def mesh_faces_between_pairs(nodes: Nodes, pairs: NDArray[np.int64], opening_time: NDArray[np.float64]) -> CrackSurface:
    """The faces between `pairs` (f, 2) of neighbours that parted at `opening_time` (f,), s, in this order."""
    finer = np.take_along_axis(pairs, nodes.delta[pairs].argmin(axis=1)[:, None], axis=1)[:, 0]
    way = nodes.position[pairs.sum(axis=1) - finer] - nodes.position[finer]
    axis, spacing = np.abs(way).argmax(axis=1), nodes.delta[finer]
    places = np.repeat(nodes.position[finer][:, None, :], 4, axis=1)
    row = np.arange(len(pairs))
    places[row, :, axis] += (np.sign(way[row, axis]) * spacing / 2)[:, None]
    for turn in (0, 1):
        places[row, :, (axis + 1 + turn) % 3] += SQUARE[:, turn] * spacing[:, None]
    grain = float(nodes.delta.min()) / 4
    keys = np.rint((places.reshape(-1, 3) - nodes.position.min(axis=0)) / grain).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces, stairs = number.reshape(-1, 4), places.reshape(-1, 3)[first]
    every = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, sides = np.unique(every, axis=0, return_inverse=True)
    free = np.bincount(sides.ravel(), minlength=len(edges)) == 1
    cubes = NodeCubes(nodes)
    inside = _edges_are_inside_body(cubes, stairs[edges])
    # corners on edges of the body, and those where free edges inside meet others
    reach, around = cubes.finest / 4, np.zeros(len(stairs), dtype=int)
    for way in itertools.product((-reach, reach), repeat=3):
        around += cubes.contain(stairs + way)
    ends = np.zeros((2, len(stairs)), dtype=bool)
    for corner_mask, edge_mask in zip(ends, (inside[free], ~inside[free]), strict=True):
        corner_mask[edges[free][edge_mask]] = True
    corners = _smooth_corners(stairs, edges, free, (around <= ON_EDGE) | ends.all(axis=0))
    return CrackSurface(
        corners, faces, opening_time, quadrilateral_areas(corners[faces]), edges, sides.reshape(-1, 4), inside
    )


class NodeCubes:
    """The cubes of a body's nodes."""

    def __init__(self, nodes: Nodes) -> None:
        self._tree, self._delta, self.finest = cKDTree(nodes.position), nodes.delta, float(nodes.delta.min())

    def contain(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (k,) of places (k, 3), m, in the cube of the nearest node."""
        away, nearest = self._tree.query(places, p=np.inf)
        return np.asarray(away < (0.5 + NEAR) * self._delta[nearest])


def _edges_are_inside_body(cubes: NodeCubes, edges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (e,) of edges (e, 2, 3) of cubes that are between four cubes."""
    if not len(edges):
        return np.zeros(0, dtype=bool)
    row = np.arange(len(edges))
    way = np.abs(edges[:, 1] - edges[:, 0])
    axis, far = way.argmax(axis=1), way.max(axis=1) / 2
    inside = np.ones(len(edges), dtype=bool)
    for u, v in SQUARE:
        place = edges.mean(axis=1)
        place[row, (axis + 1) % 3] += u * far
        place[row, (axis + 2) % 3] += v * far
        inside &= cubes.contain(place)
    return inside


def _smooth_corners(
    corners: NDArray[np.float64],
    edges: NDArray[np.int64],
    edge_is_free: NDArray[np.bool_],
    corner_is_fixed: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """The corners (p, 3) of stairs, smoothed; those on `edge_is_free` (e,) edges move with the corners on these
    alone."""
    count, on = len(corners), np.zeros(len(corners), dtype=bool)
    on[edges[edge_is_free]] = True
    corner, neighbour = np.concatenate([edges, edges[:, ::-1]]).T
    used = ~on[corner] | np.concatenate([edge_is_free, edge_is_free])
    graph = csr_array((np.ones(used.sum()), (corner[used], neighbour[used])), shape=(count, count))
    mean = diags_array(1 / np.maximum(graph.sum(axis=1), 1)) @ graph
    corners = corners.copy()
    for _ in range(ROUNDS):
        for share in (FORTH, BACK):
            corners += np.where(corner_is_fixed, 0.0, share)[:, None] * (mean @ corners - corners)
    return corners


def quadrilateral_areas(faces: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas (f,) of quadrilaterals (f, 4, 3), each as two triangles, m^2."""
    first, second, third = (faces[:, k] - faces[:, 0] for k in (1, 2, 3))
    both = np.linalg.norm(np.cross(first, second), axis=1) + np.linalg.norm(np.cross(second, third), axis=1)
    return np.asarray(both / 2)
