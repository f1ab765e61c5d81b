"""Solutions with the factors of a tangent from before some bonds broke.

A bond between nodes i and j adds k b b^T to the tangent, b being n at i and -n at j, of its direction n and of the
largest eigenvalue k of what it adds to the block of i and j. Without p such bonds, by Woodbury's identity

    A^-1 r = x + X z,   (1 / k - B^T X) z = B^T x,   x = B_0^-1 r,   X = B_0^-1 B

with B_0 the matrix that has factors (W. W. Hager, SIAM Review 31 (1989) 221-239). What is left of the bonds, across n,
is some percent under the strains at which bonds break, and iterations correct it. Just after bonds broke the residual
is a sum of their b, so that the columns of X solve for it, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.state import Broken
from pdsolve.steppers.factors import GROUP

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]

MOST, AT_ONCE = 150, 40  # bonds in all, and in one call: beyond, new factors take no longer
LEFT = 0.05  # of a right side that is not of the bonds that broke last: then it is solved for


class DowndatedTangent:
    """The tangent of a plate with factors, less the bonds that have broken since."""

    def __init__(
        self, tangent: csr_array, free: NDArray[np.bool_], solve_with_factors: Solve, broken_bonds: Broken
    ) -> None:
        """`tangent` (n w, n w) is symmetric, without those `broken_bonds`; `free` (n, w) components have factors."""
        self._matrix, self._solve, self._width = tangent, solve_with_factors, free.shape[1]
        self._row = np.where(free.ravel(), np.cumsum(free.ravel()) - 1, -1).reshape(free.shape)
        size = int(free.sum())
        self._nodes, self._known = len(free), np.unique(_unordered_node_pair_ids(broken_bonds, len(free)))
        self._ways, self._columns = np.zeros((0, size)), np.zeros((0, size))  # (p, k): b, and X
        self._whole = np.zeros((0, 0))  # (p, p): 1 / k - B^T X
        self._last = 0  # of them from the last call

    def remove_bonds_if_few(self, broken_bonds: Broken) -> bool:
        """Take all these for broken; False if they are too many."""
        new = np.setdiff1d(_unordered_node_pair_ids(broken_bonds, self._nodes), self._known)
        self._last = 0
        if not len(new):
            return True
        self._known = np.union1d(self._known, new)
        if len(new) > AT_ONCE or len(self._ways) + len(new) > MOST:
            return False
        i, j = np.divmod(new, self._nodes)
        axes = np.arange(self._width)
        rows, columns = (self._width * node[:, None] + axes for node in (i, j))
        places = np.repeat(rows, self._width, axis=1).ravel(), np.tile(columns, self._width).ravel()
        block = -np.asarray(self._matrix[places]).reshape(len(i), self._width, self._width)
        values, vectors = np.linalg.eigh(block)
        ways = np.zeros((len(i), self._ways.shape[1]))
        for node, sign in ((i, 1.0), (j, -1.0)):
            for axis in range(self._width):
                row = self._row[node, axis]
                free_bonds = np.flatnonzero(row >= 0)
                ways[free_bonds, row[free_bonds]] = sign * vectors[free_bonds, axis, -1]
        pulls = values[:, -1] > 0
        ways, stiffness = ways[pulls], values[pulls, -1]
        columns = solve_right_sides_in_blocks(self._solve, ways.T).T
        old, diagonal_block = -self._ways @ columns.T, np.diag(1 / stiffness) - ways @ columns.T
        self._whole = np.block([[self._whole, old], [old.T, diagonal_block]])
        self._ways, self._columns = np.vstack([self._ways, ways]), np.vstack([self._columns, columns])
        self._last = len(ways)
        return True

    def solve(self, right_side: Array) -> Array:
        """The solution for a right side (k,)."""
        solution = None
        if self._last:  # by the columns of the bonds that broke last, where the right side is of them
            ways, columns = self._ways[-self._last :], self._columns[-self._last :]
            self._last = 0
            share = np.linalg.lstsq(ways @ ways.T, ways @ right_side, rcond=1e-12)[0]
            if np.linalg.norm(right_side - share @ ways) < LEFT * np.linalg.norm(right_side):
                solution = np.asarray(share @ columns)
        if solution is None:
            solution = self._solve(right_side)
        if not len(self._ways):
            return solution
        try:
            share = np.linalg.solve(self._whole, self._ways @ solution)
        except np.linalg.LinAlgError:  # nothing else holds a node: iterations will find out
            return solution
        return np.asarray(solution + share @ self._columns)


def solve_right_sides_in_blocks(solve: Solve, right_sides: Array) -> Array:
    """The solutions for right sides (k, p), some at once."""
    blocks = range(0, right_sides.shape[1], GROUP)
    return np.hstack([right_sides[:, :0], *(solve(np.asfortranarray(right_sides[:, k : k + GROUP])) for k in blocks)])


def _unordered_node_pair_ids(broken_bonds: Broken, node_count: int) -> NDArray[np.int64]:
    """A number for each pair of nodes, whichever of them comes first."""
    return np.minimum(broken_bonds.source, broken_bonds.target) * node_count + np.maximum(
        broken_bonds.source, broken_bonds.target
    )
