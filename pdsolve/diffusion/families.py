"""Bonds between nodes and their conductances.

The conductance of a bond is k beta / |xi|^q, with the micro-diffusivity k that gives a lattice the medium's
diffusivity, Hu's beta (families extend half a spacing beyond the horizon), and the mean of both ends' horizons. Between
two media, D is the harmonic mean, which makes the flux continuous across their interface. Nodes in one row are a bar,
as thick as its cells are long.

Constants after F. Bobaru, M. Duangpanya, Int. J. Heat Mass Transf. 53 (2010) 4047-4059, for q = 2; those of q = 0 and 1
follow in the same way, from D = sum(k |xi|^(2 - q) V) / (2 d).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import hu_beta, offsets
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, Pairs, chosen, lengths, row_chunks
from pdmesh.model.visibility import sight_of
from pdsolve.diffusion.walls import Array
from pdsolve.lattice.flux_operator import FluxesInList, FluxesInTiles
from pdsolve.lattice.sites import Sites, place_nodes
from pdsolve.lattice.tile_bonds import bits_of_pairs, remove_separated_bonds
from pdsolve.laws.bond_arrays import Links
from pdsolve.model import Model

SHORT = 8  # ways to the farthest neighbour: rows shorter than that lie along the longest axis
CONSTANTS = {1: (3.0, 2.0, 1.0), 2: (8 / np.pi, 6 / np.pi, 4 / np.pi), 3: (7.5 / np.pi, 6 / np.pi, 4.5 / np.pi)}


def extended(model: Model) -> list[int]:
    """Axes along which nodes extend; the first for a single node."""
    return np.flatnonzero(np.ptp(model.grid.position, axis=0) > 0).tolist() or [0]


def diffusivities(model: Model) -> Array:
    """The diffusivity of each node (n,), m^2/s."""
    assert model.settings.medium is not None
    diffusivity = np.full(len(model.grid), model.settings.medium.D)
    for region in model.settings.media:
        diffusivity[model.selected(region)] = region.D
    return diffusivity


def shape(length: Array, reach: Array, delta: Array, dimension: int, power: int) -> Array:
    """Uncalibrated conductance (b,) for D = 1 of neighbours at `length` with cells of size `delta`; in m."""
    k = CONSTANTS[dimension][power] / reach ** (dimension + 2 - power)
    return np.asarray(k * hu_beta(length, reach, delta) / length**power)


@lru_cache
def moment(order: int, ratio: float, dimension: int, power: int) -> float:
    """Sum of uncalibrated conductance (D = 1) times length to the power `order` over a family of a unit lattice."""
    steps = range(-int(ratio + 0.5) - 1, int(ratio + 0.5) + 2)
    length = np.linalg.norm(np.array([at for at in product(steps, repeat=dimension) if any(at)], dtype=float), axis=1)
    ones = np.ones(len(length))
    return float((shape(length, ratio * ones, ones, dimension, power) * length**order).sum())


def lattice_diffusivity(ratio: float, dimension: int, power: int) -> float:
    """Diffusivity of a full lattice of this horizon over spacing, relative to that of the continuum."""
    return moment(2, ratio, dimension, power) / (2 * dimension)


class DiffusionFamilies:
    """Bonds of the nodes of a model. Raises GridError for an invalid outline."""

    def __init__(self, model: Model) -> None:
        assert model.settings.medium is not None
        grid = model.grid
        self.model, self.dimension = model, len(extended(model))
        self.power = model.settings.medium.power
        self.diffusivity, self.horizon = diffusivities(model), model.horizons
        self.delta, self.reach = grid.delta, self.horizon + grid.delta / 2
        self.position = grid.position[:, extended(model)]
        self.sight = sight_of(grid, model.name)
        self.neighbours = Neighbours(grid.position, grid.delta, self.reach, mutual=True)
        self.lattice_share = lattice_diffusivity(model.settings.horizon.ratio, self.dimension, self.power)

    @property
    def crossing(self) -> float:
        """Value of `contrast` for a unit of surface of a solid, m/s: the mean over all directions, for a full family.

        The mean projection of a bond of length |xi| across a surface is 2/pi of it in the plane and 1/2 in space.
        """
        medium, d = self.model.settings.medium, self.dimension
        assert medium is not None
        across = {1: 1.0, 2: 2 / np.pi, 3: 0.5}[d] * moment(1, self.model.settings.horizon.ratio, d, self.power)
        return across * medium.D / self.lattice_share / float(self.delta.min())

    def conductance(self, pairs: Pairs) -> Array:
        """Conductance (b,) of pairs, 1/(s m^d); 0 beyond the horizon."""
        i, j, length = pairs
        delta, reach = self.delta, (self.horizon[i] + self.horizon[j]) / 2
        across = delta ** (self.model.grid.dimension - self.dimension)
        both = [shape(length, reach, delta[end], self.dimension, self.power) / across[end] for end in (i, j)]
        D_i, D_j = self.diffusivity[i], self.diffusivity[j]
        return np.asarray((both[0] + both[1]) / self.lattice_share * D_i * D_j / (D_i + D_j))

    def part(self, rows: NDArray[np.int64]) -> tuple[Pairs, Array, NDArray[np.int64]]:
        """Bonds (b,) of some increasing rows, their conductances (b,), and the rows of nodes that each bond blocked by
        a crack is of."""
        pairs = self.neighbours.pairs(rows)
        conductance = self.conductance(pairs)
        within_horizon = conductance > ROUND_OFF * conductance.max(initial=0.0)
        pairs, conductance = chosen(pairs, within_horizon), conductance[within_horizon]
        is_bond = self.sight.inside(pairs)
        blocked = is_bond & self.sight.cut(pairs)
        is_bond &= ~blocked
        return chosen(pairs, is_bond), conductance[is_bond], pairs.source[blocked]

    def of(self, rows: NDArray[np.int64]) -> tuple[Pairs, Array]:
        """Bonds (b,) of some increasing rows, and their conductances (b,)."""
        return self.part(rows)[:2]

    def in_list(self, volume: Array, threads: int) -> tuple[FluxesInList, NDArray[np.int64]]:
        """Fluxes along listed bonds between nodes with the `volume` (n,), m^d, and the number (n,) of bonds of each
        node that a crack blocks."""
        nodes = len(self.delta)
        counts, blocked = np.zeros((2, nodes), dtype=np.int64)
        neighbours, conductances = [], []
        for pairs, conductance, hidden in (self.part(rows) for rows in row_chunks(nodes)):
            counts += np.bincount(pairs.source, minlength=nodes)
            blocked += np.bincount(hidden, minlength=nodes)
            neighbours.append(pairs.target.astype(np.int32))
            conductances.append(conductance)
        links = Links(np.concatenate([[0], np.cumsum(counts)]), np.concatenate(neighbours))
        return FluxesInList(links, np.concatenate(conductances), volume, threads), blocked

    def in_tiles(self, volume: Array, threads: int) -> tuple[FluxesInTiles, NDArray[np.int64]] | None:
        """Fluxes in tiles, and the blocked bonds of each node (n,); None unless the nodes are on one lattice."""
        spacing, D = float(self.delta[0]), self.diffusivity
        if (self.delta != spacing).any():
            return None
        placed = place_bonds(self.position, spacing, *self.full_family(spacing, float(D[0])))
        if placed is None:
            return None
        sites, conductance = placed
        bits = bits_of_pairs(sites)
        blocked = remove_separated_bonds(sites, bits, self.sight)
        return FluxesInTiles(sites, bits, conductance, volume, threads, D / D[0]), blocked

    def full_family(self, spacing: float, D: float) -> tuple[NDArray[np.int64], Array]:
        """Offsets (k, d) and conductances (k,) of the bonds of a node with a full family."""
        ratio = self.model.settings.horizon.ratio
        steps = offsets(ratio + 0.5, self.dimension)
        reach, delta = np.full((2, len(steps)), spacing)
        conductance = shape(lengths(steps * spacing), ratio * reach, delta, self.dimension, self.power)
        conductance *= D / self.lattice_share / spacing ** (self.model.grid.dimension - self.dimension)
        within_horizon = conductance > ROUND_OFF * conductance.max()
        return np.rint(steps[within_horizon]).astype(np.int64), conductance[within_horizon]


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
