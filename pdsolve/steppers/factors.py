"""Direct solutions of sparse linear equations: SuperLU through SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Of symmetric matrices: half of the fill, without pivots off the diagonal
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}


def factorize(matrix: csr_array, symmetric: bool = True) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """The function that solves with a matrix (k, k). Raises RuntimeError for a singular one."""
    from scipy.sparse.linalg import splu  # SciPy takes long to import, and few runs ask

    solve: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    solve = splu(matrix.tocsc(), **(SYMMETRIC if symmetric else {})).solve
    return solve


def count_negative_eigenvalues(matrix: csr_array) -> int:
    """How many eigenvalues of a symmetric matrix (k, k) are negative, by Sylvester's law of inertia.

    Raises RuntimeError for a singular one.
    """
    from scipy.sparse.linalg import splu

    return int((splu(matrix.tocsc(), **SYMMETRIC).U.diagonal() < 0).sum())
