"""The prototype micro-elastic brittle law: linear up to the critical stretch, nothing beyond, no way back.

S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535; in 2D eq. 10 and 11 of the thesis.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.grid import Material

SQUARED = {
    ("stress", "constant"): 4 * np.pi / 9,
    ("stress", "conical"): 5 * np.pi / 9,
    ("strain", "constant"): 5 * np.pi / 12,
    ("strain", "conical"): 25 * np.pi / 48,
}


def critical_stretch(material: Material, horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """s0 at which a bond of a family of this horizon (m) breaks, so that a crack costs the material's G0."""
    factor = SQUARED[material.plane, material.micromodulus]
    return np.asarray(np.sqrt(factor * material.G0 / (material.E * horizon)))


@njit
def breaks(stretch: float, limit: float) -> bool:
    """Whether an intact bond breaks at this stretch."""
    return stretch > limit
