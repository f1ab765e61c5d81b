"""Solutions of linear equations with the factors of an older matrix and the changes since then.

A = B + E M E^T, where B has factors and E picks the p components whose entries have changed by more than `SLIGHT`. By
Woodbury's identity A^-1 b = x - X M z with x = B^-1 b, X = B^-1 E and (I + E^T X M) z = E^T x: each component that
changes costs one more column of X, once (W. W. Hager, SIAM Review 31 (1989) 221-239). Iterative refinement corrects
what changed slightly. Factors are made anew where that would take longer.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.steppers.equilibrium import NotConvergedError
from pdsolve.steppers.factors import factorize

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

SLIGHT = 5e-3  # of the largest entry of the diagonal: smaller changes are left to refinement
CHANGED = 200  # components, at most
AT_ONCE = 80  # components that change at once, at most: their columns take as long as factors
REFINED = 4  # times, at most, each of which halves the residual at least
BLOCK = 4  # right sides at once: for more BLAS takes threads, which cost more than they save
LEFT = 1e-2  # of the right side, which a solution may leave


class ReusedFactorSolver:
    """Solves with matrices that may be indefinite; they are `symmetric`, or not."""

    def __init__(self, symmetric: bool = True) -> None:
        self._symmetric = symmetric
        self._old: csr_array | None = None
        self._inverse: Callable[[Array], Array] | None = None
        self._changed = np.zeros(0, dtype=np.int64)  # (p,) components
        self._columns = np.zeros((0, 0))  # (k, p) of the old matrix's inverse

    def solve(self, matrix: csr_array, right_side: Array, force_new_factors: bool) -> Array:
        """The solutions for right sides (k,) or (k, r); `force_new_factors`: use no old ones.

        Raises NotConvergedError.
        """
        rights = right_side.reshape(len(right_side), -1)
        solution = (
            None if force_new_factors or self._old is None else self._solve_with_old_factors_if_fast(matrix, rights)
        )
        if solution is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # SuperLU's
                try:
                    self._inverse = factorize(matrix, self._symmetric)
                except RuntimeError:
                    raise NotConvergedError("the tangent is singular") from None
            self._old = matrix
            self._changed, self._columns = np.zeros(0, dtype=np.int64), np.zeros((len(right_side), 0))
            solution = self._inverse(rights)
        return solution.reshape(right_side.shape)

    def _solve_with_old_factors_if_fast(self, matrix: csr_array, right_side: Array) -> Array | None:
        """The solutions; None if they take long."""
        matrix_change, inverse = matrix - self._old, self._inverse
        assert self._old is not None
        assert inverse is not None
        entries = matrix_change.tocoo()
        large = np.abs(entries.data) > SLIGHT * np.abs(self._old.diagonal()).max()
        new = np.setdiff1d(np.union1d(entries.row[large], entries.col[large]), self._changed)
        if len(new) > AT_ONCE or len(self._changed) + len(new) > CHANGED:
            return None
        if len(new):
            unit_columns = np.zeros((len(self._columns), len(new)), order="F")
            unit_columns[new, np.arange(len(new))] = 1.0
            self._changed = np.concatenate([self._changed, new])
            self._columns = np.hstack([self._columns, solve_right_sides_in_blocks(inverse, unit_columns)])
        changed_rows = self._changed
        change = matrix_change[changed_rows][:, changed_rows].toarray()
        capacitance_matrix = np.eye(len(changed_rows)) + self._columns[changed_rows] @ change
        size = np.linalg.norm(right_side, axis=0)
        solution: Array = np.zeros_like(right_side)
        residual, most = right_side, np.inf
        for _ in range(1 + REFINED):
            x = inverse(residual)
            try:
                solution = (
                    solution + x - self._columns @ (change @ np.linalg.solve(capacitance_matrix, x[changed_rows]))
                )
            except np.linalg.LinAlgError:
                return None
            residual = right_side - matrix @ solution
            before, most = most, float((np.linalg.norm(residual, axis=0) / np.where(size > 0, size, 1.0)).max())
            if most <= LEFT:
                return solution
            if not most < before / 2:
                return None
        return None


def solve_right_sides_in_blocks(solve: Callable[[Array], Array], right_sides: Array) -> Array:
    """The solutions for right sides (k, p), some at once."""
    blocks = range(0, right_sides.shape[1], BLOCK)
    return np.hstack([right_sides[:, :0], *(solve(np.asfortranarray(right_sides[:, k : k + BLOCK])) for k in blocks)])
