"""Links in a list: for any nodes, and where what a link does depends on what is at both ends."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.diffusion.links import Links
from pdsolve.threads import share

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Listed:
    """Exchange along listed links of nodes with these `volume` (n,), m^d."""

    name = "listed"

    def __init__(self, links: Links, volume: NDArray[np.float64], threads: int) -> None:
        self.links, self.volume, self.threads = links, volume, threads
        self.count = np.diff(links.start)
        self.total = np.zeros(len(volume))
        self._share(_pull, (volume, np.ones(len(volume)), np.zeros(len(volume))), self.total)

    def _share(self, kernel, of, out) -> None:  # type: ignore[no-untyped-def]
        share(lambda first, last: kernel(self.links, of, out, first, last), len(self.volume), self.threads)

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Put into `out` (n,) what comes to each node, per volume and time, at this `potential` (n,)."""
        self._share(_pull, (self.volume * potential, potential, self.total), out)

    def dissolve(
        self,
        concentration: NDArray[np.float64],
        solid: NDArray[np.uint8],
        C_sat: float,
        k_diss: float,
        out: NDArray[np.float64],
    ) -> None:
        """The same (n,) where links from solid to liquid are `k_diss` times as readily gone along, and only while the
        liquid holds less than `C_sat`; links between two solid nodes are not gone along."""
        self._share(_dissolve, (self.volume, concentration, solid, C_sat, k_diss), out)

    def tangent(self) -> csr_array:
        """The rates (n, n) by the potentials, 1/s."""
        from scipy.sparse import csr_array  # here, as it takes long to import

        _, neighbour, kind, table = self.links
        nodes = np.arange(len(self.volume))
        values = np.concatenate([table[kind] * self.volume[neighbour], -self.total])
        row, column = np.concatenate([np.repeat(nodes, self.count), nodes]), np.concatenate([neighbour, nodes])
        return csr_array((values, (row, column)), shape=(len(nodes), len(nodes)))

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Sum over links of what the `share` (n,) differs by, conductances and both volumes counted, m^d/s."""
        out = np.zeros(len(share))
        self._share(_differ, (self.volume, share), out)
        return float((out * self.volume).sum())


compiled = partial(njit, nogil=True, error_model="numpy", cache=True)


@compiled(fastmath={"reassoc", "contract", "nsz"})
def _pull(links, of, out, first, last):  # type: ignore[no-untyped-def]
    amount, potential, total = of
    for i in range(first, last):
        s = 0.0
        for b in range(links.start[i], links.start[i + 1]):
            s += links.table[links.kind[b]] * amount[links.neighbour[b]]
        out[i] = s - total[i] * potential[i]


@compiled()
def _differ(links, of, out, first, last):  # type: ignore[no-untyped-def]
    volume, share = of
    for i in range(first, last):
        s = 0.0
        for b in range(links.start[i], links.start[i + 1]):
            j = links.neighbour[b]
            s += links.table[links.kind[b]] * volume[j] * abs(share[j] - share[i])
        out[i] = s


@compiled()
def _dissolve(links, of, out, first, last):  # type: ignore[no-untyped-def]
    volume, concentration, solid, C_sat, k_diss = of
    for i in range(first, last):
        s, mine, here = 0.0, concentration[i], solid[i]
        for b in range(links.start[i], links.start[i + 1]):
            j = links.neighbour[b]
            other = concentration[j]
            factor = 0.0
            if here != solid[j]:
                factor = k_diss if (other if here else mine) < C_sat else 0.0
            elif not here:
                factor = 1.0
            s += factor * links.table[links.kind[b]] * volume[j] * (other - mine)
        out[i] = s
