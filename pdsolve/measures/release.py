"""Energy spent by cracks: dissipation in the ledger over the length of all cracks, relative to G0.

A crack is as long as its cracked nodes. Where bonds soften before they break, a crack spends part of its energy ahead
of its tip, and some before it exists. While its softening zone shrinks, it spends less on its advance than it costs.
The ratio of total energy to total length is therefore given too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdsolve.measures.balance import damped_energy
from pdsolve.measures.embedded_model import at_rest, read
from pdsolve.measures.speed import WINDOW
from pdsolve.measures.tips import CrackBranch
from pdsolve.results import Results


class EnergyRelease(NamedTuple):
    """Energy released over crack advance, dD/da, at k ledger entries while cracks grew."""

    time: NDArray[np.float64]  # (k,) s
    crack_length: NDArray[np.float64]  # (k,) m, of all cracks together
    release_rate: NDArray[np.float64]  # (k,) J/m^2, over ten spacings of length; NaN nearer to either end than five
    G0: float  # J/m^2, of the plate's own material
    dissipated_before_growth: float = (
        0.0  # J/m, spent when the cracks began to grow: by what softens ahead of a crack to be
    )
    overall_release_rate: float = float("nan")  # J/m^2, all that was spent until they grew last over their length

    def release_rate_at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """The energy release dD/da (t,) at times (t,), s, in J/m^2; NaN where no crack grows."""
        finite = np.isfinite(self.release_rate)
        if not finite.any():
            return np.full(len(time), np.nan)
        return np.asarray(np.interp(time, self.time[finite], self.release_rate[finite], left=np.nan, right=np.nan))


class _FractureEnergyGridFileKeys(msgspec.Struct):
    """The keys of the grid file that the energy release needs."""

    material: Material


def measure_energy_release(results: Results, branches: Sequence[CrackBranch]) -> EnergyRelease:
    """dD/da of a run, where a is the length of all `branches` together.

    D is the dissipated energy of the ledger; at rest it includes the energy that the plate releases on the way to rest.
    """
    energy_balance = results.history()
    spent = energy_balance["dissipated"] + (np.nan_to_num(damped_energy(energy_balance)) if at_rest(results) else 0.0)
    return energy_release_over_crack_length(
        energy_balance["time"], spent, branches, read(results, _FractureEnergyGridFileKeys).material.G0
    )


def energy_release_over_crack_length(
    time: NDArray[np.float64], dissipated: NDArray[np.float64], branches: Sequence[CrackBranch], G0: float
) -> EnergyRelease:
    """dD/da, where D is the energy `dissipated` (t,) at times (t,), s, and a the length of all `branches` together."""
    lengths = [np.zeros(len(time))]
    for branch in branches:
        last = np.append(np.diff(branch.passing_time) > 0, True)  # of several points at one time, the last counts
        at, far = branch.passing_time[last], branch.length_along_crack[last] - branch.length_along_crack[0]
        if at[0] > branch.passing_time[0]:
            at, far = np.insert(at, 0, branch.passing_time[0]), np.insert(far, 0, 0.0)
        lengths.append(np.interp(time, at, far))
    length = np.sum(lengths, axis=0)
    grew = np.flatnonzero(np.diff(length) > 0)
    if not len(grew):
        return EnergyRelease(time[:0], time[:0], time[:0], G0)
    span = slice(int(grew[0]), int(grew[-1]) + 2)
    time, length, dissipated = time[span], length[span], dissipated[span]
    unique, which = np.unique(length, return_inverse=True)
    mean = np.bincount(which, dissipated) / np.bincount(which)  # of the entries while it waited
    half = WINDOW / 2 * max(float(branch.node_spacing.max()) for branch in branches)
    ends = np.array([length - half, length + half])
    within = (ends[0] >= unique[0]) & (ends[1] <= unique[-1])
    value = np.where(within, np.diff(np.interp(ends, unique, mean), axis=0)[0] / (2 * half), np.nan)
    return EnergyRelease(time, length, value, G0, float(dissipated[0]), float(dissipated[-1] / length[-1]))
