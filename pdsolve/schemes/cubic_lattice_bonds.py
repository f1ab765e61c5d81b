"""The symmetric bonds of a body on one cubic lattice, in tiles; no bond is listed.

The bonds are those of `pdsolve.schemes.average_horizon`. On a lattice they depend on the offset between two nodes, on
their cells and materials and on their surface corrections. The sums over families are passes over the offsets. Only
pairs near cracks and concave surfaces are looked at one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs, lengths
from pdsolve.bonds.assembly import FamilyCounts
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice import tile_bonds
from pdsolve.lattice.sites import Sites, sites_of
from pdsolve.lattice.tile_bonds import INVERSE, PULL, SAME, Springs
from pdsolve.lattice.tiles import EMPTY, Tiles
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.schemes.average_horizon import Rule, shares

TOGETHER = 4096  # tiles whose sums are made at once


class Tiled(NamedTuple):
    """The bonds of n nodes in tiles."""

    tiles: Tiles
    sites: Sites
    counted: FamilyCounts
    stiffness_bound: NDArray[np.float64]  # (n,) N/m^4, see `pdsolve.operators.protocol`


def tiled(model: Model, kind: type[np.floating], unbreakable: bool = False) -> Tiled | None:
    """The bonds of a body in precision `kind`; None where tiles cannot be."""
    law = law_of(model)
    if law.pair is None:
        return None
    if model.grid.fields or model.settings.interfaces:
        return None
    if law.pair.is_curved and (law.pair.elastic_in_compression or model.varies):
        return None
    if model.materials[0].detour is not None and len(model.grid.cracks):
        return None
    sites = sites_of(model.grid, model.settings.horizon.ratio + 0.5)
    if sites is None:
        return None
    rule = Rule(model)
    sites_and_springs = _springs(model, rule, sites, unbreakable)
    if sites_and_springs is None:
        return None
    sites, springs = sites_and_springs
    bits = tile_bonds.bits_of_pairs(sites)
    cut = tile_bonds.remove_separated_bonds(sites, bits, rule.sight)
    if not bits.any():
        return None
    count = tile_bonds.count_bonds(bits, sites)
    tiles = tile_bonds.tiles_of(law, sites, bits, springs)
    squared = 1 / tiles.vectors[:, INVERSE]
    n = tiles.vectors[:, :3] / np.sqrt(squared)[:, None]
    for rows, bond_energy in _in_parts(tiles, sites, shares(n) * squared[:, None] / 2):  # surface corrections
        tiles.c[:, sites.site[rows]] = rule.lack_in_space(rows, bond_energy.reshape(-1, 3, 3)).T
    tile_bonds.classify_tiles(tiles)
    # The largest eigenvalue of the sum of k n n^T over a node's bonds; see `stiffness_bound` of lists
    n = tiles.vectors[:, :3] * np.sqrt(tiles.vectors[:, INVERSE])[:, None]
    weights = (n[:, :, None] * n[:, None, :]).reshape(-1, 9)
    inner = np.einsum("k,kp->p", tiles.vectors[:, PULL], weights)
    stiffness_bound = np.full(len(sites.site), float(np.linalg.eigvalsh(inner.reshape(3, 3))[-1]))
    for rows, sums in _in_parts(tiles, sites, weights):
        stiffness_bound[rows] = np.linalg.eigvalsh(sums.reshape(-1, 3, 3))[:, -1]
    family = count + cut if cut.any() else count
    return Tiled(tile_bonds.in_precision(tiles, kind), sites, FamilyCounts(rule.area, family, count), stiffness_bound)


def _springs(model: Model, rule: Rule, sites: Sites, unbreakable: bool) -> tuple[Sites, Springs] | None:
    """The bonds' constants, and the sites with those offsets alone that have bonds; None where materials'
    stiffness falls differently with distance."""
    number = model.material_of
    which, first = np.unique(number, return_index=True)
    count, h = len(which), sites.spacing
    length = lengths(sites.ways * h)
    i, j = (first[ends.ravel()] for ends in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    pairs = Pairs(np.repeat(i, len(length)), np.repeat(j, len(length)), np.tile(length, count**2))
    modulus, peak, limit = (array.reshape(count, count, -1) for array in rule.constants(pairs))
    has_bond = modulus[0, 0] > 0
    if not has_bond.any() or ((modulus > 0) != has_bond).any():
        return None
    sites = sites._replace(ways=sites.ways[has_bond])
    modulus = modulus[..., has_bond]
    peak = peak[..., has_bond]
    limit = limit[..., has_bond]
    ratio = modulus[:, :, 0] / modulus[0, 0, 0]
    half = ratio.diagonal() / 2
    if (np.abs(modulus - ratio[..., None] * modulus[0, 0]) > SAME * modulus).any():
        return None
    if (np.abs(ratio - half[:, None] - half) > SAME * ratio).any():
        return None
    if unbreakable:
        peak[:] = limit[:] = np.inf
    material = np.searchsorted(which, number)
    of_nodes = rule.area / h**3, half[material], rule.held, material.astype(np.uint8)
    stretches = (np.ascontiguousarray(array.reshape(count**2, -1)) for array in (peak, limit))
    return sites, Springs(modulus[0, 0] * h**3, *of_nodes, *stretches)


def _in_parts(
    tiles: Tiles, sites: Sites, weights: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Rows (r,) of nodes and their sums (r, p) of stiffness over length times `weights` (k, p), some at a time; those
    of whole tiles, which are all alike, are left out."""
    full_tiles = np.zeros(sites.tiles, dtype=np.bool_)
    tile_bonds.mark_whole_tiles(tiles.bits, tiles.kind, full_tiles)
    rest = np.flatnonzero(~full_tiles & (tiles.kind != EMPTY))
    for begin in range(0, len(rest), TOGETHER):
        tile_numbers = rest[begin : begin + TOGETHER]
        sums = np.empty((ROW * len(tile_numbers), weights.shape[1]))
        tile_bonds.sum_weighted_bonds(tiles, weights, tile_numbers, sums)
        rows = tiles.node.reshape(-1, ROW)[tile_numbers].ravel().astype(np.int64)
        yield rows[rows >= 0], sums[rows >= 0]
