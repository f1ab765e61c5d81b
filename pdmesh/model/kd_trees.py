"""k-d trees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


def tree_of(position: NDArray[np.float64]) -> cKDTree:
    """The k-d tree of nodes at `position` (n, d)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate, which may do without a tree
    from scipy.spatial import cKDTree

    return cKDTree(position)
