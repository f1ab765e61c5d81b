"""Solutions of linear equations with the factors of an older matrix, as a preconditioner of GMRES.

Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856-869. Factors are made anew where GMRES
would take longer.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.steppers.equilibrium import UnsettledError
from pdsolve.steppers.factors import factors

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

INNER = 16  # iterations of GMRES; factors take as long as 30
LEFT = 1e-3  # of the right side, which a solution may leave


class Solver:
    """Solves with matrices that may be indefinite; they are `symmetric`, or not."""

    def __init__(self, symmetric: bool = True) -> None:
        self._inverse: Callable[[Array], Array] | None = None
        self._symmetric = symmetric

    def solve(self, matrix: csr_array, right: Array, anew: bool) -> Array:
        """The solution for one right side (k,); `anew` does not use old factors. Raises UnsettledError."""
        found = None if anew or self._inverse is None else self._by_old_factors(matrix, right)
        if found is None:
            self._inverse = _factors(matrix, self._symmetric)
            found = self._inverse(right)
        return found

    def solve_two(self, matrix: csr_array, first: Array, second: Array, anew: bool) -> tuple[Array, Array]:
        """Solutions for two right sides (k,)."""
        a = self.solve(matrix, first, anew)
        return a, self.solve(matrix, second, False)

    def _by_old_factors(self, matrix: csr_array, right: Array) -> Array | None:
        """The solution by GMRES preconditioned from the right, which has the true residual; None if it takes long."""
        from scipy.sparse.linalg import LinearOperator, gmres

        inverse = self._inverse
        assert inverse is not None
        nearly_one = LinearOperator(matrix.shape, lambda of: matrix @ inverse(of), dtype=float)
        found, failed = gmres(nearly_one, right, rtol=LEFT, restart=INNER, maxiter=1)
        return None if failed else inverse(found)


def _factors(matrix: csr_array, symmetric: bool) -> Callable[[Array], Array]:
    """The function that solves with a matrix; SuperLU's warnings are left out. Raises UnsettledError."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return factors(matrix, symmetric)
        except RuntimeError:
            raise UnsettledError("found a singular tangent") from None
