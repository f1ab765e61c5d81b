"""Triangles in space: which segments meet them, and which of a surface's a segment inside can meet at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, Pairs

EDGE = 1e-12  # of a triangle: how far beside its edge a segment still meets it
OUTER = 1e-9  # of the size of a body: a corner this little in front of a triangle's plane is on it
AT_ONCE = 2**22  # products of corners and triangles


def volume(triangles: NDArray[np.float64]) -> float:
    """What a closed surface of triangles (t, 3, 3), m, encloses, m^3."""
    a, b, c = triangles.transpose(1, 0, 2)
    return abs(float((a * np.cross(b, c)).sum())) / 6


def gap(triangles: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """A place (3,) at which a surface of triangles (t, 3, 3) is open: an edge that is not of two; None: none."""
    corners, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c = number.reshape(-1, 3).T
    edges = np.sort(np.concatenate([np.stack(pair, axis=1) for pair in ((a, b), (b, c), (c, a))]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    every, count = np.unique(edges, axis=0, return_counts=True)
    odd = np.flatnonzero(count % 2)
    return np.asarray(corners[every[odd[0]]].mean(axis=0)) if len(odd) else None


def facing(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The triangles (t, 3, 3) of a surface without those on its convex hull: no segment inside meets these."""
    if not len(triangles):
        return triangles
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    size = float(np.ptp(corners, axis=0).max())
    normal = _normals(triangles)
    length = np.sqrt((normal**2).sum(axis=1))
    unit = normal / np.where(length > 0, length, 1.0)[:, None]
    kept = np.zeros(len(triangles), dtype=bool)
    for some in np.array_split(np.arange(len(triangles)), len(triangles) * len(corners) // AT_ONCE + 1):
        above = corners @ unit[some].T - (unit[some] * triangles[some, 0]).sum(axis=1)
        kept[some] = (above.max(axis=0) > OUTER * size) & (above.min(axis=0) < -OUTER * size)
    return np.asarray(triangles[kept & (length > 0)])


def met(position: NDArray[np.float64], pairs: Pairs, triangles: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which pairs (b,) of nodes at `position` (n, 3), m, have a segment that meets one of the triangles (t, 3, 3), m.

    Edges and corners belong to a triangle. (i, j) and (j, i) give the same answer.
    """
    found = np.zeros(len(pairs.source), dtype=bool)
    if not len(found) or not len(triangles):
        return found
    far = float(pairs.length.max()) * (1 + ROUND_OFF)
    start = np.append(np.flatnonzero(np.diff(pairs.source, prepend=-1)), len(found))
    place = position[pairs.source[start[:-1]]]
    low, high, normal = triangles.min(axis=1) - far, triangles.max(axis=1) + far, _normals(triangles)
    near = ((low <= place.max(axis=0)) & (high >= place.min(axis=0))).all(axis=1)
    for t in np.flatnonzero(near).tolist():
        length = float(np.sqrt((normal[t] ** 2).sum()))
        if length == 0:
            continue
        beside = ((place >= low[t]) & (place <= high[t])).all(axis=1)
        beside &= np.abs((place - triangles[t, 0]) @ normal[t]) <= far * length
        own = np.flatnonzero(beside)
        if not len(own):
            continue
        count = start[own + 1] - start[own]
        which = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - start[own], count)
        which = which[~found[which]]
        ends = np.sort(np.column_stack([pairs.source[which], pairs.target[which]]), axis=1)
        found[which] = _meets(position[ends[:, 0]], position[ends[:, 1]], triangles[t], normal[t])
    return found


def _normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(t, 3) twice as long as the triangles are large, m^2."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _meets(
    p: NDArray[np.float64], q: NDArray[np.float64], triangle: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which segments from p to q (k, 3) meet a triangle (3, 3)."""
    squared = float((normal**2).sum())
    above, below = (((end - triangle[0]) @ normal) / squared**0.75 for end in (p, q))  # in sizes of the triangle
    above, below = (np.where(np.abs(side) <= EDGE, 0.0, side) for side in (above, below))
    crossing = above * below <= 0
    flat = (above == 0) & (below == 0)
    share = np.divide(above, above - below, out=np.full(len(p), 0.5), where=crossing & ~flat)
    found = crossing & _within(p + share[:, None] * (q - p), triangle, normal, squared)
    for end in (p, q) if flat.any() else ():
        found |= flat & _within(end, triangle, normal, squared)
    return np.asarray(found)


def _within(
    x: NDArray[np.float64], triangle: NDArray[np.float64], normal: NDArray[np.float64], squared: float
) -> NDArray[np.bool_]:
    """Which points x (k, 3) of a triangle's plane are in it."""
    inside = np.ones(len(x), dtype=bool)
    for corner in range(3):
        a, b = triangle[corner], triangle[(corner + 1) % 3]
        inside &= np.cross(b - a, x - a) @ normal >= -EDGE * squared
    return inside


def distances(points: NDArray[np.float64], triangles: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """How far (n,) points (n, 3) are from the nearest of some triangles (t, 3, 3); infinite beyond a `reach`. In m."""
    found = np.full(len(points), np.inf)
    low, high = triangles.min(axis=1) - reach, triangles.max(axis=1) + reach
    for t in range(len(triangles)):
        near = np.flatnonzero(((points >= low[t]) & (points <= high[t])).all(axis=1))
        if len(near):
            away = _away(points[near], triangles[t])
            found[near] = np.minimum(found[near], np.where(away <= reach, away, np.inf))
    return found


def _away(x: NDArray[np.float64], triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (k,) of points (k, 3) from a triangle."""
    normal = _normals(triangle[None])[0]
    squared = float((normal**2).sum())
    found = np.full(len(x), np.inf)
    if squared > 0:
        above = (x - triangle[0]) @ normal
        foot = x - (above / squared)[:, None] * normal
        found = np.where(_within(foot, triangle, normal, squared), np.abs(above) / np.sqrt(squared), np.inf)
    for corner in range(3):
        a, way = triangle[corner], triangle[(corner + 1) % 3] - triangle[corner]
        share = np.clip((x - a) @ way / max(float(way @ way), 1e-300), 0.0, 1.0)
        found = np.minimum(found, np.sqrt(((x - a - share[:, None] * way) ** 2).sum(axis=1)))
    return np.asarray(found)
