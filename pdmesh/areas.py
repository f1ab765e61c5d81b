"""The area a node stands for: the thesis's equation 19, and exact cells."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NEAREST = 24  # nodes looked at to find the four next ones; an interface of ratio 2 needs 13


def thesis_areas(
    position: NDArray[np.float64], delta: NDArray[np.float64], horizon: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Areas (n,), m^2, by eq. 19 of the thesis: (d_top + d_bottom)/2 * (d_left + d_right)/2.

    The four deltas (m) are those of the nearest node of each side, among the nodes that `position` (n, 2) sees
    within its `horizon` (n,), and the node's own delta where that side is empty. A side is the quadrant around
    its axis. The rule over-counts where the gap between two zones is one fine delta.
    """
    distance, near = cKDTree(position).query(position, k=min(NEAREST, len(position) - 1) + 1)
    distance, near = distance[:, 1:], near[:, 1:]
    offset = position[near] - position[:, None, :]
    seen = distance <= horizon[:, None] * (1 + 1e-9)
    sums = []
    for axis in (0, 1):
        along, across = offset[..., axis], np.abs(offset[..., 1 - axis])
        total = np.zeros(len(position))
        for side in (along, -along):
            beside = seen & (side > across * (1 - 1e-9)) & (side > 0)
            first = beside.argmax(axis=1)
            total += np.where(beside.any(axis=1), delta[near[np.arange(len(near)), first]], delta)
        sums.append(total / 2)
    return sums[0] * sums[1]


def cell_areas(position: NDArray[np.float64], shape: shapely.Geometry) -> NDArray[np.float64]:
    """Areas (n,), m^2, of the Voronoi cells of `position` (n, 2) clipped by `shape`; their sum is its area."""
    cells = shapely.voronoi_polygons(shapely.multipoints(position), extend_to=shape.envelope, ordered=True)
    cells = shapely.convex_hull(shapely.get_parts(cells))  # on a lattice GEOS leaves crossing edges of no length
    shapely.prepare(shape)
    clipped = np.where(shapely.covers(shape, cells), cells, shapely.intersection(cells, shape))
    return np.asarray(shapely.area(clipped), dtype=np.float64)
