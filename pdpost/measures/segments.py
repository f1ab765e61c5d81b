"""Distances of points from straight segments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BLOCK = 256  # points at a time, so that memory stays small


def distances_to_nearest_segment(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (n,) of points (n, 2) from the nearest segment from `start` (k, 2) to `end` (k, 2), m."""
    way = end - start
    squared = np.maximum((way**2).sum(axis=1), 1e-300)
    nearest = np.full(len(points), np.inf)
    for at in range(0, len(points), BLOCK):
        from_start = points[at : at + BLOCK, None, :] - start
        share = ((from_start * way).sum(axis=2) / squared).clip(0, 1)
        nearest[at : at + BLOCK] = np.hypot(*(from_start - share[..., None] * way).transpose(2, 0, 1)).min(
            axis=1, initial=np.inf
        )
    return nearest
