"""The sum over a node's bonds in space, fast: tiles of 16 sites of a cubic lattice, one after the other along x.

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
from numba import njit
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same, where_above
from pdsolve.codegen.tile_lanes import bonded, magnitude
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import (
    IN_PLACE,
    any_beyond,
    corrected_weight,
    difference,
    elongation,
    factor,
    factor_near,
    pulled,
    where_inverse,
    where_weight,
    zeros,
)
from pdsolve.laws.calls import (
    added_force,
    bond_strain_energy,
    broken_energy,
    dissipated_energy,
    pair_of,
    secant,
    second_force,
)
from pdsolve.laws.law import Pair

# Tiles: without a node; what their bonds' stiffnesses are made of; and the same of tiles with a memory
EMPTY, ALIKE, CORRECTED, GENERAL, SOFT_ALIKE, SOFT_CORRECTED, SOFT_GENERAL = range(7)
SOFTENED = SOFT_ALIKE - ALIKE  # added to a tile's kind as it gets a memory
VOLUME, MODULUS, UNBREAKABLE = range(3)  # rows of `cells`
EVERY = 2**ROW - 1  # bits of all lanes
UNAGED, AGED, UNDONE = range(3)  # lanes: summed, the same though bonds softened or broke, not summed


class Tiles(NamedTuple):
    """Bonds of n nodes in t tiles, with k offsets; m sites, of which the first and last `margin` have no node; p pairs
    of materials; r tiles with a memory."""

    law: Any  # columns of no bonds, by whose type kernels are compiled
    axes: tuple[int, ...]  # as many entries as there are axes, d
    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    table: NDArray[np.floating]  # (k, 12) of the offsets, see `bond`
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


class Motion(NamedTuple):
    """How sites move in a step, and what this does to bonds."""

    u: NDArray[np.floating]  # (d, m) displacements of sites, m
    rate: NDArray[np.floating]  # (d, m) velocities of sites since the last step, m/s; or (d, n) of nodes
    by_sites: bool  # which of them
    dt: float  # s
    step: int  # 0: bonds neither soften nor break


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


@cached_njit(nogil=True, error_model="numpy")
def sum_tiles(tiles, u, rate, dt, step, out, dissipated, breaks, first, last):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles `first` to `last` - 1 to `out` (n, d); bonds over their limit break
    and those over their peak soften, but not in step 0.

    Returns the tile to go on with: `last`, or one that there was no room left to write breaks of, or one whose bonds
    soften and that has no memory.
    """
    s, motion = np.empty((len(u), ROW), u.dtype), Motion(u, rate.T, False, dt, step)
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        if not has_room(tiles, breaks):
            return t
        for lane in range(0, ROW, across(u)):
            status, f = sum_lanes(tiles, motion, out.T, dissipated, breaks, t, lane)
            if status == UNDONE:
                return t
            keep(f, s, lane)
        _write(tiles, t, s, out)
    return last


@cached_njit(nogil=True, error_model="numpy")
def sum_some(tiles, u, rate, out, dissipated, site_mask):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles with `site_mask` sites (16 t,) to `out` (n, d); nothing breaks."""
    nothing = room_for(ROW * len(tiles.offsets))
    for t in range(len(tiles.kind)):
        if site_mask[t * ROW : t * ROW + ROW].any():
            sum_tiles(tiles, u, rate, 0.0, 0, out, dissipated, nothing, t, t + 1)


@njit(**INNER)
def _write(tiles, t, f, out):  # type: ignore[no-untyped-def]
    """Add the force densities f (d, 16) of a tile to `out` (n, d)."""
    for lane in range(ROW):
        i = tiles.node[t * ROW + lane]
        if i >= 0:
            for axis in range(len(f)):
                out[i, axis] += f[axis, lane]


@njit(**IN_PLACE)
def sum_lanes(tiles, motion, pulls, dissipated, breaks, t, lane):  # type: ignore[no-untyped-def]
    """UNAGED, AGED or UNDONE, and the force densities on some lanes of a tile, from `lane` on, N/m^3.

    Lanes are not summed where a bond softens in a tile without a memory. The pulls that match the work of bonds that
    break or soften go to `pulls` (d, .) at once: a tile that gets a memory is summed anew without them.
    """
    slot, aged, f = np.int64(0), np.int64(-1), zeros(motion.u, tiles.axes)  # literals would be a type of their own
    while True:
        slot, f = _add(tiles, motion.u, t, lane, slot, aged, f)
        if slot == len(tiles.offsets):
            return UNAGED if aged < 0 else AGED, f
        if motion.step > 0 and not _update_slot(tiles, motion, pulls, dissipated, breaks, t, lane, slot):
            return UNDONE, f
        aged = slot


@njit(**IN_PLACE)
def _add(tiles, u, t, lane, first, aged, f):  # type: ignore[no-untyped-def]
    """Add the pulls of bonds to f, slot by slot from `first` on.

    Returns the first slot with a bond that may soften or break, but for the slot `aged` where that was seen to; or the
    number of slots.
    """
    own, near, edge = tiles.margin + t * ROW + lane, same(u, tiles.near), same(u, tiles.edge)
    axes, kind = tiles.axes, tiles.kind[t]
    here, c_here = beside(u, axes, own), beside(tiles.c, axes, own)
    softened, tile = kind >= SOFT_ALIKE, np.uint64(t)
    row_of_memory = np.int64(tiles.memory[t]) if softened else np.int64(-1)
    kind = kind - SOFTENED if softened else kind
    for number in range(first, len(tiles.offsets)):
        slot = np.uint64(number)  # saves a look whether it counts from the end
        if tiles.bits[tile, slot] == 0:
            continue
        row, at = tiles.table[slot], own + tiles.offsets[slot]
        w = same(u, row[where_weight(len(axes))])  # before eta takes registers
        if kind != ALIKE:
            w = corrected_weight(row, beside(tiles.c, axes, at), c_here)
            if kind == GENERAL:
                volume, modulus = beside(tiles.cells, (0, 0), at)
                w = (w * volume) * (modulus + beside(tiles.cells, (0, 0), own)[1])
        eta = difference(beside(u, axes, at), here)
        (e,) = bonded((elongation(eta, row),), tiles.bits, t, number, lane)
        g, size = factor_near(e), magnitude(e)
        if any_beyond(size, near):
            if number != aged and any_beyond(e, edge):
                return number, f
            g = factor(u, e, size, near, g)
        w = secant_weight(tiles, w, e, g, slot, lane, own, row_of_memory)
        f = pulled(f, w * (e * g), eta, row)
    return len(tiles.offsets), f


def secant_weight(tiles: Any, w: Any, e: Any, g: Any, slot: Any, lane: Any, own: Any, row_of_memory: Any) -> Any:
    """The secant of lanes at e, over the bonds' lengths, from the stiffness over length w; `own` is the first place.

    A negative row of the memory: no bond of the tile has softened.
    """
    raise NotImplementedError("compiled for each law")


@overload(secant_weight, jit_options=IN_PLACE)
def _secant_weight(tiles, w, e, g, slot, lane, own, row_of_memory):  # type: ignore[no-untyped-def]
    return _secant_of_curve if _pair(tiles).is_curved else _secant_of_line


def _secant_of_line(tiles, w, e, g, slot, lane, own, row_of_memory):  # type: ignore[no-untyped-def]
    if row_of_memory >= 0:
        (left,) = beside(tiles.share[row_of_memory, slot : slot + np.uint64(1)], (0,), lane)
        w = w * where_above(e, same(tiles.share, tiles.floor), left, same(tiles.share, 1.0))
    return w


def _secant_of_curve(tiles, w, e, g, slot, lane, own, row_of_memory):  # type: ignore[no-untyped-def]
    worst = same(tiles.share, 0.0)
    if row_of_memory >= 0:
        (worst,) = beside(tiles.share[row_of_memory, slot : slot + np.uint64(1)], (0,), lane)
    rows, at = (VOLUME, MODULUS, UNBREAKABLE), own + tiles.offsets[slot]
    beyond = beside(tiles.cells, rows, own)[UNBREAKABLE] + beside(tiles.cells, rows, at)[UNBREAKABLE]
    peak, limit = beyond + tiles.peak[0, slot], beyond + tiles.limit[0, slot]
    return w * secant(tiles.law, e * g * np.sqrt(1.0 + e), worst, peak, limit)


def _pair(tiles: Any) -> Pair:
    """The pair law of the numba type of tiles."""
    return pair_of(tiles.types[Tiles._fields.index("law")])


@njit(**INNER)
def _update_slot(tiles, motion, pulls, dissipated, breaks, t, lane, slot):  # type: ignore[no-untyped-def]
    """Take out the bonds of a slot that are over their limit, and book what they have spent; soften those over their
    peak. False if there is no memory for it."""
    row, offset, word, memory = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot], np.int64(tiles.memory[t])
    u, rate = motion.u, motion.rate
    for k in range(lane, lane + across(u)):
        if not (word >> np.uint16(k)) & np.uint16(1):
            continue
        site = t * ROW + k
        i, j = tiles.node[site], tiles.node[site + offset]
        place, pair = tiles.margin + site, pair_number(tiles, i, j)
        peak, limit = tiles.peak[pair, slot], tiles.limit[pair, slot]
        stretch, worst = _stretch(row, u, place, offset), tiles.worst[memory, slot, k] if memory >= 0 else 0.0
        if stretch <= peak or stretch <= worst or tiles.unbreakable[i] or tiles.unbreakable[j]:
            continue
        if stretch <= limit and not soften(tiles, t, slot, k, stretch, peak, limit):
            return False
        near, far = (place, place + offset) if motion.by_sites else (np.int64(i), np.int64(j))
        last = _stretch_before(row, u, rate, motion.dt, place, offset, near, far)
        w = stiffness(tiles, row, t, place, offset)
        pull = added_force(tiles.law, stretch, last, worst, peak, limit) * (w / (1 + stretch))
        for axis in range(len(u)):
            pulls[axis, near] += pull * (row[axis] + (u[axis, place + offset] - u[axis, place]))
        if stretch <= limit:
            continue
        modulus = w / row[where_inverse(len(u))] / 4
        dissipated[i] += broken_energy(tiles.law, modulus, stretch, last, peak, limit)
        tiles.bits[t, slot] &= ~(np.uint16(1) << np.uint16(k))
        _record(breaks, motion.step, i, j, site, slot, last if tiles.law.matches_work and last < limit else limit)
    return True


@njit(**INNER)
def _record(breaks, step, i, j, site, slot, stretch_before):  # type: ignore[no-untyped-def]
    """Record a bond that breaks."""
    n = breaks.used[0]
    breaks.bonds[n, 0], breaks.bonds[n, 1], breaks.bonds[n, 2] = step, i, j
    breaks.places[n, 0], breaks.places[n, 1], breaks.stretch_before[n] = site, slot, stretch_before
    breaks.used[0] = n + 1


@njit(**INNER)
def pull_again(tiles, motion, pulls, breaks, n):  # type: ignore[no-untyped-def]
    """Add the second pull of the broken bond n to `pulls` (d, .), if it broke one step ago."""
    if breaks.bonds[n, 0] != motion.step - 1:
        return
    site, slot, u = breaks.places[n, 0], breaks.places[n, 1], motion.u
    t, row, offset = site // ROW, tiles.table[slot], tiles.offsets[slot]
    i, j, place, memory = tiles.node[site], tiles.node[site + offset], tiles.margin + site, np.int64(tiles.memory[t])
    pair, worst = pair_number(tiles, i, j), tiles.worst[memory, slot, site % ROW] if memory >= 0 else 0.0
    near, far = (place, place + offset) if motion.by_sites else (np.int64(i), np.int64(j))
    stretch = _stretch(row, u, place, offset)
    last = _stretch_before(row, u, motion.rate, motion.dt, place, offset, near, far)
    limits = tiles.peak[pair, slot], tiles.limit[pair, slot]
    pull = second_force(tiles.law, np.float64(stretch), last, breaks.stretch_before[n], worst, *limits)
    pull *= stiffness(tiles, row, t, place, offset) / (1 + stretch)
    for axis in range(len(u)):
        pulls[axis, near] += pull * (row[axis] + (u[axis, place + offset] - u[axis, place]))


@cached_njit(nogil=True, error_model="numpy")
def pull_all_again(tiles, u, rate, dt, step, breaks, out):  # type: ignore[no-untyped-def]
    """Add the second pulls of the bonds that broke one step ago, N/m^3, to `out` (n, d)."""
    motion = Motion(u, rate.T, False, dt, step)
    for n in range(breaks.used[0]):
        pull_again(tiles, motion, out.T, breaks, n)


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
    pair = _pair(tiles)
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


@njit(**INNER)
def _stretch(row, u, place, offset):  # type: ignore[no-untyped-def]
    """The stretch of the bond of a site."""
    along, square = u.dtype.type(0), u.dtype.type(0)
    for axis in range(len(u)):
        eta = u[axis, place + offset] - u[axis, place]
        along += row[axis] * eta
        square += eta * eta
    return _ratio(row[where_inverse(len(u))] * (2 * along + square))


@njit(**INNER)
def _stretch_before(row, u, rate, dt, place, offset, near, far):  # type: ignore[no-untyped-def]
    """The stretch of the bond of a site one step ago, since when its ends have moved with `rate` (d, .), m/s."""
    along, square = 0.0, 0.0
    for axis in range(len(u)):
        eta = u[axis, place + offset] - u[axis, place] - dt * (rate[axis, far] - rate[axis, near])
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


@cached_njit(nogil=True, error_model="numpy")
def sum_energies_of_tiles(tiles, u, own_strain_energy, own_dissipated, first, last):  # type: ignore[no-untyped-def]
    """Add the energy densities, J/m^3, that the bonds of nodes in the tiles `first` to `last` - 1 hold and that their
    softening has spent, to arrays (n,)."""
    for t in range(first, last):
        _sum_energies_of_tile(tiles, u, own_strain_energy, own_dissipated, t, np.uint16(EVERY))


@cached_njit(nogil=True, error_model="numpy")
def sum_some_energies(tiles, u, own_strain_energy, own_dissipated, site_mask):  # type: ignore[no-untyped-def]
    """`sum_energies_of_tiles` of the nodes at `site_mask` sites (16 t,) alone."""
    for t in range(len(tiles.kind)):
        lanes = np.uint16(0)
        for k in range(ROW):
            if site_mask[t * ROW + k]:
                lanes |= np.uint16(1) << np.uint16(k)
        if lanes != 0:
            _sum_energies_of_tile(tiles, u, own_strain_energy, own_dissipated, t, lanes)


@njit(**INNER)
def _sum_energies_of_tile(tiles, u, own_strain_energy, own_dissipated, t, lanes):  # type: ignore[no-untyped-def]
    """Add the energy densities that the bonds of some lanes of a tile hold and have spent."""
    row = tiles.memory[t]
    for slot in range(len(tiles.offsets)):
        field, offset, word = tiles.table[slot], tiles.offsets[slot], tiles.bits[t, slot] & lanes
        if word == 0:
            continue
        for k in range(ROW):
            if (word >> np.uint16(k)) & np.uint16(1):
                place, i, j = tiles.margin + t * ROW + k, tiles.node[t * ROW + k], tiles.node[t * ROW + k + offset]
                pair, worst = pair_number(tiles, i, j), tiles.worst[row, slot, k] if row >= 0 else 0.0
                peak, limit = tiles.peak[pair, slot], tiles.limit[pair, slot]
                if tiles.unbreakable[i] or tiles.unbreakable[j]:
                    peak = limit = np.inf
                c = stiffness(tiles, field, t, place, offset) / field[where_inverse(len(u))] / 4
                own_strain_energy[i] += bond_strain_energy(
                    tiles.law, c, _stretch(field, u, place, offset), worst, peak, limit
                )
                if worst > 0:
                    own_dissipated[i] += dissipated_energy(tiles.law, c, worst, peak, limit)


@cached_njit(error_model="numpy")
def recall(tiles, tile, slot, lane, worst):  # type: ignore[no-untyped-def]
    """Enter the largest stretches `worst` (b,) of bonds in the memory of their tiles."""
    for b in range(len(tile)):
        site = tile[b] * ROW + lane[b]
        pair = pair_number(tiles, tiles.node[site], tiles.node[site + tiles.offsets[slot[b]]])
        soften(tiles, tile[b], slot[b], lane[b], worst[b], tiles.peak[pair, slot[b]], tiles.limit[pair, slot[b]])
