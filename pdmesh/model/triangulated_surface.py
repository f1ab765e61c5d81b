"""Triangulated surfaces in space: volume, closure, cuts of segments, and feet of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, Pairs, connected, tree_of

EDGE = 1e-12  # of a triangle: how far beside its edge a segment still meets it
OUTER = 1e-9  # of the size of a body: a corner this little in front of a triangle's plane is on it
AT_ONCE = 2**20  # products of corners, or of segments, and triangles
SMALL = 2.0  # spacings from its middle: what a triangle that is found by a tree reaches at most
RAY = (0.0713914, 0.1371277)  # across a triangle: what a ray from it leans by
NEAR = 1.001  # radii from its middle: what is beside a triangle but for round-off
LENGTHS = 6  # parts in which segments are tested, the shortest first
FEW = 64  # triangles that are looked at one by one, small or not
Array = NDArray[np.float64]
SAME = 1e-9  # of the size of a surface: corners that near are one
UPRIGHT = 0.9  # cosine: within that of the normal a point is above a surface, not beside its rim


def volume(triangles: NDArray[np.float64]) -> float:
    """Volume, m^3, enclosed by a closed surface of triangles (t, 3, 3), m; nested parts are voids, or bodies in them.

    Triangles may have either orientation.
    """
    a, b, c = (triangles - triangles[:1, :1]).transpose(1, 0, 2)
    return float(orientation(triangles) @ (a * np.cross(b, c)).sum(axis=1)) / 6


def outward(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangles (t, 3, 3) of a closed surface with area, their corners counterclockwise seen from outside.

    Inside is what a ray leaves through an odd number of triangles.
    """
    way = orientation(triangles)[:, None, None]
    return np.asarray(np.where(way < 0, triangles[:, ::-1], triangles)[way[:, 0, 0] != 0])


def orientation(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each triangle (t, 3, 3) of a closed surface 1 if its corners are counterclockwise seen from outside, else -1.

    0 for triangles of two corners.
    """
    way = np.zeros(len(triangles))
    number = _corner_numbers(triangles)
    distinct_corners = (number != np.roll(number, 1, axis=1)).all(axis=1)
    triangles, number = triangles[distinct_corners], number[distinct_corners]
    if not len(triangles):
        return way
    count = len(number)
    ends = np.stack([number, np.roll(number, -1, axis=1)], axis=2).reshape(-1, 2)
    edge = _edge_keys(ends)
    order = np.argsort(edge, kind="stable")
    _, shared = np.unique(edge[order], return_counts=True)
    first, second = order[np.repeat(shared, shared) == 2].reshape(-1, 2).T
    # Triangles agree if they run along their edge in opposite directions; edges of more than two are ignored
    against = (ends[first, 0] == ends[second, 0]) * count
    first_triangle, second_triangle = first // 3, second // 3
    side = connected(
        2 * count,
        np.concatenate([first_triangle, first_triangle + count]),
        np.concatenate([second_triangle + against, second_triangle + count - against]),
    ).reshape(2, count)
    turned, part = np.asarray(side[0] > side[1]), np.asarray(side.min(axis=0))
    triangles = np.where(turned[:, None, None], triangles[:, ::-1], triangles)
    area = (normals(triangles) ** 2).sum(axis=1)
    largest = np.lexsort((area, part))[np.append(np.flatnonzero(np.diff(np.sort(part))), len(part) - 1)]
    inward = np.zeros(part.max() + 1, dtype=bool)
    for triangle in largest:
        inward[part[triangle]] = _crossings(triangles, int(triangle)) % 2
    way[distinct_corners] = np.where(turned ^ inward[part], -1.0, 1.0)
    return way


def _corner_numbers(triangles: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers (t, 3) of the corners of triangles, the same for those at the same place."""
    corners = triangles.reshape(-1, 3)
    order = np.lexsort(corners.T)
    new = (np.diff(corners[order], axis=0) != 0).any(axis=1)
    number = np.zeros(len(corners), dtype=np.int64)
    number[order[1:]] = np.cumsum(new)
    return number.reshape(-1, 3)


def _edge_keys(ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """A number (e,) for each edge between two corners (e, 2), the same for both directions."""
    return np.asarray(ends.min(axis=1) * (ends.max(initial=0) + 1) + ends.max(axis=1))


def _crossings(triangles: NDArray[np.float64], triangle: int) -> int:
    """How many triangles a ray meets that leaves one of them on the side from which it is counterclockwise."""
    corners = triangles - triangles[triangle].mean(axis=0)
    edge, second_edge = corners[triangle, 1] - corners[triangle, 0], corners[triangle, 2] - corners[triangle, 0]
    normal = np.cross(edge, second_edge)
    way = normal / np.linalg.norm(normal) + RAY[0] * edge / np.linalg.norm(edge)  # in no plane that bodies have
    way += RAY[1] * second_edge / np.linalg.norm(second_edge)
    a, b, c = corners.transpose(1, 0, 2)
    sides = np.stack([np.cross(p, q) @ way for p, q in ((a, b), (b, c), (c, a))])
    met = np.asarray((sides > 0).all(axis=0) | (sides < 0).all(axis=0))
    met[triangle] = False
    ahead = (a * np.cross(b, c)).sum(axis=1) * sides.sum(axis=0) > 0
    return int((met & ahead).sum())


def gap(triangles: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """A place (3,) at which a surface of triangles (t, 3, 3) is open, on an edge that is not of two triangles; else
    None."""
    number = _corner_numbers(triangles)
    ends = np.stack([number, np.roll(number, -1, axis=1)], axis=2).reshape(-1, 2)
    _, first, count = np.unique(_edge_keys(ends), return_index=True, return_counts=True)
    odd = first[(count % 2 == 1) & (ends[first, 0] != ends[first, 1])]
    if not len(odd):
        return None
    at, corner = divmod(int(odd[0]), 3)
    return np.asarray((triangles[at, corner] + triangles[at, (corner + 1) % 3]) / 2)


def facing(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangles (t, 3, 3) of a surface that are not on its convex hull; no segment inside meets the others."""
    if not len(triangles):
        return triangles
    from scipy.spatial import ConvexHull, QhullError  # here, as a plate needs none

    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    try:
        hull = ConvexHull(corners)
    except QhullError:  # of a surface in one plane, which is no body's
        return triangles
    corners = corners[hull.vertices]
    size = float(np.ptp(corners, axis=0).max())
    normal = normals(triangles)
    length = np.sqrt((normal**2).sum(axis=1))
    unit = normal / np.where(length > 0, length, 1.0)[:, None]
    off_hull = np.zeros(len(triangles), dtype=bool)
    for chunk in np.array_split(np.arange(len(triangles)), len(triangles) * len(corners) // AT_ONCE + 1):
        above = corners @ unit[chunk].T - (unit[chunk] * triangles[chunk, 0]).sum(axis=1)
        off_hull[chunk] = (above.max(axis=0) > OUTER * size) & (above.min(axis=0) < -OUTER * size)
    return np.asarray(triangles[off_hull & (length > 0)])


class Screen:
    """Intersection tests of segments between nodes with triangles (t, 3, 3).

    Nodes are at `position` (n, 3) with spacings `delta` (n,), m. Large triangles are tested one by one. Small ones are
    tested near a segment's middle, and only for segments longer than the distance of their ends from all of them.
    """

    def __init__(
        self, triangles: NDArray[np.float64], position: NDArray[np.float64], delta: NDArray[np.float64]
    ) -> None:
        self._position = position
        normal = normals(triangles)
        has_area = (normal != 0).any(axis=1)
        triangles, normal = triangles[has_area], normal[has_area]
        middle = triangles.mean(axis=1)
        radius = np.sqrt(((triangles - middle[:, None]) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
        small = radius <= SMALL * float(delta.max(initial=0.0))
        small &= small.sum() > FEW
        self._large, self._large_normal = triangles[~small], normal[~small]
        self._small, self._small_normal = triangles[small], normal[small]
        if small.any():
            self._middle, self._radius = middle[small], radius[small]
            self._reach = float(self._radius.max())
            self._tree = tree_of(middle[small])
            self._away = np.maximum(self._tree.query(position)[0] - self._reach, 0.0)  # at least

    def met(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of nodes whose segment meets one of the triangles.

        Edges and corners belong to a triangle. (i, j) and (j, i) give the same answer.
        """
        mask = np.zeros(len(pairs.source), dtype=bool)
        if len(mask):
            self._look_at_large(pairs, mask)
            if len(self._small):
                self._look_at_small(pairs, mask)
        return mask

    def near(self, far: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes with a segment of length `far`, m, that may meet one of the triangles."""
        mask = np.zeros(len(self._position), dtype=bool)
        if len(self._large):  # of few nodes, each triangle asks those in the box around all of them
            low, high = self._large.min(axis=(0, 1)) - far, self._large.max(axis=(0, 1)) + far
            rows = np.flatnonzero(((self._position >= low) & (self._position <= high)).all(axis=1))
            place = self._position[rows]
            for triangle, normal in zip(self._large, self._large_normal, strict=True):
                mask[rows] |= _beside(place, triangle, normal, far)
        return mask | (self._away <= far) if len(self._small) else mask

    def _ends(self, pairs: Pairs, which: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ends of segments (k, 3), in the order of rows, so that both directions give the same answer."""
        i, j = pairs.source[which], pairs.target[which]
        return self._position[np.minimum(i, j)], self._position[np.maximum(i, j)]

    def _look_at_large(self, pairs: Pairs, mask: NDArray[np.bool_]) -> None:
        far = float(pairs.length.max()) * (1 + ROUND_OFF)
        start = np.append(np.flatnonzero(np.diff(pairs.source, prepend=-1)), len(mask))
        place = self._position[pairs.source[start[:-1]]]
        for triangle, normal in zip(self._large, self._large_normal, strict=True):
            near_rows = np.flatnonzero(_beside(place, triangle, normal, far))
            if not len(near_rows):
                continue
            count = start[near_rows + 1] - start[near_rows]
            which = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - start[near_rows], count)
            which = which[~mask[which]]
            mask[which] = meets(*self._ends(pairs, which), triangle[None], normal[None])

    def _look_at_small(self, pairs: Pairs, mask: NDArray[np.bool_]) -> None:
        longer = self._away[pairs.source] + self._away[pairs.target] <= pairs.length * (1 + ROUND_OFF)
        candidates = np.flatnonzero(longer & ~mask)
        candidates = candidates[np.argsort(pairs.length[candidates], kind="stable")]
        for alike in filter(len, np.array_split(candidates, LENGTHS)):
            p, q = self._ends(pairs, alike)
            near = (float(pairs.length[alike[-1]]) / 2 + self._reach) * (1 + ROUND_OFF)
            count = self._tree.query_ball_point((p + q) / 2, near, return_length=True)
            part = np.cumsum(count) // AT_ONCE
            for which in np.split(alike, np.flatnonzero(np.diff(part)) + 1):
                p, q = self._ends(pairs, which)
                both = tree_of((p + q) / 2).sparse_distance_matrix(self._tree, near, output_type="ndarray")
                beside = self._beside(p, q, both["i"], both["j"], both["v"])
                own, number = both["i"][beside], both["j"][beside]
                met = meets(p[own], q[own], self._small[number], self._small_normal[number])
                mask[which[own[met]]] = True

    def _beside(
        self,
        p: NDArray[np.float64],
        q: NDArray[np.float64],
        own: NDArray[np.int64],
        number: NDArray[np.int64],
        away: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Mask (k,) of small triangles that are no farther from the lines of segments than they reach.

        `own` (k,) are rows of the segments from p to q, `number` (k,) those of triangles, and `away` (k,) the distances
        of their middles, m.
        """
        way = (q - p) / np.linalg.norm(q - p, axis=1, keepdims=True)
        start = ((p + q) / 2 * way).sum(axis=1)
        along = np.einsum("kd,kd->k", self._middle[number], way[own]) - start[own]
        return np.asarray(away**2 - along**2 <= (self._radius[number] * NEAR) ** 2)


def _beside(
    place: NDArray[np.float64], triangle: NDArray[np.float64], normal: NDArray[np.float64], far: float
) -> NDArray[np.bool_]:
    """Mask (k,) of places (k, 3) within `far`, m, of a triangle's plane and of the box around it."""
    in_box = ((place >= triangle.min(axis=0) - far) & (place <= triangle.max(axis=0) + far)).all(axis=1)
    return np.asarray(in_box & (np.abs((place - triangle[0]) @ normal) <= far * float(np.sqrt((normal**2).sum()))))


def normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (t, 3) of triangles; their length is twice the area, m^2."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def meets(
    p: NDArray[np.float64], q: NDArray[np.float64], triangles: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask (k,) of segments from p to q (k, 3) that meet their triangle, (k, 3, 3), or one common triangle, (1, 3, 3).

    `normal` are the `normals`. Edges and corners belong to a triangle, ends to a segment, and so does anything within
    `EDGE` of the triangle's size. A segment in the plane of a triangle meets it only if an end or its middle is on it.
    (q, p), (p, q) and mirror images give the same answer.
    """
    size = (normal**2).sum(axis=1) ** 0.75
    above, below = ((normal * (end - triangles[:, 0])).sum(axis=1) / size for end in (p, q))
    above, below = (np.where(np.abs(side) <= EDGE, 0.0, side) for side in (above, below))
    mask = np.zeros(len(p), dtype=bool)
    which = np.flatnonzero(above * below <= 0)
    if not len(which):
        return mask
    if len(triangles) > 1:
        triangles, normal = triangles[which], normal[which]
    p, q, above, below = p[which], q[which], above[which], below[which]
    flat = (above == 0) & (below == 0)
    share = np.divide(above, above - below, out=np.full(len(p), 0.5), where=~flat)
    crossing = _within(p + share[:, None] * (q - p), triangles, normal)
    for end in (p, q) if flat.any() else ():
        crossing |= flat & _within(end, triangles, normal)
    mask[which] = crossing
    return mask


def _within(x: NDArray[np.float64], triangles: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (k,) of points x (k, 3), in the planes of triangles, that lie in them; arguments are those of `meets`."""
    inside, least = np.ones(len(x), dtype=bool), -EDGE * (normal**2).sum(axis=1)
    for corner in range(3):
        a, b = triangles[:, corner], triangles[:, (corner + 1) % 3]
        inside &= (np.cross(b - a, x - a) * normal).sum(axis=1) >= least
    return inside


def distances(points: NDArray[np.float64], triangles: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Distances (n,) of points (n, 3) from the nearest of triangles (t, 3, 3), m; infinite beyond `reach`."""
    shortest = np.full(len(points), np.inf)
    low, high = triangles.min(axis=1) - reach, triangles.max(axis=1) + reach
    for t in range(len(triangles)):
        near = np.flatnonzero(((points >= low[t]) & (points <= high[t])).all(axis=1))
        if len(near):
            away = _away(points[near], triangles[t])
            shortest[near] = np.minimum(shortest[near], np.where(away <= reach, away, np.inf))
    return shortest


def _away(x: NDArray[np.float64], triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (k,) of points (k, 3) from a triangle, m."""
    normal = normals(triangle[None])[0]
    squared = float((normal**2).sum())
    distance = np.full(len(x), np.inf)
    if squared > 0:
        above = (x - triangle[0]) @ normal
        foot = x - (above / squared)[:, None] * normal
        distance = np.where(_within(foot, triangle[None], normal[None]), np.abs(above) / np.sqrt(squared), np.inf)
    for corner in range(3):
        a, way = triangle[corner], triangle[(corner + 1) % 3] - triangle[corner]
        share = np.clip((x - a) @ way / max(float(way @ way), 1e-300), 0.0, 1.0)
        distance = np.minimum(distance, np.sqrt(((x - a - share[:, None] * way) ** 2).sum(axis=1)))
    return np.asarray(distance)


def ways_to(points: Array, triangles: Array, reach: float) -> tuple[Array, NDArray[np.bool_]]:
    """Vectors (n, 3) from points (n, 3) to the nearest of triangles (t, 3, 3), m, and whether (n,) points are above it,
    not beside its rim. Points further than `reach` (m) have NaN."""
    ways, length = np.full(points.shape, np.nan), np.full(len(points), np.inf)
    beyond_rim = np.zeros(len(points), dtype=bool)
    # the sides (t, 3) of triangles that belong to no other one; side k begins at corner k
    corners = triangles.reshape(-1, 3)
    size = float(np.ptp(corners, axis=0).max()) * SAME
    _, number = np.unique(np.rint((corners - corners.min(axis=0)) / size), axis=0, return_inverse=True)
    ends = number.reshape(-1, 3)
    sides = np.sort(np.stack([ends, np.roll(ends, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, which, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    on_rim = np.asarray(count[which.reshape(-1)].reshape(-1, 3) == 1)
    low, high = triangles.min(axis=1) - reach, triangles.max(axis=1) + reach
    for t, normal in enumerate(normals(triangles)):
        size = float(np.sqrt((normal**2).sum()))
        near = np.flatnonzero(((points >= low[t]) & (points <= high[t])).all(axis=1)) if size > 0 else ()
        if not len(near):
            continue
        way, side = _ways(points[near], triangles[t])
        far = np.sqrt((way**2).sum(axis=1))
        nearer = (far < length[near]) & (far <= reach)
        rows, way, side, far = near[nearer], way[nearer], side[nearer], far[nearer]
        ways[rows], length[rows] = way, far
        beyond_rim[rows] = (side >= 0) & on_rim[t, side] & (np.abs(way @ normal) < UPRIGHT * size * far)
    return ways, np.isfinite(length) & ~beyond_rim


def _ways(points: Array, triangle: Array) -> tuple[Array, NDArray[np.int64]]:
    """Vectors (k, 3) from points (k, 3) to a triangle, and on which of its sides (k,) these end; -1: within."""
    a, b, c = triangle
    inverse = np.linalg.pinv(np.stack([b - a, c - a], axis=1))
    u, v = inverse @ (points - a).T
    foot = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    ways, side = foot - points, np.full(len(points), -1)
    outside = (u < 0) | (v < 0) | (u + v > 1)
    length = np.where(outside, np.inf, (ways**2).sum(axis=1))
    for number in range(3):
        start, along = triangle[number], triangle[(number + 1) % 3] - triangle[number]
        share = np.clip((points - start) @ along / float(along @ along), 0.0, 1.0)
        way = start + share[:, None] * along - points
        far = (way**2).sum(axis=1)
        nearer = far < length
        ways[nearer], side[nearer], length[nearer] = way[nearer], number, far[nearer]
    return ways, side
