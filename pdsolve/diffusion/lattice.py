"""Bonds on a lattice: neighbours follow from the positions of nodes, and no bond is listed."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import offsets
from pdmesh.model.neighbours import ROUND_OFF, lengths, row_chunks
from pdsolve.codegen.vector_code import ROW
from pdsolve.diffusion.families import DiffusionFamilies, shape
from pdsolve.diffusion.listed import links_between, tangent_of
from pdsolve.diffusion.walls import Array
from pdsolve.lattice.families import sum_first_pass
from pdsolve.lattice.fluxes import FluxTiles, collect_rates, place_amounts, share_of, sort_tiles
from pdsolve.lattice.sites import Sites, place_nodes
from pdsolve.lattice.tile_bonds import bits_of_pairs, count_bonds, list_bonds, remove_separated_bonds
from pdsolve.laws.fluxes import Conduction, Contrast
from pdsolve.numerics.memory import aligned
from pdsolve.numerics.thread_team import share

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SHORT = 8  # ways to the farthest neighbour: rows shorter than that lie along the longest axis


def family(families: DiffusionFamilies, spacing: float, D: float) -> tuple[NDArray[np.int64], Array]:
    """Offsets (k, d) and conductances (k,) of the bonds of a node with a full family."""
    ratio, dimension = families.model.settings.horizon.ratio, families.dimension
    steps = offsets(ratio + 0.5, dimension)
    reach, delta = np.full((2, len(steps)), spacing)
    conductance = shape(lengths(steps * spacing), ratio * reach, delta, dimension, families.power)
    conductance *= D / families.lattice_share / spacing ** (families.model.grid.dimension - dimension)
    within_horizon = conductance > ROUND_OFF * conductance.max()
    return np.rint(steps[within_horizon]).astype(np.int64), conductance[within_horizon]


def on_lattice(families: DiffusionFamilies, volume: Array, threads: int) -> tuple[OnLattice, NDArray[np.int64]] | None:
    """Bonds of a model in tiles, and the number (n,) of each node's that cracks block; None unless its nodes are on one
    lattice."""
    grid, D = families.model.grid, families.diffusivity
    spacing = float(grid.delta[0])
    if (grid.delta != spacing).any():
        return None
    placed = place_bonds(families.position, spacing, *family(families, spacing, float(D[0])))
    if placed is None:
        return None
    sites, conductance = placed
    bits = bits_of_pairs(sites)
    blocked = remove_separated_bonds(sites, bits, families.sight)
    return OnLattice(sites, bits, conductance, volume, threads, D / D[0]), blocked


def place_bonds(
    position: Array, spacing: float, ways: NDArray[np.int64], conductance: Array
) -> tuple[Sites, Array] | None:
    """Sites of nodes (n, d), and the conductance of their `ways` in the order of sites; None if they are no lattice."""
    cells, axes = np.rint(np.ptp(position, axis=0) / spacing) + 1, np.arange(position.shape[1])
    if cells[0] < SHORT * np.abs(ways).max():
        axes = np.argsort(-cells, kind="stable")
    ways = ways[:, axes]
    sites = place_nodes(position[:, axes], spacing, ways, separate_rows=True)
    return None if sites is None else (sites, conductance[np.lexsort(ways.T)])


class OnLattice:
    """Exchange between the nodes of one lattice, the first `wanted` of which ask for their rates, by default all."""

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
        self.sites, self.volume, self.threads = sites, volume, threads
        D_of_sites = aligned(np.zeros((1, sites.size)))
        D_of_sites[0, sites.site] = D
        self.tiles = FluxTiles(
            offsets=sites.steps,
            g=conductance,
            bits=bits,
            filled=np.zeros(sites.tiles, dtype=np.bool_),
            general=np.zeros(sites.tiles, dtype=np.bool_),
            D=D_of_sites,
            margin=sites.margin,
        )
        self._rows, self._amount, self._sums = slice(0, wanted or len(volume)), *site_arrays(self.tiles)
        sort_tiles(self.tiles, np.where(sites.node < self._rows.stop, sites.node, -1))
        self.count, self.total, outflow = count_bonds(bits, sites), np.zeros(len(volume)), np.zeros(len(volume))
        self.rates(np.ones(len(volume)), outflow)
        self.total = outflow

    def part(self, first: int, last: int, begin: int, end: int) -> OnLattice:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours. It has rates alone: a tangent is asked of the whole."""
        part, tiles, rows = copy(self), self.tiles, slice(begin, end)
        site = self.sites.site[rows]
        low, high = ((int(at) - tiles.margin) // ROW for at in (site.min(), site.max() + ROW))
        filled = np.isin(np.arange(low, high), (self.sites.site[first:last] - tiles.margin) // ROW)
        node = self.sites.node[low * ROW : high * ROW]
        node = np.where((begin <= node) & (node < end), node - np.int32(begin), np.int32(-1))
        part.sites = self.sites._replace(site=site - np.int32(low * ROW), node=node)
        part.volume, part.count, part.total, part.threads = self.volume[rows], self.count[rows], self.total[rows], 1
        part.tiles = tiles._replace(
            bits=tiles.bits[low:high],
            filled=filled,
            general=tiles.general[low:high],
            D=tiles.D[:, low * ROW : high * ROW + 2 * tiles.margin],
        )
        part._rows = slice(first - begin, last - begin)
        part._amount, part._sums = site_arrays(part.tiles)
        return part

    def _sum(self, law: Conduction | Contrast, of: Array) -> None:
        """Sum what bonds bring to sites that have these values `of` (w, m)."""
        tiles, likes = self.tiles, ((0,), (), (0,), (0,) * len(of))

        def work(first: int, last: int) -> None:
            sum_first_pass(tiles, law, of, tiles.D, self._sums, likes, True, first // ROW, last // ROW)

        share(work, len(tiles.filled) * ROW, self.threads)

    def rates(self, potential: Array, out: Array) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        site, amount, sums, begin = self.sites.site, self._amount, self._sums, self._rows.start
        share(lambda *rows: place_amounts(site, potential, self.volume, amount, *rows), len(site), self.threads)
        self._sum(Conduction(self.tiles.g), amount)

        def collect(first: int, last: int) -> None:
            collect_rates(site, sums, self.total, potential, out, begin + first, begin + last)

        share(collect, self._rows.stop - begin, self.threads)

    def lacking(self, cell: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose total conductance differs from that of a full family of whole cells, m^d."""
        full = self.tiles.D[0, self.sites.site] * self.tiles.g.sum() * cell
        return np.asarray(np.abs(self.total - full) > ROUND_OFF * full)

    def of(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Sources, targets and conductances (b,) of the bonds of some rows, in order."""
        source, target, slot = list_bonds(self.sites, self.tiles.bits, rows)
        D, neighbour_D = (self.tiles.D[0, self.sites.site[end]] for end in (source, target))
        return source, target, D * self.tiles.g[slot] * share_of(D, neighbour_D)

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        bonds = [self.of(rows) for rows in row_chunks(len(self.volume))]
        source, target, conductance = (np.concatenate(column) for column in zip(*bonds, strict=True))
        return tangent_of(links_between(source, target, len(self.volume)), conductance, self.volume, self.total)

    def contrast(self, share: Array) -> float:
        """Sum over bonds of the differences of `share` (n,), weighted by conductance and both volumes, m^d/s."""
        of, site, rows = np.zeros((2, self.tiles.D.shape[1])), self.sites.site, self._rows
        of[:, site] = self.volume, share
        self._sum(Contrast(self.tiles.g), of)
        return float((self._sums[0, site[rows]] * self.volume[rows]).sum())


def site_arrays(tiles: FluxTiles) -> Iterator[Array]:
    """Two arrays (1, m) of zeros for the sites of tiles."""
    return (aligned(np.zeros(tiles.D.shape)) for _ in range(2))
