"""The bilinear law: linear to the peak, then softening to nothing, irreversible; brittle where peak = limit.

    force / stiffness                 peak    s_p, stretch of the largest force
        /\\                           limit   s_0, stretch at which the bond is gone
       /  \\                          worst   the largest stretch the bond has had, 0 if never above the peak
      /    \\
     /------\\---> stretch            kr = s_0 / s_p
           s_p  s_0

Thesis, figures 40 and 58; unloading goes straight to the origin and compression follows the same line, as the
damage of a bond is one number. The brittle law is S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535;
its critical stretch s_c in 2D is eq. 10 and 11 of the thesis.
"""

from __future__ import annotations

from typing import NamedTuple

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


class Limits(NamedTuple):
    """Stretches at which a bond changes."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone


def critical_stretch(material: Material, horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """s_c at which a brittle bond of a family of this horizon (m) breaks, so that a crack costs G0."""
    factor = SQUARED[material.plane, material.micromodulus]
    return np.asarray(np.sqrt(factor * material.G0 / (material.E * horizon)))


def limits(material: Material, critical: NDArray[np.float64]) -> Limits:
    """Peak and limit of a material's bonds, given the critical stretch they would have if brittle.

    A bond spends c xi s_p s_0 / 2, so s_p = s_c / sqrt(kr) and s_0 = s_c sqrt(kr) keep G0. Without `keep_G0` it
    is the thesis's s_0 = s_c, s_p = s_c / kr, which spends G0 / kr.
    """
    if material.law == "brittle":
        return Limits(critical, critical)
    if material.keep_G0:
        return Limits(critical / np.sqrt(material.kr), critical * np.sqrt(material.kr))
    return Limits(critical / material.kr, critical)


@njit(error_model="numpy")
def intact_share(worst: float, peak: float, limit: float) -> float:
    """Share of its stiffness a bond has kept that was stretched to `worst`, between peak and limit."""
    return peak * (limit - worst) / ((limit - peak) * worst)


@njit(error_model="numpy")
def spent_share(worst: float, peak: float, limit: float) -> float:
    """Share of its energy c xi s_p s_0 / 2 a bond has spent that was stretched to `worst`."""
    return (worst - peak) / (limit - peak)
