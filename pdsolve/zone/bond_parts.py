"""The parts into which cells divide the bonds of a fine lattice, in the plane and in space.

A bond along a line or a face between cells belongs in equal shares to all sides on which there are cells.
"""

from __future__ import annotations

from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.zone.cells import EMPTY, FINE, VOID, add_step, cell_at, cell_corner, place_number_at, vectorize_over_axes

WORD = 64  # bits
ROUND_OFF = 1e-9  # of 2 h: places this near to a line between cells are on it


class BondPartsInCells(NamedTuple):
    """The p parts of k bonds from each of the 2^d positions of their node in its cell, x fastest.

    Those of bond k from position f, on one side, are bounds[f, k, side] to bounds[f, k, side + 1].
    """

    part_bounds_of_sides: NDArray[np.int64]  # (2^d, k, 2^(d - 1) + 1)
    begin_and_end_shares: NDArray[np.float64]  # (p, 2) shares of the bond where a part begins and ends
    cell_offset: NDArray[np.int64]  # (p, d) the cell it is in, from the node's own
    end_cells: NDArray[np.int64]  # (p, 2, d) where it begins and ends: a cell, from the node's own
    end_shares_of_cell: NDArray[np.float64]  # (p, 2, d) and how far beyond its lowest corner, over 2 h
    side_cell_bits: NDArray[np.uint64]  # (2^d, k, 2^(d - 1), w) bits of the cells that the bond passes on a side
    # of the cells around a node along an axis: the lowest (2,), by the node's position there, and how many
    lowest_cell_offset: NDArray[np.int64]
    cells_around_per_axis: int


def divide_bonds_at_cell_borders(offsets: NDArray[np.int64]) -> BondPartsInCells:
    """The parts of the bonds `offsets` (k, d), in spacings."""
    (count, d), reach = offsets.shape, np.abs(offsets).max(initial=1)
    lowest = (np.arange(2) - reach) // 2
    wide = int(((np.arange(2) + reach) // 2 - lowest).max()) + 1
    bounds = np.zeros((2**d, count, 2 ** (d - 1) + 1), dtype=np.int64)
    bits = np.zeros((2**d, count, 2 ** (d - 1), -(-(wide**d) // WORD)), dtype=np.uint64)
    shares, cells, ends = list[tuple[float, float]](), list[tuple[int, ...]](), list[list[list[float]]]()
    for position, (k, xi) in product(range(2**d), enumerate(offsets.tolist())):
        x = cell_corner((0,) * d, position)
        bounds[position, k] = len(cells)
        crossings = {0.0, 1.0}
        for start, step in zip(x, xi, strict=True):
            low, high = sorted((start, start + step))
            crossing = ((line - start) / step for line in range(low + low % 2, high + 1, 2) if step)
            crossings |= {share for share in crossing if 0 < share < 1}
        # the directions from a bond to its cells: both across each line or face between cells that it lies in
        across = ((-0.5, 0.5) if step == 0 and start == 0 else (0.0,) for start, step in zip(x, xi, strict=True))
        for side, off in enumerate(product(*across)):
            for begin, end in pairwise(sorted(crossings)):
                middle = (begin + end) / 2
                cell = tuple(int((start + middle * step + s) // 2) for start, step, s in zip(x, xi, off, strict=True))
                shares.append((begin, end))
                cells.append(cell)
                ends.append([[start + t * step for start, step in zip(x, xi, strict=True)] for t in (begin, end)])
                steps = (along - lowest[start] for along, start in zip(cell, x, strict=True))
                word, bit = divmod(int(sum(step * wide**axis for axis, step in enumerate(steps))), WORD)
                bits[position, k, side, word] |= np.uint64(1 << bit)
            bounds[position, k, side + 1 :] = len(cells)
    at = np.array(ends) / 2
    end_cells = np.floor(at + ROUND_OFF)
    beyond = at - end_cells
    beyond[np.abs(beyond) < ROUND_OFF] = 0.0
    return BondPartsInCells(
        bounds, np.array(shares), np.array(cells), end_cells.astype(np.int64), beyond, bits, lowest, wide
    )


# The lowest of the cells around fine node x (d,), of which `BondPartsInCells` has bits
lowest_cell_around = vectorize_over_axes(lambda along, axis, lowest_offset: (along >> 1) + lowest_offset[along & 1])


@njit(forceinline=True, **INNER)
def next_parts_outside_coarse_cells(numbering, cell_kinds, bond_parts, x, part, last, passes_void):  # type: ignore[no-untyped-def]
    """The next parts of a bond of fine node x (d,), of those from `part` to `last` - 1, that lie in a row outside
    coarse cells: the first, and one after the last, which are equal if there are none.

    Bonds pass through fine and empty cells, and through void ones if it `passes_void`. `numbering` is that of cells.
    """
    begin = end = last
    for n in range(part, last):
        kind = cell_kinds[place_number_at(numbering, add_step(cell_at(x), bond_parts.cell_offset[n]))]
        passes = kind in (FINE, EMPTY) or (passes_void and kind == VOID)
        if passes and begin == last:
            begin = n
        elif not passes and begin < last:
            end = n
            break
    return begin, end
