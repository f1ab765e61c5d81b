"""Shortest paths between places round the tips and bends of cracks.

Cracks are polylines that may be kinked, curved, branched or inside the plate. A path consists of straight legs between
corners. A corner is a vertex of the cracks with one of the sectors between its arms; a path can bend only in a sector
of half a turn or more. A path that touches a vertex stays on its side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected, tree_of

if TYPE_CHECKING:
    import shapely

FLAT = 1e-9  # rad: a vertex this near to straight is passed along the crack
TOGETHER = 1 << 20  # sums of legs at once

Inside = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]


class Corners(NamedTuple):
    """The c corners at which paths may bend."""

    vertex: NDArray[np.int64]  # (c,) number of the vertex
    place: NDArray[np.float64]  # (c, 2) m
    first: NDArray[np.float64]  # (c,) rad: the direction of the arm that the sector begins with, and goes left from
    width: NDArray[np.float64]  # (c,) rad
    before: NDArray[np.int64]  # (c,) vertices at the other ends of the arms it begins and ends with
    after: NDArray[np.int64]


class Detours:
    """Shortest paths round the segments of cracks (k, 2, 2), m."""

    def __init__(
        self,
        segments: NDArray[np.float64],
        slack: float,
        farthest: float,
        inside: Inside,
        void: shapely.Geometry | None = None,
    ) -> None:
        """Places within `slack` m are one; legs longer than `farthest` m are not used; no leg meets `void`.

        `inside(places, headings)` returns whether paths inside the plate can pass vertices (v, 2), given the direction
        beyond those that are tips.
        """
        import shapely

        self._slack, self._farthest = slack, farthest
        lines = shapely.union_all(shapely.multilinestrings(segments))  # cracks that meet have a vertex there
        ends = np.concatenate([shapely.get_coordinates(line)[[0, -1]] for line in shapely.get_parts(lines)])
        pairs = tree_of(ends).query_pairs(slack, output_type="ndarray")
        _, first, number = np.unique(connected(len(ends), *pairs.T), return_index=True, return_inverse=True)
        place, arms = ends[first], number.reshape(-1, 2)  # vertices, and those of the two ends of each line
        arms = arms[arms[:, 0] != arms[:, 1]]
        # vertices that paths can pass: not tips on an edge, nor ends that miss another crack by round-off
        arm_count = np.bincount(arms.ravel(), minlength=len(place))
        heading = np.zeros(place.shape)
        for near, far in (arms.T, arms.T[::-1]):
            heading[near] = place[near] - place[far]
        heading[arm_count != 1] = 0
        passed = inside(place, heading / np.maximum(np.hypot(*heading.T), slack)[:, None])
        parts = shapely.get_parts(lines)
        tips = np.flatnonzero(arm_count == 1)
        within = shapely.dwithin(shapely.points(place[tips])[:, None], parts[None, :], slack).sum(axis=1)
        passed[tips[within > 1]] = False
        barriers = place[arms]
        way = barriers[:, 1] - barriers[:, 0]
        longer = slack * way / np.hypot(*way.T)[:, None]  # at vertices that cannot be passed
        barriers[:, 0] -= np.where(passed[arms[:, 0]], 0.0, 1.0)[:, None] * longer
        barriers[:, 1] += np.where(passed[arms[:, 1]], 0.0, 1.0)[:, None] * longer
        self._obstacles = [shapely.multilinestrings(barriers)]
        self._obstacles += [] if void is None or void.is_empty else [void]
        shapely.prepare(self._obstacles)
        self._corners = _corners(place, arms, passed)
        self._between = self._legs_between()

    def around(
        self, places: NDArray[np.float64], first: NDArray[np.int64], second: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Length (b,), m, of the shortest bent path from places[first] to places[second]; infinite if there is none.

        `places` (n, 2) are in m.
        """
        shortest = np.full(len(first), np.inf)
        if not len(self._corners.vertex) or not len(first):
            return shortest
        # corners (n, k) visible from places, -1 for none, and their distances, m, infinity for none
        near = tree_of(places).sparse_distance_matrix(
            tree_of(self._corners.place), self._farthest, output_type="ndarray"
        )
        near = near[np.lexsort((near["j"], near["i"]))]
        row, near_corner, near_far = near["i"], near["j"], near["v"]
        visible = self._in_sector(places[row], near_corner)
        visible[visible] = ~self._blocked(places[row[visible]], self._corners.place[near_corner[visible]], False)
        row, near_corner, near_far = row[visible], near_corner[visible], near_far[visible]
        count = np.bincount(row, minlength=len(places))
        column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        corner = np.full((len(places), max(1, int(count.max(initial=0)))), -1, dtype=np.int64)
        far = np.full(corner.shape, np.inf)
        corner[row, column], far[row, column] = near_corner, near_far
        both = np.flatnonzero((corner[first, 0] >= 0) & (corner[second, 0] >= 0))
        for chunk in np.array_split(both, len(both) * corner.shape[1] ** 2 // TOGETHER + 1):
            start, end = first[chunk], second[chunk]
            between = self._between[corner[start][:, :, None], corner[end][:, None, :]]
            total = far[start][:, :, None] + between + far[end][:, None, :]
            shortest[chunk] = total.min(axis=(1, 2), initial=np.inf)
        return shortest

    def _in_sector(self, places: NDArray[np.float64], corner: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (b,) of places (b, 2) in the sectors of corners (b,)."""
        way = places - self._corners.place[corner]
        turn = np.mod(np.arctan2(way[:, 1], way[:, 0]) - self._corners.first[corner], 2 * np.pi)
        return np.asarray((turn <= self._corners.width[corner] + FLAT) | (turn >= 2 * np.pi - FLAT))

    def _blocked(self, start: NDArray[np.float64], end: NDArray[np.float64], both: bool) -> NDArray[np.bool_]:
        """Mask of straight legs (b, 2) that a crack blocks; they end at vertices, and with `both` also begin there."""
        import shapely

        way = end - start
        short = self._slack * way / np.maximum(np.hypot(*way.T), self._slack)[:, None]
        legs = np.stack([start + short if both else start, end - short], axis=1)
        lines = shapely.linestrings(legs)
        return np.asarray(np.any([shapely.intersects(obstacle, lines) for obstacle in self._obstacles], axis=0))

    def _legs_between(self) -> NDArray[np.float64]:
        """Lengths (c, c) of the shortest paths between corners, m."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        corners = self._corners
        count = len(corners.vertex)
        if not count:
            return np.zeros((0, 0))
        first, second = np.triu_indices(count, 1)
        length = np.hypot(*(corners.place[second] - corners.place[first]).T)
        along = (corners.after[first] == corners.vertex[second]) & (corners.before[second] == corners.vertex[first])
        along |= (corners.before[first] == corners.vertex[second]) & (corners.after[second] == corners.vertex[first])
        apart = (corners.vertex[first] != corners.vertex[second]) & (along | (length <= self._farthest))
        first, second, along, length = (array[apart] for array in (first, second, along, length))
        free = ~along & self._in_sector(corners.place[second], first) & self._in_sector(corners.place[first], second)
        free[free] = ~self._blocked(corners.place[first[free]], corners.place[second[free]], True)
        passable = along | free
        graph = coo_array((length[passable], (first[passable], second[passable])), shape=(count, count)).tocsr()
        return np.asarray(dijkstra(graph, directed=False, limit=self._farthest))


def _corners(place: NDArray[np.float64], arms: NDArray[np.int64], passed: NDArray[np.bool_]) -> Corners:
    """Sectors of vertices in which paths may bend."""
    vertex, arm_end = np.concatenate([arms, arms[:, ::-1]]).T
    way = place[arm_end] - place[vertex]
    angle = np.arctan2(way[:, 1], way[:, 0])
    order = np.lexsort((angle, vertex))
    vertex, arm_end, angle = vertex[order], arm_end[order], angle[order]
    begins = np.flatnonzero(np.diff(vertex, prepend=-1))
    following = np.arange(1, len(vertex) + 1)
    following[np.append(begins[1:], len(vertex)) - 1] = begins  # the last arm's sector ends with the first
    width = np.mod(angle[following] - angle, 2 * np.pi)
    width[following == np.arange(len(vertex))] = 2 * np.pi
    corner_rows = np.flatnonzero((width >= np.pi - FLAT) & passed[vertex])
    return Corners(
        vertex[corner_rows],
        place[vertex[corner_rows]],
        angle[corner_rows],
        width[corner_rows],
        arm_end[corner_rows],
        arm_end[following[corner_rows]],
    )
