r"""The cohesive law: a bond softens by its opening, as a crack does; see `pdmesh.model.cohesive_softening`.

    force / stiffness                 peak    s0, stretch at which the bond begins to soften
       s0 /\                          limit   s0 + w_c / |xi|, stretch at which it is gone
         /  \_                        worst   kappa, the largest stretch so far above s0, 0 if never there
        /     \__                     t       (kappa - s0) / (limit - s0), opening over w_c
       /         \___
      /              \---> stretch    g(t)    the softening curve, from g(0) = 1 to g(1) = 0
     /      s0      limit

kappa is all that a bond remembers. While it grows the force follows the curve, sigma = stiffness s0 g(t). Below it the
bond is straight through the origin, with the secant omega = s0 g / kappa. Under compression it has its whole stiffness.
With c = stiffness |xi| / 4, half of a bond's energy at unit stretch:

    held      c omega stretch^2, c stretch^2 under compression
    spent     c (s0^2 + 2 s0 (limit - s0) int_0^t g - s0 g kappa)      of a bond that is gone with g = 0, all of it
    slope     s0 g'(t) / (limit - s0), of force / stiffness while kappa grows

    linear        g = 1 - t
    bilinear      g = 1 - 3 t to 1/3 at t = 2/9, then 3/7 (1 - t): P.-E. Petersson, TVBM-1006, Lund (1981)
    exponential   g = (exp(-n t) - exp(-n)) / (1 - exp(-n)), n = 8
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from pdmesh.model.cohesive_softening import AREA, DECAYS, critical_opening, first_stretch
from pdmesh.model.material import Material
from pdsolve.laws.law import INNER, Function, Law, Limits, Pair, Sizes, Softening
from pdsolve.laws.pair import PairColumns, pair_law
from pdsolve.numerics.exponential import exponential

KINK, LEFT = 2 / 9, exponential(-DECAYS)
LINEAR, BILINEAR, EXPONENTIAL = AREA["linear"], AREA["bilinear"], float(AREA["exponential"])


class Linear(PairColumns):
    """Columns of bonds that soften along a line."""


class Bilinear(PairColumns):
    """Columns of bonds that soften along two lines."""


class Exponential(PairColumns):
    """Columns of bonds that soften exponentially."""


def limits(material: Material, bonds: Sizes) -> Limits:
    """Stretches s0 and s0 + w_c / |xi| of bonds (b,)."""
    opening = critical_opening(material, bonds.ratio, bonds.horizon)
    s0 = np.full(len(bonds.length), first_stretch(material))
    return Limits(s0, s0 + opening / bonds.length)


@register_jitable(**INNER)
def share(worst, peak, limit):  # type: ignore[no-untyped-def]
    """t, the opening of a bond stretched to `worst` over w_c."""
    return (worst - peak) / (limit - peak)


@register_jitable(**INNER)
def dissipated(c, worst, peak, limit, g, area):  # type: ignore[no-untyped-def]
    """Energy spent, J/m^3, by a bond at g on a curve with this area so far."""
    return c * peak * (peak + 2 * (limit - peak) * area - g * worst)


def secant_linear(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return peak * (1 - share(worst, peak, limit)) / worst


def dissipated_linear(law, c, worst, peak, limit):  # type: ignore[no-untyped-def]
    return c * peak * limit * share(worst, peak, limit)


def slope_linear(law, worst, peak, limit):  # type: ignore[no-untyped-def]
    return -peak / (limit - peak)


def total_linear(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return c * peak * limit


@register_jitable(**INNER)
def two_lines(t):  # type: ignore[no-untyped-def]
    return np.maximum(1 - 3 * t, 3 / 7 * (1 - t))


def secant_bilinear(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return peak * two_lines(share(worst, peak, limit)) / worst


def dissipated_bilinear(law, c, worst, peak, limit):  # type: ignore[no-untyped-def]
    t = share(worst, peak, limit)
    steep = np.minimum(t, KINK)
    area = steep - 1.5 * steep * steep + 3 / 14 * ((1 - steep) * (1 - steep) - (1 - t) * (1 - t))
    return dissipated(c, worst, peak, limit, two_lines(t), area)


def slope_bilinear(law, worst, peak, limit):  # type: ignore[no-untyped-def]
    return -peak / (limit - peak) * np.where(share(worst, peak, limit) < KINK, 3.0, 3 / 7)


def total_bilinear(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return c * peak * (peak + 2 * (limit - peak) * BILINEAR)


@register_jitable(**INNER)
def decaying(t):  # type: ignore[no-untyped-def]
    return (exponential(-DECAYS * t) - LEFT) / (1 - LEFT)


def secant_exponential(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return peak * decaying(share(worst, peak, limit)) / worst


def dissipated_exponential(law, c, worst, peak, limit):  # type: ignore[no-untyped-def]
    t = share(worst, peak, limit)
    area = ((1 - exponential(-DECAYS * t)) / DECAYS - LEFT * t) / (1 - LEFT)
    return dissipated(c, worst, peak, limit, decaying(t), area)


def slope_exponential(law, worst, peak, limit):  # type: ignore[no-untyped-def]
    return -peak / (limit - peak) * DECAYS * exponential(-DECAYS * share(worst, peak, limit)) / (1 - LEFT)


def total_exponential(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return c * peak * (peak + 2 * (limit - peak) * EXPONENTIAL)


def _law(kind: type[PairColumns], secant: Function, softening: Softening) -> Law:
    return pair_law(kind, Pair(limits=limits, secant=secant, softening=softening, elastic_in_compression=True))


LAWS: dict[str, Law] = {  # by `Material.shape`
    "linear": _law(Linear, secant_linear, Softening(dissipated_linear, total_linear, slope_linear)),
    "bilinear": _law(Bilinear, secant_bilinear, Softening(dissipated_bilinear, total_bilinear, slope_bilinear)),
    "exponential": _law(
        Exponential, secant_exponential, Softening(dissipated_exponential, total_exponential, slope_exponential)
    ),
}
