"""Merges values that differ only by round-off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Distinct:
    """Distinct values, numbered in order of appearance; values within a share of the largest known one are equal."""

    def __init__(self, share: float) -> None:
        self._share, self._tolerance = share, 0.0
        self._order = np.zeros(0, dtype=np.int32)
        self.values = np.zeros(0)

    def numbers(self, values: NDArray[np.float64]) -> NDArray[np.int32]:
        """Numbers of `values`; new values are added."""
        if self._share > 0:
            self._tolerance = max(self._tolerance, self._share * float(np.abs(values).max(initial=0.0)))
        number, known = self._look_up(values)
        if not known.all():
            self._add(np.sort(values[~known]))
            number, known = self._look_up(values)
            assert known.all()
        return number

    def loosen(self, share: float) -> None:
        """Treat values within this share as equal from now on, if it is larger than before."""
        self._share = max(self._share, share)

    def _near(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):  # infinite less infinite
            return np.asarray((one == other) | (np.abs(one - other) <= self._tolerance))

    def _look_up(self, values: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        if not len(self.values):
            return np.zeros(len(values), dtype=np.int32), np.zeros(len(values), dtype=bool)
        ordered = self.values[self._order]
        above = np.searchsorted(ordered, values).clip(max=len(ordered) - 1)
        below = np.maximum(above - 1, 0)
        at = np.where(self._near(values, ordered[below]), below, above)
        return self._order[at], self._near(values, ordered[at])

    def _add(self, ordered: NDArray[np.float64]) -> None:
        within = 0.99 * self._tolerance
        with np.errstate(invalid="ignore"):  # infinite less infinite
            first = np.flatnonzero(np.append(True, np.diff(ordered) > within))
            last = np.append(first[1:], len(ordered)) - 1
            new = [ordered[first]]
            for chain in np.flatnonzero(ordered[last] - ordered[first] > within):
                at, end = first[chain], last[chain] + 1
                while True:  # each is as near to the first of its group as the tolerance, not to the next one only
                    at += np.searchsorted(ordered[at:end], ordered[at] + within, side="right")
                    if at == end:
                        break
                    new.append(ordered[at : at + 1])
        self.values = np.concatenate([self.values, *new])
        self._order = np.argsort(self.values).astype(np.int32)
