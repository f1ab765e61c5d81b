"""Areas of nodes by the thesis's equation 19."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of
from pdmesh.model.neighbours import ROUND_OFF

ROWS = 16384  # whose surroundings are looked at together
NEAREST = 24  # nodes looked at to find the four next ones; an interface of ratio 2 needs 13


def thesis_areas(
    position: NDArray[np.float64], delta: NDArray[np.float64], horizon: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Areas (n,), m^2, by eq. 19 of the thesis: (d_top + d_bottom)/2 * (d_left + d_right)/2.

    The four deltas (m) are those of the nearest node on each side, among the nodes within the `horizon` (n,) of each
    `position` (n, 2), or the node's own delta if that side is empty. A side is the quadrant around its axis, including
    its diagonals. At an interface with a gap of one fine delta, the area is therefore a tenth too small.
    """
    if len(position) < 2:
        return delta**2
    tree = tree_of(position)
    areas = []
    for begin in range(0, len(position), ROWS):
        rows = np.arange(begin, min(begin + ROWS, len(position)))
        distance, near = tree.query(position[rows], k=min(NEAREST, len(position) - 1) + 1)
        distance, near = distance[:, 1:], near[:, 1:]
        offset = position[near] - position[rows, None, :]
        within_horizon = distance <= horizon[rows, None] * (1 + ROUND_OFF)
        sums = []
        for axis in (0, 1):
            along, across = offset[..., axis], np.abs(offset[..., 1 - axis])
            total = np.zeros(len(rows))
            for side in (along, -along):
                on_side = within_horizon & (side > across * (1 - 1e-9)) & (side > 0)
                first = on_side.argmax(axis=1)
                total += np.where(on_side.any(axis=1), delta[near[np.arange(len(near)), first]], delta[rows])
            sums.append(total / 2)
        areas.append(sums[0] * sums[1])
    return np.concatenate(areas)
