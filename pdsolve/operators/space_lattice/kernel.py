"""The sum over a node's bonds in space, fast: tiles of 16 sites of a cubic lattice, one after the other along x.

Layout:
    site     a place of the lattice in the box around the body, numbered with x fastest; not every one has a node
    tile     16 consecutive sites; a site's place in it is its lane
    slot     the bonds of a tile with one offset between sites: there are no lists of neighbours
    bits     of a slot, one a lane: there is a bond, and it is intact. What a lane reads over the edge of the box is
             some other site's, and does not count.
    memory   of a tile, from when the first of its bonds has softened: what each was stretched to at most, and the
             share of its stiffness that is left

Any pair law that is linear until it first softens, and then has a secant (`Pair.held` is None). A slot is looked at
bond by bond only in steps in which one of its bonds is beyond the least of all peaks. Symbols as in pdsolve.laws.law;
pdsolve.laws.pair says the same in a few lines and is what this is tested against.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across
from pdsolve.codegen.space_slots import (
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
    add_soft_alike,
    add_soft_alike_far,
    add_soft_corrected,
    add_soft_corrected_far,
    add_soft_general,
    add_soft_general_far,
)
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.calls import added_pull, broken_energy, held, pair_of, secant, spent
from pdsolve.operators.simd_lattice.kernel import INNER

# Tiles: without a node; what their bonds' stiffnesses are made of; and the same of tiles with a memory
EMPTY, ALIKE, CORRECTED, GENERAL, SOFT_ALIKE, SOFT_CORRECTED, SOFT_GENERAL = range(7)
SOFTENED = SOFT_ALIKE - ALIKE  # added to a tile's kind as it gets a memory
VOLUME, MODULUS = 0, 1  # rows of `cells`
EVERY = 2**ROW - 1  # bits of all lanes


class Tiles(NamedTuple):
    """Bonds of n nodes in t tiles, with k offsets; m sites, of which the first and last `margin` have no node; p pairs
    of materials; r tiles with a memory."""

    law: Any  # columns of no bonds, by whose type kernels are compiled
    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    table: NDArray[np.floating]  # (k, 12) xi, 2 xi / |xi|^2, 1 / |xi|^2, w = stiffness / |xi|, w n_a^2 / 2
    bits: NDArray[np.uint16]  # (t, k) lanes with an intact bond
    c: NDArray[np.floating]  # (3, m) corrections along x, y and z
    cells: NDArray[np.floating]  # (2, m) cell over h^3; half of the modulus over E
    kind: NDArray[np.uint8]  # (t,) EMPTY to SOFT_GENERAL
    node: NDArray[np.int32]  # (16 t,) row of a site's node, or -1
    held: NDArray[np.bool_]  # (n,) whose bonds must not break
    material: NDArray[np.uint8]  # (n,)
    peak: NDArray[np.float64]  # (p, k) stretch above which bonds soften; of materials i and j in row i sqrt(p) + j
    limit: NDArray[np.float64]  # (p, k) stretch above which they are gone
    memory: NDArray[np.int32]  # (t,) row of what follows, or -1
    share: NDArray[np.floating]  # (r, k, 16) of the stiffness that is left
    worst: NDArray[np.float64]  # (r, k, 16) largest stretch above the peak, 0 if never there
    margin: int
    floor: float  # e above which softened bonds have what is left of their stiffness alone
    near: float  # |e| up to which nothing happens to bonds and the narrow polynomial holds
    edge: float  # e up to which nothing happens to bonds


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
def sum_tiles(tiles, u, rate, dt, ages, out, dissipated, breaks, first, last):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles `first` to `last` - 1 to `out` (n, 3); if bonds age now, those over
    their limit break and those over their peak soften.

    Returns the tile to go on with: `last`, or one that there was no room left to write breaks of, or one whose bonds
    soften and that has no memory.
    """
    s, f, count = np.empty(SCRATCH, u.dtype), np.empty((3, ROW)), len(tiles.offsets)
    limits = u.dtype.type(tiles.near), u.dtype.type(tiles.floor), u.dtype.type(tiles.edge)
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        if breaks.used[0] + ROW * count > len(breaks.ends):
            return t
        for lane in range(0, ROW, across(s)):
            if not _sum_lanes(tiles, u, rate, dt, ages, out, dissipated, breaks, limits, t, lane, s):
                return t
            for k in range(across(s)):
                for axis in range(3):
                    f[axis, lane + k] = s[ROW * axis + k]
        _write(tiles, t, f, out)
    return last


@cached_njit(nogil=True, error_model="numpy")
def sum_some(tiles, u, rate, out, dissipated, site_mask):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles with `site_mask` sites (16 t,) to `out` (n, 3); nothing breaks."""
    nothing = Breaks(np.zeros(1, np.int64), np.empty((ROW * len(tiles.offsets), 2), np.int32))
    for t in range(len(tiles.kind)):
        if site_mask[t * ROW : t * ROW + ROW].any():
            sum_tiles(tiles, u, rate, 0.0, False, out, dissipated, nothing, t, t + 1)


@njit(**INNER)
def _write(tiles, t, f, out):  # type: ignore[no-untyped-def]
    """Add the force densities f (3, 16) of a tile to `out` (n, 3)."""
    for lane in range(ROW):
        i = tiles.node[t * ROW + lane]
        if i >= 0:
            for axis in range(3):
                out[i, axis] += f[axis, lane]


@njit(**INNER)
def _sum_lanes(tiles, u, rate, dt, ages, out, dissipated, breaks, limits, t, lane, s):  # type: ignore[no-untyped-def]
    """Force densities on some lanes of a tile, from `lane` on, at the beginning of s; False if it needs a memory."""
    for k in range(SCRATCH):
        s[k] = 0
    count, slot, kind = len(tiles.offsets), 0, tiles.kind[t]
    place, row = tiles.margin + t * ROW + lane, np.int64(tiles.memory[t])
    to = (tiles.offsets, tiles.table, tiles.bits, tiles.c, tiles.cells, tiles.share)
    while True:
        at = (t, place, lane, row, count)
        slot = _add(kind, u, to, limits, slot, count, at, s)
        if slot == count:
            return True
        if ages and not _age_slot(tiles, u, rate, dt, out, dissipated, breaks, t, lane, slot, across(s)):
            return False
        slot = _add_far(kind, u, to, limits, slot, at, s)


@njit(**INNER)
def _add(kind, u, to, limits, slot, count, at, s):  # type: ignore[no-untyped-def]
    """Add bonds from a slot on; returns the first that is left alone, or `count`."""
    if kind == ALIKE:
        return add_alike(u, *to, limits, slot, count, *at, s)
    if kind == CORRECTED:
        return add_corrected(u, *to, limits, slot, count, *at, s)
    if kind == GENERAL:
        return add_general(u, *to, limits, slot, count, *at, s)
    if kind == SOFT_ALIKE:
        return add_soft_alike(u, *to, limits, slot, count, *at, s)
    if kind == SOFT_CORRECTED:
        return add_soft_corrected(u, *to, limits, slot, count, *at, s)
    return add_soft_general(u, *to, limits, slot, count, *at, s)


@njit(**INNER)
def _add_far(kind, u, to, limits, slot, at, s):  # type: ignore[no-untyped-def]
    """Add the bonds of one slot, however long; returns the next slot."""
    if kind == ALIKE:
        return add_alike_far(u, *to, limits, slot, slot + 1, *at, s)
    if kind == CORRECTED:
        return add_corrected_far(u, *to, limits, slot, slot + 1, *at, s)
    if kind == GENERAL:
        return add_general_far(u, *to, limits, slot, slot + 1, *at, s)
    if kind == SOFT_ALIKE:
        return add_soft_alike_far(u, *to, limits, slot, slot + 1, *at, s)
    if kind == SOFT_CORRECTED:
        return add_soft_corrected_far(u, *to, limits, slot, slot + 1, *at, s)
    return add_soft_general_far(u, *to, limits, slot, slot + 1, *at, s)


@njit(**INNER)
def _age_slot(tiles, u, rate, dt, out, dissipated, breaks, t, lane, slot, count):  # type: ignore[no-untyped-def]
    """Take out the bonds of a slot that are over their limit, and book what they have spent; soften those over their
    peak. False if there is no memory for it.

    The pulls that match their work go to `out` (n, 3) at once: a tile that gets a memory is summed anew without them.
    """
    row, offset, word, memory = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot], np.int64(tiles.memory[t])
    for k in range(lane, lane + count):
        if not (word >> np.uint16(k)) & np.uint16(1):
            continue
        site = t * ROW + k
        i, j = tiles.node[site], tiles.node[site + offset]
        place, pair = tiles.margin + site, pair_number(tiles, i, j)
        peak, limit = tiles.peak[pair, slot], tiles.limit[pair, slot]
        x, y, z = _relative(u, place, offset)
        stretch, worst = _stretch(row, x, y, z), tiles.worst[memory, slot, k] if memory >= 0 else 0.0
        if stretch <= peak or stretch <= worst or tiles.held[i] or tiles.held[j]:
            continue
        if stretch <= limit and not soften(tiles, t, slot, k, stretch, peak, limit):
            return False
        last = _stretch(
            row,
            x - dt * (rate[j, 0] - rate[i, 0]),
            y - dt * (rate[j, 1] - rate[i, 1]),
            z - dt * (rate[j, 2] - rate[i, 2]),
        )
        w = stiffness(tiles, row, t, place, offset)
        pull = added_pull(tiles.law, stretch, last, worst, peak, limit) * (w / (1 + stretch))
        out[i, 0] += pull * (row[0] + x)
        out[i, 1] += pull * (row[1] + y)
        out[i, 2] += pull * (row[2] + z)
        if stretch <= limit:
            continue
        dissipated[i] += broken_energy(tiles.law, w / row[INVERSE] / 4, stretch, last, peak, limit)
        tiles.bits[t, slot] &= ~(np.uint16(1) << np.uint16(k))
        breaks.ends[breaks.used[0], 0], breaks.ends[breaks.used[0], 1] = i, j
        breaks.used[0] += 1
    return True


@njit(**INNER)
def pair_number(tiles, i, j):  # type: ignore[no-untyped-def]
    """The row of `peak` and `limit` of bonds between two nodes."""
    if len(tiles.peak) == 1:
        return 0
    return tiles.material[i] * int(np.sqrt(len(tiles.peak)) + 0.5) + tiles.material[j]


def soften(tiles: Any, t: Any, slot: Any, lane: Any, stretch: Any, peak: Any, limit: Any) -> bool:
    """Store the stretch of a bond above its peak, if its law softens; False if its tile has no memory."""
    raise NotImplementedError("compiled for each law")


@overload(soften, jit_options=INNER)
def _soften(tiles, t, slot, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    if pair_of(tiles.types[Tiles._fields.index("law")]).softening is None:
        return lambda tiles, t, slot, lane, stretch, peak, limit: True
    return _weaken


def _weaken(tiles, t, slot, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    row = tiles.memory[t]
    if row < 0:
        return False
    if stretch > tiles.worst[row, slot, lane]:
        tiles.worst[row, slot, lane] = stretch
        tiles.share[row, slot, lane] = secant(tiles.law, stretch, stretch, peak, limit)
    return True


@njit(**INNER)
def _relative(u, place, offset):  # type: ignore[no-untyped-def]
    """The displacement of a site's neighbour less its own, eta, m."""
    far = place + offset
    return u[0, far] - u[0, place], u[1, far] - u[1, place], u[2, far] - u[2, place]


@njit(**INNER)
def _stretch(row, x, y, z):  # type: ignore[no-untyped-def]
    """The stretch of a bond whose relative displacement eta is (x, y, z), m."""
    e = row[INVERSE] * (2 * (row[0] * x + row[1] * y + row[2] * z) + (x * x + y * y + z * z))
    return e / (np.sqrt(1 + e) + 1)


@njit(**INNER)
def stiffness(tiles, row, t, place, offset):  # type: ignore[no-untyped-def]
    """Stiffness over length of a bond."""
    kind = tiles.kind[t]
    if kind in (ALIKE, SOFT_ALIKE):
        return np.float64(row[PULL])
    c, cells, w = tiles.c, tiles.cells, np.float64(0)
    for axis in range(3):
        w += row[SHARES + axis] * (np.float64(c[axis, place]) + np.float64(c[axis, place + offset]))
    if kind in (GENERAL, SOFT_GENERAL):
        w *= cells[VOLUME, place + offset] * (cells[MODULUS, place] + cells[MODULUS, place + offset])
    return w


@cached_njit(nogil=True, error_model="numpy")
def hold_tiles(tiles, u, own_held, own_spent, first, last):  # type: ignore[no-untyped-def]
    """Add the energy densities, J/m^3, that the bonds of nodes in the tiles `first` to `last` - 1 hold and that their
    softening has spent, to arrays (n,)."""
    for t in range(first, last):
        _hold_tile(tiles, u, own_held, own_spent, t, np.uint16(EVERY))


@cached_njit(nogil=True, error_model="numpy")
def hold_some(tiles, u, own_held, own_spent, site_mask):  # type: ignore[no-untyped-def]
    """`hold_tiles` of the nodes at `site_mask` sites (16 t,) alone."""
    for t in range(len(tiles.kind)):
        lanes = np.uint16(0)
        for k in range(ROW):
            if site_mask[t * ROW + k]:
                lanes |= np.uint16(1) << np.uint16(k)
        if lanes != 0:
            _hold_tile(tiles, u, own_held, own_spent, t, lanes)


@njit(**INNER)
def _hold_tile(tiles, u, own_held, own_spent, t, lanes):  # type: ignore[no-untyped-def]
    """Add the energy densities that the bonds of some lanes of a tile hold and have spent."""
    row = tiles.memory[t]
    for slot in range(len(tiles.offsets)):
        field, offset, word = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot] & lanes
        if word == 0:
            continue
        for k in range(ROW):
            if (word >> np.uint16(k)) & np.uint16(1):
                place, i, j = tiles.margin + t * ROW + k, tiles.node[t * ROW + k], tiles.node[t * ROW + k + offset]
                x, y, z = _relative(u, place, offset)
                pair, worst = pair_number(tiles, i, j), tiles.worst[row, slot, k] if row >= 0 else 0.0
                peak, limit = tiles.peak[pair, slot], tiles.limit[pair, slot]
                c = stiffness(tiles, field, t, place, offset) / field[INVERSE] / 4
                own_held[i] += held(tiles.law, c, _stretch(field, x, y, z), worst, peak, limit)
                if worst > 0:
                    own_spent[i] += spent(tiles.law, c, worst, peak, limit)


@cached_njit(error_model="numpy")
def recall(tiles, tile, slot, lane, worst):  # type: ignore[no-untyped-def]
    """Enter the largest stretches `worst` (b,) of bonds in the memory of their tiles."""
    for b in range(len(tile)):
        site = tile[b] * ROW + lane[b]
        pair = pair_number(tiles, tiles.node[site], tiles.node[site + tiles.offsets[slot[b]]])
        soften(tiles, tile[b], slot[b], lane[b], worst[b], tiles.peak[pair, slot[b]], tiles.limit[pair, slot[b]])
