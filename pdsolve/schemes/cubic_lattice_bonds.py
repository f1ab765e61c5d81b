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

from pdmesh.model.neighbours import Pairs, lengths, row_chunks
from pdmesh.model.visibility import SightInSpace
from pdsolve.bonds.assembly import Counted
from pdsolve.codegen.space_slots import INVERSE, PULL
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.operators.space_lattice import families, layout
from pdsolve.operators.space_lattice.kernel import EMPTY, Tiles
from pdsolve.operators.space_lattice.layout import SAME, Springs
from pdsolve.operators.space_lattice.sites import Sites, sites_of
from pdsolve.schemes.average_horizon import Rule, shares

TOGETHER = 4096  # tiles whose sums are made at once


class Tiled(NamedTuple):
    """The bonds of n nodes in tiles."""

    tiles: Tiles
    sites: Sites
    counted: Counted
    stiffness_bound: NDArray[np.float64]  # (n,) N/m^4, see `pdsolve.operators.protocol`


def tiled(model: Model, kind: type[np.floating], unbreakable: bool = False) -> Tiled | None:
    """The bonds of a body in precision `kind`; None where tiles cannot be."""
    law = law_of(model)
    if law.pair is None or law.pair.held is not None:
        return None
    if model.materials[0].detour is not None and len(model.grid.cracks):
        return None
    sites = sites_of(model.grid, model.settings.horizon.ratio + 0.5)
    if sites is None:
        return None
    rule = Rule(model)
    found = _springs(model, rule, sites, unbreakable)
    if found is None:
        return None
    sites, springs = found
    bits = families.members(sites)
    cut = _part(bits, sites, rule)
    if not bits.any():
        return None
    count = families.counts(bits, sites)
    tiles = layout.tiles_of(law, sites, bits, springs)
    _correct(tiles, sites, rule)
    layout.sort(tiles)
    stiffness_bound = _bound(tiles, sites)
    family = count + cut if cut.any() else count
    return Tiled(layout.in_precision(tiles, kind), sites, Counted(rule.area, family, count), stiffness_bound)


def _springs(model: Model, rule: Rule, sites: Sites, unbreakable: bool) -> tuple[Sites, Springs] | None:
    """The bonds' constants, and the sites with those offsets alone that have bonds; None where materials'
    stiffness falls differently with distance."""
    number = model.material_of
    which, first = np.unique(number, return_index=True)
    count, h = len(which), sites.spacing
    length = lengths(sites.ways * h)
    i, j = (first[ends.ravel()] for ends in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    pairs = Pairs(np.repeat(i, len(length)), np.repeat(j, len(length)), np.tile(length, count**2))
    modulus, peak, limit = (each.reshape(count, count, -1) for each in rule.constants(pairs))
    own = modulus[0, 0] > 0
    if not own.any() or ((modulus > 0) != own).any():
        return None
    sites, modulus, peak, limit = (
        sites._replace(ways=sites.ways[own]),
        modulus[..., own],
        peak[..., own],
        limit[..., own],
    )
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
    stretches = (np.ascontiguousarray(each.reshape(count**2, -1)) for each in (peak, limit))
    return sites, Springs(modulus[0, 0] * h**3, *of_nodes, *stretches)


def _part(bits: NDArray[np.uint16], sites: Sites, rule: Rule) -> NDArray[np.int64]:
    """Take out the bonds that surfaces and cracks separate; returns the number (n,) that cracks alone do."""
    assert isinstance(rule.sight, SightInSpace)
    cut, length = np.zeros(len(sites.site), dtype=np.int64), lengths(sites.ways * sites.spacing)
    if rule.sight.clear:
        return cut
    gone = []
    near = np.flatnonzero(rule.sight.near(float(length.max())))
    for some in row_chunks(len(near)):
        source, target, slot = layout.intact(sites, bits, near[some])
        pairs = Pairs(source, target, length[slot])
        inside, parted = rule.sight.inside(pairs), rule.sight.cut(pairs)
        cut += np.bincount(source[inside & parted], minlength=len(cut))
        gone.append((source[parted | ~inside], target[parted | ~inside]))
    for source, target in gone:
        layout.cleared(sites, source, target, bits)
    return cut


def _in_parts(
    tiles: Tiles, sites: Sites, weights: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Rows (r,) of nodes and their sums (r, p) of stiffness over length times `weights` (k, p), some at a time; those
    of whole tiles, which are all alike, are left out."""
    whole = np.zeros(sites.tiles, dtype=np.bool_)
    families.whole(tiles.bits, tiles.kind, whole)
    rest = np.flatnonzero(~whole & (tiles.kind != EMPTY))
    for begin in range(0, len(rest), TOGETHER):
        some = rest[begin : begin + TOGETHER]
        sums = np.empty((ROW * len(some), weights.shape[1]))
        families.sum_bonds(tiles, weights, some, sums)
        rows = tiles.node.reshape(-1, ROW)[some].ravel().astype(np.int64)
        yield rows[rows >= 0], sums[rows >= 0]


def _correct(tiles: Tiles, sites: Sites, rule: Rule) -> None:
    """Set the surface corrections of all nodes."""
    squared = 1 / tiles.table[:, INVERSE]
    n = tiles.table[:, :3] / np.sqrt(squared)[:, None]
    for rows, held in _in_parts(tiles, sites, shares(n) * squared[:, None] / 2):
        tiles.c[:, sites.site[rows]] = rule.lack_in_space(rows, held.reshape(-1, 3, 3)).T


def _bound(tiles: Tiles, sites: Sites) -> NDArray[np.float64]:
    """The largest eigenvalue (n,) of the sum of k n n^T over a node's bonds; see `stiffness_bound` of lists."""
    n = tiles.table[:, :3] * np.sqrt(tiles.table[:, INVERSE])[:, None]
    weights = (n[:, :, None] * n[:, None, :]).reshape(-1, 9)
    inner = np.einsum("k,kp->p", tiles.table[:, PULL], weights)
    found = np.full(len(sites.site), float(np.linalg.eigvalsh(inner.reshape(3, 3))[-1]))
    for rows, sums in _in_parts(tiles, sites, weights):
        found[rows] = np.linalg.eigvalsh(sums.reshape(-1, 3, 3))[:, -1]
    return found
