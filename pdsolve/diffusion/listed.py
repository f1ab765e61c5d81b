"""Bonds in a list, for any nodes, and for fluxes that depend on both ends of a bond."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.diffusion.walls import Array
from pdsolve.laws.bond_arrays import Links
from pdsolve.laws.fluxes import Conduction, Contrast, Dissolution
from pdsolve.numerics.thread_team import share
from pdsolve.operators.bond_list_loops import first_pass_rows_of_sums

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Values(NamedTuple):
    """What nodes have (n,), as the loops know it."""

    value: tuple[NDArray[Any], ...]


def links_between(source: NDArray[np.int64], target: NDArray[np.int64], nodes: int) -> Links:
    """Bonds (b,) between so many nodes, which are sorted by source."""
    return Links(np.searchsorted(source, np.arange(nodes + 1)), target.astype(np.int32))


class BondList:
    """Exchange along listed bonds (b,) between n nodes."""

    name = "listed"

    def __init__(self, links: Links, conductance: Array, volume: Array, threads: int) -> None:
        """Bonds with a `conductance` (b,), 1/(s m^d), of nodes with the `volume` (n,), m^d."""
        self.links, self.conductance, self.volume, self.threads = links, conductance, volume, threads
        self.count = np.diff(links.start)
        self._rows = np.flatnonzero(self.count)
        self._at = self._rows if len(self._rows) < len(volume) else slice(None)
        self.total = np.zeros(len(volume))
        self.add(Conduction(conductance), self.total, volume)

    def part(self, first: int, last: int, begin: int, end: int) -> BondList:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours."""
        start, bonds = self.links.start, slice(*self.links.start[[first, last]].tolist())
        links = Links(
            np.clip(start[begin : end + 1], bonds.start, bonds.stop) - bonds.start,
            self.links.neighbour[bonds] - np.int32(begin),
        )
        return BondList(links, self.conductance[bonds], self.volume[begin:end], 1)

    def add(self, law: Conduction | Contrast | Dissolution, out: Array, *value: NDArray[Any]) -> None:
        """Add the sums over the bonds of nodes that have these values (n,) to `out` (n,)."""
        links, values, rows, sums = self.links, Values(value), self._rows, np.empty((len(self.volume), 2))

        def work(first: int, last: int) -> None:
            first_pass_rows_of_sums(links, law, values, sums, rows, first, last)

        share(work, len(rows), self.threads)
        out[self._at] += sums[self._at, 0]

    def rates(self, potential: Array, out: Array) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        self.add(Conduction(self.conductance), out, self.volume * potential)
        out[self._at] -= self.total[self._at] * potential[self._at]

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        return tangent_of(self.links, self.conductance, self.volume, self.total)

    def contrast(self, share: Array) -> float:
        """Sum over bonds of the differences of `share` (n,), weighted by conductance and both volumes, m^d/s."""
        out = np.zeros(len(share))
        self.add(Contrast(self.conductance), out, self.volume, share)
        return float((out * self.volume).sum())


def tangent_of(links: Links, conductance: Array, volume: Array, total: Array) -> csr_array:
    """Derivative (n, n) of the rates of bonds by the potentials, 1/s, given all that leaves a node, `total` (n,)."""
    from scipy.sparse import csr_array, diags_array  # here, as it takes long to import

    start, neighbour, _ = links
    brought = csr_array((conductance * volume[neighbour], neighbour, start), shape=(len(total), len(total)))
    return csr_array(brought - diags_array(total))
