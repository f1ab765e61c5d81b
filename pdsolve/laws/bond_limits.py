"""Stretches at which a bond changes, such that a crack costs its fracture energy.

A pair law has a function `limits(material, critical)`, not compiled: the stretches at which a bond begins to soften and
breaks. On the way it dissipates c xi s_c^2 / 2, as a brittle bond with the critical stretch s_c does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Limits(NamedTuple):
    """Stretches at which a bond softens and breaks."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone
