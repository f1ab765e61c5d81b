"""The brittle law: linear up to the limit, then broken for ever.

S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535. A bond that breaks takes c xi s_c^2 / 2 from the motion,
with the pull that `pdsolve.laws.calls.matching_force` adds. Without it, as in the thesis, Verlet takes c xi s_n
s_(n+1) / 2 (s_n of the last intact step, s_(n+1) at detection). Half of the energy is booked at each node.
"""

from __future__ import annotations

from pdmesh.model.material import Material
from pdsolve.laws.law import Limits, Pair, Sizes
from pdsolve.laws.pair import PairColumns, pair_law


class Brittle(PairColumns):
    """Columns of bonds under this law."""


def limits(material: Material, bonds: Sizes) -> Limits:
    """Both stretches are the critical one: a bond dissipates c xi s_c^2 / 2."""
    return Limits(bonds.critical, bonds.critical)


LAW = pair_law(Brittle, Pair(limits=limits))
