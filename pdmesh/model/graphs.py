"""Connected components of graphs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def connected(count: int, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """The component number (count,) of each vertex, from edges between `source` (k,) and `target` (k,)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(source), dtype=np.int8), (source, target)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
