"""Shared stiffnesses of edge rows: along a straight edge, bonds have periodic corrections.

Storing the stiffness of each bond would take too much memory; one row of 16 places stands for all rows like it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.collocation.layout import LatticeConstants, mask_edge_rows
from pdsolve.adaptivity.collocation.simd_rows import surface_corrected_stiffness
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.layout import PLANE

ROOM = 2**26  # bytes of stiffnesses that are kept, at most
ALIKE = 4  # rows, at least, for which it is worth it


def share_stiffness_of_equal_edge_rows(lattice: LatticeConstants) -> LatticeConstants:
    """The constant arrays with the stiffnesses of edge rows, stored once for equal rows."""
    rows = np.flatnonzero(mask_edge_rows(lattice) & (lattice.cell_area_share[0] > 0).reshape(-1, ROW).any(axis=1))
    first, number, count = _distinct_rows(_number_surroundings_of_rows(lattice, rows))
    often = np.argsort(-count, kind="stable")[: ROOM // (8 * ROW * len(lattice.neighbour_offsets))]
    often = often[count[often] >= ALIKE]
    rank = np.full(len(count), -1)
    rank[often] = np.arange(len(often))
    pattern = lattice.edge_row_stiffness_index.copy()
    pattern[rows] = rank[number]
    stiffness = np.zeros((1, len(often) * len(lattice.neighbour_offsets) * ROW))
    _store_bond_stiffness_of_rows(lattice, rows[first[often]], stiffness)
    return lattice._replace(edge_row_stiffness_index=pattern, edge_row_stiffness=stiffness.reshape(-1, 1, ROW))


def _number_surroundings_of_rows(lattice: LatticeConstants, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Surroundings of each of these rows (r, ...) within reach of its bonds; rows with equal surroundings are equal."""
    numbering, wide = lattice.numbering, -(-lattice.numbering.row_margin // ROW)
    what = (
        np.concatenate([lattice.cell_area_share, lattice.surface_correction])
        .reshape(3, -1, ROW)
        .transpose(1, 0, 2)
        .reshape(-1, 3 * ROW)
    )
    kind = np.pad(_distinct_rows(what)[1], wide)
    surroundings = _distinct_rows(np.lib.stride_tricks.sliding_window_view(kind, 2 * wide + 1))[1]
    return np.asarray(
        surroundings[
            rows[:, None] + np.arange(-numbering.row_margin, numbering.row_margin + 1) * (numbering.row_stride // ROW)
        ]
    )


def _distinct_rows(values: NDArray[np.generic]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Distinct rows of values (n, w): index of each one's first occurrence, class number (n,), count of each class."""
    _, first, number, count = np.unique(values, axis=0, return_index=True, return_inverse=True, return_counts=True)
    return first, number.ravel(), count


@cached_njit(error_model="numpy")
def _store_bond_stiffness_of_rows(lattice, rows, stiffness):  # type: ignore[no-untyped-def]
    """Store the stiffnesses of all bonds of these rows in `stiffness` (1, ...)."""
    for n in range(len(rows)):
        _store_bond_stiffness_of_row(lattice, rows[n], n * len(lattice.neighbour_offsets) * ROW, stiffness)


@njit(**INNER)
def _store_bond_stiffness_of_row(lattice, row, offset, bond_stiffness):  # type: ignore[no-untyped-def]
    """Store the corrected stiffnesses of the bonds of a row of 16 nodes from `offset` on, slot by slot."""
    for lane in range(0, ROW, across(bond_stiffness)):
        p = row * ROW + lane
        surface_correction = beside(lattice.surface_correction, PLANE, p)
        for k in range(len(lattice.neighbour_offsets)):
            keep(
                (surface_corrected_stiffness(lattice, p, k, surface_correction),),
                bond_stiffness,
                offset + k * ROW + lane,
            )
