"""When a bond changes, so that a crack costs its fracture energy.

A law of bonds alone has a function `limits(material, critical)`, not compiled: the stretches at which a bond begins to
soften and is gone, such that it spends c xi s_c^2 / 2 on the way, as a brittle one with the critical stretch s_c does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Limits(NamedTuple):
    """Stretches at which a bond changes."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone
