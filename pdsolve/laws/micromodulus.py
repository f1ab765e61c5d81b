"""Stiffness of a bond against its length, 2D, per unit thickness.

The constants match the strain energy of a classical solid at the one Poisson's ratio a bond-based model has:
1/3 in plane stress, 1/4 in plane strain. Plane stress is eq. 7 and 8 of the thesis with nu = 1/3 (9E/pi h^3 and
36E/pi h^3); plane strain after W. Gerstle, N. Sau, S. Silling, Nucl. Eng. Des. 237 (2007) 1250-1258.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material

STIFFNESS = {
    ("stress", "constant"): 9 / np.pi,
    ("stress", "conical"): 36 / np.pi,
    ("strain", "constant"): 48 / (5 * np.pi),
    ("strain", "conical"): 192 / (5 * np.pi),
}


def micromodulus(material: Material, length: NDArray[np.float64], horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """c(xi), N/m^5 in 2D (force per area of both cells and unit stretch), for bonds of `length` <= `horizon`, m."""
    c0 = STIFFNESS[material.plane, material.micromodulus] * material.E / horizon**3
    if material.micromodulus == "constant":
        return c0
    return np.asarray(c0 * np.maximum(1 - length / horizon, 0.0))
