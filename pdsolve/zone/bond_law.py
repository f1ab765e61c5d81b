"""Which law fine bonds of a plate have, and up to which stretch coarse springs, straight lines, may stand for them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.laws import law_named
from pdsolve.laws.calls import pair_of, secant
from pdsolve.laws.law import Law
from pdsolve.laws.pair_laws import bilinear, brittle
from pdsolve.model import Model

NEAR_STRAIGHT = 0.05  # by so much secants of bonds in coarse cells may differ from 1
LOOKS = 1000  # stretches that are looked at, up to the largest


def law_of_zone(model: Model) -> Law:
    """The law of fine bonds of a plate; a brittle bond is a bilinear one whose peak is its limit."""
    law = law_named(model.materials[0], model.place_of(0))
    return bilinear.LAW if law is brittle.LAW else law


def stretch_that_makes_cells_fine(
    columns: Any, peak: NDArray[np.float64], limit: NDArray[np.float64], kappa: float
) -> float:
    """The least stretch beyond which bonds (k,) of a law with these columns need fine cells: `kappa` of their peaks, or
    less where a curved law is no longer near to straight, shortened or stretched. It is 0 for a law that never is.
    """
    most = kappa * peak
    if not pair_of(columns).is_curved:
        return float(most.min())
    share = np.linspace(0, 1, LOOKS + 1)[1:, None]
    straight = np.ones((LOOKS, len(peak)), dtype=np.bool_)
    for sign in (-1.0, 1.0):
        with np.errstate(invalid="ignore"):
            secants = secant(columns, sign * share * most, 0.0 * share, peak, limit)
        straight &= np.abs(secants - 1) <= NEAR_STRAIGHT
    first_bent = np.where(straight.all(axis=0), LOOKS, np.argmin(straight, axis=0))
    return float((first_bent / LOOKS * most).min())
