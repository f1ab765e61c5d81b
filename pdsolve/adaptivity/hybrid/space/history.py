"""What happened so far in a run whose operator is made anew when cells become fine."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.lattice.tiles import Breaks, room_for


class ZoneHistory(NamedTuple):
    """Broken bonds and books."""

    break_step: NDArray[np.int64]  # (b,) when directed bonds broke
    broken_source: NDArray[np.int64]  # (b,) fine sites, or rows of the grid
    broken_target: NDArray[np.int64]
    refinement_energy: float  # J, in the plane per unit thickness: energy that refining has made
    largest_clipped_strain: float  # of bonds that do not break: e, or stretch over their limit
    latest_breaks: Breaks  # bonds that broke in the last step in which any did; rows of nodes may be others since


NEVER = np.zeros(0, dtype=np.int64)
NOTHING = ZoneHistory(NEVER, NEVER, NEVER, 0.0, 0.0, room_for(0))
