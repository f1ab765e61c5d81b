"""The parts into which cells divide the bonds of one half of a family, for each place of a node in its cell."""

from __future__ import annotations

from math import lcm
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.bond_division import Part, divided

SIDES = 4  # of a bond along an edge between cells


class Divisions(NamedTuple):
    """The p parts of k bonds from the 8 places of a node in its cell, x fastest.

    Those of bond k from place f, on one side, are first[f, k, side] to first[f, k, side + 1]. Places where parts begin
    and end are whole multiples of h / unit.
    """

    first: NDArray[np.int64]  # (8, k, 5)
    t: NDArray[np.float64]  # (p, 2) shares of the bond where it begins and ends
    cell: NDArray[np.int64]  # (p, 3) the cell it is in, from the node's own
    at: NDArray[np.int64]  # (p, 2, 3) h / unit, where it begins and ends, from the corner of the node's cell
    unit: int


def divisions(ways: NDArray[np.int64]) -> Divisions:
    """The parts of the bonds `ways` (k, 3)."""
    first = np.zeros((8, len(ways), SIDES + 1), dtype=np.int64)
    found: list[Part] = []
    ends: list[list[list[float]]] = []
    unit = lcm(*range(1, int(np.abs(ways).max(initial=1)) + 1))
    for f in range(8):
        place = f % 2, f // 2 % 2, f // 4
        for k, way in enumerate(map(tuple, ways.tolist())):
            first[f, k] = len(found)
            for side, parts in enumerate(divided(place, way)):
                for part in parts:
                    found.append(part)
                    ends.append([[x + t * dx for x, dx in zip(place, way, strict=True)] for t in part[:2]])
                first[f, k, side + 1 :] = len(found)
    t = np.array([part[:2] for part in found])
    at = np.rint(unit * np.array(ends)).astype(np.int64)
    return Divisions(first, t, np.array([part.cell for part in found], dtype=np.int64), at, unit)
