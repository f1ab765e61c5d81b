"""The brittle law: linear up to the limit, then broken for ever.

S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535. When a bond breaks, Verlet takes exactly c xi s_n s_(n+1)
/ 2 out of the motion (s_n of the last intact step, s_(n+1) at detection). This energy is booked as dissipated, half of
it at each node.
"""

from __future__ import annotations

from pdmesh.model.material import Material
from pdsolve.laws.bond_limits import Limits, Sizes
from pdsolve.laws.law import Pair
from pdsolve.laws.pair import PairColumns, pair_law


class Brittle(PairColumns):
    """Columns of bonds under this law."""


def limits(material: Material, bonds: Sizes) -> Limits:
    """Both stretches are the critical one: a bond dissipates c xi s_c^2 / 2."""
    return Limits(bonds.critical, bonds.critical)


LAW = pair_law(Brittle, Pair(limits=limits))
