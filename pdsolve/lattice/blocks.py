"""Bonds in blocks of 64 nodes: for nodes on lattices of any spacings, best if numbered row by row.

Layout, after the sliced ELL format of sparse matrices:

    block    64 consecutive nodes; a node's position in it is its lane
    row      16 consecutive lanes
    slot     the bonds of a block with one reference vector, at most one a lane. If the neighbours of a row's lanes are
             consecutive too, as nearly everywhere, a slot stores their offset (way), otherwise all of them (ids).
    table    reference vectors, rows of 64 stiffnesses and rows of 64 limits are stored once and shared by slots.
             Inside a lattice all lanes have one stiffness and one limit, so that a slot is a few small numbers.
             A slot gets its own rows when its first bond breaks or softens.
    mask     one bit a lane: the bond exists and is intact. As the stiffness is 0 without a bond, only code for single
             bonds needs it.

Symbols as in pdsolve.laws.law. A lane has an `edge`: an e up to which its bond does not change. It is the e of the
limit or, for a softening law, of the peak and then of the largest stretch so far. Laws with straight lines have their
secant as stiffness; where softened bonds have all their stiffness under compression, the blocks with one choose between
the two in lanes. A slot is processed lane by lane only in steps in which one of its bonds exceeds its edge.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.lanes import beside, keep, trailing_zeros, which_above
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import displaced_along, entries, sums_in, where_inverse
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import FAR, LANES, ONE, VECTOR, pair_law_of
from pdsolve.laws.calls import added_force, broken_energy, dissipated_energy, pair_of, secant, second_force

PULL, BOUND, LIMITS = 5, 6, 7  # of a slot: row of `stiffness`, of `near` and `edge`, and of `peak` and `limit`
# Edges of a bond that broke in the last step, so that it is looked at in this one: minus its `near` is the size of its
# stretch one step before it broke, of a bond that was longer then than at the start, or shorter
PENDING, PENDING_SHORT = -np.inf, -1e30


class Blocks(NamedTuple):
    """Bonds in blocks: s slots, in d dimensions."""

    law: Any  # columns of no bonds, by whose type kernels are compiled
    axes: tuple[int, ...]  # as many entries as there are axes, d
    start: NDArray[np.int64]  # (blocks + 1,) slots of a block
    slots: NDArray[np.int32]  # (s, 8) way from the nodes of each row to their neighbours, or FAR + row of `ids`; then
    # rows of `vectors`, of `stiffness`, of `near` and `edge`, and of `peak` and `limit`
    start_of_rows: NDArray[np.int64]  # (4 blocks + 1,) entries of a row in `of_rows`
    of_rows: NDArray[np.int32]  # (.,) slots in which a row has bonds, consecutive neighbours first; of bodies
    ids: NDArray[np.int32]  # (., 16) neighbours
    vectors: NDArray[np.floating]  # (., 8 or 9) xi, 2 xi / |xi|^2, 1 / |xi|^2
    stiffness: NDArray[np.floating]  # (., 64) stiffness / |xi|, the secant's of straight lines, 0 without a bond; then
    # one for each slot
    near: NDArray[np.floating]  # (., 64) |e| up to which a lane needs no care, infinite without a bond; likewise
    edge: NDArray[np.floating]  # (., 64) e above which something happens to a bond; likewise
    peak: NDArray[np.floating]  # (., 64)
    limit: NDArray[np.floating]  # (., 64)
    whole: NDArray[np.int32]  # (s,) row of `stiffness` while no bond is broken or softened
    mask: NDArray[np.uint64]  # (s,) lanes with an intact bond
    softened: NDArray[np.bool_]  # (blocks,) whether a bond has been above its peak
    scratch: NDArray[np.floating]  # (threads, 16 (d + 1)) room for the sums of a row along each axis, and its e


class Tracks(NamedTuple):
    """The state of all blocks' nodes, component by component; m nodes in whole blocks, of which the last may be
    idle."""

    u: NDArray[np.floating]  # (3, d, m) displacements of three steps in turn, m; at rest in the first
    v: NDArray[np.floating]  # (d, m) velocity, m/s; from a drift to the next kick the mean velocity between them
    a: NDArray[np.floating]  # (d, m) acceleration, m/s^2
    dissipated: NDArray[np.float64]  # (m,) spent by the node's broken bonds so far, J/m^3
    work: NDArray[np.float64]  # (m,) done on the node by loads and holds so far, J/m^3
    broken: NDArray[np.int32]  # (s, 64) step in which the bond broke, 0 while intact
    worst: NDArray[np.floating]  # (s, 64) or (0, 64): largest stretch above the peak, 0 if never there
    shrink: NDArray[np.floating] | None = None  # (m,) minus half the strain of a free node: bonds are relieved of that
    # of both ends; None: nothing swells


class BlockMotion(NamedTuple):
    """How nodes move in a step, and a thread's room."""

    u: NDArray[np.floating]  # (d, m) displacements, m
    previous_u: NDArray[np.floating]  # (d, m) one step ago, m
    step: int
    s: NDArray[np.floating]  # (.,) scratch: sums of forces on a row of lanes, axis by axis, then e


@njit(forceinline=True, **INNER)
def row_of(table, row, lane):  # type: ignore[no-untyped-def]
    """The lanes from `lane` on of a row of a table (., 64)."""
    return beside(table, ONE, np.int64(row) * LANES + lane)[0]


def worst_lanes(law: Any, worst: Any, slot: Any, lane: Any, none: Any) -> Any:
    """Largest stretches above their peaks of the lanes from `lane` on, or `none`."""


@overload(worst_lanes, jit_options=INNER | {"forceinline": True})
def _worst_lanes(law, worst, slot, lane, none):  # type: ignore[no-untyped-def]
    if pair_of(law).softening is None:
        return lambda law, worst, slot, lane, none: none
    return lambda law, worst, slot, lane, none: row_of(worst, slot, lane)


def worst_of(law: Any, worst: Any, slot: Any, lane: Any) -> Any:
    """Largest stretch of a bond above its peak, 0 if it was never above."""


@overload(worst_of, jit_options=INNER)
def _worst_of(law, worst, slot, lane):  # type: ignore[no-untyped-def]
    if pair_of(law).softening is None:
        return lambda law, worst, slot, lane: 0.0
    return lambda law, worst, slot, lane: np.float64(worst[slot, lane])


def update_lanes_of_block(bonds, history, motion, group, lane, slot, e, f):  # type: ignore[no-untyped-def]
    sums, axes = sums_in(motion.s, bonds.axes), bonds.axes
    keep((e,), motion.s, len(axes) * ROW)
    keep(f, sums, 0)
    over = which_above(e, row_of(bonds.edge, bonds.slots[slot, BOUND], lane))
    _update_bonds(bonds, history, motion, np.int64(slot), group, lane, over)
    return True, beside(sums, axes, 0)


@njit(**INNER)
def _update_bonds(blocks, tracks, motion, slot, b, first, over):  # type: ignore[no-untyped-def]
    """Break or soften the bonds of a slot in the lanes of the bits `over`, counted from `first` on, add the pulls that
    match their work to the sums in the scratch, and book the dissipated energy."""
    u, before, step, s = motion
    law, first_e = blocks.slots[slot, LIMITS], len(blocks.axes) * ROW  # in s
    while over != 0:
        k = trailing_zeros(over)
        over &= over - 1
        lane, e = first + k, s[first_e + k]
        row, stretch, i = _own_rows(blocks, slot), e / (1 + np.sqrt(1 + e)), b * LANES + lane
        is_pending = blocks.edge[row, lane] <= PENDING_SHORT
        if is_pending and tracks.broken[slot, lane] == step:  # if a step is summed twice: it pulls in the next one
            continue
        if is_pending:
            pull = _pull_again(blocks, tracks, before, step, slot, b, lane, stretch) / (1 + stretch)
            _add_force(blocks, tracks, u, slot, i, lane, pull, k, s)
            continue
        peak, limit = np.float64(blocks.peak[law, lane]), np.float64(blocks.limit[law, lane])
        if stretch > peak:
            last, worst = _previous_stretch(blocks, tracks, before, slot, i, lane), 0.0
            if blocks.softened[b]:  # else there may be no room for it
                worst = worst_of(blocks.law, tracks.worst, slot, lane)
            pull = added_force(blocks.law, stretch, last, worst, peak, limit) / (1 + stretch)
            _add_force(blocks, tracks, u, slot, i, lane, pull, k, s)
            if stretch > limit:
                c = blocks.stiffness[blocks.whole[slot], lane] / inverse_of(blocks, slot) / 4
                tracks.dissipated[i] += broken_energy(blocks.law, c, stretch, last, peak, limit)
                tracks.broken[slot, lane] = step
                blocks.mask[slot] &= ~(np.uint64(1) << np.uint64(lane))
                blocks.stiffness[blocks.slots[slot, PULL], lane] = 0
                blocks.edge[row, lane] = blocks.near[row, lane] = np.inf
                if blocks.law.matches_work and last < limit and last < stretch:
                    blocks.edge[row, lane] = PENDING if last >= 0 else PENDING_SHORT
                    blocks.near[row, lane] = -abs(last)
                continue
            soften(blocks, tracks, slot, b, lane, stretch, peak, limit)
        blocks.edge[row, lane] = e
        blocks.near[row, lane] = min(e, NARROW)


def soften(blocks: Any, tracks: Any, slot: Any, b: Any, lane: Any, stretch: Any, peak: Any, limit: Any) -> None:
    """Store the stretch of a bond above its peak, if its law softens."""


@overload(soften, jit_options=INNER)
def _soften(blocks, tracks, slot, b, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    pair = pair_law_of(blocks)
    if pair.softening is None:
        return lambda blocks, tracks, slot, b, lane, stretch, peak, limit: None
    return _update_history if pair.is_curved else _weaken


@register_jitable(**INNER)
def _update_history(blocks, tracks, slot, b, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    blocks.softened[b] = True
    tracks.worst[slot, lane] = stretch  # whose digits are all that a checkpoint has


def _weaken(blocks, tracks, slot, b, lane, stretch, peak, limit):  # type: ignore[no-untyped-def]
    _update_history(blocks, tracks, slot, b, lane, stretch, peak, limit)
    share = secant(blocks.law, stretch, np.float64(tracks.worst[slot, lane]), peak, limit)
    blocks.stiffness[blocks.slots[slot, PULL], lane] = share * blocks.stiffness[blocks.whole[slot], lane]


@njit(**INNER)
def _previous_stretch(blocks, tracks, before, slot, i, lane):  # type: ignore[no-untyped-def]
    """The stretch of a bond of node i at the displacements one step ago."""
    xi = entries(blocks.vectors[blocks.slots[slot, VECTOR]], blocks.axes)
    eta = displaced_along(before, tracks.shrink, xi, i, neighbour(blocks, slot, i, lane))
    along = xi[0] * eta[0]
    for axis in range(1, len(xi)):
        along += xi[axis] * eta[axis]
    along *= 2
    for axis in range(len(xi)):
        along += eta[axis] * eta[axis]
    e = inverse_of(blocks, slot) * along
    return e / (np.sqrt(1 + e) + 1)


@njit(forceinline=True, **INNER)
def inverse_of(blocks, slot):  # type: ignore[no-untyped-def]
    """1 / |xi|^2 of a slot's bonds, 1/m^2."""
    return blocks.vectors[blocks.slots[slot, VECTOR], where_inverse(len(blocks.axes))]


@njit(**INNER)
def _pull_again(blocks, tracks, before, step, slot, b, lane, stretch):  # type: ignore[no-untyped-def]
    """Force over stiffness with which a bond that has broken pulls for a second time, if that was one step ago; it
    needs no care from now on."""
    row, law, i = blocks.slots[slot, BOUND], blocks.slots[slot, LIMITS], b * LANES + lane
    first, worst, pull = np.float64(blocks.near[row, lane]), 0.0, 0.0
    if blocks.edge[row, lane] == PENDING:
        first = -first
    peak, limit = np.float64(blocks.peak[law, lane]), np.float64(blocks.limit[law, lane])
    if tracks.broken[slot, lane] == step - 1:
        if blocks.softened[b]:
            worst = worst_of(blocks.law, tracks.worst, slot, lane)
        last = _previous_stretch(blocks, tracks, before, slot, i, lane)
        pull = second_force(blocks.law, stretch, last, first, worst, peak, limit)
    blocks.edge[row, lane] = blocks.near[row, lane] = np.inf
    return pull


@njit(**INNER)
def _add_force(blocks, tracks, u, slot, i, lane, pull, k, s):  # type: ignore[no-untyped-def]
    """Add the pull of a bond of node i, over stiffness and length ratio, to the sums of lane k in s."""
    xi = entries(blocks.vectors[blocks.slots[slot, VECTOR]], blocks.axes)
    eta = displaced_along(u, tracks.shrink, xi, i, neighbour(blocks, slot, i, lane))
    pull *= blocks.stiffness[blocks.whole[slot], lane]
    for axis in range(len(xi)):
        s[axis * ROW + k] += pull * (xi[axis] + eta[axis])


@njit(**INNER)
def _own_rows(blocks, slot):  # type: ignore[no-untyped-def]
    """Give a slot its own rows of stiffnesses and edges; returns the row of the edges."""
    slots = len(blocks.mask)
    pull, bound = len(blocks.stiffness) - slots + slot, len(blocks.edge) - slots + slot
    if blocks.slots[slot, PULL] == pull:
        return bound
    for lane in range(LANES):
        blocks.stiffness[pull, lane] = blocks.stiffness[blocks.slots[slot, PULL], lane]
        blocks.near[bound, lane] = blocks.near[blocks.slots[slot, BOUND], lane]
        blocks.edge[bound, lane] = blocks.edge[blocks.slots[slot, BOUND], lane]
    blocks.slots[slot, PULL], blocks.slots[slot, BOUND] = pull, bound
    return bound


@njit(forceinline=True, **INNER)
def neighbour(blocks, slot, i, lane):  # type: ignore[no-untyped-def]
    """The neighbour at the other end of node i's bond in this lane."""
    way = blocks.slots[slot, lane // ROW]
    return i + way if way < FAR else blocks.ids[way - FAR, lane % ROW]


@njit(**INNER)
def dissipated_in_slot(blocks, worst, b, slot, out):  # type: ignore[no-untyped-def]
    """Add what softening has dissipated in the intact bonds of a slot, J/m^3, to `out` (m,)."""
    law, inverse = blocks.slots[slot, LIMITS], inverse_of(blocks, slot)
    for lane in range(LANES):
        largest = worst[slot, lane]
        if largest > 0 and (blocks.mask[slot] >> np.uint64(lane)) & np.uint64(1):
            peak, limit = blocks.peak[law, lane], blocks.limit[law, lane]
            full_stiffness = blocks.stiffness[blocks.whole[slot], lane] / inverse / 4
            out[b * LANES + lane] += dissipated_energy(blocks.law, full_stiffness, largest, peak, limit)
