"""Families on a cubic lattice, tile by tile: which sites have a neighbour at each offset, and sums over them.

No bond is listed. Symbols as in `Tiles`: t tiles of 16 sites, k offsets.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.tiles import ALIKE, CORRECTED, EMPTY, GENERAL, stiffness
from pdsolve.operators.space_lattice.sites import Sites, strides_of

FULL = np.uint16(2**ROW - 1)  # bits of a slot that all lanes have


def members(sites: Sites) -> NDArray[np.uint16]:
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


def counts(bits: NDArray[np.uint16], sites: Sites) -> NDArray[np.int64]:
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
def kinds(node, bits, steps, margin, corrected, general, kind):  # type: ignore[no-untyped-def]
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
def whole(bits, kind, which):  # type: ignore[no-untyped-def]
    """Fill the mask (t,) of tiles all of whose bonds are there and of one stiffness for each offset."""
    for t in range(len(bits)):
        which[t] = kind[t] == ALIKE
        for slot in range(bits.shape[1]):
            which[t] &= bits[t, slot] == FULL


@cached_njit(error_model="numpy")
def sum_bonds(tiles, weights, tile_numbers, sums):  # type: ignore[no-untyped-def]
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
