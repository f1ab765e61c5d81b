"""How fast a crack ran: the slope of time over length, along its own path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdpost.paths import Branch

WINDOW = 3  # points to each side, two local spacings apart


def speeds(branch: Branch, time_step: float) -> NDArray[np.float64]:
    """Speed (k,) of a crack's tip at the points of a branch, m/s; not a number where it cannot be told.

    One over the slope of a straight line, by least squares, through times over lengths of the point and three to each
    side, which are two spacings of the nodes apart. Lengths have the window, not times: cracks wait and jump.
    """
    found = np.full(len(branch.points), np.nan)
    known = np.flatnonzero(branch.since >= 0)
    along, time = branch.along[known], branch.since[known] * time_step
    for at, row in enumerate(known):
        near = slice(max(at - WINDOW, 0), at + WINDOW + 1)
        if len(along[near]) <= WINDOW or np.ptp(time[near]) == 0:
            continue
        away = along[near] - along[near].mean()
        slowness = float(away @ time[near]) / float(away @ away)
        if slowness > 0:
            found[row] = 1 / slowness
    return found


def mean_speed(branch: Branch, time_step: float) -> float | None:
    """Length over time from the first node that cracked to the last, m/s; None where it took no time."""
    known = np.flatnonzero(branch.since >= 0)
    if not len(known):
        return None
    first, last = known[0], known[-1]
    took = float(branch.since[last] - branch.since[first]) * time_step
    return float(branch.along[last] - branch.along[first]) / took if took > 0 else None
