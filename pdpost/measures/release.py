"""What cracks spend on their way: the dissipation of the ledger over the length of all cracks, beside G0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdpost.measures.speed import WINDOW
from pdpost.measures.tips import Branch
from pdpost.reading.embedded import read
from pdsolve.results import Results


class Release(NamedTuple):
    """Energy released over crack advance, dD/da, at k entries of the ledger while cracks grew."""

    time: NDArray[np.float64]  # (k,) s
    length: NDArray[np.float64]  # (k,) m, of all cracks together
    value: NDArray[np.float64]  # (k,) J/m^2, over ten spacings of length; NaN nearer to either end than five
    G0: float  # J/m^2, of the plate's own material

    def at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same (t,) at other times (t,), s; NaN where no crack grows."""
        known = np.isfinite(self.value)
        if not known.any():
            return np.full(len(time), np.nan)
        return np.asarray(np.interp(time, self.time[known], self.value[known], left=np.nan, right=np.nan))


class _Plate(msgspec.Struct):
    """What is read of the grid file."""

    material: Material


def release(results: Results, branches: Sequence[Branch]) -> Release:
    """dD/da of a run: of the dissipated energy of its ledger, over the length of all `branches` together."""
    books = results.history()
    return over_length(books["time"], books["dissipated"], branches, read(results, _Plate).material.G0)


def over_length(
    time: NDArray[np.float64], spent: NDArray[np.float64], branches: Sequence[Branch], G0: float
) -> Release:
    """dD/da: D the energy `spent` (t,) at times (t,), s, a the length of all `branches` together, whichever grows."""
    length = np.sum([_reached(branch, time) for branch in branches], axis=0) if branches else np.zeros(len(time))
    grew = np.flatnonzero(np.diff(length) > 0)
    if not len(grew):
        return Release(time[:0], time[:0], time[:0], G0)
    span = slice(int(grew[0]), int(grew[-1]) + 2)
    time, length, spent = time[span], length[span], spent[span]
    unique, which = np.unique(length, return_inverse=True)
    mean = np.bincount(which, spent) / np.bincount(which)  # of the entries while it waited
    half = WINDOW / 2 * max(float(branch.spacing.max()) for branch in branches)
    ends = np.array([length - half, length + half])
    within = (ends[0] >= unique[0]) & (ends[1] <= unique[-1])
    value = np.where(within, np.diff(np.interp(ends, unique, mean), axis=0)[0] / (2 * half), np.nan)
    return Release(time, length, value, G0)


def _reached(branch: Branch, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Its own length (t,) at times (t,), m; where several points are of one time, the last counts."""
    keep = np.append(np.diff(branch.time) > 0, True)
    at, far = branch.time[keep], branch.along[keep] - branch.along[0]
    if at[0] > branch.time[0]:
        at, far = np.insert(at, 0, branch.time[0]), np.insert(far, 0, 0.0)
    return np.asarray(np.interp(time, at, far))
