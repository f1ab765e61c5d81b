"""Strength of bonds that are wider than those of the finest zone: the remedy for weak borders of spacings.

Bonds that cost the fracture energy break at a stretch s0 that falls with their horizon, s0^2 ~ G0 / (E horizon). A
zone of twice the spacing has 0.71 of the strength, so that an even load breaks it first, along its border. `coarse` of
a material says which strength bonds have that are wider than the finest ones of their body:

    own           that of their horizon: cracks cost G0 everywhere, and coarse zones are weaker
    matched       that of the finest horizon: one strength everywhere, and a crack in a coarse zone costs G0 times its
                  horizon over the finest one
    unbreakable   none: cracks stay in the finest zone
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdmesh.model.neighbours import ROUND_OFF
from pdsolve.model import Model


def strength_reach(
    model: Model, material: Material, rows: NDArray[np.int64], reach: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Horizons (b,), m, whose strength bonds of these rows (b,) with these horizons (b,) have."""
    return np.minimum(reach, model.finest_horizon_of(rows)) if material.coarse == "matched" else reach


def is_unbreakable(
    model: Model, material: Material, rows: NDArray[np.int64], reach: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask (b,) of bonds that do not break, of such rows and horizons (b,), m."""
    if material.coarse != "unbreakable":
        return np.zeros(len(rows), dtype=np.bool_)
    return reach > model.finest_horizon_of(rows) * (1 + ROUND_OFF)
