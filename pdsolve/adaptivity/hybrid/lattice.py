"""Numbering of nodes and cells row by row, with margins, so that a neighbour is at a constant offset.

ix, iy   of a fine node, 0 to nx, ny          p   its place
X, Y     of a coarse node, 0 to nx/2, ny/2    q   its place; it lies on the fine node (2 X, 2 Y)
X, Y     of a cell: of its lower left corner  c   its place
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER

LEFT = ROW  # idle places before each row of nodes
BELOW = 8  # idle rows of fine nodes below and above
BELOW_COARSE = 2  # of coarse ones
AROUND = 6  # cells around the plate that are void
COARSE, FINE, VOID, EMPTY = range(4)  # cells; empty ones have none of the plate, as void ones, but bonds pass through
IDLE, FREE, BORDER = 0, 1, 2  # nodes


class Lattice(NamedTuple):
    """A rectangle of nx by ny fine cells, both even."""

    nx: int
    ny: int
    stride: int  # places from a fine node to the one above
    places: int  # of fine nodes
    coarse_stride: int
    coarse_places: int
    cell_stride: int
    cells: int


def lattice_of(nx: int, ny: int) -> Lattice:
    """The numbering of a plate of nx by ny fine cells."""
    stride, coarse = (ROW * -(-(LEFT + count + 1 + BELOW) // ROW) for count in (nx, nx // 2))
    rows, coarse_rows = ny + 1 + 2 * BELOW, ny // 2 + 1 + 2 * BELOW_COARSE
    cells = nx // 2 + 2 * AROUND
    return Lattice(nx, ny, stride, rows * stride, coarse, coarse_rows * coarse, cells, cells * (ny // 2 + 2 * AROUND))


@njit(forceinline=True, **INNER)
def fine_place(at, ix, iy):  # type: ignore[no-untyped-def]
    """The place p of the fine node (ix, iy)."""
    return (iy + BELOW) * at.stride + LEFT + ix


@njit(forceinline=True, **INNER)
def fine_column(at, p):  # type: ignore[no-untyped-def]
    """The column ix of the fine node at place p."""
    return p % at.stride - LEFT


@njit(forceinline=True, **INNER)
def fine_row(at, p):  # type: ignore[no-untyped-def]
    """The row iy of the fine node at place p."""
    return p // at.stride - BELOW


@njit(forceinline=True, **INNER)
def coarse_place(at, x, y):  # type: ignore[no-untyped-def]
    """The place q of the coarse node (x, y)."""
    return (y + BELOW_COARSE) * at.coarse_stride + LEFT + x


@njit(forceinline=True, **INNER)
def coarse_column(at, q):  # type: ignore[no-untyped-def]
    """The column x of the coarse node at place q."""
    return q % at.coarse_stride - LEFT


@njit(forceinline=True, **INNER)
def coarse_row(at, q):  # type: ignore[no-untyped-def]
    """The row y of the coarse node at place q."""
    return q // at.coarse_stride - BELOW_COARSE


@njit(forceinline=True, **INNER)
def cell_place(at, x, y):  # type: ignore[no-untyped-def]
    """The place c of the cell (x, y)."""
    return (y + AROUND) * at.cell_stride + AROUND + x
