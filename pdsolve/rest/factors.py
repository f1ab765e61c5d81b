"""Direct solutions of sparse linear equations: SuperLU through SciPy, and old factors of matrices that have changed.

A = B + E M E^T, where B has factors and E picks the p components whose entries have changed by more than `SLIGHT`. By
Woodbury's identity A^-1 b = x - X M z with x = B^-1 b, X = B^-1 E and (I + E^T X M) z = E^T x: each component that
changes costs one more column of X, once (W. W. Hager, SIAM Review 31 (1989) 221-239). A right side that acts on these
components alone is solved by the columns, without the factors. Iterative refinement corrects what changed slightly.
Factors are made anew where that would take longer.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.rest.equilibrium import SingularTangentError
from pdsolve.state import Broken

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Of symmetric matrices: half of the fill, without pivots off the diagonal
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}
SLIGHT = 5e-3  # of the largest entry of the diagonal: smaller changes are left to refinement
GROUP = (
    4  # components, whose columns are solved for together: for more BLAS takes threads, which cost more than they save
)
CHANGED = 800  # components, at most: equations of them take less than factors of a plate
REFINED = 8  # times, at most
ELSEWHERE = 0.05  # of a right side: if less acts on components that have not changed, that is left to refinement


def factorize(matrix: csr_array, symmetric: bool = True) -> Callable[[Array], Array]:
    """The function that solves with a matrix (k, k). Raises RuntimeError for a singular one."""
    from scipy.sparse.linalg import splu  # SciPy takes long to import, and few runs ask

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # SuperLU's, of singular matrices
        solve: Callable[[Array], Array] = splu(matrix.tocsc(), **(SYMMETRIC if symmetric else {})).solve
    return solve


def count_negative_eigenvalues(matrix: csr_array) -> int:
    """How many eigenvalues of a symmetric matrix (k, k) are negative, by Sylvester's law of inertia.

    Raises RuntimeError for a singular one.
    """
    from scipy.sparse.linalg import splu

    return int((splu(matrix.tocsc(), **SYMMETRIC).U.diagonal() < 0).sum())


class FreeComponents:
    """The free components (k,) of nodes, and what tangents have of them."""

    def __init__(self, is_free: NDArray[np.bool_]) -> None:
        """`is_free` is (n, w)."""
        self.shape, inner = is_free.shape, is_free.ravel()
        self.numbers = np.flatnonzero(inner)  # (k,), in order
        self.row = np.where(inner, np.cumsum(inner) - 1, -1).reshape(is_free.shape)  # of (n, w) among them; or -1
        self._parts: tuple[csr_array, csr_array] | None = None  # a matrix, and its part with numbers of entries

    def part_of(self, matrix: csr_array) -> csr_array:
        """The part (k, k) of a matrix (n w, n w), whose pattern is the same array wherever that of the matrix is."""
        from scipy.sparse import csr_array

        if self._parts is None or not _have_same_pattern(self._parts[0], matrix):
            numbers = csr_array((np.arange(len(matrix.data)), matrix.indices, matrix.indptr), matrix.shape)
            self._parts = matrix, numbers[self.numbers][:, self.numbers]
        part = self._parts[1]
        return csr_array((matrix.data[part.data], part.indices, part.indptr), part.shape)


class Factors:
    """Factors of the free components (k,) of a tangent; solutions with tangents that differ, the more in few of them,
    and with this tangent without bonds that have broken since."""

    def __init__(
        self, tangent: csr_array, free: FreeComponents, symmetric: bool = True, broken_bonds: Broken | None = None
    ) -> None:
        """`tangent` (n w, n w) may be indefinite; it is `symmetric`, or not, and without `broken_bonds`.

        Raises SingularTangentError.
        """
        self.tangent, self._free, self._part = tangent, free, free.part_of(tangent)
        try:
            self._inverse = factorize(self._part, symmetric)
        except RuntimeError:
            raise SingularTangentError("the tangent is singular") from None
        self._scale = float(np.abs(self._part.diagonal()).max(initial=0.0))
        self._room: Array | None = None  # (k, CHANGED + GROUP) for columns X, once there are any
        self.components: Index = np.zeros(0, dtype=np.int64)  # (p,) that have changed
        self._rows: Index | None = None  # of the entries of the part
        self._place = np.full(self._part.shape[0], -1)  # of components among these
        self._change = np.zeros((0, 0))  # (p, p): M
        self._coupling = np.zeros((0, 0))  # (p, p): E^T X
        self._entries: tuple[Index, Index, Index] | None = (
            None  # of matrices of the same pattern: which, and where in M
        )
        self._equations: tuple[Array, Array, int] | None = None  # LU factors of I + E^T X M; None: to be made
        self._broken_at_start = self._broken = (
            np.zeros(0, dtype=np.int64) if broken_bonds is None else self._bond_ids(broken_bonds)
        )

    def changed_components(self, tangent: csr_array) -> Index:
        """Components (q,) with larger changes of their entries, in order."""
        row, column, change = self._difference(self._free.part_of(tangent))
        large = np.abs(change) > SLIGHT * self._scale
        is_changed = np.zeros(len(self._place), dtype=bool)
        is_changed[row[large]] = is_changed[column[large]] = True
        return np.flatnonzero(is_changed)

    def _difference(self, part: csr_array) -> tuple[Index, Index, Array]:
        """Rows, columns and values of what a part (k, k) has more than that with factors."""
        if not _have_same_pattern(part, self._part):
            difference = (part - self._part).tocoo()
            return difference.row, difference.col, difference.data
        if self._rows is None:
            self._rows = np.repeat(np.arange(part.shape[0]), np.diff(part.indptr))
        return self._rows, part.indices, part.data - self._part.data

    def keep_components(self, components: Index, most: int = CHANGED * 3 // 4) -> bool:
        """Keep columns of these components only, in order, and add what is missing, so that solutions depend on them
        and not on what was there before; False if they are more than `most`."""
        groups = np.unique(components // GROUP)
        if GROUP * len(groups) > most:
            return False
        remaining = np.flatnonzero(np.isin(self.components // GROUP, groups))
        self._order(remaining)
        self.add_columns(components)
        self._order(np.argsort(self.components))
        return True

    def _order(self, order: Index) -> None:
        """Take the columns at these places (q,) for all, and forget changes."""
        if self._room is not None and not np.array_equal(order, np.arange(len(self.components))):
            self._room[:, : len(order)] = self._room[:, order]
        self._set_components(self.components[order])

    def _set_components(self, components: Index) -> None:
        """Take these for the components of the columns, and forget changes."""
        self._place[self.components] = -1
        self.components, count = components, len(components)
        self._place[components] = np.arange(count)
        self._coupling = (
            np.zeros((0, 0)) if self._room is None else np.ascontiguousarray(self._room[components, :count])
        )
        self._change, self._equations, self._entries = np.zeros((count, count)), None, None

    def add_columns(self, components: Index) -> bool:
        """Solve for the columns of these components, where they are new; False if they are too many."""
        groups, size = np.setdiff1d(components // GROUP, self.components // GROUP), len(self._place)
        if len(self.components) + GROUP * len(groups) > CHANGED:
            return False
        if not len(groups):
            return True
        if self._room is None:
            self._room = np.empty((size, CHANGED + GROUP), order="F")
        components, before, count = self.components, self._change, len(self.components)
        for group in groups.tolist():
            rows = np.arange(GROUP * group, min(GROUP * (group + 1), size))
            unit = np.zeros((size, len(rows)), order="F")
            unit[rows, np.arange(len(rows))] = 1.0
            self._room[:, len(components) : len(components) + len(rows)] = self._inverse(unit)
            components = np.concatenate([components, rows])
        self._set_components(components)
        self._change[:count, :count] = before
        return True

    def add_change(self, components: Index, change: Array) -> bool:
        """Let the matrix change by (q, q) at these components (q,), each of which is there once; False if too many
        have changed."""
        if not self.add_columns(components):
            return False
        at = self._place[components]
        self._change[np.ix_(at, at)] += change
        self._equations = None
        return True

    def solve_approximately(self, right_side: Array) -> Array:
        """The solutions for right sides (k, r), without refinement."""
        from scipy.linalg.lapack import dgetrf, dgetrs

        at = self.components
        if not len(at) or self._room is None:
            return self._inverse(right_side)
        columns = self._room[:, : len(at)]
        if self._equations is None:
            self._equations = dgetrf(np.eye(len(at)) + self._coupling @ self._change)
        lu, pivots, is_singular = self._equations
        inside = right_side[at]
        squares = (right_side**2).sum(axis=0)
        if not is_singular and (squares - (inside**2).sum(axis=0) <= ELSEWHERE**2 * squares).all():
            weights = dgetrs(lu, pivots, self._coupling @ inside)[0]
            return np.asarray(columns @ (inside - self._change @ weights))
        solution = self._inverse(right_side)
        if is_singular:  # nothing else holds a node: iterations will find out
            return solution
        weights = dgetrs(lu, pivots, solution[at])[0]
        return np.asarray(solution - columns @ (self._change @ weights))

    def solve(self, tangent: csr_array, right_side: Array, left: float, guess: Array | None = None) -> Array | None:
        """The solutions of this tangent for right sides (k, r), which leave at most this share of them, from a guess
        on; None if they take long."""
        matrix = self._free.part_of(tangent)
        if not self.add_columns(self.changed_components(tangent)):
            return None
        self._change[:], self._equations = 0.0, None
        row, column, change = self._difference(matrix)
        if self._entries is None or not _have_same_pattern(matrix, self._part):
            row, column = self._place[row], self._place[column]
            inside = np.flatnonzero((row >= 0) & (column >= 0))
            self._entries = inside, row[inside], column[inside]
        inside, row, column = self._entries
        self._change[row, column] = change[inside]
        enough = left * np.linalg.norm(right_side, axis=0)
        solution: Array = np.zeros_like(right_side) if guess is None else guess
        residual = right_side.copy() if guess is None else right_side - matrix @ guess
        images: list[tuple[Array, Array]] = []  # steps, and what the matrix makes of them, of norm 1 and orthogonal
        for _ in range(1 + REFINED):
            step = self.solve_approximately(residual)
            image = matrix @ step
            for earlier_step, earlier_image in images:
                share = (image * earlier_image).sum(axis=0)
                step, image = step - share * earlier_step, image - share * earlier_image
            size = np.linalg.norm(image, axis=0)
            size[size == 0] = 1.0
            images.append((step / size, image / size))
            share = (residual * images[-1][1]).sum(axis=0)
            solution = solution + share * images[-1][0]
            residual -= share * images[-1][1]
            if (np.linalg.norm(residual, axis=0) <= enough).all():
                return solution
        return None

    def remove_bonds(self, broken_bonds: Broken) -> bool:
        """Take these for broken; False if they are too many, or if one is there again."""
        before, self._broken = self._broken, self._bond_ids(broken_bonds)
        new = np.setdiff1d(self._broken, before)
        if len(np.setdiff1d(before, self._broken)):
            return False
        return not len(new) or self.add_change(*self._change_without(new))

    def restart_without_bonds(self, broken_bonds: Broken) -> bool:
        """Take these for broken, whatever was solved before; False if they are too many."""
        self._broken = self._bond_ids(broken_bonds)
        components, change = self._change_without(np.setdiff1d(self._broken, self._broken_at_start))
        if len(np.setdiff1d(self._broken_at_start, self._broken)) or not self.keep_components(components):
            return False
        return self.add_change(components, change)

    def _bond_ids(self, broken_bonds: Broken) -> Index:
        """A number for each bond of a node, in order."""
        return np.unique(broken_bonds.source * self._free.shape[0] + broken_bonds.target)

    def _change_without(self, bonds: Index) -> tuple[Index, Array]:
        """Free components (q,), and the change (q, q) of the tangent there, without these bonds of nodes.

        A bond of node i with j adds k n n^T to what is at i, and takes it from what is between i and j: n is its
        direction and k the largest eigenvalue of its block. What is left of it, across n, is some percent under the
        strains at which bonds break, and iterations correct it.
        """
        if not len(bonds):
            return bonds, np.zeros((0, 0))
        nodes, w = self._free.shape
        axes, ends = np.arange(w), np.stack(np.divmod(bonds, nodes), axis=1)  # (b, 2)
        rows, columns = (w * node[:, None] + axes for node in ends.T)
        places = np.repeat(rows, w, axis=1).ravel(), np.tile(columns, w).ravel()
        values, vectors = np.linalg.eigh(-np.asarray(self.tangent[places]).reshape(len(bonds), w, w))
        n = vectors[:, :, -1]
        block = np.maximum(values[:, -1], 0.0)[:, None, None] * n[:, :, None] * n[:, None, :]
        change = np.concatenate([-block, block], axis=2)  # (b, w, 2 w): at the node, and between both
        at = self._free.row[ends].reshape(len(bonds), -1)
        components = np.unique(at[at >= 0])
        is_free = (at[:, :w, None] >= 0) & (at[:, None, :] >= 0)
        place = np.searchsorted(components, at)
        row, column = np.broadcast_arrays(place[:, :w, None], place[:, None, :])
        total = np.zeros((len(components), len(components)))
        np.add.at(total, (row[is_free], column[is_free]), change[is_free])
        return components, total


def _have_same_pattern(one: csr_array, other: csr_array) -> bool:
    """Whether two matrices share the arrays of their pattern; others may be alike, too."""
    return bool(one.indices.ctypes.data == other.indices.ctypes.data and len(one.indices) == len(other.indices))
