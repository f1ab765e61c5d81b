"""How fast a crack's tip ran, and how well that is known: the slope of time over length along its own path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

WINDOW = 10.0  # local spacings of path, at least, that a speed is measured over
SURE = 0.95  # of Student's distribution; cracks drawn with noise are within their bands nine times in ten
BLUR = 0.1  # spacings: how well the place of a tip is known at best
VAGUE = 0.5  # of the slope: where it is less sure than this, no speed is told


class Speeds(NamedTuple):
    """Speeds of a tip at k places, m/s; not numbers where they cannot be told."""

    value: NDArray[np.float64]  # (k,)
    low: NDArray[np.float64]  # (k,)
    high: NDArray[np.float64]  # (k,)


def speeds(
    along: NDArray[np.float64],
    time: NDArray[np.float64],
    spacing: NDArray[np.float64],
    told: NDArray[np.bool_],
    time_step: float,
) -> Speeds:
    """Speeds at k points of a path, from the length there, m, and the time a tip came past, s.

    One over the slope of a straight line, by least squares, through times over lengths of the points around, at least
    ten spacings from first to last; with Student's band of the slope. Lengths have the window, not times: cracks
    wait and jump. Nothing is told of a stretch that is shorter, that has a point which is not `told`, or whose slope
    is known to no better than a half.
    """
    found = np.full((3, len(along)), np.nan)
    for at in range(len(along)):
        near = window(along, at, WINDOW * spacing[at])
        if near is not None:  # of the coarsest nodes there
            near = window(along, at, WINDOW * float(spacing[near].max()))
        if near is None or not told[near].all():
            continue
        away, late = along[near] - along[near].mean(), time[near] - time[near].mean()
        free = len(away) - 2
        slowness = float(away @ late) / float(away @ away)
        known = time_step**2 / 12 + (BLUR * spacing[at] * slowness) ** 2
        scatter = max(float(((late - slowness * away) ** 2).sum()) / free, known)
        off = float(stdtrit(free, (1 + SURE) / 2)) * np.sqrt(scatter / float(away @ away))
        if slowness > 0 and off <= VAGUE * slowness:
            found[:, at] = 1 / slowness, 1 / (slowness + off), 1 / (slowness - off)
    return Speeds(*found)


def window(along: NDArray[np.float64], at: int, length: float) -> slice | None:
    """The points around one, first to last at least `length` apart, as far to both sides as there is path.

    None where the whole path is shorter.
    """
    slack = 1e-9 * length
    if along[-1] - along[0] < length - slack:
        return None
    low = min(max(along[at] - length / 2, along[0]), along[-1] - length)
    first = int(np.searchsorted(along, low + slack, side="right")) - 1
    last = int(np.searchsorted(along, low + length - slack))
    return slice(max(first, 0), last + 1)
