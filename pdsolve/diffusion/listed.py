"""Bonds in a list, for any nodes, and for bonds that depend on both of their ends."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Self

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.fused import fused
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.diffusion.families import Grouped
from pdsolve.lattice.bond import IN_PLACE
from pdsolve.numerics.thread_team import share

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class BondList:
    """Exchange along listed bonds between nodes with these volumes `volume` (n,), m^d."""

    name = "listed"

    def __init__(self, bonds: Grouped, volume: NDArray[np.float64], threads: int) -> None:
        self.bonds, self.volume, self.threads = bonds, volume, threads
        ends = bonds.first[bonds.start].astype(np.int64)
        self.count = ends[1:] - ends[:-1]
        self.total = np.zeros(len(volume))
        self._share(_pull, (volume, np.ones(len(volume)), np.zeros(len(volume))), self.total)

    def part(self, first: int, last: int, begin: int, end: int) -> Self:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours."""
        start, groups = self.bonds.start, slice(*self.bonds.start[[first, last]].tolist())
        ends = self.bonds.first[groups.start : groups.stop + 1]
        bonds = Grouped(
            np.clip(start[begin : end + 1], groups.start, groups.stop) - groups.start,
            ends - ends[0],
            self.bonds.neighbour[ends[0] : ends[-1]] - np.uint32(begin),
            self.bonds.conductance[groups],
        )
        part = copy(self)
        BondList.__init__(part, bonds, self.volume[begin:end], 1)
        return part

    def _share(self, kernel, of, out) -> None:  # type: ignore[no-untyped-def]
        share(lambda first, last: kernel(self.bonds, of, out, first, last), len(self.volume), self.threads)

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        self._share(_pull, (self.volume * potential, potential, self.total), out)

    def dissolve(
        self,
        concentration: NDArray[np.float64],
        solid: NDArray[np.uint8],
        C_sat: float,
        k_diss: float,
        out: NDArray[np.float64],
    ) -> None:
        """Add the rates (n,) of dissolution to `out`.

        Bonds from solid to liquid have `k_diss` times their conductance, and only while the liquid is below `C_sat`;
        bonds between solid nodes have none.
        """
        self._share(_dissolve, (self.volume, concentration, solid, C_sat, k_diss), out)

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        from scipy.sparse import csr_array  # here, as it takes long to import

        _, first, neighbour, conductance = self.bonds
        nodes = np.arange(len(self.volume))
        alike = (first[1:] - first[:-1]).astype(np.int64)
        values = np.repeat(conductance, alike) * self.volume[neighbour]
        values = np.concatenate([values, -self.total])
        row, column = np.concatenate([np.repeat(nodes, self.count), nodes]), np.concatenate([neighbour, nodes])
        return csr_array((values, (row, column)), shape=(len(nodes), len(nodes)))

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Sum over bonds of the differences of `share` (n,), weighted by conductance and both volumes, m^d/s."""
        out = np.zeros(len(share))
        self._share(_differ, (self.volume, share), out)
        return float((out * self.volume).sum())


class ChangedBonds(BondList):
    """Exchange along what is added to conductances: few bonds, none like another."""

    def __init__(
        self,
        source: NDArray[np.int64],
        target: NDArray[np.int64],
        conductance: NDArray[np.float64],
        volume: NDArray[np.float64],
        threads: int,
    ) -> None:
        """What is added to the `conductance` (b,) of bonds, which are sorted by source."""
        start, group_first = (
            np.searchsorted(source, np.arange(len(volume) + 1)),
            np.arange(len(source) + 1).astype(np.uint32),
        )
        super().__init__(Grouped(start, group_first, target.astype(np.uint32), conductance), volume, threads)

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        self._share(_add, (self.volume, potential), out)


compiled = partial(cached_njit, nogil=True, error_model="numpy", fastmath={"contract"})


@compiled()
def _pull(bonds, of, out, first, last):  # type: ignore[no-untyped-def]
    amount, potential, total = of
    for i in range(first, last):
        t = 0.0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            b, end = bonds.first[k], bonds.first[k + 1]
            first_sum = second_sum = 0.0  # two sums, as adding to one has to wait for the last
            while b + 2 <= end:
                first_sum += amount[bonds.neighbour[b]]
                second_sum += amount[bonds.neighbour[b + 1]]
                b += 2
            if b < end:
                first_sum += amount[bonds.neighbour[b]]
            t += bonds.conductance[k] * (first_sum + second_sum)
        out[i] += t - total[i] * potential[i]


@register_jitable(**IN_PLACE)
def flux(g, V, node_potential, neighbour_potential, t):  # type: ignore[no-untyped-def]
    """t and what a bond of conductance g to a node of volume V adds to it, from the potentials of both ends."""
    return fused(g * V, neighbour_potential - node_potential, t)


@compiled()
def _add(bonds, of, out, first, last):  # type: ignore[no-untyped-def]
    volume, potential = of
    for i in range(first, last):
        t = 0.0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            t = flux(bonds.conductance[k], volume[j], potential[i], potential[j], t)
        out[i] += t


@compiled()
def _differ(bonds, of, out, first, last):  # type: ignore[no-untyped-def]
    volume, share = of
    for i in range(first, last):
        t = 0.0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            s = 0.0
            for b in range(bonds.first[k], bonds.first[k + 1]):
                j = bonds.neighbour[b]
                s += volume[j] * abs(share[j] - share[i])
            t += bonds.conductance[k] * s
        out[i] = t


@compiled()
def _dissolve(bonds, of, out, first, last):  # type: ignore[no-untyped-def]
    volume, concentration, solid, C_sat, k_diss = of
    for i in range(first, last):
        t, mine, is_solid = 0.0, concentration[i], solid[i]
        for k in range(bonds.start[i], bonds.start[i + 1]):
            s = 0.0
            for b in range(bonds.first[k], bonds.first[k + 1]):
                j = bonds.neighbour[b]
                neighbour_content = concentration[j]
                factor = 0.0
                if is_solid != solid[j]:
                    factor = k_diss if (neighbour_content if is_solid else mine) < C_sat else 0.0
                elif not is_solid:
                    factor = 1.0
                s += factor * volume[j] * (neighbour_content - mine)
            t += bonds.conductance[k] * s
        out[i] += t
