"""An operator with corrected links near surfaces; see `surfaces`."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.diffusion.links import Links
from pdsolve.diffusion.listed import BondList, compiled
from pdsolve.diffusion.operator import Exchange
from pdsolve.diffusion.surfaces import Change
from pdsolve.numerics.thread_team import share

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Corrected:
    """An operator with changes to some of its conductances; its `contrast` is that without the changes."""

    def __init__(self, base: Exchange, change: Change, threads: int) -> None:
        self.base, self.name, self.volume, self.count = base, base.name, base.volume, base.count
        self._threads, self.change, self.contrast = threads, change, base.contrast
        self._rows, first = np.unique(change.source, return_index=True)
        self._links = np.append(first, len(change.source)), change.target, change.conductance
        weight = change.conductance * self.volume[change.target]
        self.total = base.total + np.bincount(change.source, weight, minlength=len(self.volume))

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        self.base.rates(potential, out)
        of = self._rows, self._links, self.volume, potential
        share(lambda first, last: _add(of, out, first, last), len(self._rows), self._threads)

    def dissolve(
        self,
        concentration: NDArray[np.float64],
        solid: NDArray[np.uint8],
        C_sat: float,
        k_diss: float,
        out: NDArray[np.float64],
    ) -> None:
        """Add the rates (n,) of a kinetic dissolution along listed links to `out`."""
        assert isinstance(self.base, BondList)
        self.base.dissolve(concentration, solid, C_sat, k_diss, out)
        self._listed.dissolve(concentration, solid, C_sat, k_diss, out)

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        return self.base.tangent() + self._listed.tangent()

    @cached_property
    def _listed(self) -> BondList:
        source, target, conductance = self.change[:3]
        start = np.searchsorted(source, np.arange(len(self.volume) + 1))
        each = np.arange(len(source) + 1).astype(np.uint32)
        return BondList(Links(start, each, target.astype(np.uint32), conductance), self.volume, self._threads)


@compiled()
def _add(of, out, first, last):  # type: ignore[no-untyped-def]
    rows, (start, neighbour, conductance), volume, potential = of
    for r in range(first, last):
        i, t = rows[r], 0.0
        for b in range(start[r], start[r + 1]):
            j = neighbour[b]
            t += conductance[b] * volume[j] * (potential[j] - potential[i])
        out[i] += t
