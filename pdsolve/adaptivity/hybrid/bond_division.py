"""The parts into which cells of two spacings divide a bond of a lattice, in the plane and in space.

A bond along a line or a face between cells belongs in equal shares to all sides on which there are cells.
"""

from __future__ import annotations

from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class BondPart(NamedTuple):
    """The part of a bond in one cell."""

    begin_share: float  # share of the bond's length where it begins
    end_share: float
    cell_offset: tuple[int, ...]  # from the cell of the bond's node


def divide_bond(node_position_in_cell: tuple[int, ...], xi: tuple[int, ...]) -> list[list[BondPart]]:
    """The parts of bond `xi` (d,) from a node at `node_position_in_cell` (d,), 0 or 1 along each axis; by side."""
    crossings = sorted(
        {
            0.0,
            1.0,
            *(
                share
                for x, dx in zip(node_position_in_cell, xi, strict=True)
                for share in _shares_at_cell_line_crossings(x, dx)
            ),
        }
    )
    parts_by_side = []
    # the directions from a bond to its cells: both across each line or face between cells that it lies in
    across = ((-0.5, 0.5) if dx == 0 and x == 0 else (0.0,) for x, dx in zip(node_position_in_cell, xi, strict=True))
    for side in product(*across):
        parts = []
        for t0, t1 in pairwise(crossings):
            middle = (t0 + t1) / 2
            at = (int((x + middle * dx + s) // 2) for x, dx, s in zip(node_position_in_cell, xi, side, strict=True))
            parts.append(BondPart(t0, t1, tuple(at)))
        parts_by_side.append(parts)
    return parts_by_side


def divide_family(offsets: NDArray[np.int64]) -> tuple[NDArray[np.int64], list[BondPart]]:
    """The parts of the bonds `offsets` (k, d), from each of the 2^d places of a node in its cell, x fastest.

    Those of bond k from place f, on one side, are first[f, k, side] to first[f, k, side + 1].
    """
    d = offsets.shape[1]
    first, all_parts = np.zeros((2**d, len(offsets), 2 ** (d - 1) + 1), dtype=np.int64), list[BondPart]()
    for f in range(2**d):
        for k, way in enumerate(map(tuple, offsets.tolist())):
            first[f, k] = len(all_parts)
            for side, parts in enumerate(divide_bond(node_position_in_cell(f, d), way)):
                all_parts += parts
                first[f, k, side + 1 :] = len(all_parts)
    return first, all_parts


def node_position_in_cell(position_number: int, dimension: int) -> tuple[int, ...]:
    """Where a node is in its cell, 0 or 1 along each of d axes, by the number of that place."""
    return tuple(position_number >> axis & 1 for axis in range(dimension))


def _shares_at_cell_line_crossings(start: int, step: int) -> list[float]:
    """Shares of a bond's length at which a coordinate is even."""
    if step == 0:
        return []
    low, high = sorted((start, start + step))
    shares = ((line - start) / step for line in range(low + low % 2, high + 1, 2))
    return [share for share in shares if 0 < share < 1]
