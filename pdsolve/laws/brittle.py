"""The brittle law: linear until a bond is stretched to its limit, then nothing, for ever.

S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535. Where a bond breaks, Verlet takes exactly c xi s_n
s_(n+1) / 2 out of the motion at that moment (s_n of the last intact step, s_(n+1) at detection), so that is what is
booked as spent; half of it belongs to each node.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdsolve.laws.bond_limits import Limits
from pdsolve.laws.law import Pair
from pdsolve.laws.pair import PairColumns, pair_law


class Brittle(PairColumns):
    """Columns of bonds under this law."""


def limits(material: Material, critical: NDArray[np.float64]) -> Limits:
    """The critical stretch is both: a bond spends c xi s_c^2 / 2."""
    return Limits(critical, critical)


LAW = pair_law(Brittle, Pair(limits=limits))
