"""What follows from the cells: kinds of nodes, and the pieces of bonds in the fine zone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.lattice import AROUND, BORDER, COARSE, EMPTY, FINE, FREE, IDLE, VOID
from pdsolve.adaptivity.hybrid.state_based.plate import Whole
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.numerics.dilation import in_square
from pdsolve.operators.simd_lattice.kernel import INNER

PARTS = 8  # pieces of a bond, more than there are
UNIT = 60  # places where pieces end are whole multiples of h / UNIT: 1 to 6 divide it


class Nodes(NamedTuple):
    """The fine nodes (n,) of a plate in its cells."""

    kind: NDArray[np.uint8]  # (n,)
    share: NDArray[np.float64]  # (n,) of h^2, in fine cells
    above: NDArray[np.bool_]  # (n,) whether a coarse node is there


class Pieces(NamedTuple):
    """The p pieces of bonds in the fine zone."""

    bond: NDArray[np.int64]  # (p,)
    t: NDArray[np.float64]  # (p, 2) shares of the bond's length where it begins and ends
    part: NDArray[np.float64]  # (p,) of the bond's sides, that of the fine zone


def around(cells: NDArray[np.uint8], stride: int, xy: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The cells (4, n) around fine nodes."""
    x, y = xy.T
    return np.array([cells[((y + b) // 2 + AROUND) * stride + (x + a) // 2 + AROUND] for b in (-1, 0) for a in (-1, 0)])


def nodes_of(whole: Whole, cells: NDArray[np.uint8]) -> Nodes:
    """The kinds of nodes in these cells (c,)."""
    beside = around(cells, whole.plate.at.cell_stride, whole.xy)
    fine, coarse = (beside == FINE).any(axis=0), (beside == COARSE).any(axis=0)
    kind = np.where(fine, np.where(coarse, BORDER, FREE), IDLE).astype(np.uint8)
    share = np.where(coarse, (beside == FINE).mean(axis=0), whole.area / whole.plate.h**2)
    return Nodes(kind, share, coarse & (whole.xy % 2 == 0).all(axis=1))


def pieces_of(whole: Whole, cells: NDArray[np.uint8]) -> Pieces:
    """The pieces of intact bonds in these cells (c,)."""
    at, bonds, of = whole.plate.at, whole.bonds, whole.divisions
    fine = (cells == FINE).reshape(-1, at.cell_stride)
    near = in_square(fine, int(np.abs(whole.ways).max()) // 2 + 2).ravel()
    x, y = whole.xy[bonds.one].T
    some = np.flatnonzero(near[(y // 2 + AROUND) * at.cell_stride + x // 2 + AROUND] & bonds.intact)
    room = 2 * len(some) + PARTS
    bond, t, part = np.empty(room, np.int64), np.empty((room, 2)), np.empty(room)
    count = _divide(cells, at.cell_stride, whole.xy, bonds.one, bonds.way, some, *of, bond, t, part)
    if count > room:
        bond, t, part = np.empty(count, np.int64), np.empty((count, 2)), np.empty(count)
        _divide(cells, at.cell_stride, whole.xy, bonds.one, bonds.way, some, *of, bond, t, part)
    return Pieces(bond[:count], t[:count], part[:count])


@njit(**INNER)
def _is_there(cells, stride, own, cell, first, last):  # type: ignore[no-untyped-def]
    """Whether a side of a bond has cells of the plate."""
    found = False
    for p in range(first, last):
        found |= cells[own + cell[p, 1] * stride + cell[p, 0]] not in (VOID, EMPTY)
    return found


@cached_njit(error_model="numpy")
def _divide(cells, stride, xy, one, way, some, first, t, cell, bond, ends, part):  # type: ignore[no-untyped-def]
    """List the pieces of `some` bonds; returns how many there are, those without room included."""
    count, room = 0, len(bond)
    for b in some:
        x, y = xy[one[b], 0], xy[one[b], 1]
        begins = first[x % 2 + 2 * (y % 2), way[b]]
        own = ((y >> 1) + AROUND) * stride + (x >> 1) + AROUND
        there = np.zeros(2, np.bool_)
        for side in range(2):
            there[side] = _is_there(cells, stride, own, cell, begins[side], begins[side + 1])
        sides = there[0] + there[1]
        whole = False  # whether the last piece is open: of all sides
        for q in range(begins[1] - begins[0]):
            fine = 0
            for side in range(2):
                p = begins[side] + q
                fine += there[side] and cells[own + cell[p, 1] * stride + cell[p, 0]] != COARSE
            if whole and fine == sides:
                if count <= room:
                    ends[count - 1, 1] = t[begins[0] + q, 1]
            elif fine or not sides:
                if count < room:
                    bond[count], part[count] = b, fine / sides if sides else 1.0
                    ends[count] = t[begins[0] + q]
                count += 1
            whole = fine == sides
    return count
