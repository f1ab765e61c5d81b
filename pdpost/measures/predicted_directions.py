"""Directions in which cracks should leave their notches, by the stress intensities before they grew.

Bonds of a lattice of few neighbours break more easily along rows and diagonals: a crack leans to them. How far its path
lies from the direction of the largest hoop stress, which `stress_intensities` has, tells how much of it is the grid's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdpost.measures.directions import CrackDirection
from pdpost.measures.stress_intensities import follow_tips
from pdsolve.results import Results, ResultsError

LEANS = 10.0  # degrees: a path that lies further off may be the grid's
SURE = 20.0  # degrees: a wider band of the rings, as of waves that cross them, predicts nothing


@dataclass(frozen=True)
class PredictedDirection:
    """What stress intensities predict of the direction of a crack, and how far its path lies from that."""

    tip: tuple[float, float]  # m
    step: int  # of the frame before bonds broke
    angle: float  # degrees from the line of the pre-crack, to the left positive
    low: float  # degrees, over the rings around the tip
    high: float
    off: float  # degrees that the path turns more to the left than that


def predict_directions(
    results: Results, directions: Sequence[CrackDirection], first_break_step: int
) -> list[PredictedDirection]:
    """Predictions for the directions `directions`, from the last frame before the step `first_break_step`.

    A tip without room for a ring, or with too vague a direction, has none; nor has a run without such a frame.
    """
    steps = results.frames()[0]
    before = steps[steps < first_break_step]
    predictions = []
    for way in directions if len(before) else ():
        step = int(before[-1])
        try:
            (series,) = follow_tips(results, [step], way.tip)
        except ResultsError:
            continue
        (low,), (angle,), (high,) = (side["angle"].tolist() for side in (series.low, series.value, series.high))
        if np.isfinite(angle) and high - low <= SURE and float(series.value["J"][0]) > 0:
            predictions.append(PredictedDirection(way.tip, step, angle, low, high, way.angle - angle))
    return predictions
