"""The bilinear law: linear to the peak, then softening to nothing, irreversible; brittle where peak = limit.

    force / stiffness                 peak    s_p, stretch of the largest force
        /\\                           limit   s_0, stretch at which the bond is gone
       /  \\                          worst   the largest stretch the bond has had, 0 if never above the peak
      /    \\
     /------\\---> stretch            kr = s_0 / s_p
           s_p  s_0

Thesis, figures 40 and 58; unloading goes straight to the origin and compression follows the same line, as the damage
of a bond is one number. A bond that was softened to nothing has spent c xi s_p s_0 / 2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_limits import Limits
from pdsolve.laws.law import INNER, stretch_before
from pdsolve.model import Model

MEMORY = ("worst",)


class Law(NamedTuple):
    """Columns of b bonds."""

    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,)
    limit: NDArray[np.floating]  # (b,) both infinite where a bond must not break
    worst: NDArray[np.floating]  # (b,)
    broken: NDArray[np.int32]  # (b,) step in which the bond broke, 0 while intact


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,)."""
    count, kind = len(bonds.limit), bonds.limit.dtype
    return Law(bonds.stiffness, bonds.peak, bonds.limit, np.zeros(count, kind), np.zeros(count, np.int32))


def limits(material: Material, critical: NDArray[np.float64]) -> Limits:
    """Stretches at the peak and at failure. A bond spends c xi s_p s_0 / 2, so s_p = s_c / sqrt(kr) and s_0 = s_c
    sqrt(kr) keep G0.

    Without `keep_G0` they are the thesis's s_p = s_c / kr and s_0 = s_c, which spend G0 / kr.
    """
    if material.keep_G0:
        return Limits(critical / np.sqrt(material.kr), critical * np.sqrt(material.kr))
    return Limits(critical / material.kr, critical)


def springs(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """Force densities (b,) for a unit stretch of linear bonds that are nowhere softer than these, N/m^3."""
    return law.stiffness


def age(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0
    if bond.stretch > law.limit[k]:
        law.broken[k] = now.step
        if law.peak[k] < law.limit[k]:
            spent = law.peak[k] * law.limit[k]
        else:
            spent = bond.stretch * stretch_before(bond, now, i, j)
        return law.stiffness[k] * bond.length * spent / 4
    if bond.stretch > law.peak[k] and bond.stretch > law.worst[k]:
        law.worst[k] = bond.stretch
    return 0.0


def pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        if law.worst[k] > 0:
            force *= intact_share(law.worst[k], law.peak[k], law.limit[k])
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    quarter, spent = law.stiffness[k] * bond.length / 4, 0.0
    if law.worst[k] > 0:
        worst, peak, limit = law.worst[k], law.peak[k], law.limit[k]
        spent = quarter * peak * limit * spent_share(worst, peak, limit)
        quarter *= intact_share(worst, peak, limit)
    return quarter * bond.stretch * bond.stretch, spent


@njit(**INNER)
def intact_share(worst: float, peak: float, limit: float) -> float:
    """Share of its stiffness a bond has kept that was stretched to `worst`, between peak and limit."""
    return peak * (limit - worst) / ((limit - peak) * worst)


@njit(**INNER)
def spent_share(worst: float, peak: float, limit: float) -> float:
    """Share of its energy c xi s_p s_0 / 2 a bond has spent that was stretched to `worst`."""
    return (worst - peak) / (limit - peak)
