"""Directions in which cracks should leave their notches, by the stress intensities before they grew.

Bonds of a lattice of few neighbours break more easily along rows and diagonals: a crack leans to them. How far its path
lies from the direction of the largest hoop stress, which `stress_intensities` has, tells how much of it is the grid's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdpost.measures.directions import InitialCrackDirection
from pdpost.measures.stress_intensities import follow_tip_intensities
from pdsolve.results import Results, ResultsError

LEANS = 10.0  # degrees: a path that lies further off may be the grid's
SURE = 20.0  # degrees: a wider band of the rings, as of waves that cross them, predicts nothing


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
        if np.isfinite(angle) and high - low <= SURE and float(series.value["J"][0]) > 0:
            predictions.append(
                PredictedCrackDirection(way.pre_crack_tip, step, angle, low, high, way.angle_from_pre_crack - angle)
            )
    return predictions
