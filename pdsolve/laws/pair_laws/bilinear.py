r"""The bilinear law: linear to the peak, then softening to zero, irreversible; brittle if peak = limit.

    force / stiffness                 peak    s_p, stretch of the largest force
        /\                           limit   s_0, stretch at which the bond is gone
       /  \                          worst   the largest stretch the bond has had, 0 if never above the peak
      /    \
     /------\---> stretch            kr = s_0 / s_p
           s_p  s_0

Thesis, figures 40 and 58. Unloading goes straight to the origin, and compression follows the same line, as the damage
of a bond is one number. A fully softened bond has dissipated c xi s_p s_0 / 2.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numba.extending import register_jitable

from pdmesh.model.material import Material
from pdsolve.laws.law import INNER, Limits, Pair, Sizes, Softening
from pdsolve.laws.pair import PairColumns, pair_law


class BilinearColumns(PairColumns):
    """Columns of bonds under this law."""


def limits(material: Material, bonds: Sizes) -> Limits:
    """Stretches at the peak and at failure.

    A bond dissipates c xi s_p s_0 / 2, so that s_p = s_c / sqrt(kr) and s_0 = s_c sqrt(kr) keep G0. Without `keep_G0`
    they are the thesis's s_p = s_c / kr and s_0 = s_c, which dissipate G0 / kr.
    """
    critical = bonds.critical
    if material.keep_G0:
        return Limits(critical / np.sqrt(material.kr), critical * np.sqrt(material.kr))
    return Limits(critical / material.kr, critical)


@register_jitable(**INNER)
def secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return peak * (limit - worst) / ((limit - peak) * worst)


def dissipated_energy(law, c, worst, peak, limit):  # type: ignore[no-untyped-def]
    return c * peak * limit * dissipated_share(worst, peak, limit)


def total_dissipated_energy(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return c * (peak * limit)


def softening_slope(law, worst, peak, limit):  # type: ignore[no-untyped-def]
    return -peak / (limit - peak)


@njit(**INNER)
def intact_share(worst, peak, limit):  # type: ignore[no-untyped-def]
    """Remaining share of a bond's stiffness after the stretch `worst`, between peak and limit."""
    return secant(None, worst, worst, peak, limit)


@register_jitable(**INNER)
def dissipated_share(worst: float, peak: float, limit: float) -> float:
    """Dissipated share of a bond's energy c xi s_p s_0 / 2 after the stretch `worst`."""
    return (worst - peak) / (limit - peak)


LAW = pair_law(
    BilinearColumns,
    Pair(
        limits=limits, secant=secant, softening=Softening(dissipated_energy, total_dissipated_energy, softening_slope)
    ),
)
