"""Bonds in tiles of 16 sites of a cubic lattice, one after the other along x.

Layout:
    site     a place of the lattice in the box around the body, numbered with x fastest; not every one has a node
    tile     16 consecutive sites; a site's place in it is its lane
    slot     the bonds of a tile with one offset between sites: there are no lists of neighbours
    bits     of a slot, one a lane: there is a bond, and it is intact. What a lane reads over the edge of the box is
             some other site's, and does not count.
    memory   of a tile, from when the first of its bonds has softened: what each was stretched to at most, and the
             share of its stiffness that is left

Any pair law; one that is curved (`Pair.bond_strain_energy`) has one material, and its secant is computed in lanes. A
slot is looked at bond by bond only in steps in which one of its bonds is beyond the least of all peaks. Symbols as in
pdsolve.laws.law; pdsolve.laws.pair says the same in a few lines and is what this is tested against.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, same
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import corrected_weight, where_inverse, where_weight
from pdsolve.lattice.layout import pair_law_of
from pdsolve.laws.calls import added_force, broken_energy, dissipated_energy, secant, second_force

# Tiles: without a node; what their bonds' stiffnesses are made of; and the same of tiles with a memory
EMPTY, ALIKE, CORRECTED, GENERAL, SOFT_ALIKE, SOFT_CORRECTED, SOFT_GENERAL = range(7)
SOFTENED = SOFT_ALIKE - ALIKE  # added to a tile's kind as it gets a memory
VOLUME, MODULUS, UNBREAKABLE = range(3)  # rows of `cells`
CELL = (0, 0)  # of as many rows


class Tiles(NamedTuple):
    """Bonds of n nodes in t tiles, with k offsets; m sites, of which the first and last `margin` have no node; p pairs
    of materials; r tiles with a memory."""

    law: Any  # columns of no bonds, by whose type kernels are compiled
    axes: tuple[int, ...]  # as many entries as there are axes, d
    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    vectors: NDArray[np.floating]  # (k, 12) rows of the offsets, see `bond`
    bits: NDArray[np.uint16]  # (t, k) lanes with an intact bond
    c: NDArray[np.floating]  # (d, m) corrections along each axis
    cells: NDArray[np.floating]  # (2, m) cell over h^3; half of the modulus over E; of a curved law (3, m), the third
    # infinite where bonds must not break, else 0: what peaks and limits of its bonds have more
    kind: NDArray[np.uint8]  # (t,) EMPTY to SOFT_GENERAL
    node: NDArray[np.int32]  # (16 t,) row of a site's node, or -1
    unbreakable: NDArray[np.bool_]  # (n,) whose bonds must not break
    material: NDArray[np.uint8]  # (n,)
    peak: NDArray[np.float64]  # (p, k) stretch above which bonds soften; of materials i and j in row i sqrt(p) + j
    limit: NDArray[np.float64]  # (p, k) stretch above which they are gone
    memory: NDArray[np.int32]  # (t,) row of what follows, or -1
    share: NDArray[np.floating]  # (r, k, 16) of the stiffness that is left; of a curved law the largest stretch
    worst: NDArray[np.float64]  # (r, k, 16) largest stretch above the peak, 0 if never there
    margin: int
    floor: float  # e above which softened bonds have what is left of their stiffness alone
    near: float  # |e| up to which nothing happens to bonds and the narrow polynomial holds
    edge: float  # e up to which nothing happens to bonds
    shrink: NDArray[np.floating] | None = None  # (m,) minus half the strain of a free node: bonds are relieved of that
    # of both ends; None: nothing swells


class Breaks(NamedTuple):
    """Room for what breaks."""

    used: NDArray[np.int64]  # (1,) bonds
    bonds: NDArray[np.int64]  # (., 3) step, and rows of source and target
    places: NDArray[np.int64]  # (., 2) site of the source, from the first tile on, and slot
    stretch_before: NDArray[np.float64]  # (.,) of each, one step before


@register_jitable
def room_for(bonds: int) -> Breaks:
    """Room for so many bonds that break."""
    columns = np.empty((bonds, 3), dtype=np.int64), np.empty((bonds, 2), dtype=np.int64), np.empty(bonds)
    return Breaks(np.zeros(1, dtype=np.int64), *columns)


def copy_breaks(breaks: Breaks, first: int = 0) -> Breaks:
    """A copy of the breaks from `first` on."""
    last = int(breaks.used[0])
    return Breaks._make([np.array([last - first]), *(column[first:last].copy() for column in breaks[1:])])


def join_breaks(breaks: Sequence[Breaks]) -> Breaks:
    """Some breaks one after the other."""
    columns = zip(*(one[1:] for one in breaks), strict=True)
    return Breaks._make([sum((one.used for one in breaks), np.zeros(1, np.int64)), *map(np.concatenate, columns)])


def select_breaks(breaks: Breaks, which: NDArray[Any]) -> Breaks:
    """Some of the breaks, by mask (b,) or by numbers (k,)."""
    columns = [column[: breaks.used[0]][which] for column in breaks[1:]]
    return Breaks._make([np.array([len(columns[0])]), *columns])


@njit(**INNER)
def has_room(tiles, breaks):  # type: ignore[no-untyped-def]
    """Whether all bonds of a tile can break."""
    return breaks.used[0] + ROW * len(tiles.offsets) <= len(breaks.bonds)


class SiteMotion(NamedTuple):
    """How sites move in a step, and what this does to bonds."""

    u: NDArray[np.floating]  # (d, m) displacements of sites, m
    rate: NDArray[np.floating]  # (d, m) velocities of sites since the last step, m/s; or (d, n) of nodes
    by_sites: bool  # which of them
    dt: float  # s
    step: int  # 0: bonds neither soften nor break
    failure_forces: NDArray[np.floating]  # (d, m) of sites or (d, n) of nodes, N/m^3: takes the pulls that match the
    # work of bonds that soften or break
    dissipated: NDArray[np.float64]  # (n,) takes what broken bonds have spent, J/m^3


@cached_njit(nogil=True)
def place_rows(site, value, u, first, last):  # type: ignore[no-untyped-def]
    """Displacements (n, d) of the rows `first` to `last` - 1 to their sites, u (d, m)."""
    for i in range(first, last):
        for axis in range(len(u)):
            u[axis, site[i]] = value[i, axis]


@cached_njit(nogil=True)
def collect_rows(site, u, value, first, last):  # type: ignore[no-untyped-def]
    """Displacements u (d, m) of sites to the rows `first` to `last` - 1 of `value` (n, d)."""
    for i in range(first, last):
        for axis in range(len(u)):
            value[i, axis] = u[axis, site[i]]


@njit(**INNER)
def write_tile(tiles, t, f, out):  # type: ignore[no-untyped-def]
    """Add the force densities f (d, 16) of a tile to `out` (n, d)."""
    for lane in range(ROW):
        i = tiles.node[t * ROW + lane]
        if i >= 0:
            for axis in range(len(f)):
                out[i, axis] += f[axis, lane]


def common_of_tile(bonds, group, own):  # type: ignore[no-untyped-def]
    # what stiffnesses are made of, the row of the memory or -1, corrections and modulus of the lanes, and their place
    kind = bonds.kind[group]
    row_of_memory = np.int64(bonds.memory[group]) if kind >= SOFT_ALIKE else np.int64(-1)
    kind = kind - SOFTENED if kind >= SOFT_ALIKE else np.int64(kind)
    return kind, row_of_memory, beside(bonds.c, bonds.axes, own), beside(bonds.cells, CELL, own)[MODULUS], own


def weight_in_tile(bonds, common, u, row, slot, lane):  # type: ignore[no-untyped-def]
    kind, _, c, own_modulus, own = common
    w, at = same(u, row[where_weight(len(bonds.axes))]), own + bonds.offsets[slot]
    if kind != ALIKE:
        w = corrected_weight(row, beside(bonds.c, bonds.axes, at), c)
        if kind == GENERAL:
            volume, modulus = beside(bonds.cells, CELL, at)
            w = (w * volume) * (modulus + own_modulus)
    return w


def update_lanes_of_tile(bonds, history, motion, group, lane, slot, e, f):  # type: ignore[no-untyped-def]
    # the pulls go to `failure_forces` at once: a tile that gets a memory is summed anew without them
    return motion.step == 0 or _update_slot(bonds, motion, history, group, lane, slot), f


@njit(**INNER)
def _update_slot(tiles, motion, breaks, t, lane, slot):  # type: ignore[no-untyped-def]
    """Take out the bonds of a slot that are over their limit, and book what they have spent; soften those over their
    peak. False if there is no memory for it."""
    row, offset, word, memory = tiles.vectors[slot], tiles.offsets[slot], tiles.bits[t, slot], np.int64(tiles.memory[t])
    u, rate, pulls = motion.u, motion.rate, motion.failure_forces
    for k in range(lane, lane + across(u)):
        if not (word >> np.uint16(k)) & np.uint16(1):
            continue
        site = t * ROW + k
        i, j = tiles.node[site], tiles.node[site + offset]
        place, pair = tiles.margin + site, pair_number(tiles, i, j)
        peak, limit = tiles.peak[pair, slot], tiles.limit[pair, slot]
        stretch = _stretch(row, u, tiles.shrink, place, offset)
        worst = tiles.worst[memory, slot, k] if memory >= 0 else 0.0
        if stretch <= peak or stretch <= worst or tiles.unbreakable[i] or tiles.unbreakable[j]:
            continue
        if stretch <= limit and not soften(tiles, t, slot, k, stretch, peak, limit):
            return False
        near, far = (place, place + offset) if motion.by_sites else (np.int64(i), np.int64(j))
        last = _previous_stretch(row, u, tiles.shrink, rate, motion.dt, place, offset, near, far)
        w = stiffness(tiles, row, t, place, offset)
        pull = added_force(tiles.law, stretch, last, worst, peak, limit) * (w / (1 + stretch))
        for axis in range(len(u)):
            pulls[axis, near] += pull * (row[axis] + displaced_of_bond(u, tiles.shrink, row, axis, place, offset))
        if stretch <= limit:
            continue
        modulus = w / row[where_inverse(len(u))] / 4
        motion.dissipated[i] += broken_energy(tiles.law, modulus, stretch, last, peak, limit)
        tiles.bits[t, slot] &= ~(np.uint16(1) << np.uint16(k))
        n = breaks.used[0]
        breaks.bonds[n, 0], breaks.bonds[n, 1], breaks.bonds[n, 2] = motion.step, i, j
        breaks.places[n, 0], breaks.places[n, 1] = site, slot
        breaks.stretch_before[n] = last if tiles.law.matches_work and last < limit else limit
        breaks.used[0] = n + 1
    return True


@njit(**INNER)
def pull_again(tiles, motion, breaks, n):  # type: ignore[no-untyped-def]
    """Add the second pull of the broken bond n, if it broke one step ago."""
    if breaks.bonds[n, 0] != motion.step - 1:
        return
    site, slot, u = breaks.places[n, 0], breaks.places[n, 1], motion.u
    t, row, offset = site // ROW, tiles.vectors[slot], tiles.offsets[slot]
    i, j, place, memory = tiles.node[site], tiles.node[site + offset], tiles.margin + site, np.int64(tiles.memory[t])
    pair, worst = pair_number(tiles, i, j), tiles.worst[memory, slot, site % ROW] if memory >= 0 else 0.0
    near, far = (place, place + offset) if motion.by_sites else (np.int64(i), np.int64(j))
    stretch = _stretch(row, u, tiles.shrink, place, offset)
    last = _previous_stretch(row, u, tiles.shrink, motion.rate, motion.dt, place, offset, near, far)
    limits = tiles.peak[pair, slot], tiles.limit[pair, slot]
    pull = second_force(tiles.law, np.float64(stretch), last, breaks.stretch_before[n], worst, *limits)
    pull *= stiffness(tiles, row, t, place, offset) / (1 + stretch)
    for axis in range(len(u)):
        eta = displaced_of_bond(u, tiles.shrink, row, axis, place, offset)
        motion.failure_forces[axis, near] += pull * (row[axis] + eta)


@cached_njit(nogil=True, error_model="numpy")
def pull_all_again(tiles, u, rate, dt, step, breaks, out):  # type: ignore[no-untyped-def]
    """Add the second pulls of the bonds that broke one step ago, N/m^3, to `out` (n, d)."""
    motion = SiteMotion(u, rate.T, False, dt, step, out.T, np.empty(0))
    for n in range(breaks.used[0]):
        pull_again(tiles, motion, breaks, n)


@njit(**INNER)
def pair_number(tiles, i, j):  # type: ignore[no-untyped-def]
    """The row of `peak` and `limit` of bonds between two nodes."""
    if len(tiles.peak) == 1:
        return 0
    return tiles.material[i] * int(np.sqrt(len(tiles.peak)) + 0.5) + tiles.material[j]


@overloaded(INNER)
def soften(tiles, t, slot, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    """Store the stretch of a bond above its peak, if its law softens; False if its tile has no memory."""
    pair = pair_law_of(tiles)
    if pair.softening is None:
        return lambda tiles, t, slot, lane, stretch, peak, limit: True
    return _remember if pair.is_curved else _weaken


def _remember(tiles, t, slot, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    row = tiles.memory[t]
    if row < 0:
        return False
    if stretch > tiles.worst[row, slot, lane]:
        tiles.worst[row, slot, lane] = tiles.share[row, slot, lane] = stretch
    return True


def _weaken(tiles, t, slot, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    row = tiles.memory[t]
    if row < 0:
        return False
    if stretch > tiles.worst[row, slot, lane]:
        tiles.worst[row, slot, lane] = stretch
        tiles.share[row, slot, lane] = secant(tiles.law, stretch, stretch, peak, limit)
    return True


@overloaded(INNER)
def displaced_of_bond(u, shrink, row, axis, place, offset):  # type: ignore[no-untyped-def]
    """A component of what stretches the bond of a site."""
    if isinstance(shrink, types.NoneType):
        return lambda u, shrink, row, axis, place, offset: u[axis, place + offset] - u[axis, place]

    def relieved(u, shrink, row, axis, place, offset):  # type: ignore[no-untyped-def]
        return u[axis, place + offset] - u[axis, place] + row[axis] * (shrink[place] + shrink[place + offset])

    return relieved


@njit(**INNER)
def _stretch(row, u, shrink, place, offset):  # type: ignore[no-untyped-def]
    """The stretch of the bond of a site."""
    along, square = u.dtype.type(0), u.dtype.type(0)
    for axis in range(len(u)):
        eta = displaced_of_bond(u, shrink, row, axis, place, offset)
        along += row[axis] * eta
        square += eta * eta
    return _ratio(row[where_inverse(len(u))] * (2 * along + square))


@njit(**INNER)
def _previous_stretch(row, u, shrink, rate, dt, place, offset, near, far):  # type: ignore[no-untyped-def]
    """The stretch of the bond of a site one step ago, since when its ends have moved with `rate` (d, .), m/s."""
    along, square = 0.0, 0.0
    for axis in range(len(u)):
        eta = displaced_of_bond(u, shrink, row, axis, place, offset) - dt * (rate[axis, far] - rate[axis, near])
        along += row[axis] * eta
        square += eta * eta
    return _ratio(row[where_inverse(len(u))] * (2 * along + square))


@njit(**INNER)
def _ratio(e):  # type: ignore[no-untyped-def]
    """The stretch at e."""
    return e / (np.sqrt(1 + e) + 1)


@njit(**INNER)
def stiffness(tiles, row, t, place, offset):  # type: ignore[no-untyped-def]
    """Stiffness over length of a bond."""
    kind, axes = tiles.kind[t], len(tiles.axes)
    if kind in (ALIKE, SOFT_ALIKE):
        return np.float64(row[where_weight(axes)])
    c, cells, w = tiles.c, tiles.cells, np.float64(0)
    for axis in range(axes):
        w += row[where_weight(axes) + 1 + axis] * (np.float64(c[axis, place]) + np.float64(c[axis, place + offset]))
    if kind in (GENERAL, SOFT_GENERAL):
        w *= cells[VOLUME, place + offset] * (cells[MODULUS, place] + cells[MODULUS, place + offset])
    return w


@njit(**INNER)
def dissipated_in_tile(tiles, t, slot, lane, out):  # type: ignore[no-untyped-def]
    """Add what softening has dissipated in a lane's intact bond, J/m^3, to `out` (n,); the tile has a memory."""
    site, worst = t * ROW + lane, tiles.worst[tiles.memory[t], slot, lane]
    if worst > 0 and (tiles.bits[t, slot] >> np.uint16(lane)) & np.uint16(1):
        i, row = tiles.node[site], tiles.vectors[slot]
        pair = pair_number(tiles, i, tiles.node[site + tiles.offsets[slot]])
        c = stiffness(tiles, row, t, tiles.margin + site, tiles.offsets[slot]) / row[where_inverse(len(tiles.axes))] / 4
        out[i] += dissipated_energy(tiles.law, c, worst, tiles.peak[pair, slot], tiles.limit[pair, slot])


@cached_njit(error_model="numpy")
def recall(tiles, tile, slot, lane, worst):  # type: ignore[no-untyped-def]
    """Enter the largest stretches `worst` (b,) of bonds in the memory of their tiles."""
    for b in range(len(tile)):
        site = tile[b] * ROW + lane[b]
        pair = pair_number(tiles, tiles.node[site], tiles.node[site + tiles.offsets[slot[b]]])
        soften(tiles, tile[b], slot[b], lane[b], worst[b], tiles.peak[pair, slot[b]], tiles.limit[pair, slot[b]])
