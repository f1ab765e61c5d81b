"""Which way cracks leave the tips of pre-cracks: straight lines through the first stretch of each.

The stretch begins three spacings from the tip, where what is crushed around it ends, and goes on as long as the crack
is straight, no further than to where it forks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from pdpost.measures.crack_labels import SHORTEST
from pdpost.measures.cracked_nodes import pre_crack_tips
from pdpost.measures.speed import SURE
from pdpost.measures.tips import ARM, BEGINS, NEAR_TIP, Branch, axis_of
from pdsolve.results import Results

STRAIGHT = 1.0  # local spacings: a stretch with a point further off its line is not straight
PLACED = 1 / np.sqrt(12)  # spacings: a crack that breaks bonds is somewhere between two rows of nodes
NORMAL = 1.96  # standard deviations: 0.95 of a normal distribution
FEWEST = 3  # points, without which no line has a band
BEHIND = 135.0  # degrees: what turns back further runs along its notch


@dataclass(frozen=True)
class Direction:
    """Which way a crack left the tip of a pre-crack, to the left (positive) or right of its line."""

    tip: tuple[float, float]  # m
    angle: float  # degrees from the line of the pre-crack
    low: float  # degrees, with `high` the band that it is in with a probability of 0.95
    high: float
    length: float  # m of the crack, from the tip, that the line is through
    whole: float  # degrees, of a line through all of the crack until it forks or ends


def directions(results: Results, branches: Sequence[Branch]) -> list[Direction]:
    """The directions of the cracks from each tip of a pre-crack, of all `branches` (see `tips`).

    A crack that forks within five spacings of the tip leaves it in each of its arms. Of cracks that are particles:
    the direction of the first arm.
    """
    found = []
    for tip, heading in pre_crack_tips(results.cracks()):
        for first in branches:
            if np.hypot(*(first.place[0] - tip)) > BEGINS * first.spacing[0]:
                continue
            for branch in _leaving(first, branches):
                way = _direction(branch, tip, heading)
                if way is not None and abs(way.angle) <= BEHIND:
                    found.append(way)
    return found


def _leaving(branch: Branch, branches: Sequence[Branch]) -> list[Branch]:
    """A branch, or, where that is too short to have a direction, its arms."""
    arms = [other for other in branches if other.begin == branch.end]
    if branch.exact or branch.length >= SHORTEST * branch.spacing[0] or not arms:
        return [branch]
    return [each for arm in arms for each in _leaving(arm, branches)]


def _direction(branch: Branch, tip: NDArray[np.float64], heading: NDArray[np.float64]) -> Direction | None:
    """The direction of a branch; None where it has too few points."""
    place = (float(tip[0]), float(tip[1]))
    if branch.exact:
        angle, whole = (_angle(way, heading) for way in (branch.direction[0], axis_of(branch.place)))
        return Direction(place, angle, angle, angle, float(branch.along[1] - branch.along[0]), whole)
    beyond = np.hypot(*(branch.place - tip).T) > NEAR_TIP * branch.spacing
    first = int(beyond.argmax()) if beyond.sum() >= FEWEST else 0
    points, spacing, along = branch.place[first:], branch.spacing[first:], branch.along[first:]
    if len(points) < FEWEST:
        return None
    count = _straight(points, spacing, along - along[0])
    angle, off = _angle(axis_of(points[:count]), heading), _band(points[:count], spacing[:count])
    length, whole = float(along[count - 1]), _angle(axis_of(points), heading)
    return Direction(place, angle, angle - off, angle + off, length, whole)


def _straight(points: NDArray[np.float64], spacing: NDArray[np.float64], far: NDArray[np.float64]) -> int:
    """How many of the first points are on a straight line: those within ten spacings, and further ones as far as no
    point is off the line through them by more than one."""
    count = max(FEWEST, int((far <= ARM * spacing[0]).sum()))
    while count < len(points):
        across = _across(points[: count + 1])
        if (np.abs(across) > STRAIGHT * spacing[: count + 1]).any():
            break
        count += 1
    return count


def _band(points: NDArray[np.float64], spacing: NDArray[np.float64]) -> float:
    """How far, degrees, a line through points may be off: by Student's distribution, no better than nodes allow."""
    free = len(points) - 2
    along = (points - points.mean(axis=0)) @ axis_of(points)
    seen = float(stdtrit(free, (1 + SURE) / 2)) * np.sqrt((_across(points) ** 2).sum() / free)
    slope = max(float(seen), NORMAL * PLACED * float(spacing.max())) / np.sqrt((along**2).sum())
    return float(np.degrees(np.arctan(slope)))


def _across(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far (k,) points are off the straight line through them, m."""
    x, y = axis_of(points)
    return np.asarray((points - points.mean(axis=0)) @ np.array([-y, x]))


def _angle(way: NDArray[np.float64], heading: NDArray[np.float64]) -> float:
    """Degrees from a heading to a way, both unit vectors, to the left positive."""
    return float(np.degrees(np.arctan2(heading[0] * way[1] - heading[1] * way[0], heading @ way)))
