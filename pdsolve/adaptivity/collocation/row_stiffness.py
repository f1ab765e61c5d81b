"""Stiffnesses of the bonds of rows of 16 nodes: at edges and faces of pre-cracks with the correction of surfaces.

Storing the stiffness of each bond would take too much memory. Inside a plate it is that of the lattice; along a
straight edge corrections repeat, so that one row stands for all rows like it; those of other rows are computed as they
are needed.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.collocation.layout import (
    ALONG_X,
    ALONG_Y,
    CollocationPlate,
    LatticeConstants,
    is_bond_cut,
    mask_rows_without_full_families,
)
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.layout import ONE, PLANE

WHOLE, COMPUTED = -1, -2  # stiffness indices of rows: no bond is cut, and all are those of the lattice; at edges, not
# stored
UNCORRECTED = 0  # that of rows without corrections, some of whose bonds are cut
ROOM = 2**26  # bytes of stiffnesses that are kept, at most
ALIKE = 4  # rows, at least, for which it is worth it


def store_stiffness_once_for_equal_rows(
    lattice: LatticeConstants, plate: CollocationPlate
) -> tuple[LatticeConstants, CollocationPlate]:
    """Both with the stiffnesses of rows, stored once for equal rows."""
    at_edge, is_cut = mask_rows_without_full_families(lattice), plate.cut_bond_bits.any(axis=1)
    rows = np.flatnonzero(at_edge & (lattice.cell_area_share[0] > 0).reshape(-1, ROW).any(axis=1))
    numbering, wide = lattice.numbering, -(-lattice.numbering.row_margin // ROW)
    what = (
        np.concatenate([lattice.cell_area_share, lattice.surface_correction])
        .reshape(3, -1, ROW)
        .transpose(1, 0, 2)
        .reshape(-1, 3 * ROW)
    )
    kind = np.pad(_distinct_rows(what)[1], wide)
    surroundings = _distinct_rows(np.lib.stride_tricks.sliding_window_view(kind, 2 * wide + 1))[1]
    within_reach = np.arange(-numbering.row_margin, numbering.row_margin + 1) * (numbering.row_stride // ROW)
    first, number, count = _distinct_rows(surroundings[rows[:, None] + within_reach])
    often = np.argsort(-count, kind="stable")[: ROOM // (8 * ROW * len(lattice.neighbour_offsets))]
    often = often[count[often] >= ALIKE]
    index_of_kind = np.full(len(count), COMPUTED)
    index_of_kind[often] = 1 + np.arange(len(often))
    index = np.where(at_edge, COMPUTED, np.where(is_cut, UNCORRECTED, WHOLE)).astype(np.int32)
    index[rows] = index_of_kind[number]
    stiffness = np.empty((1 + len(often), len(lattice.neighbour_offsets), ROW))
    stiffness[UNCORRECTED] = lattice.spring_table[:, 5, None]
    _store_stiffness_of_rows(lattice, rows[first[often]], stiffness[1:])
    return lattice._replace(row_stiffness=stiffness), plate._replace(stiffness_index_of_row=index)


def _distinct_rows(values: NDArray[np.generic]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Distinct rows of values (n, w): index of each one's first occurrence, class number (n,), count of each class."""
    _, first, number, count = np.unique(values, axis=0, return_index=True, return_inverse=True, return_counts=True)
    return first, number.ravel(), count


@cached_njit(error_model="numpy")
def _store_stiffness_of_rows(lattice, rows, stiffness):  # type: ignore[no-untyped-def]
    for n in range(len(rows)):
        store_row_stiffness(lattice, rows[n], stiffness[n])


@njit(**INNER)
def store_row_stiffness(lattice, row, stiffness):  # type: ignore[no-untyped-def]
    """Store the corrected stiffnesses (k, 16) of the bonds of a row of nodes, whether cut or not, N/m^4."""
    for lane in range(0, ROW, across(stiffness)):
        p = row * ROW + lane
        own = beside(lattice.surface_correction, PLANE, p)
        for k in range(len(lattice.neighbour_offsets)):
            j = p + lattice.neighbour_offsets[k]
            other = beside(lattice.surface_correction, PLANE, j)
            factor = _bond_surface_correction(lattice, k, (own[0] + other[0]) * 0.5, (own[1] + other[1]) * 0.5)
            share = beside(lattice.cell_area_share, ONE, j)[0]
            keep((lattice.spring_table[k, 5] * (factor * share),), stiffness, k * ROW + lane)


@njit(forceinline=True, **INNER)
def _bond_surface_correction(lattice, k, x, y):  # type: ignore[no-untyped-def]
    """The correction of bond k whose ends have the mean corrections x and y along the axes."""
    return x * y / np.sqrt(y * y * lattice.spring_table[k, ALONG_X] + x * x * lattice.spring_table[k, ALONG_Y])


@njit(**INNER)
def bond_stiffness(lattice, p, k):  # type: ignore[no-untyped-def]
    """Corrected stiffness of bond k of node p, N/m^4."""
    j, correction = p + lattice.neighbour_offsets[k], lattice.surface_correction
    x, y = (correction[0, p] + correction[0, j]) / 2, (correction[1, p] + correction[1, j]) / 2
    return lattice.spring_table[k, 5] * _bond_surface_correction(lattice, k, x, y) * lattice.cell_area_share[0, j]


@cached_njit(error_model="numpy")
def stiffness_of_bonds(lattice, places, bond_numbers):  # type: ignore[no-untyped-def]
    """Corrected stiffnesses (b,) of bonds `bond_numbers` of nodes at `places`, N/m^4."""
    stiffness = np.empty(len(places))
    for n in range(len(places)):
        stiffness[n] = bond_stiffness(lattice, places[n], bond_numbers[n])
    return stiffness


@cached_njit(error_model="numpy")
def largest_stiffness_bound(lattice, cut_bond_bits, places):  # type: ignore[no-untyped-def]
    """The largest row sum of stiffness of these nodes, N/m^4 (see `pdsolve.bonds.assembly.stiffness_bound`)."""
    most = 0.0
    for p in places:
        xx, yy, xy = 0.0, 0.0, 0.0
        for k in range(len(lattice.neighbour_offsets)):
            if is_bond_cut(cut_bond_bits, p, k):
                continue
            pull = bond_stiffness(lattice, p, k) * lattice.spring_table[k, 4]
            x, y = lattice.spring_table[k, 0], lattice.spring_table[k, 1]
            xx, yy, xy = xx + pull * x * x, yy + pull * y * y, xy + pull * x * y
        most = max(most, (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    return most
