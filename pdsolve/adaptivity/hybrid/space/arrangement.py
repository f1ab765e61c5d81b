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
from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.space_lattice.kernel import VOLUME, Tiles, stiffness
from pdsolve.operators.space_lattice.vectors import INVERSE

PARTS = 8  # of a bond, more than there are
ENDS = 4  # coarse nodes that an end moves with, at most


class Fine(NamedTuple):
    """The constant arrays of the fine lattice of a whole body."""

    box: Box
    tiles: Tiles  # with all bonds that are intact, those in coarse cells too
    divisions: Divisions  # of the upper half of the offsets
    reach: int  # spacings, along an axis
    cube: float  # h^3, m^3


class Pieces(NamedTuple):
    """The p pieces of clipped bonds, in the order of their owners."""

    owner: NDArray[np.int32]  # (p,) site of the bond's lower node
    kind: NDArray[np.int32]  # (p,) alike for pieces with the same ends, seen from the owner
    site: NDArray[np.int32]  # (p, 8) fine sites that move its two ends, four each
    k: NDArray[np.float64]  # (p,) stiffness, N/m
    breaks: NDArray[np.float64]  # (p,) 0 if its bond never breaks, else 1


def pieces_of(count: int) -> Pieces:
    """Room for so many pieces."""
    ends, (k, breaks) = np.empty((count, 2 * ENDS), np.int32), np.empty((2, count))
    return Pieces(np.empty(count, np.int32), np.empty(count, np.int32), ends, k, breaks)


class Groups(NamedTuple):
    """The g groups of pieces of one kind."""

    start: NDArray[np.int64]  # (g + 1,) of each one's pieces
    ends: NDArray[np.int64]  # (g, 2) nodes that move each end
    w: NDArray[np.float64]  # (g, 8) with these weights
    xi: NDArray[np.float64]  # (g, 4) xi, m, 1 / |xi|^2


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
def arrange(fine, cells, bits, some, pieces, scratch):  # type: ignore[no-untyped-def]
    """Set the bits of the whole bonds of nodes at the sites `some`, which are in order, and list their pieces.

    Bonds are those of which a node is the lower end. Returns the number of pieces; those for which there is no room are
    only counted. `scratch` is (4,).
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
                made = _divide(fine, cells, (site, x, y, z), k, sides, pieces, made, scratch)
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
def _divide(fine, cells, own, k, sides, pieces, made, w):  # type: ignore[no-untyped-def]
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
                    pieces.owner[made], first_site, last_site = site, pieces.site[made, :ENDS], pieces.site[made, ENDS:]
                    one = _set_end(box, cells, of, own, site, (begin, 0), first_site, w)
                    other = _set_end(box, cells, of, own, site + tiles.offsets[slot], (part - 1, 1), last_site, w)
                    pieces.kind[made] = ((begin * PARTS + part - 1 - begin) * 2 + one) * 2 + other
                    pieces.k[made] = _stiffness(fine, site, slot) / (sides * length)
                    i, j = tiles.node[site], tiles.node[site + tiles.offsets[slot]]
                    pieces.breaks[made] = 0.0 if tiles.held[i] or tiles.held[j] else 1.0
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
def _set_end(box, cells, of, own, node, end, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) of one end of a piece: `node`, or where the part of the bond `end` begins (., 0)
    or ends (., 1). Returns whether it is a free node."""
    (part, which), (_, x, y, z) = end, own
    if of.whole[part, which]:
        return carried(box, cells, node, sites, w)
    at, beyond = of.corner[part, which], of.w[part, which]
    _between(box, (x >> 1) + at[0], (y >> 1) + at[1], (z >> 1) + at[2], (beyond[0], beyond[1], beyond[2]), sites, w)
    return False


@cached_njit(error_model="numpy")
def describe(fine, cells, pieces, order, groups):  # type: ignore[no-untyped-def]
    """Fill in what the pieces of each group, in this `order` (p,), have in common."""
    of, sites, half = fine.divisions, np.empty(ENDS, np.int32), len(fine.tiles.offsets) // 2
    for g in range(len(groups.ends)):
        n = order[groups.start[g]]
        site, kind = np.int64(pieces.owner[n]), np.int64(pieces.kind[n]) // 4
        begin, last = kind // PARTS, kind // PARTS + kind % PARTS
        x, y, z = fine_at(fine.box, site)
        place, k = x % 2 + 2 * (y % 2) + 4 * (z % 2), np.int64(0)
        while of.first[place, k, SIDES] <= begin:
            k += 1
        own, row = (site, x, y, z), fine.tiles.table[half + k]
        other = site + fine.tiles.offsets[half + k]
        _set_end(fine.box, cells, of, own, site, (begin, 0), sites, groups.w[g, :ENDS])
        _set_end(fine.box, cells, of, own, other, (last, 1), sites, groups.w[g, ENDS:])
        length = of.t[last, 1] - of.t[begin, 0]
        for axis in range(3):
            groups.xi[g, axis] = length * row[axis]
        groups.xi[g, 3] = row[INVERSE] / length**2
        for end in range(2):
            groups.ends[g, end] = 0
            for m in range(ENDS):
                groups.ends[g, end] += groups.w[g, ENDS * end + m] > 0


def grouped(fine: Fine, cells: NDArray[np.uint8], pieces: Pieces) -> tuple[NDArray[np.int64], Groups]:
    """The order (p,) of pieces by their kind, and their groups."""
    order = np.argsort(pieces.kind, kind="stable")
    kind = pieces.kind[order]
    first = np.flatnonzero(np.diff(kind, prepend=-1))
    start, count = np.append(first, len(kind)), len(first)
    groups = Groups(start, np.zeros((count, 2), np.int64), np.zeros((count, 2 * ENDS)), np.zeros((count, 4)))
    describe(fine, cells, pieces, order, groups)
    return order, groups


@njit(**INNER)
def carried(box, cells, node, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) by which a fine node moves; returns whether it is free."""
    x, y, z = fine_at(box, node)
    free = kind_of(box, cells, x, y, z) == FREE
    if free:
        for n in range(ENDS):
            sites[n], w[n] = node, 0.0
        w[0] = 1.0
    else:
        _between(box, x >> 1, y >> 1, z >> 1, (0.5 * (x % 2), 0.5 * (y % 2), 0.5 * (z % 2)), sites, w)
    return free


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
def carriers(box, cells, some, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (b, 4) by which fine nodes on the border, at the sites `some` (b,), move."""
    for n in range(len(some)):
        carried(box, cells, some[n], sites[n], w[n])


@cached_njit(error_model="numpy")
def gather_volumes(fine, kind, some, volume):  # type: ignore[no-untyped-def]
    """Fill the volumes (k,), m^3, of coarse nodes at the fine sites `some`: their shares of all fine nodes that are
    not free."""
    box, tiles = fine.box, fine.tiles
    for n in range(len(some)):
        x, y, z = fine_at(box, some[n])
        volume[n] = 0.0
        for dz in range(max(z - 1, 0), min(z + 2, box.sz)):
            for dy in range(max(y - 1, 0), min(y + 2, box.sy)):
                for dx in range(max(x - 1, 0), min(x + 2, box.sx)):
                    site = fine_site(box, dx, dy, dz)
                    if tiles.node[site] >= 0 and kind[site] != FREE:
                        share = 0.5 ** (abs(dx - x) + abs(dy - y) + abs(dz - z))
                        volume[n] += share * fine.cube * tiles.cells[VOLUME, tiles.margin + site]


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
    "Groups",
    "Pieces",
    "arrange",
    "carriers",
    "classify",
    "count_bonds",
    "gather_volumes",
    "grouped",
    "interpolate",
    "list_bonds",
    "pieces_of",
]
