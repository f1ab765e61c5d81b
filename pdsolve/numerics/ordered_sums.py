"""Sums of values that are in pieces, to the bits of NumPy's sum of all of them.

NumPy adds up an array as a tree: one of more than LEAF values is cut near its middle, at a multiple of UNROLLED. Who
has a piece adds up the branches that are inside it; a leaf that a cut goes through is added up from its values.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAF, UNROLLED = 128, 8  # values that NumPy adds up in one loop; of which so many sums are kept


class Branches(NamedTuple):
    """Sums of what is in one piece of n values."""

    sums: dict[tuple[int, int], float]  # by the first value and the one after the last
    cut: dict[tuple[int, int], NDArray[np.float64]]  # this piece's values of leaves that are in several pieces


def branches(values: NDArray[np.float64], first: int, count: int) -> Branches:
    """The sums of `values` (k,), which are those from `first` on of `count` values."""
    branch_sums, values = Branches({}, {}), np.ascontiguousarray(values, dtype=np.float64)
    last, pending = first + len(values), [(0, count)]
    while pending:
        begin, end = pending.pop()
        if end <= first or begin >= last:
            continue
        if first <= begin and end <= last:
            branch_sums.sums[begin, end] = float(np.sum(values[begin - first : end - first]))
        elif end - begin <= LEAF:
            branch_sums.cut[begin, end] = values[max(begin - first, 0) : end - first]
        else:
            middle = _middle(begin, end)
            pending += [(begin, middle), (middle, end)]
    return branch_sums


def total(parts: Iterable[Branches], count: int) -> float:
    """The sum of `count` values from the branches of their pieces, in order."""
    every = list(parts)
    sums = {place: value for part in every for place, value in part.sums.items()}

    def summed(begin: int, end: int) -> float:
        if (begin, end) in sums:
            return sums[begin, end]
        if end - begin <= LEAF:
            return float(np.sum(np.concatenate([part.cut[begin, end] for part in every if (begin, end) in part.cut])))
        middle = _middle(begin, end)
        return summed(begin, middle) + summed(middle, end)

    return summed(0, count) if count else 0.0


def _middle(begin: int, end: int) -> int:
    half = (end - begin) // 2
    return begin + half - half % UNROLLED
