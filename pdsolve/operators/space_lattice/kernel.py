"""The sum over a node's bonds in space, fast: tiles of 16 sites of a cubic lattice, one after the other along x.

Layout:
    site     a place of the lattice in the box around the body, numbered with x fastest; not every one has a node
    tile     16 consecutive sites; a site's place in it is its lane
    slot     the bonds of a tile with one offset between sites: there are no lists of neighbours
    bits     of a slot, one a lane: there is a bond, and it is intact. What a lane reads over the edge of the box is
             some other site's, and does not count.

Symbols as in pdsolve.laws.law; pdsolve.laws.brittle says the same in a few lines and is what this is tested against.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice import lanes
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.space_lattice.vectors import (
    INVERSE,
    PULL,
    SCRATCH,
    SHARES,
    add_alike,
    add_alike_far,
    add_corrected,
    add_corrected_far,
    add_general,
    add_general_far,
)

EMPTY, ALIKE, CORRECTED, GENERAL = 0, 1, 2, 3  # tiles: without a node; what their bonds' stiffnesses are made of
ACROSS = lanes.across(8)  # lanes summed at once in double precision; in single precision a row
VOLUME, MODULUS = 0, 1  # rows of `cells`


class Tiles(NamedTuple):
    """Bonds of n nodes in t tiles, with k offsets; m sites, of which the first and last `margin` have no node."""

    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    table: NDArray[np.floating]  # (k, 12) xi, 2 xi / |xi|^2, 1 / |xi|^2, w = stiffness / |xi|, w n_a^2 / 2
    bits: NDArray[np.uint16]  # (t, k) lanes with an intact bond
    c: NDArray[np.floating]  # (3, m) corrections along x, y and z
    cells: NDArray[np.floating]  # (2, m) cell over h^3; half of the modulus over E
    kind: NDArray[np.uint8]  # (t,) EMPTY to GENERAL
    node: NDArray[np.int32]  # (16 t,) row of a site's node, or -1
    held: NDArray[np.bool_]  # (n,) whose bonds must not break
    margin: int
    near: float  # |e| up to which no bond breaks and the polynomial holds
    limit: float  # stretch at which bonds break


class Breaks(NamedTuple):
    """Room for what breaks."""

    used: NDArray[np.int64]  # (1,) bonds
    ends: NDArray[np.int32]  # (., 2) rows of source and target


@cached_njit(nogil=True)
def place_rows(site, value, u, first, last):  # type: ignore[no-untyped-def]
    """Displacements (n, 3) of the rows `first` to `last` - 1 to their sites, u (3, m)."""
    for i in range(first, last):
        for axis in range(3):
            u[axis, site[i]] = value[i, axis]


@cached_njit(nogil=True, error_model="numpy")
def sum_tiles(tiles, u, rate, dt, out, dissipated, breaks, first, last):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles `first` to `last` - 1 to `out` (n, 3); bonds over their limit break.

    Returns the tile that there was no room left to write breaks of, or `last`.
    """
    s, count = np.empty(SCRATCH, u.dtype), len(tiles.offsets)
    near = u.dtype.type(tiles.near)
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        if breaks.used[0] + ROW * count > len(breaks.ends):
            return t
        for lane in range(0, ROW, _across(s)):
            _sum_lanes(tiles, u, rate, dt, dissipated, breaks, near, t, lane, s)
            for k in range(_across(s)):
                i = tiles.node[t * ROW + lane + k]
                if i >= 0:
                    for axis in range(3):
                        out[i, axis] += s[ROW * axis + k]
    return last


@njit(**INNER)
def _across(s):  # type: ignore[no-untyped-def]
    return ACROSS if s.itemsize == 8 else ROW


@njit(**INNER)
def _sum_lanes(tiles, u, rate, dt, dissipated, breaks, near, t, lane, s):  # type: ignore[no-untyped-def]
    """Force densities on some lanes of a tile, from `lane` on, at the beginning of s."""
    for k in range(SCRATCH):
        s[k] = 0
    offsets, table, bits, c, cells, count = (
        tiles.offsets,
        tiles.table,
        tiles.bits,
        tiles.c,
        tiles.cells,
        len(tiles.offsets),
    )
    own, slot, kind = tiles.margin + t * ROW + lane, 0, tiles.kind[t]
    while True:
        if kind == ALIKE:
            slot = add_alike(u, offsets, table, bits, c, cells, near, slot, count, t, own, lane, count, s)
        elif kind == CORRECTED:
            slot = add_corrected(u, offsets, table, bits, c, cells, near, slot, count, t, own, lane, count, s)
        else:
            slot = add_general(u, offsets, table, bits, c, cells, near, slot, count, t, own, lane, count, s)
        if slot == count:
            return
        _break_slot(tiles, u, rate, dt, dissipated, breaks, t, lane, slot, _across(s))
        if kind == ALIKE:
            slot = add_alike_far(u, offsets, table, bits, c, cells, near, slot, slot + 1, t, own, lane, count, s)
        elif kind == CORRECTED:
            slot = add_corrected_far(u, offsets, table, bits, c, cells, near, slot, slot + 1, t, own, lane, count, s)
        else:
            slot = add_general_far(u, offsets, table, bits, c, cells, near, slot, slot + 1, t, own, lane, count, s)


@njit(**INNER)
def _break_slot(tiles, u, rate, dt, dissipated, breaks, t, lane, slot, across):  # type: ignore[no-untyped-def]
    """Take out the bonds of a slot that are over their limit, and book what they have spent."""
    row, offset, word = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot]
    for k in range(lane, lane + across):
        if not (word >> np.uint16(k)) & np.uint16(1):
            continue
        site = t * ROW + k
        i, j = tiles.node[site], tiles.node[site + offset]
        own = tiles.margin + site
        x, y, z = _relative(u, own, offset)
        stretch = _stretch(row, x, y, z)
        if stretch <= tiles.limit or tiles.held[i] or tiles.held[j]:
            continue
        last = _stretch(
            row,
            x - dt * (rate[j, 0] - rate[i, 0]),
            y - dt * (rate[j, 1] - rate[i, 1]),
            z - dt * (rate[j, 2] - rate[i, 2]),
        )
        dissipated[i] += stiffness(tiles, row, t, own, offset) / row[INVERSE] * stretch * last / 4
        tiles.bits[t, slot] &= ~(np.uint16(1) << np.uint16(k))
        breaks.ends[breaks.used[0], 0], breaks.ends[breaks.used[0], 1] = i, j
        breaks.used[0] += 1


@njit(**INNER)
def _relative(u, own, offset):  # type: ignore[no-untyped-def]
    """The displacement of a site's neighbour less its own, eta, m."""
    far = own + offset
    return u[0, far] - u[0, own], u[1, far] - u[1, own], u[2, far] - u[2, own]


@njit(**INNER)
def _stretch(row, x, y, z):  # type: ignore[no-untyped-def]
    """The stretch of a bond whose relative displacement eta is (x, y, z), m."""
    e = row[INVERSE] * (2 * (row[0] * x + row[1] * y + row[2] * z) + (x * x + y * y + z * z))
    return e / (np.sqrt(1 + e) + 1)


@njit(**INNER)
def stiffness(tiles, row, t, own, offset):  # type: ignore[no-untyped-def]
    """Stiffness over length of a bond."""
    if tiles.kind[t] == ALIKE:
        return np.float64(row[PULL])
    c, cells, w = tiles.c, tiles.cells, np.float64(0)
    for axis in range(3):
        w += row[SHARES + axis] * (np.float64(c[axis, own]) + np.float64(c[axis, own + offset]))
    if tiles.kind[t] == GENERAL:
        w *= cells[VOLUME, own + offset] * (cells[MODULUS, own] + cells[MODULUS, own + offset])
    return w


@cached_njit(nogil=True, error_model="numpy")
def hold_tiles(tiles, u, held, first, last):  # type: ignore[no-untyped-def]
    """Fill the energy density, J/m^3, that the bonds of nodes (n,) in the tiles `first` to `last` - 1 hold."""
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        for k in range(ROW):
            if tiles.node[t * ROW + k] >= 0:
                held[tiles.node[t * ROW + k]] = 0
        for slot in range(len(tiles.offsets)):
            row, offset, word = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot]
            for k in range(ROW):
                if (word >> np.uint16(k)) & np.uint16(1):
                    own = tiles.margin + t * ROW + k
                    x, y, z = _relative(u, own, offset)
                    stretch = _stretch(row, x, y, z)
                    pull = stiffness(tiles, row, t, own, offset)
                    held[tiles.node[t * ROW + k]] += pull / row[INVERSE] / 4 * stretch * stretch
