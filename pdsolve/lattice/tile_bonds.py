"""Bonds that the bits of tiles stand for: which sites have a neighbour at each offset, and what their bonds are.

No bond is listed. Symbols as in `Tiles`: t tiles of 16 sites, k offsets.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs, lengths
from pdmesh.model.visibility import BondObstacles
from pdsolve.checkpoint_validation import PendingPulls, expect_found, last_breaks
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import FIELDS, where_inverse, where_weight
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.sites import Sites, strides_of
from pdsolve.lattice.tiles import (
    ALIKE,
    CORRECTED,
    EMPTY,
    GENERAL,
    MODULUS,
    SOFTENED,
    UNBREAKABLE,
    VOLUME,
    Breaks,
    Tiles,
    select_breaks,
    stiffness,
)
from pdsolve.laws.calls import pair_of
from pdsolve.laws.law import Law
from pdsolve.laws.pair import no_bonds
from pdsolve.numerics.memory import aligned
from pdsolve.state import Broken

INVERSE, PULL, SHARES = where_inverse(3), where_weight(3), where_weight(3) + 1  # in a row of `Tiles.vectors`
SAME = 1e-11  # relative: stiffnesses this close are one
LOOKED_AT = 1024  # rows whose pairs are looked at together, some 100 bytes each
ROUNDED = 1e-5  # relative: what rounding does to e, and more
FULL = np.uint16(2**ROW - 1)  # bits of a slot that all lanes have


class Springs(NamedTuple):
    """What the bonds between n nodes on a lattice with k offsets are, but for corrections at surfaces."""

    strength: NDArray[np.float64]  # (k,) stiffness, N/m^3, between whole cells of the first material
    volume: NDArray[np.float64]  # (n,) cell over h^3
    modulus: NDArray[np.float64]  # (n,) half of the modulus over that of the first material
    held: NDArray[np.bool_]  # (n,) whose bonds must not break
    material: NDArray[np.uint8]  # (n,)
    peak: NDArray[np.float64]  # (p, k) stretches above which bonds soften; see `Tiles`
    limit: NDArray[np.float64]  # (p, k) and above which they are gone


def tiles_of(law: Law, sites: Sites, bits: NDArray[np.uint16], springs: Springs) -> Tiles:
    """The bonds of n nodes at these sites, in double precision and without corrections."""
    is_curved = law.pair is not None and law.pair.is_curved
    c, cells = (aligned(np.zeros((rows, sites.size))) for rows in (3, 3 if is_curved else 2))
    c[:, sites.site] = 1.0
    cells[VOLUME, sites.site], cells[MODULUS, sites.site] = springs.volume, springs.modulus
    if is_curved:
        cells[UNBREAKABLE, sites.site[springs.held]] = np.inf
    peak, nothing = float(springs.peak.min()), np.zeros((0, len(sites.ways), ROW))
    edge = peak * (peak + 2) * (1 - ROUNDED)
    tiles = Tiles(
        law=no_bonds(law),
        axes=(0, 0, 0),
        offsets=sites.steps.astype(np.int32),
        vectors=offset_table(sites.ways, sites.spacing, springs.strength),
        bits=bits,
        c=c,
        cells=cells,
        kind=np.zeros(sites.tiles, dtype=np.uint8),
        node=sites.node,
        unbreakable=springs.held,
        material=springs.material,
        peak=springs.peak,
        limit=springs.limit,
        memory=np.full(sites.tiles, -1, dtype=np.int32),
        share=nothing,
        worst=nothing,
        margin=sites.margin,
        floor=0.0 if law.pair is not None and law.pair.elastic_in_compression else -np.inf,
        near=min(edge, NARROW),
        edge=edge,
    )
    classify_tiles(tiles)
    return tiles


def in_precision(tiles: Tiles, kind: type[np.floating]) -> Tiles:
    """The tiles with their numbers rounded to a precision."""
    if kind is np.float64:
        return tiles
    c, cells = (aligned(array.astype(kind)) for array in (tiles.c, tiles.cells))
    return tiles._replace(vectors=tiles.vectors.astype(kind), c=c, cells=cells, share=tiles.share.astype(kind))


def with_memory(tiles: Tiles, tile_numbers: NDArray[np.int64]) -> Tiles:
    """The tiles, of which `tile_numbers` (s,) have a memory from now on."""
    used, room = int(tiles.memory.max(initial=-1)) + 1, len(tiles.share)
    if used + len(tile_numbers) > room:
        more = max(used + len(tile_numbers) - room, room // 4)
        share, worst = (
            np.concatenate([array, np.zeros((more, *array.shape[1:]), array.dtype)])
            for array in (tiles.share, tiles.worst)
        )
        tiles = tiles._replace(share=share, worst=worst)
    tiles.memory[tile_numbers] = used + np.arange(len(tile_numbers))
    tiles.kind[tile_numbers] += np.uint8(SOFTENED)
    rows, is_straight = slice(used, used + len(tile_numbers)), not pair_of(tiles.law).is_curved
    tiles.share[rows], tiles.worst[rows] = float(is_straight), 0
    return tiles


def without_memory(tiles: Tiles) -> Tiles:
    """The tiles without a memory."""
    tiles.kind[tiles.memory >= 0] -= np.uint8(SOFTENED)
    tiles.memory[:] = -1
    return tiles._replace(share=tiles.share[:0], worst=tiles.worst[:0])


def offset_table(ways: NDArray[np.int64], spacing: float, strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """`Tiles.vectors` of offsets (k, 3) whose bonds have the stiffness (k,), N/m^3."""
    xi = ways * spacing
    squared = (xi**2).sum(axis=1)
    table = np.zeros((len(ways), FIELDS))
    table[:, :3], table[:, 3:6], table[:, INVERSE] = xi, 2 * xi / squared[:, None], 1 / squared
    table[:, PULL] = strength / np.sqrt(squared)
    table[:, SHARES : SHARES + 3] = table[:, PULL, None] * xi**2 / squared[:, None] / 2
    return table


def classify_tiles(tiles: Tiles) -> None:
    """Find what the stiffnesses of each tile's bonds are made of."""
    has_node = tiles.cells[MODULUS] > 0
    corrected = (tiles.c != 1).any(axis=0) & has_node
    general = (np.abs(tiles.cells[VOLUME] - 1) > SAME) | (np.abs(tiles.cells[MODULUS] - 0.5) > SAME)
    before = [np.concatenate([[0], np.cumsum(mask, dtype=np.int32)]) for mask in (corrected, general & has_node)]
    fill_kinds(tiles.node, tiles.bits, tiles.offsets, tiles.margin, *before, tiles.kind)


def list_bonds(
    sites: Sites, bits: NDArray[np.uint16], rows: NDArray[np.int64], tile: int = 0
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Source and target rows (b,) and slots of the bonds of these rows, in order; `bits` are those from `tile` on."""
    site = sites.site[rows] - sites.margin
    is_intact = (bits[site // ROW - tile] >> (site % ROW).astype(np.uint16)[:, None]) & np.uint16(1)
    which, slot = np.nonzero(is_intact)
    source, target = rows[which], sites.node[site[which] + sites.steps[slot]].astype(np.int64)
    order = np.lexsort((target, source))
    return source[order], target[order], slot[order]


def springs_of_bonds(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64], slot: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reference vectors (b, 3), m, and force densities for a unit stretch (b,), N/m^3, of bonds that have not
    softened."""
    row, i, j = tiles.vectors[slot].astype(np.float64), sites.site[source], sites.site[target]
    c, cells = tiles.c, tiles.cells
    w = (row[:, SHARES : SHARES + 3] * (c[:, i].astype(np.float64) + c[:, j]).T).sum(axis=1)
    w *= cells[VOLUME, j].astype(np.float64) * (cells[MODULUS, i] + cells[MODULUS, j])
    return row[:, :3], w / np.sqrt(row[:, INVERSE])


def remaining_shares(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], slot: NDArray[np.int64]
) -> NDArray[np.float64]:
    """What is left (b,) of the stiffness of bonds that have softened, over the whole; 1 of others."""
    return _memories(tiles, tiles.share, sites, source, slot, np.ones(len(source)))


def largest_stretches(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], slot: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The largest stretches (b,) of bonds above their peaks, 0 if never there."""
    return _memories(tiles, tiles.worst, sites, source, slot, np.zeros(len(source)))


def curves_of_bonds(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], slot: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Peaks and limits (b,), infinite of unbreakable bonds, and largest stretches of bonds under a curved law."""
    place, never = sites.site[source], tiles.cells[UNBREAKABLE].astype(np.float64)
    beyond = never[place] + never[place + tiles.offsets[slot]]
    worst = largest_stretches(tiles, sites, source, slot)
    return tiles.peak[0, slot] + beyond, tiles.limit[0, slot] + beyond, worst


def _memories(
    tiles: Tiles,
    table: NDArray[np.floating],
    sites: Sites,
    source: NDArray[np.int64],
    slot: NDArray[np.int64],
    values: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The values (b,) of bonds in a table (r, k, 16); those that are given where a tile has no memory."""
    tile, lane = np.divmod(sites.site[source] - sites.margin, ROW)
    which = np.flatnonzero(tiles.memory[tile] >= 0)
    values[which] = table[tiles.memory[tile[which]], slot[which], lane[which]]
    return values


def find_slots(
    sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint16]]:
    """Tile, slot and bit of bonds (b,) from `source` to `target`; those of another bond for one that is none."""
    site, step = (sites.site[source] - sites.margin).astype(np.int64), sites.site[target] - sites.site[source]
    slot = np.searchsorted(sites.steps, step).clip(max=len(sites.ways) - 1)
    return site // ROW, slot, np.uint16(1) << (site % ROW).astype(np.uint16)


def remove_bonds(sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64], bits: NDArray[Any]) -> None:
    """Take bonds (b,) out of the bits (t, k). Raises CheckpointError for one that is none."""
    tile, slot, bit = find_slots(sites, source, target)
    step = sites.site[target] - sites.site[source]
    expect_found((sites.steps[slot] == step) & ((bits[tile, slot] & bit) != 0), source, target)
    np.bitwise_and.at(bits, (tile, slot), ~bit)


def remove_separated_bonds(sites: Sites, bits: NDArray[np.uint16], sight: BondObstacles) -> NDArray[np.int64]:
    """Take the bonds that surfaces and cracks separate out of the bits (t, k); returns the number (n,) of each node's
    that cracks alone do."""
    cut, length = np.zeros(len(sites.site), dtype=np.int64), lengths(sites.ways * sites.spacing)
    if sight.clear:
        return cut
    separated_pairs = []
    near = np.flatnonzero(sight.near(float(length.max())))
    for rows in np.array_split(near, 1 + len(near) // LOOKED_AT):
        source, target, slot = list_bonds(sites, bits, rows)
        pairs = Pairs(source, target, length[slot])
        inside, parted = sight.inside(pairs), sight.cut(pairs)
        cut += np.bincount(source[inside & parted], minlength=len(cut))
        separated_pairs.append((source[parted | ~inside], target[parted | ~inside]))
    for source, target in separated_pairs:
        remove_bonds(sites, source, target, bits)
    return cut


def place_pending(sites: Sites, pending: PendingPulls, broken: Broken) -> Breaks:
    """Bonds of a checkpoint that broke in the last step as the kernel has them. Raises CheckpointError."""
    (source, target, stretch), last = pending, last_breaks(broken)
    tile, slot, bit = find_slots(sites, source, target)
    broken_keys = last.source * len(sites.site) + last.target
    expect_found(np.isin(source * len(sites.site) + target, broken_keys), source, target)
    site = tile * ROW + np.log2(bit).astype(np.int64)
    bonds = np.column_stack([np.full(len(source), broken.step.max(initial=0)), source, target])
    return select_breaks(
        Breaks(np.array([len(source)]), bonds, np.column_stack([site, slot]), stretch), np.lexsort((slot, site))
    )


def with_pending(bits: NDArray[np.uint16], pending: Breaks) -> NDArray[np.uint16]:
    """A copy of bits (t, k) with bonds that pull once more."""
    copy, (site, slot) = bits.copy(), pending.places.T
    np.bitwise_or.at(copy, (site // ROW, slot), np.uint16(1) << (site % ROW).astype(np.uint16))
    return copy


def bits_of_pairs(sites: Sites) -> NDArray[np.uint16]:
    """The bits (t, k) of all pairs of nodes that are one of the offsets apart."""
    radius = int(np.abs(sites.ways).max())
    sides = np.array((*sites.sides, 1, 1)[:3])
    padded = tuple(side + 2 * radius for side in sites.sides)
    has_node = np.zeros(padded[::-1], dtype=np.bool_)
    inner = (slice(radius, -radius),) * len(sites.sides)
    has_node[inner] = (sites.node[: sides.prod()] >= 0).reshape(sites.sides[::-1])
    bits = np.zeros((sites.tiles, len(sites.ways)), dtype=np.uint16)
    stride = strides_of(padded)
    _fill(sites.node, sides, (*stride, 0, 0)[:3], radius * stride.sum(), has_node.ravel(), sites.ways @ stride, bits)
    return bits


@cached_njit(error_model="numpy")
def _fill(node, sides, stride, first, has_node, steps, bits):  # type: ignore[no-untyped-def]
    columns, rows = sides[0], sides[1]
    for site in range(len(node)):
        if node[site] < 0:
            continue
        x, y, z = site % columns, site // columns % rows, site // (columns * rows)
        padded_place = first + x * stride[0] + y * stride[1] + z * stride[2]
        tile, bit = site // ROW, np.uint16(1) << np.uint16(site % ROW)
        for slot in range(len(steps)):
            if has_node[padded_place + steps[slot]]:
                bits[tile, slot] |= bit


def count_bonds(bits: NDArray[np.uint16], sites: Sites) -> NDArray[np.int64]:
    """Number (n,) of each node's bonds."""
    bond_counts = np.zeros(len(sites.site), dtype=np.int64)
    _count(bits, sites.node, bond_counts)
    return bond_counts


@cached_njit(error_model="numpy")
def _count(bits, node, bond_counts):  # type: ignore[no-untyped-def]
    for site in range(len(node)):
        if node[site] >= 0:
            lane = np.uint16(site % ROW)
            for slot in range(bits.shape[1]):
                bond_counts[node[site]] += (bits[site // ROW, slot] >> lane) & np.uint16(1)


@cached_njit(error_model="numpy")
def fill_kinds(node, bits, steps, margin, corrected, general, kind):  # type: ignore[no-untyped-def]
    """Fill what the stiffnesses of each tile's bonds (t,) are made of, from all sites that the tile looks at.

    `corrected` and `general` (m + 1,) count the sites before each one that have a correction, and a cell or a modulus
    of their own.
    """
    for t in range(len(kind)):
        kind[t] = EMPTY
        for lane in range(ROW):
            if node[t * ROW + lane] >= 0:
                kind[t] = ALIKE
        if kind[t] != EMPTY:
            first = margin + t * ROW
            kind[t] = _kind(first, corrected, general)
            for slot in range(len(steps)):
                if bits[t, slot] != 0:
                    kind[t] = max(kind[t], _kind(first + steps[slot], corrected, general))


@njit(**INNER)
def _kind(first, corrected, general):  # type: ignore[no-untyped-def]
    """What bonds to 16 sites from `first` on are made of."""
    if general[first + ROW] > general[first]:
        return np.uint8(GENERAL)
    return np.uint8(CORRECTED if corrected[first + ROW] > corrected[first] else ALIKE)


@cached_njit(error_model="numpy")
def mark_whole_tiles(bits, kind, which):  # type: ignore[no-untyped-def]
    """Fill the mask (t,) of tiles all of whose bonds are there and of one stiffness for each offset."""
    for t in range(len(bits)):
        which[t] = kind[t] == ALIKE
        for slot in range(bits.shape[1]):
            which[t] &= bits[t, slot] == FULL


@cached_njit(error_model="numpy")
def sum_weighted_bonds(tiles, weights, tile_numbers, sums):  # type: ignore[no-untyped-def]
    """Fill the sums of stiffness over length times `weights` (k, p), (16 s, p) for the s tiles `tile_numbers`."""
    for number in range(len(tile_numbers)):
        t = tile_numbers[number]
        for lane in range(ROW):
            site = t * ROW + lane
            row = sums[number * ROW + lane]
            row[:] = 0
            if tiles.node[site] < 0:
                continue
            for slot in range(len(tiles.offsets)):
                if (tiles.bits[t, slot] >> np.uint16(lane)) & np.uint16(1):
                    w = stiffness(tiles, tiles.vectors[slot], t, tiles.margin + site, tiles.offsets[slot])
                    for p in range(weights.shape[1]):
                        row[p] += w * weights[slot, p]
