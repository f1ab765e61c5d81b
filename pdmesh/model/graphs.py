"""Graphs and k-d trees of SciPy, which is imported when one is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


def connected(count: int, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """The component number (count,) of each vertex, from edges between `source` (k,) and `target` (k,)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(source), dtype=np.int8), (source, target)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def tree_of(position: NDArray[np.float64]) -> cKDTree:
    """The k-d tree of nodes at `position` (n, d)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate, which may do without a tree
    from scipy.spatial import cKDTree

    return cKDTree(position)
