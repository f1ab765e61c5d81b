"""Feet of points on a triangulated surface: where on it is nearest to each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import normals

Array = NDArray[np.float64]

SAME = 1e-9  # of the size of a surface: corners that near are one
UPRIGHT = 0.9  # cosine: within that of the normal a point is above a surface, not beside its rim


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
