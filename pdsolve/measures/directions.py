"""The direction in which cracks leave the tips of pre-cracks: a straight line fitted to the beginning of each.

The fit begins three spacings from the tip, beyond the crushed region around it. It extends as far as the crack is
straight, at most to its first fork.

The predicted direction is that of the stress intensities before cracks grew. Bonds of a lattice of few neighbours break
more easily along rows and diagonals: a crack leans to them. How far its path lies from the direction of the largest
hoop stress, which `stress_intensities` has, tells how much of it is the grid's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from pdsolve.measures.crack_labels import SHORTEST
from pdsolve.measures.cracked_nodes import find_free_pre_crack_tips
from pdsolve.measures.speed import SURE
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.measures.tips import ARM, BEGINS, NEAR_TIP, CrackBranch, fit_line_direction
from pdsolve.results import Results, ResultsError

STRAIGHT = 1.0  # local spacings: a stretch with a point further off its line is not straight
PLACED = 1 / np.sqrt(12)  # spacings: a crack that breaks bonds is somewhere between two rows of nodes
NORMAL = 1.96  # standard deviations: 0.95 of a normal distribution
FEWEST = 3  # points, without which no line has a band
BEHIND = 135.0  # degrees: what turns back further runs along its notch
LEANS = 10.0  # degrees: a path that lies further off may be the grid's
WIDEST_BAND = 20.0  # degrees: a wider band of the rings, as of waves that cross them, predicts nothing


@dataclass(frozen=True)
class InitialCrackDirection:
    """The angle between a crack and the pre-crack that it starts from, positive to the left."""

    pre_crack_tip: tuple[float, float]  # m
    angle_from_pre_crack: float  # degrees from the line of the pre-crack
    angle_lower_bound: float  # degrees, with `angle_upper_bound` its band of probability 0.95
    angle_upper_bound: float
    fitted_length: float  # m of the crack, from the tip, that the line is through
    overall_angle: float  # degrees, of a line through all of the crack until it forks or ends


def measure_initial_directions(results: Results, branches: Sequence[CrackBranch]) -> list[InitialCrackDirection]:
    """Directions of the cracks from each tip of a pre-crack, from all `branches` (see `crack_branches`).

    A crack that forks within five spacings of the tip has a direction for each arm. A crack of particles has the
    direction of its first arm.
    """
    crack_directions = []
    for tip, heading in find_free_pre_crack_tips(results.cracks()):
        for first in branches:
            if np.hypot(*(first.points[0] - tip)) > BEGINS * first.node_spacing[0]:
                continue
            for branch in _branch_or_arms_if_short(first, branches):
                way = _measure_branch_direction(branch, tip, heading)
                if way is not None and abs(way.angle_from_pre_crack) <= BEHIND:
                    crack_directions.append(way)
    return crack_directions


def _branch_or_arms_if_short(branch: CrackBranch, branches: Sequence[CrackBranch]) -> list[CrackBranch]:
    """The branch itself or, if it is too short for a direction, its arms."""
    arms = [candidate for candidate in branches if candidate.begin_joint == branch.end_joint]
    if branch.is_of_particles or branch.length >= SHORTEST * branch.node_spacing[0] or not arms:
        return [branch]
    return [leaving_arm for arm in arms for leaving_arm in _branch_or_arms_if_short(arm, branches)]


def _measure_branch_direction(
    branch: CrackBranch, tip: NDArray[np.float64], heading: NDArray[np.float64]
) -> InitialCrackDirection | None:
    """The direction of a branch; None if it has too few points."""
    place = (float(tip[0]), float(tip[1]))
    if branch.is_of_particles:
        angle, overall_angle = (
            _signed_angle_from_heading(way, heading) for way in (branch.direction[0], fit_line_direction(branch.points))
        )
        return InitialCrackDirection(
            place,
            angle,
            angle,
            angle,
            float(branch.length_along_crack[1] - branch.length_along_crack[0]),
            overall_angle,
        )
    beyond = np.hypot(*(branch.points - tip).T) > NEAR_TIP * branch.node_spacing
    first = int(beyond.argmax()) if beyond.sum() >= FEWEST else 0
    points, spacing, along = branch.points[first:], branch.node_spacing[first:], branch.length_along_crack[first:]
    if len(points) < FEWEST:
        return None
    # all points within ten spacings, then as many as stay within one spacing of the line fitted through them
    count = max(FEWEST, int(((along - along[0]) <= ARM * spacing[0]).sum()))
    while count < len(points):
        across = _distances_from_fitted_line(points[: count + 1])
        if (np.abs(across) > STRAIGHT * spacing[: count + 1]).any():
            break
        count += 1
    line, free = points[:count], count - 2
    # the uncertainty is Student's, but not below the resolution of the nodes
    scatter = float(stdtrit(free, (1 + SURE) / 2)) * np.sqrt((_distances_from_fitted_line(line) ** 2).sum() / free)
    from_middle = (line - line.mean(axis=0)) @ fit_line_direction(line)
    slope = max(float(scatter), NORMAL * PLACED * float(spacing[:count].max())) / np.sqrt((from_middle**2).sum())
    angle, off = _signed_angle_from_heading(fit_line_direction(line), heading), float(np.degrees(np.arctan(slope)))
    length, overall_angle = float(along[count - 1]), _signed_angle_from_heading(fit_line_direction(points), heading)
    return InitialCrackDirection(place, angle, angle - off, angle + off, length, overall_angle)


def _distances_from_fitted_line(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (k,) of points from the straight line through them, m."""
    x, y = fit_line_direction(points)
    return np.asarray((points - points.mean(axis=0)) @ np.array([-y, x]))


def _signed_angle_from_heading(direction: NDArray[np.float64], heading: NDArray[np.float64]) -> float:
    """Angle in degrees from the unit vector `heading` to the unit vector `direction`, positive to the left."""
    return float(np.degrees(np.arctan2(heading[0] * direction[1] - heading[1] * direction[0], heading @ direction)))


@dataclass(frozen=True)
class PredictedCrackDirection:
    """What stress intensities predict of the direction of a crack, and how far its path lies from that."""

    pre_crack_tip: tuple[float, float]  # m
    frame_step: int  # of the frame before bonds broke
    angle_from_pre_crack: float  # degrees from the line of the pre-crack, to the left positive
    angle_lower_bound: float  # degrees, over the rings around the tip
    angle_upper_bound: float
    path_deviation: float  # degrees that the path turns more to the left than that


def predict_initial_directions(
    results: Results, measured_directions: Sequence[InitialCrackDirection], first_break_step: int
) -> list[PredictedCrackDirection]:
    """Predictions for the `measured_directions`, from the last frame before the step `first_break_step`.

    A tip without room for a ring, or with too vague a direction, has none; nor has a run without such a frame.
    """
    steps = results.frames()[0]
    before = steps[steps < first_break_step]
    predictions = []
    for way in measured_directions if len(before) else ():
        step = int(before[-1])
        try:
            (series,) = follow_tip_intensities(results, [step], way.pre_crack_tip)
        except ResultsError:
            continue
        (low,), (angle,), (high,) = (side["angle"].tolist() for side in (series.low, series.value, series.high))
        if np.isfinite(angle) and high - low <= WIDEST_BAND and float(series.value["J"][0]) > 0:
            predictions.append(
                PredictedCrackDirection(way.pre_crack_tip, step, angle, low, high, way.angle_from_pre_crack - angle)
            )
    return predictions
