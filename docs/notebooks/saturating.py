"""The saturating law: a bond pulls less and less beyond its peak stretch, and is gone at its limit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.laws.law import INNER, stretch_before
from pdsolve.model import Model


class Law(NamedTuple):
    """Columns of b bonds."""

    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,)
    limit: NDArray[np.floating]  # (b,) stretch at which the bond breaks, infinite where it must not
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,)."""
    return Law(bonds.stiffness, bonds.peak, bonds.limit, np.zeros(len(bonds.limit), dtype=np.int32))


def springs(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """Force densities (b,) for a unit stretch of linear bonds that are nowhere softer than these, N/m^3."""
    return law.stiffness


def age(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0 or bond.stretch <= law.limit[k]:
        return 0.0
    law.broken[k] = now.step
    before = stretch_before(bond, now, i, j)  # the last stretch that pulled: for half a step more
    spent = held(before, law.peak[k]) + pulled(before, law.peak[k]) * (bond.stretch - before) / 2
    return law.stiffness[k] * bond.length * spent / 2


def pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * pulled(bond.stretch, law.peak[k])
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    return law.stiffness[k] * bond.length * held(bond.stretch, law.peak[k]) / 2, 0.0


@njit(**INNER)
def pulled(stretch, peak):  # type: ignore[no-untyped-def]
    """Force over stiffness."""
    return stretch / np.sqrt(1 + (stretch / peak) ** 2)


@njit(**INNER)
def held(stretch, peak):  # type: ignore[no-untyped-def]
    """Energy over stiffness and length."""
    return stretch**2 / (np.sqrt(1 + (stretch / peak) ** 2) + 1)
