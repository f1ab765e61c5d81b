"""Numbering of nodes and cells row by row, with margins, so that a neighbour is at a constant offset.

ix, iy   of a fine node, 0 to nx, ny          p   its place
X, Y     of a coarse node, 0 to nx/2, ny/2    q   its place; it lies on the fine node (2 X, 2 Y)
X, Y     of a cell: of its lower left corner  c   its place
X, Y     of a far node, 0 to nx/4, ny/4       q   its place; it lies on the coarse node (2 X, 2 Y)
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW

LEFT = ROW  # idle places before each row of nodes
BELOW = 8  # idle rows of fine nodes below and above
BELOW_COARSE = 2  # of coarse ones
AROUND = 6  # cells around the plate that are void
# cells; empty ones have none of the plate, as void ones, but bonds pass through; far ones are four at a time one of 4 h
COARSE, FINE, VOID, EMPTY, FAR = range(5)
IDLE, FREE, BORDER = 0, 1, 2  # nodes; those on the border move with coarser ones


class Numbering(NamedTuple):
    """A rectangle of nx by ny fine cells, both even."""

    fine_cells_x: int
    fine_cells_y: int
    fine_row_stride: int  # places from a fine node to the one above
    fine_place_count: int  # of fine nodes
    coarse_row_stride: int
    coarse_place_count: int
    far_row_stride: int
    far_place_count: int
    cell_row_stride: int
    cell_count: int


def create_numbering(fine_cells_x: int, fine_cells_y: int) -> Numbering:
    """The numbering of a plate of nx by ny fine cells."""
    stride, coarse, far = (
        ROW * -(-(LEFT + count + 1 + BELOW) // ROW) for count in (fine_cells_x, fine_cells_x // 2, fine_cells_x // 4)
    )
    rows, coarse_rows, far_rows = (
        fine_cells_y + 1 + 2 * BELOW,
        *(count + 1 + 2 * BELOW_COARSE for count in (fine_cells_y // 2, fine_cells_y // 4)),
    )
    cells = fine_cells_x // 2 + 2 * AROUND
    places = rows * stride, coarse_rows * coarse, far_rows * far, cells * (fine_cells_y // 2 + 2 * AROUND)
    return Numbering(fine_cells_x, fine_cells_y, stride, places[0], coarse, places[1], far, places[2], cells, places[3])


@njit(forceinline=True, **INNER)
def fine_place(numbering, ix, iy):  # type: ignore[no-untyped-def]
    """The place p of the fine node (ix, iy)."""
    return (iy + BELOW) * numbering.fine_row_stride + LEFT + ix


@njit(forceinline=True, **INNER)
def fine_column(numbering, p):  # type: ignore[no-untyped-def]
    """The column ix of the fine node at place p."""
    return p % numbering.fine_row_stride - LEFT


@njit(forceinline=True, **INNER)
def fine_row(numbering, p):  # type: ignore[no-untyped-def]
    """The row iy of the fine node at place p."""
    return p // numbering.fine_row_stride - BELOW


@njit(forceinline=True, **INNER)
def coarse_place(numbering, x, y):  # type: ignore[no-untyped-def]
    """The place q of the coarse node (x, y)."""
    return (y + BELOW_COARSE) * numbering.coarse_row_stride + LEFT + x


@njit(forceinline=True, **INNER)
def coarse_column(numbering, q):  # type: ignore[no-untyped-def]
    """The column x of the coarse node at place q."""
    return q % numbering.coarse_row_stride - LEFT


@njit(forceinline=True, **INNER)
def coarse_row(numbering, q):  # type: ignore[no-untyped-def]
    """The row y of the coarse node at place q."""
    return q // numbering.coarse_row_stride - BELOW_COARSE


@njit(forceinline=True, **INNER)
def cell_place(numbering, x, y):  # type: ignore[no-untyped-def]
    """The place c of the cell (x, y)."""
    return (y + AROUND) * numbering.cell_row_stride + AROUND + x


@njit(forceinline=True, **INNER)
def cell_column(numbering, c):  # type: ignore[no-untyped-def]
    """The column X of the cell at place c."""
    return c % numbering.cell_row_stride - AROUND


@njit(forceinline=True, **INNER)
def cell_row(numbering, c):  # type: ignore[no-untyped-def]
    """The row Y of the cell at place c."""
    return c // numbering.cell_row_stride - AROUND


@njit(forceinline=True, **INNER)
def far_place(numbering, x, y):  # type: ignore[no-untyped-def]
    """The place q of the far node (x, y)."""
    return (y + BELOW_COARSE) * numbering.far_row_stride + LEFT + x


@njit(forceinline=True, **INNER)
def far_column(numbering, q):  # type: ignore[no-untyped-def]
    """The column x of the far node at place q."""
    return q % numbering.far_row_stride - LEFT


@njit(forceinline=True, **INNER)
def far_row(numbering, q):  # type: ignore[no-untyped-def]
    """The row y of the far node at place q."""
    return q // numbering.far_row_stride - BELOW_COARSE
