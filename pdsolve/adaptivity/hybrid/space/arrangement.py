"""What follows from the cells: kinds of nodes, the bits of whole bonds, and the pieces of others.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, as in the plane. An end in a
fine cell is a node; one on the border moves with the coarse nodes around it, at most four. Bonds between cells belong
in equal shares to their sides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.box import (
    BORDER,
    COARSE,
    FINE,
    FREE,
    VOID,
    Box,
    cell_place,
    fine_at,
    fine_site,
    kind_of,
    touches,
)
from pdsolve.adaptivity.hybrid.space.divisions import SIDES, Divisions
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.space_slots import INVERSE
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.operators.space_lattice.kernel import VOLUME, Tiles, pair_number, stiffness

PARTS = 8  # of a bond, more than there are
ENDS = 4  # coarse nodes that an end moves with, at most


class Fine(NamedTuple):
    """The constant arrays of the fine lattice of a whole body."""

    box: Box
    tiles: Tiles  # with all bonds that are intact, those in coarse cells too
    divisions: Divisions  # of the upper half of the offsets
    reach: int  # spacings, along an axis
    cube: float  # h^3, m^3
    weakness: NDArray[np.float64]  # (p,) of pairs of materials: least e at which bonds break over theirs


class Pieces(NamedTuple):
    """The p pieces of clipped bonds, in the order of their owners."""

    owner: NDArray[np.int32]  # (p,) site of the bond's lower node
    kind: NDArray[np.int32]  # (p,) alike for pieces with the same xi
    ends: NDArray[np.int64]  # (p, 2) places of its ends; see `place_of`
    k: NDArray[np.float64]  # (p,) stiffness, N/m
    breaks: NDArray[np.float64]  # (p,) least e at which bonds break over that of its own; 0 if it never breaks


def pieces_of(count: int) -> Pieces:
    """Room for so many pieces."""
    k, breaks = np.empty((2, count))
    return Pieces(np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 2), np.int64), k, breaks)


class Points(NamedTuple):
    """The q places at which pieces end, in the order in which pieces name them: nodes, or places on the border."""

    number: NDArray[np.int64]  # (q,) nodes that move it
    site: NDArray[np.int32]  # (q, 4) their fine sites
    w: NDArray[np.float64]  # (q, 4) their weights


@cached_njit(error_model="numpy")
def classify(box, node, cells, some, kind, above):  # type: ignore[no-untyped-def]
    """Set, for `some` sites, the `kind` of the fine node there, and whether a coarse node is `above` it."""
    for site in some:
        if node[site] < 0:
            continue
        x, y, z = fine_at(box, site)
        kind[site] = kind_of(box, cells, x, y, z)
        above[site] = (x | y | z) % 2 == 0 and touches(box, cells, x, y, z, COARSE)


@njit(**INNER)
def _around(box, cells, x, y, z, reach):  # type: ignore[no-untyped-def]
    """The kind of all cells that bonds of a fine node can pass through; VOID for several kinds."""
    found = cells[cell_place(box, x >> 1, y >> 1, z >> 1)]
    for cz in range((z - reach) >> 1, ((z + reach) >> 1) + 1):
        for cy in range((y - reach) >> 1, ((y + reach) >> 1) + 1):
            for cx in range((x - reach) >> 1, ((x + reach) >> 1) + 1):
                if cells[cell_place(box, cx, cy, cz)] != found:
                    return np.uint8(VOID)
    return found


@njit(forceinline=True, **INNER)
def _cell(box, cells, of, part, x, y, z):  # type: ignore[no-untyped-def]
    """The kind of the cell of a part of a bond of fine node (x, y, z)."""
    return cells[cell_place(box, (x >> 1) + of.cell[part, 0], (y >> 1) + of.cell[part, 1], (z >> 1) + of.cell[part, 2])]


@njit(**INNER)
def _sides(box, cells, of, first, x, y, z):  # type: ignore[no-untyped-def]
    """Number of sides of a bond with cells, and of those where all cells are fine."""
    sides = whole = 0
    for side in range(SIDES):
        some, all_fine = False, True
        for part in range(first[side], first[side + 1]):
            kind = _cell(box, cells, of, part, x, y, z)
            some |= kind != VOID
            all_fine &= kind != COARSE
        sides += some
        whole += some and all_fine
    return sides, whole


@cached_njit(error_model="numpy")
def arrange(fine, cells, bits, some, pieces):  # type: ignore[no-untyped-def]
    """Set the bits of the whole bonds of nodes at the sites `some`, which are in order, and list their pieces.

    Bonds are those of which a node is the lower end. Returns the number of pieces; those for which there is no room are
    only counted.
    """
    box, tiles, of, half, made = fine.box, fine.tiles, fine.divisions, len(fine.tiles.offsets) // 2, 0
    for site in some:
        if tiles.node[site] < 0:
            continue
        x, y, z = fine_at(box, site)
        around = _around(box, cells, x, y, z, fine.reach)
        if around == COARSE:
            continue
        tile, lane, place = site // ROW, np.uint16(site % ROW), x % 2 + 2 * (y % 2) + 4 * (z % 2)
        for k in range(half):
            slot = half + k
            if not (tiles.bits[tile, slot] >> lane) & np.uint16(1):
                continue
            first, sides, whole = of.first[place, k], 1, 1
            if around != FINE:
                sides, whole = _sides(box, cells, of, first, x, y, z)
            _set_bit(bits, site, site + tiles.offsets[slot], slot, whole == sides)
            if whole < sides:
                made = _divide(fine, cells, (site, x, y, z), k, sides, pieces, made)
    return made


@njit(**INNER)
def _set_bit(bits, site, other, slot, there):  # type: ignore[no-untyped-def]
    """Set both directions of a bond."""
    last = bits.shape[1] - 1
    for own, number in ((site, slot), (other, last - slot)):
        bit = np.uint16(1) << np.uint16(own % ROW)
        if there:
            bits[own // ROW, number] |= bit
        else:
            bits[own // ROW, number] &= ~bit


@njit(**INNER)
def _divide(fine, cells, own, k, sides, pieces, made):  # type: ignore[no-untyped-def]
    """List the pieces of a bond; returns how many there are then."""
    box, tiles, of, (site, x, y, z) = fine.box, fine.tiles, fine.divisions, own
    slot, first = len(tiles.offsets) // 2 + k, of.first[x % 2 + 2 * (y % 2) + 4 * (z % 2), k]
    for side in range(SIDES):
        some = False
        for part in range(first[side], first[side + 1]):
            some |= _cell(box, cells, of, part, x, y, z) != VOID
        part, last = first[side], first[side + 1]
        while some and part < last:
            begin = part
            while part < last and _cell(box, cells, of, part, x, y, z) != COARSE:
                part += 1
            if part > begin:
                if made < len(pieces.owner):
                    length = of.t[part - 1, 1] - of.t[begin, 0]
                    pieces.owner[made], pieces.kind[made] = site, begin * PARTS + part - 1 - begin
                    pieces.ends[made, 0] = _place_of(box, of, own, begin, 0)
                    pieces.ends[made, 1] = _place_of(box, of, own, part - 1, 1)
                    pieces.k[made] = _stiffness(fine, site, slot) / (sides * length)
                    i, j = tiles.node[site], tiles.node[site + tiles.offsets[slot]]
                    pieces.breaks[made] = (
                        0.0 if tiles.held[i] or tiles.held[j] else fine.weakness[pair_number(tiles, i, j)]
                    )
                made += 1
            part += 1
    return made


@njit(**INNER)
def _stiffness(fine, site, slot):  # type: ignore[no-untyped-def]
    """The stiffness of a whole bond, N/m."""
    tiles = fine.tiles
    at = tiles.margin + site
    w = stiffness(tiles, tiles.table[slot], site // ROW, at, tiles.offsets[slot])
    return tiles.cells[VOLUME, at] * fine.cube * w


@njit(**INNER)
def _place_of(box, of, own, part, which):  # type: ignore[no-untyped-def]
    """The place where a part of a node's bond begins, 0, or ends, 1: a number that counts h / unit, x fastest."""
    at, (_, x, y, z), unit = of.at[part, which], own, of.unit
    wide, high = unit * (box.sx + 1), unit * (box.sy + 1)
    place = (unit * (z - z % 2) + at[2]) * high + unit * (y - y % 2) + at[1]
    return place * wide + unit * (x - x % 2) + at[0]


@cached_njit(error_model="numpy")
def number_places(places, size, numbers, found):  # type: ignore[no-untyped-def]
    """Number the distinct ones of the `places` (p, 2) as they come: the `numbers` (p, 2) and the places `found` (q,).

    `size` is a power of two above 2 p. Returns q.
    """
    count, mask, key, number = 0, np.uint64(size - 1), np.full(size, -1, np.int64), np.empty(size, np.int32)
    for n in range(len(places)):
        for end in range(2):
            place = places[n, end]
            at = (np.uint64(place) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(20) & mask
            while key[at] not in (-1, place):
                at = (at + np.uint64(1)) & mask
            if key[at] < 0:
                key[at], number[at], found[count] = place, count, place
                count += 1
            numbers[n, end] = number[at]
    return count


@cached_njit(error_model="numpy")
def carry_places(fine, kind, places, points):  # type: ignore[no-untyped-def]
    """Fill in what moves the `places` (q,)."""
    box, unit = fine.box, fine.divisions.unit
    wide, high, cell = unit * (box.sx + 1), unit * (box.sy + 1), 2 * unit
    for n in range(len(places)):
        x, y, z = places[n] % wide, places[n] // wide % high, places[n] // (wide * high)
        sites, w = points.site[n], points.w[n]
        node = fine_site(box, x // unit, y // unit, z // unit)
        if x % unit == 0 and y % unit == 0 and z % unit == 0 and kind[node] == FREE:
            _alone(node, sites, w)
        else:
            beyond = (x % cell / cell, y % cell / cell, z % cell / cell)
            _between(box, x // cell, y // cell, z // cell, beyond, sites, w)
        points.number[n] = 0
        for m in range(ENDS):
            points.number[n] += w[m] > 0


def ended(fine: Fine, kind: NDArray[np.uint8], pieces: Pieces) -> tuple[NDArray[np.int32], Points]:
    """The numbers (p, 2) of the points at which pieces end, and these points; `kind` is of fine nodes."""
    count = len(pieces.owner)
    numbers, found = np.zeros((count, 2), dtype=np.int32), np.zeros(2 * count, dtype=np.int64)
    found = found[: number_places(pieces.ends, 1 << (2 * count).bit_length(), numbers, found)]
    points = Points(
        np.zeros(len(found), np.int64), np.zeros((len(found), ENDS), np.int32), np.zeros((len(found), ENDS))
    )
    carry_places(fine, kind, found, points)
    return numbers, points


def directed(fine: Fine, pieces: Pieces) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The directions (p,) of pieces, and xi, m, and 1 / |xi|^2 of each direction (g, 4)."""
    of, table, half = fine.divisions, fine.tiles.table, len(fine.tiles.offsets) // 2
    number = np.zeros(PARTS * len(of.t), dtype=np.int32)
    number[pieces.kind] = 1
    there = np.flatnonzero(number)
    number[there] = np.arange(len(there))
    begin = there // PARTS
    length = of.t[begin + there % PARTS, 1] - of.t[begin, 0]
    bond = np.searchsorted(of.first[:, :, 0].ravel(), begin, side="right") - 1
    row = table[half + bond % of.first.shape[1]].astype(np.float64)
    return number[pieces.kind], np.column_stack([length[:, None] * row[:, :3], row[:, INVERSE] / length**2])


@njit(**INNER)
def _alone(node, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) of a node."""
    for n in range(ENDS):
        sites[n], w[n] = node, 0.0
    w[0] = 1.0


@njit(**INNER)
def _between(box, x, y, z, beyond, sites, w):  # type: ignore[no-untyped-def]
    """Fill sites and weights (4,) of a place on the border, `beyond` the coarse node (X, Y, Z)."""
    count = 0
    for dz in range(2):
        for dy in range(2):
            for dx in range(2):
                share = beyond[0] if dx else 1 - beyond[0]
                share *= beyond[1] if dy else 1 - beyond[1]
                share *= beyond[2] if dz else 1 - beyond[2]
                if share > 0 and count < ENDS:
                    sites[count], w[count] = fine_site(box, 2 * (x + dx), 2 * (y + dy), 2 * (z + dz)), share
                    count += 1
    for n in range(count, ENDS):
        sites[n], w[n] = sites[0], 0.0


@cached_njit(error_model="numpy")
def carriers(box, some, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (b, 4) by which fine nodes on the border, at the sites `some` (b,), move."""
    for n in range(len(some)):
        x, y, z = fine_at(box, some[n])
        _between(box, x >> 1, y >> 1, z >> 1, (0.5 * (x % 2), 0.5 * (y % 2), 0.5 * (z % 2)), sites[n], w[n])


@cached_njit(error_model="numpy")
def gather(fine, kind, some, own, found):  # type: ignore[no-untyped-def]
    """Fill in what is `found` (k,) of coarse nodes at the fine sites `some`: their shares of what is the `own` (sites,)
    of all fine nodes that are not free."""
    box, tiles = fine.box, fine.tiles
    for n in range(len(some)):
        x, y, z = fine_at(box, some[n])
        found[n] = 0.0
        for dz in range(max(z - 1, 0), min(z + 2, box.sz)):
            for dy in range(max(y - 1, 0), min(y + 2, box.sy)):
                for dx in range(max(x - 1, 0), min(x + 2, box.sx)):
                    site = fine_site(box, dx, dy, dz)
                    if tiles.node[site] >= 0 and kind[site] != FREE:
                        share = 0.5 ** (abs(dx - x) + abs(dy - y) + abs(dz - z))
                        found[n] += share * own[site]


@cached_njit(error_model="numpy")
def interpolate(box, known, row, value, some, found):  # type: ignore[no-untyped-def]
    """Fill `found` (k, 3) with the values of fine nodes at the sites `some`, from `value` (n, 3) of nodes.

    Nodes that were there before are those with a `row` (sites,) of at least 0; others lie in coarse cells.
    """
    sites, w = known
    for n in range(len(some)):
        if row[some[n]] >= 0:
            for axis in range(3):
                found[n, axis] = value[row[some[n]], axis]
            continue
        x, y, z = fine_at(box, some[n])
        for axis in range(3):
            found[n, axis] = 0.0
        count = 0
        for dz in range(1 + z % 2):
            for dy in range(1 + y % 2):
                for dx in range(1 + x % 2):
                    sites[count] = fine_site(box, x - x % 2 + 2 * dx, y - y % 2 + 2 * dy, z - z % 2 + 2 * dz)
                    count += 1
        for m in range(count):
            w[m] = 1.0 / count
            for axis in range(3):
                found[n, axis] += w[m] * value[row[sites[m]], axis]


@cached_njit(nogil=True, error_model="numpy")
def count_bonds(sites, row, offsets, bits):  # type: ignore[no-untyped-def]
    """Number (k,) of the bonds of nodes at these sites to nodes, which have a `row` of at least 0."""
    found = np.zeros(len(sites), dtype=np.int64)
    for n in range(len(sites)):
        tile, lane = sites[n] // ROW, np.uint16(sites[n] % ROW)
        for slot in range(len(offsets)):
            if (bits[tile, slot] >> lane) & np.uint16(1) and row[sites[n] + offsets[slot]] >= 0:
                found[n] += 1
    return found


@cached_njit(nogil=True, error_model="numpy")
def list_bonds(sites, row, offsets, bits, target):  # type: ignore[no-untyped-def]
    """Fill the rows of the targets of these bonds."""
    at = 0
    for n in range(len(sites)):
        tile, lane = sites[n] // ROW, np.uint16(sites[n] % ROW)
        for slot in range(len(offsets)):
            if (bits[tile, slot] >> lane) & np.uint16(1) and row[sites[n] + offsets[slot]] >= 0:
                target[at] = row[sites[n] + offsets[slot]]
                at += 1


__all__ = [
    "BORDER",
    "ENDS",
    "Fine",
    "Pieces",
    "Points",
    "arrange",
    "carriers",
    "classify",
    "count_bonds",
    "directed",
    "ended",
    "gather",
    "interpolate",
    "list_bonds",
    "pieces_of",
]
