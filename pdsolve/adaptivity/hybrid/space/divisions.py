"""The parts into which cells divide the bonds of one half of a family, for each place of a node in its cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.bond_division import Part, divided, on_cells

SIDES = 4  # of a bond along an edge between cells


class Divisions(NamedTuple):
    """The p parts of k bonds from the 8 places of a node in its cell, x fastest.

    Those of bond k from place f, on one side, are first[f, k, side] to first[f, k, side + 1].
    """

    first: NDArray[np.int64]  # (8, k, 5)
    t: NDArray[np.float64]  # (p, 2) shares of the bond where it begins and ends
    cell: NDArray[np.int64]  # (p, 3) the cell it is in, from the node's own
    whole: NDArray[np.bool_]  # (p, 2) whether it begins or ends with the bond
    corner: NDArray[np.int64]  # (p, 2, 3) where it begins and ends: lowest coarse node around, from the cell's corner
    w: NDArray[np.float64]  # (p, 2, 3) how far beyond that, in cells


def divisions(ways: NDArray[np.int64]) -> Divisions:
    """The parts of the bonds `ways` (k, 3)."""
    first = np.zeros((8, len(ways), SIDES + 1), dtype=np.int64)
    found: list[Part] = []
    ends: list[list[list[tuple[int, float]]]] = []
    for f in range(8):
        place = f % 2, f // 2 % 2, f // 4
        for k, way in enumerate(map(tuple, ways.tolist())):
            first[f, k] = len(found)
            for side, parts in enumerate(divided(place, way)):
                for part in parts:
                    found.append(part)
                    points = [[on_cells((x + t * dx) / 2) for x, dx in zip(place, way, strict=True)] for t in part[:2]]
                    ends.append(points)
                first[f, k, side + 1 :] = len(found)
    t = np.array([part[:2] for part in found])
    where = np.array(ends)
    return Divisions(
        first,
        t,
        np.array([part.cell for part in found], dtype=np.int64),
        t == np.array([0.0, 1.0]),
        where[..., 0].astype(np.int64),
        where[..., 1],
    )
