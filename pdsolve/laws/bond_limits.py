"""Stretches at which a bond changes, such that a crack costs its fracture energy.

A pair law has a function `limits(material, bonds)`, not compiled: the stretches at which a bond begins to soften and
breaks. On the way it dissipates c xi s_c^2 / 2, as a brittle bond with the critical stretch s_c does, or else so much
that all bonds across a crack together do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Sizes(NamedTuple):
    """What the limits of bonds (b,) depend on, besides their material."""

    critical: NDArray[np.float64]  # (b,) s_c, stretch at which brittle bonds break
    length: NDArray[np.float64]  # (b,) |xi|, m
    horizon: NDArray[np.float64]  # (b,) the mean of both ends', m
    ratio: float  # of horizon to spacing


class Limits(NamedTuple):
    """Stretches at which a bond softens and breaks."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone
