"""What the processor allows: a lean loop of as many vector operations as the force of a bond takes."""

from __future__ import annotations

import time

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.timing import least, timed

OPERATIONS = 19  # of a bond that is hardly stretched: 2 for eta, 4 for e, 2 to look at it, 5 for g, 6 for the force
LANES, TIMES, ROUNDS = 512, 20_000, 9


@njit(fastmath={"contract"})
def _operate(values, factor, times):  # type: ignore[no-untyped-def]
    """Multiply and add `OPERATIONS` times each, which is one operation of a vector; all that is needed is at hand."""
    for _ in range(times):
        part = len(values) // 4
        for lane in range(part):  # four at a time, as an operation takes four cycles and two begin in each
            a, b, c, d = values[lane], values[lane + part], values[lane + 2 * part], values[lane + 3 * part]
            for _ in range(OPERATIONS):
                a, b, c, d = a * factor + factor, b * factor + factor, c * factor + factor, d * factor + factor
            values[lane], values[lane + part], values[lane + 2 * part], values[lane + 3 * part] = a, b, c, d


def ns_per_bond(precision: str) -> float:
    """ns for the vector operations of one bond, on one thread; the least of some."""
    values: NDArray[np.floating] = np.zeros(LANES, dtype=precision)
    factor = values.dtype.type(0.5)
    _operate(values, factor, 1)
    best = least({"": lambda: timed(lambda: _operate(values, factor, TIMES), time.perf_counter)}, ROUNDS)
    return 1e9 * best[""] / (LANES * TIMES)
