"""The parts into which cells divide the bonds of one half of a family, for each place of a node in its cell."""

from __future__ import annotations

from math import lcm
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.bond_division import divide_family, node_position_in_cell

SIDES = 4  # of a bond along an edge between cells
WORD = 64  # bits


class BondDivisions(NamedTuple):
    """The p parts of k bonds from the 8 places of a node in its cell, x fastest.

    Those of bond k from place f, on one side, are first[f, k, side] to first[f, k, side + 1]. Places where parts begin
    and end are whole multiples of h / unit.
    """

    part_bounds_of_sides: NDArray[np.int64]  # (8, k, 5)
    begin_and_end_shares: NDArray[np.float64]  # (p, 2) shares of the bond where it begins and ends
    cell_offset: NDArray[np.int64]  # (p, 3) the cell it is in, from the node's own
    part_end_position: NDArray[
        np.int64
    ]  # (p, 2, 3) h / unit, where it begins and ends, from the corner of the node's cell
    part_ends_at_node: NDArray[np.bool_]  # (p, 2) whether it begins and ends at a node
    passed_cell_bits: NDArray[
        np.uint64
    ]  # (8, k, w) bits of the cells that the bond passes, of those around its node; see `lowest_cell_offset`
    lowest_cell_offset: NDArray[
        np.int64
    ]  # (2,) the lowest of the cells around a node that is 0 or 1 from its cell's corner
    cells_around_per_axis: int  # cells around a node along an axis, x fastest
    units_per_spacing: int


def divide_half_family(ways: NDArray[np.int64]) -> BondDivisions:
    """The parts of the bonds `ways` (k, 3)."""
    first, all_parts = divide_family(ways)
    reach = int(np.abs(ways).max(initial=1))
    low = (np.arange(2) - reach) // 2
    wide = int(((np.arange(2) + reach) // 2 - low).max()) + 1
    through = np.zeros((8, len(ways), -(-(wide**3) // WORD)), dtype=np.uint64)
    ends: list[list[list[float]]] = []
    unit = lcm(*range(1, reach + 1))
    for f in range(8):
        place = node_position_in_cell(f, 3)
        for k, way in enumerate(ways.tolist()):
            for part in all_parts[first[f, k, 0] : first[f, k, -1]]:
                x, y, z = (cell - low[start] for cell, start in zip(part.cell_offset, place, strict=True))
                word, bit = divmod(int((z * wide + y) * wide + x), WORD)
                through[f, k, word] |= np.uint64(1 << bit)
                ends.append([[x + t * dx for x, dx in zip(place, way, strict=True)] for t in part[:2]])
    t = np.array([part[:2] for part in all_parts])
    at = np.rint(unit * np.array(ends)).astype(np.int64)
    node, cell = (at % unit == 0).all(axis=2), np.array([part.cell_offset for part in all_parts], dtype=np.int64)
    return BondDivisions(first, t, cell, at, node, through, low, wide, unit)
