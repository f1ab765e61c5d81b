"""The brittle law: linear until a bond is stretched to its limit, then nothing, for ever.

S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535. Where a bond breaks, Verlet takes exactly c xi s_n
s_(n+1) / 2 out of the motion at that moment (s_n of the last intact step, s_(n+1) at detection), so that is what is
booked as spent; half of it belongs to each node.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_limits import Limits
from pdsolve.laws.law import stretch_before
from pdsolve.model import Model


class Law(NamedTuple):
    """Columns of b bonds."""

    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    limit: NDArray[np.floating]  # (b,) stretch at which the bond breaks, infinite where it must not
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,)."""
    return Law(bonds.stiffness, bonds.limit, np.zeros(len(bonds.limit), dtype=np.int32))


def limits(material: Material, critical: NDArray[np.float64]) -> Limits:
    """The critical stretch is both: a bond spends c xi s_c^2 / 2."""
    return Limits(critical, critical)


def springs(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """Force densities (b,) for a unit stretch of linear bonds that are nowhere softer than these, N/m^3."""
    return law.stiffness


def age(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0 or bond.stretch <= law.limit[k]:
        return 0.0
    law.broken[k] = now.step
    return law.stiffness[k] * bond.length * (bond.stretch * stretch_before(bond, now, i, j)) / 4


def pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    return law.stiffness[k] * bond.length / 4 * bond.stretch * bond.stretch, 0.0
