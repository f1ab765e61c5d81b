"""Fluxes between nodes along bonds: in tiles of the sites of a lattice, or along a list for any nodes."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, row_chunks
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.families import sum_first_pass
from pdsolve.lattice.fluxes import FluxTiles, collect_rates, place_amounts, share_of, sort_tiles
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tile_bonds import count_bonds, list_bonds
from pdsolve.laws.bond_arrays import Links, Now
from pdsolve.laws.fluxes import Conduction, Contrast, Dissolution
from pdsolve.numerics.memory import aligned
from pdsolve.numerics.thread_team import share
from pdsolve.operators.bond_list_loops import first_pass_rows_of_sums

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
FluxLaw = Conduction | Contrast | Dissolution


class Fluxes:
    """Fluxes along bonds between n nodes."""

    name: str
    volume: Array  # (n,) m^d
    total: Array  # (n,) 1/s: what all bonds take out of a node for each mol/m^3
    count: NDArray[np.int64]  # (n,) bonds
    conductance: Array  # 1/(s m^d), of bonds or of offsets

    def add(self, law: FluxLaw, out: Array, *values: NDArray[Any]) -> None:
        """Add the sums over the bonds of nodes that have these values (n,) to `out` (n,)."""
        raise NotImplementedError("written for each layout")

    def listed(self) -> tuple[Links, Array]:
        """The bonds (b,) in a list, and their conductances (b,)."""
        raise NotImplementedError("written for each layout")

    def mask_partial_families(self, cell: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose total conductance may differ from that of a full family of whole cells, m^d."""
        return np.ones(len(self.volume), dtype=np.bool_)

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        from scipy.sparse import csr_array, diags_array  # here, as it takes long to import

        ((start, neighbour, _), conductance), n = self.listed(), len(self.volume)
        brought = csr_array((conductance * self.volume[neighbour], neighbour, start), shape=(n, n))
        return csr_array(brought - diags_array(self.total))

    def contrast(self, share: Array) -> float:
        """Sum over bonds of the differences of `share` (n,), weighted by conductance and both volumes, m^d/s."""
        out = np.zeros(len(share))
        self.add(Contrast(self.conductance), out, self.volume, share)
        return float((out * self.volume).sum())


class FluxesInList(Fluxes):
    """Fluxes along listed bonds (b,)."""

    name = "listed"

    def __init__(self, links: Links, conductance: Array, volume: Array, threads: int) -> None:
        """Bonds with a `conductance` (b,), 1/(s m^d), of nodes with the `volume` (n,), m^d."""
        self.links, self.conductance, self.volume, self.threads = links, conductance, volume, threads
        self.count = np.diff(links.start)
        self._rows = np.flatnonzero(self.count)
        self._at = self._rows if len(self._rows) < len(volume) else slice(None)
        self.total = np.zeros(len(volume))
        self.add(Conduction(conductance), self.total, volume)

    def part(self, first: int, last: int, begin: int, end: int) -> FluxesInList:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours."""
        start, bonds = self.links.start, slice(*self.links.start[[first, last]].tolist())
        links = Links(
            np.clip(start[begin : end + 1], bonds.start, bonds.stop) - bonds.start,
            self.links.neighbour[bonds] - np.int32(begin),
        )
        return FluxesInList(links, self.conductance[bonds], self.volume[begin:end], 1)

    def add(self, law: FluxLaw, out: Array, *values: NDArray[Any]) -> None:
        """Add the sums over the bonds of nodes that have these values (n,) to `out` (n,)."""
        links, rows, sums = self.links, self._rows, np.empty((len(self.volume), 2))
        now = Now(values, self.volume, 0, 0.0)  # type: ignore[arg-type]
        share(lambda *part: first_pass_rows_of_sums(links, law, now, sums, rows, *part), len(rows), self.threads)
        out[self._at] += sums[self._at, 0]

    def rates(self, potential: Array, out: Array) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        self.add(Conduction(self.conductance), out, self.volume * potential)
        out[self._at] -= self.total[self._at] * potential[self._at]

    def listed(self) -> tuple[Links, Array]:
        """The bonds (b,), and their conductances (b,)."""
        return self.links, self.conductance


class FluxesInTiles(Fluxes):
    """Fluxes between the nodes of one lattice, the first `wanted` of which ask for their rates, by default all."""

    name = "lattice"

    def __init__(
        self,
        sites: Sites,
        bits: NDArray[np.uint16],
        conductance: Array,
        volume: Array,
        threads: int,
        D: float | Array = 1.0,
        wanted: int | None = None,
    ) -> None:
        """`conductance` (k,) is that of each offset, and `D` (n,) the diffusivity over that of the first node."""
        self.sites, self.conductance, self.volume, self.threads = sites, conductance, volume, threads
        D_of_sites = aligned(np.zeros((1, sites.size)))
        D_of_sites[0, sites.site] = D
        filled, general = np.zeros((2, sites.tiles), dtype=np.bool_)
        self.tiles = FluxTiles(sites.steps, conductance, bits, filled, general, D_of_sites, sites.margin)
        self._rows, self._amount, self._sums = slice(0, wanted or len(volume)), *_zeros_at_sites(self.tiles)
        sort_tiles(self.tiles, np.where(sites.node < self._rows.stop, sites.node, -1))
        self.count, self.total, outflow = count_bonds(bits, sites), np.zeros(len(volume)), np.zeros(len(volume))
        self.rates(np.ones(len(volume)), outflow)
        self.total = outflow

    def part(self, first: int, last: int, begin: int, end: int) -> FluxesInTiles:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours. It has rates alone: a tangent is asked of the whole."""
        part, tiles, rows = copy(self), self.tiles, slice(begin, end)
        site = self.sites.site[rows]
        low, high = ((int(at) - tiles.margin) // ROW for at in (site.min(), site.max() + ROW))
        node = self.sites.node[low * ROW : high * ROW]
        node = np.where((begin <= node) & (node < end), node - np.int32(begin), np.int32(-1))
        part.sites = self.sites._replace(site=site - np.int32(low * ROW), node=node)
        part.volume, part.count, part.total, part.threads = self.volume[rows], self.count[rows], self.total[rows], 1
        part.tiles = tiles._replace(
            bits=tiles.bits[low:high],
            filled=np.isin(np.arange(low, high), (self.sites.site[first:last] - tiles.margin) // ROW),
            general=tiles.general[low:high],
            D=tiles.D[:, low * ROW : high * ROW + 2 * tiles.margin],
        )
        part._rows = slice(first - begin, last - begin)
        part._amount, part._sums = _zeros_at_sites(part.tiles)
        return part

    def _sum(self, law: FluxLaw, of: Array) -> None:
        """Sum what bonds bring to sites that have these values `of` (w, m)."""
        tiles, sums, likes = self.tiles, self._sums, ((0,), (), (0,), (0,) * len(of))

        def work(first: int, last: int) -> None:
            sum_first_pass(tiles, law, of, tiles.D, sums, likes, True, first // ROW, last // ROW)

        share(work, len(tiles.filled) * ROW, self.threads)

    def add(self, law: FluxLaw, out: Array, *values: NDArray[Any]) -> None:
        """Add the sums over the bonds of nodes that have these values (n,) to `out` (n,)."""
        of, site = np.zeros((len(values), self.sites.size)), self.sites.site
        of[:, site] = values
        self._sum(law, of)
        out[self._rows] += self._sums[0, site[self._rows]]

    def rates(self, potential: Array, out: Array) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        site, amount, sums, begin = self.sites.site, self._amount, self._sums, self._rows.start
        share(lambda *rows: place_amounts(site, potential, self.volume, amount, *rows), len(site), self.threads)
        self._sum(Conduction(self.conductance), amount)

        def collect(first: int, last: int) -> None:
            collect_rates(site, sums, self.total, potential, out, begin + first, begin + last)

        share(collect, self._rows.stop - begin, self.threads)

    def mask_partial_families(self, cell: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose total conductance differs from that of a full family of whole cells, m^d."""
        full = self.tiles.D[0, self.sites.site] * self.conductance.sum() * cell
        return np.asarray(np.abs(self.total - full) > ROUND_OFF * full)

    def bonds_of_rows(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Sources, targets and conductances (b,) of the bonds of these rows, in order."""
        source, target, slot = list_bonds(self.sites, self.tiles.bits, rows)
        D, neighbour_D = (self.tiles.D[0, self.sites.site[end]] for end in (source, target))
        return source, target, D * self.conductance[slot] * share_of(D, neighbour_D)

    def listed(self) -> tuple[Links, Array]:
        """The bonds (b,) in a list, and their conductances (b,)."""
        bonds = [self.bonds_of_rows(rows) for rows in row_chunks(len(self.volume))]
        source, target, conductance = (np.concatenate(column) for column in zip(*bonds, strict=True))
        return links_between(source, target, len(self.volume)), conductance


def _zeros_at_sites(tiles: FluxTiles) -> tuple[Array, Array]:
    """Two arrays (1, m) of zeros for the sites of tiles."""
    return aligned(np.zeros(tiles.D.shape)), aligned(np.zeros(tiles.D.shape))


def links_between(source: NDArray[np.int64], target: NDArray[np.int64], nodes: int) -> Links:
    """Bonds (b,) between so many nodes, which are sorted by source."""
    return Links(np.searchsorted(source, np.arange(nodes + 1)), target.astype(np.int32))
