"""The force densities on nodes of a lattice under a pair law: one loop over bonds, for blocks and tiles.

The dimension, the precision, the law, what swells and the layout are constants of compilation. What differs between
both layouts is where a lane's neighbour is (`pdsolve.lattice.layout`), and how bonds soften and break
(`pdsolve.lattice.blocks`, `pdsolve.lattice.tiles`). Sums stay in registers until a bond softens or breaks. Symbols as
in `pdsolve.lattice.bond` and pdsolve.laws.law; pdsolve.laws.pair says the same in a few lines and is what this is
tested against.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from pdsolve.codegen.inner_functions import is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, bonded, keep, magnitude, same, unless_none, where_above
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.blocks import BOUND, LIMITS, PULL, BlockMotion, row_of, update_lanes_of_block, worst_lanes
from pdsolve.lattice.bond import IN_PLACE, any_beyond, difference, elongation, factor, factor_near, pulled, zeros
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import (
    LANES,
    ONE,
    are_listed,
    has_bonds,
    in_tiles,
    is_in_tiles,
    neighbours,
    pair_law_of,
    places_of,
    slot_at,
    turns_of,
    vector_number,
)
from pdsolve.lattice.rows import relieve
from pdsolve.lattice.tiles import (
    EMPTY,
    UNBREAKABLE,
    SiteMotion,
    common_of_tile,
    has_room,
    room_for,
    update_lanes_of_tile,
    weight_in_tile,
    write_tile,
)
from pdsolve.laws.calls import secant

UNAGED, AGED, UNDONE = range(3)  # lanes: summed, the same though bonds softened or broke, not summed


@njit(**IN_PLACE)
def sum_lanes(bonds, history, motion, group, lane):  # type: ignore[no-untyped-def]
    """UNAGED, AGED or UNDONE, and the force densities on some lanes of a group, from `lane` on, N/m^3.

    Bonds over their limit break, and those over their peak soften. Lanes are not summed where a bond softens in a tile
    without a memory; they are summed anew when it has one.
    """
    (turn, last), f, updated = turns_of(bonds, group, lane), zeros(motion.u, bonds.axes), np.int64(-1)
    turn, _, f = _add(bonds, history, motion.u, group, lane, turn, last, None, f)
    while True:
        turn, e, f = _add(bonds, history, motion.u, group, lane, turn, last, updated, f)
        if turn == last:
            return UNAGED if updated < 0 else AGED, f
        is_done, f = update_lanes(bonds, history, motion, group, lane, slot_at(bonds, turn), e, f)
        if not is_done:
            return UNDONE, f
        updated = turn


@njit(**IN_PLACE)
def _add(bonds, history, u, group, lane, first, last, updated, f):  # type: ignore[no-untyped-def]
    """Add the pulls of bonds to f, turn by turn from `first` on.

    Returns the first turn with a bond that may soften or break, but for the turn `updated` where that was seen to, or
    `last`; and the e of its lanes. Without a turn `updated`, None, the loop is short and quick: it ends at the first
    turn with listed neighbours or with a bond that needs care.
    """
    axes, own = bonds.axes, places_of(bonds, group)[0] + lane
    here, relief = beside(u, axes, own), own_shrinkage(bonds, history, own)
    common = common_of_lanes(bonds, group, own)
    for turn in range(first, last):
        slot = slot_at(bonds, turn)
        if not has_bonds(bonds, group, slot):
            continue
        if updated is None and are_listed(bonds, slot, lane):
            return turn, same(u, 0.0), f
        row, w, eta, e = weigh_and_stretch(bonds, history, u, common, here, relief, group, own, slot, lane)
        g, near = factor_near(e), in_lanes(bonds, u, bonds.near, slot, lane)
        if any_beyond(magnitude(e), near):
            if updated is None:
                return turn, e, f
            e = where_above(same(u, np.inf), near, e, same(u, 0.0))  # lanes without a bond need no care
            if turn != updated and any_beyond(e, in_lanes(bonds, u, bonds.edge, slot, lane)):
                return turn, e, f
            g = factor(u, e, magnitude(e), narrow_reach(bonds, u, near), factor_near(e))
        w = secant_weight(bonds, history, common, w, e, g, slot, lane)
        f = pulled(f, multiply(bonds, w, e, g), eta, row)
    return last, same(u, 0.0), f


@njit(**IN_PLACE)
def weigh_and_stretch(bonds, history, u, common, here, relief, group, own, slot, lane):  # type: ignore[no-untyped-def]
    """Row of `vectors`, stiffness over length, eta and e of the bonds of some lanes of a slot, whose nodes are at the
    place `own` and have the displacements `here`."""
    row = bonds.vectors[vector_number(bonds, slot)]
    w = weight(bonds, common, u, row, slot, lane)  # before eta takes registers
    eta = difference(neighbours(bonds, u, bonds.axes, own, slot, lane), here)
    eta = relieve(eta, relief, neighbour_shrinkage(bonds, history, own, slot, lane), row)
    return row, w, eta, elongation_of_bonds(bonds, group, slot, lane, elongation(eta, row))


@overloaded(IN_PLACE)
def own_shrinkage(bonds, history, at):  # type: ignore[no-untyped-def]
    """Minus half the strain of free lanes from the place `at` on; None where nothing swells."""
    if _swells(bonds):
        return lambda bonds, history, at: beside(bonds.shrink, ONE, at)[0]
    if _swells(history):
        return lambda bonds, history, at: beside(history.shrink, ONE, at)[0]
    return lambda bonds, history, at: None


@overloaded(IN_PLACE)
def neighbour_shrinkage(bonds, history, at, slot, lane):  # type: ignore[no-untyped-def]
    """Minus half the strain of the free neighbours of some lanes, from the place `at` on; None where nothing swells."""
    if _swells(bonds):
        return lambda bonds, history, at, slot, lane: neighbours(bonds, bonds.shrink, ONE, at, slot, lane)[0]
    if _swells(history):
        return lambda bonds, history, at, slot, lane: neighbours(bonds, history.shrink, ONE, at, slot, lane)[0]
    return lambda bonds, history, at, slot, lane: None


def _swells(arrays: Any) -> bool:
    """Whether the numba type of tiles, or of the history of blocks, has strains of free nodes."""
    fields = arrays.instance_class._fields
    return "shrink" in fields and not is_none(arrays.types[fields.index("shrink")])


@in_tiles(common_of_tile)
def common_of_lanes(bonds, group, own):  # type: ignore[no-untyped-def]
    """What all slots of some lanes share, the first of which is at the place `own`: of a block, whether a bond has
    softened; of a tile, what its stiffnesses are made of."""
    return bonds.softened[group]


@in_tiles(weight_in_tile)
def weight(bonds, common, u, row, slot, lane):  # type: ignore[no-untyped-def]
    """The stiffness over length of the bonds of some lanes."""
    return row_of(bonds.stiffness, bonds.slots[slot, PULL], lane)


@in_tiles(lambda bonds, group, slot, lane, e: bonded((e,), bonds.bits, group, np.int64(slot), lane)[0])
def elongation_of_bonds(bonds, group, slot, lane, e):  # type: ignore[no-untyped-def]
    """e, and in tiles 0 in lanes without a bond; in blocks, their stiffness is 0."""
    return e


@in_tiles(lambda bonds, u, limit, slot, lane: same(u, limit))
def in_lanes(bonds, u, limit, slot, lane):  # type: ignore[no-untyped-def]
    """A limit of e in some lanes: the one of all bonds in tiles, rows of limits in blocks."""
    return row_of(limit, bonds.slots[slot, BOUND], lane)


@in_tiles(lambda bonds, u, near: near)
def narrow_reach(bonds, u, near):  # type: ignore[no-untyped-def]
    """|e| up to which the narrow polynomial is used; in tiles that up to which lanes need no care."""
    return same(u, NARROW)


@in_tiles(lambda bonds, w, e, g: w * (e * g))
def multiply(bonds, w, e, g):  # type: ignore[no-untyped-def]
    """w e g, in the order of each layout, so that results stay the same to the bit."""
    return w * e * g


@overloaded(IN_PLACE)
def secant_weight(bonds, history, common, w, e, g, slot, lane):  # type: ignore[no-untyped-def]
    """The secant of some lanes at e, over the bonds' lengths, from the stiffness over length w."""
    pair = pair_law_of(bonds)
    if pair.is_curved:
        return _curve
    if is_in_tiles(bonds):
        return _line_in_tile
    if pair.elastic_in_compression:
        return _one_sided_line_in_block
    return lambda bonds, history, common, w, e, g, slot, lane: w  # whose rows hold what is left


def _curve(bonds, history, common, w, e, g, slot, lane):  # type: ignore[no-untyped-def]
    e = unless_none(w, e, w)  # in blocks, lanes without a bond have any
    return w * secant(bonds.law, e * g * np.sqrt(1.0 + e), *history_of_lanes(bonds, history, common, slot, lane))


def _one_sided_line_in_block(bonds, history, common, w, e, g, slot, lane):  # type: ignore[no-untyped-def]
    if common:
        full = unless_none(w, row_of(bonds.stiffness, bonds.whole[slot], lane), w)  # of bonds that have not broken
        w = where_above(e, same(bonds.stiffness, 0.0), w, full)
    return w


def _line_in_tile(bonds, history, common, w, e, g, slot, lane):  # type: ignore[no-untyped-def]
    _, row_of_memory, _, _, _ = common
    if row_of_memory >= 0:
        (left,) = beside(bonds.share[row_of_memory, slot : slot + np.uint64(1)], ONE, lane)
        w = w * where_above(e, same(bonds.share, bonds.floor), left, same(bonds.share, 1.0))
    return w


def _history_in_tile(bonds, history, common, slot, lane):  # type: ignore[no-untyped-def]
    (_, row_of_memory, _, _, own), worst = common, same(bonds.share, 0.0)
    if row_of_memory >= 0:
        (worst,) = beside(bonds.share[row_of_memory, slot : slot + np.uint64(1)], ONE, lane)
    (beyond,) = beside(bonds.cells[UNBREAKABLE:], ONE, own)
    beyond = beyond + beside(bonds.cells[UNBREAKABLE:], ONE, own + bonds.offsets[slot])[0]
    return worst, beyond + bonds.peak[0, slot], beyond + bonds.limit[0, slot]


@in_tiles(_history_in_tile)
def history_of_lanes(bonds, history, common, slot, lane):  # type: ignore[no-untyped-def]
    """Largest stretches above their peaks, peaks and limits of some lanes, under a curved law."""
    kind, none = bonds.slots[slot, LIMITS], same(bonds.stiffness, 0.0)
    worst = worst_lanes(bonds.law, history.worst, slot, lane, none)
    return worst, row_of(bonds.peak, kind, lane), row_of(bonds.limit, kind, lane)


# Break and soften the bonds of some lanes of a slot with these e, and add to f the pulls that match their work;
# False if there is no memory for it
update_lanes = in_tiles(update_lanes_of_tile)(update_lanes_of_block)


@cached_njit(nogil=True, error_model="numpy")
def sum_blocks(blocks, tracks, before, out, step, first, last, thread):  # type: ignore[no-untyped-def]
    """Add the force densities of the blocks `first` to `last` - 1, N/m^3, to `out` (n, d); bonds over their limit break
    in this `step`. `before` (d, m) are the displacements one step ago."""
    motion = BlockMotion(tracks.u[0], before, step, blocks.scratch[thread])
    s = np.empty((len(before), ROW), before.dtype)
    for b in range(first, last):
        for lane in range(0, LANES, across(s)):
            _, f = sum_lanes(blocks, tracks, motion, b, lane)
            keep(f, s, 0)
            for k in range(min(across(s), len(out) - b * LANES - lane)):
                for axis in range(len(s)):
                    out[b * LANES + lane + k, axis] += s[axis, k]


@cached_njit(nogil=True, error_model="numpy")
def sum_tiles(tiles, u, rate, dt, step, out, dissipated, breaks, first, last):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles `first` to `last` - 1 to `out` (n, d); bonds over their limit break
    and those over their peak soften, but not in step 0.

    Returns the tile to go on with: `last`, or one that there was no room left to write breaks of, or one whose bonds
    soften and that has no memory.
    """
    s, motion = np.empty((len(u), ROW), u.dtype), SiteMotion(u, rate.T, False, dt, step, out.T, dissipated)
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        if not has_room(tiles, breaks):
            return t
        for lane in range(0, ROW, across(u)):
            status, f = sum_lanes(tiles, breaks, motion, t, lane)
            if status == UNDONE:
                return t
            keep(f, s, lane)
        write_tile(tiles, t, s, out)
    return last


@cached_njit(nogil=True, error_model="numpy")
def sum_some(tiles, u, rate, out, dissipated, site_mask):  # type: ignore[no-untyped-def]
    """Add the force densities, N/m^3, of the tiles with `site_mask` sites (16 t,) to `out` (n, d); nothing breaks."""
    nothing = room_for(ROW * len(tiles.offsets))
    for t in range(len(tiles.kind)):
        if site_mask[t * ROW : t * ROW + ROW].any():
            sum_tiles(tiles, u, rate, 0.0, 0, out, dissipated, nothing, t, t + 1)
