"""The stiffness matrix of springs between two nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def pair_matrix(i: NDArray[np.int64], j: NDArray[np.int64], block: NDArray[np.float64], nodes: int) -> csr_array:
    """Stiffness (n d, n d) of the pairs of nodes i, j (p,), each with its `block` (p, d, d)."""
    from scipy.sparse import coo_array

    d = block.shape[1]
    rows, columns, values = [], [], []
    for first, second in ((i, j), (j, i)):
        for end, sign in ((first, 1.0), (second, -1.0)):
            rows.append((d * first[:, None, None] + np.arange(d)[:, None] + np.zeros((d, d), int)).ravel())
            columns.append((d * end[:, None, None] + np.arange(d) + np.zeros((d, d), int)).ravel())
            values.append((sign * block).ravel())
    ends = np.concatenate(rows), np.concatenate(columns)
    matrix: csr_array = coo_array((np.concatenate(values), ends), shape=(d * nodes, d * nodes)).tocsr()
    return matrix
