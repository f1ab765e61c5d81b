"""The sum over a node's bonds, fast: 64 nodes at a time, for nodes on lattices, best if numbered row by row.

Layout, after the sliced ELL format of sparse matrices:
    block    64 consecutive nodes; a node's place in it is its lane
    row      16 consecutive lanes
    slot     the bonds of a block with one reference vector, at most one a lane. Where the neighbours of a row's lanes
             are consecutive too, which is nearly everywhere, a slot stores how far on they are (way), else all (ids).
    table    reference vectors, rows of 64 stiffnesses and rows of 64 limits are stored once and shared by slots:
             inside a lattice all lanes have one stiffness and one limit, so that a slot is a few small numbers.
             A slot gets rows of its own when its first bond breaks or softens.
    mask     one bit a lane: there is a bond, and it is intact. As the stiffness is 0 where there is none, only what
             looks at single bonds needs it.

Symbols as in pdsolve.laws.law; pdsolve.laws.bilinear says the same in a few lines and is what this is tested against.
A lane carries an `edge`: nothing happens to its bond up to this e, that of its peak or, once it has softened, that of
its largest stretch so far; its stiffness is the secant's. So all bonds are summed alike, and a slot is looked at lane
by lane in the steps alone in which one of its bonds goes beyond.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.laws.bilinear import intact_share, spent_share
from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice import lanes, vectors
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.simd_lattice.pull import NARROW
from pdsolve.operators.simd_lattice.vectors import BOUND, FAR, PULL, VECTOR, add_any, add_far, add_slots

LANES = 4 * ROW
LIMITS = 7  # of a slot: row of `peak` and `limit`
# Only compiled code calls such a function: leaving out what Python would call it by saves a quarter of the compile.
# Nor does it make arrays: counting references to those it is given took a tenth of a step
INNER = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}

# Where a thread's scratch has the sums of the whole block
FX, FY, END = vectors.SCRATCH, vectors.SCRATCH + LANES, vectors.SCRATCH + 2 * LANES
_E = vectors.E
ACROSS = lanes.across(8)  # lanes summed at once in double precision; in single precision a row


class Blocks(NamedTuple):
    """Bonds in blocks: s slots."""

    start: NDArray[np.int64]  # (blocks + 1,) slots of a block
    slots: NDArray[np.int32]  # (s, 8) way from the nodes of each row to their neighbours, or FAR + row of `ids`; then
    # rows of `vectors`, of `stiffness`, of `near` and `edge`, and of `peak` and `limit`
    ids: NDArray[np.int32]  # (., 16) neighbours
    vectors: NDArray[np.floating]  # (., 8) xi, 2 xi / |xi|^2, 1 / |xi|^2
    stiffness: NDArray[np.floating]  # (., 64) secant stiffness / |xi|, 0 without a bond; at the end one for each slot
    near: NDArray[np.floating]  # (., 64) |e| up to which a lane needs no care, infinite without a bond; likewise
    edge: NDArray[np.floating]  # (., 64) e above which something happens to a bond; likewise
    peak: NDArray[np.floating]  # (., 64)
    limit: NDArray[np.floating]  # (., 64)
    whole: NDArray[np.int32]  # (s,) row of `stiffness` while no bond is broken or softened
    mask: NDArray[np.uint64]  # (s,) lanes with an intact bond
    softened: NDArray[np.bool_]  # (blocks,) whether a bond has been above its peak
    scratch: NDArray[np.floating]  # (threads, .) room for the sums of a block


class Tracks(NamedTuple):
    """The state of all blocks' nodes, component by component; m nodes in whole blocks, the last may be idle."""

    u: NDArray[np.floating]  # (3, 2, m) displacements of three steps in turn, m; at rest in the first
    v: NDArray[np.floating]  # (2, m) velocity, m/s; from a drift to the next kick the mean velocity between them
    a: NDArray[np.floating]  # (2, m) acceleration, m/s^2
    dissipated: NDArray[np.float64]  # (m,) spent by the node's broken bonds so far, J/m^3
    work: NDArray[np.float64]  # (m,) done on the node by loads and holds so far, J/m^3
    broken: NDArray[np.int32]  # (s, 64) step in which the bond broke, 0 while intact
    worst: NDArray[np.floating]  # (s, 64) or (0, 64): largest stretch above the peak, 0 if never there


@njit(forceinline=True, **INNER)
def sum_lanes(blocks, tracks, u, before, step, b, lane, s):  # type: ignore[no-untyped-def]
    """Force densities on some lanes of block b, from `lane` on, at u (2, m), N/m^3: at the beginning of `s`.

    Bonds over their limit break in this `step`; `before` are the displacements one step ago; `s` is the thread's
    scratch.
    """
    slots, ids, table, pull = blocks.slots, blocks.ids, blocks.vectors, blocks.stiffness
    near, edge, slot, last, own = blocks.near, blocks.edge, blocks.start[b], blocks.start[b + 1], b * LANES + lane
    for k in range(2 * ROW):
        s[k] = 0
    slot = add_slots(u, slots, ids, table, pull, near, edge, slot, last, own, lane, s)
    while slot < last:
        slot = add_any(u, slots, ids, table, pull, near, edge, slot, last, own, lane, s)
        if slot < last and not _age(blocks, tracks, before, step, slot, b, lane, s):
            slot = add_far(u, slots, ids, table, pull, near, edge, slot, slot + 1, own, lane, s)


@njit(forceinline=True, **INNER)
def _age(blocks, tracks, before, step, slot, b, first, s):  # type: ignore[no-untyped-def]
    """Break or soften the bonds of a slot that are beyond their edge, and book what that has spent.

    Returns whether there were any.
    """
    some, law = False, blocks.slots[slot, LIMITS]
    for k in range(across(s)):
        lane, e = first + k, s[_E + k]
        if e > blocks.edge[blocks.slots[slot, BOUND], lane]:
            some, row = True, _own_rows(blocks, slot)
            stretch, peak, limit = e / (1 + np.sqrt(1 + e)), blocks.peak[law, lane], blocks.limit[law, lane]
            if stretch > limit:
                _break(blocks, tracks, before, step, slot, b * LANES + lane, lane, stretch)
                continue
            if stretch > peak:
                blocks.softened[b] = True
                tracks.worst[slot, lane] = stretch  # whose digits are all that a checkpoint has
                share = intact_share(np.float64(tracks.worst[slot, lane]), np.float64(peak), np.float64(limit))
                blocks.stiffness[blocks.slots[slot, PULL], lane] = share * blocks.stiffness[blocks.whole[slot], lane]
            blocks.edge[row, lane] = e
            blocks.near[row, lane] = min(e, NARROW)
    return some


@njit(**INNER)
def across(s):  # type: ignore[no-untyped-def]
    """How many lanes are summed at once into this scratch."""
    return ACROSS if s.itemsize == 8 else ROW


@njit(**INNER)
def _break(blocks, tracks, before, step, slot, i, lane, stretch):  # type: ignore[no-untyped-def]
    """Take out the bond of node i that is over its limit, and book what it has spent."""
    row, law, j = blocks.slots[slot, BOUND], blocks.slots[slot, LIMITS], neighbour(blocks, slot, i, lane)
    vector = blocks.vectors[blocks.slots[slot, VECTOR]]
    peak, limit, x, y, inverse = blocks.peak[law, lane], blocks.limit[law, lane], vector[0], vector[1], vector[4]
    if peak < limit:
        spent = peak * limit
    else:
        eta_x, eta_y = before[0, j] - before[0, i], before[1, j] - before[1, i]
        e = inverse * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
        spent = stretch * (e / (np.sqrt(1 + e) + 1))
    tracks.dissipated[i] += blocks.stiffness[blocks.whole[slot], lane] / inverse * spent / 4
    tracks.broken[slot, lane] = step
    blocks.mask[slot] &= ~(np.uint64(1) << np.uint64(lane))
    blocks.stiffness[blocks.slots[slot, PULL], lane] = 0
    blocks.edge[row, lane] = blocks.near[row, lane] = np.inf


@njit(**INNER)
def _own_rows(blocks, slot):  # type: ignore[no-untyped-def]
    """Give a slot rows of stiffnesses and edges of its own; returns that of the edges."""
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
    """The node that the bond of node i, in this lane, goes to."""
    way = blocks.slots[slot, lane // ROW]
    return i + way if way < FAR else blocks.ids[way - FAR, lane % ROW]


@cached_njit(error_model="numpy")
def sum_blocks(blocks, tracks, before, out, step):  # type: ignore[no-untyped-def]
    """Add the force densities of all blocks, N/m^3, to `out` (n, 2), on one thread; else as `sum_lanes`."""
    s = blocks.scratch[0]
    for b in range(len(blocks.start) - 1):
        for lane in range(0, LANES, across(s)):
            sum_lanes(blocks, tracks, tracks.u[0], before, step, b, lane, s)
            for k in range(min(across(s), len(out) - b * LANES - lane)):
                out[b * LANES + lane + k, 0] += s[k]
                out[b * LANES + lane + k, 1] += s[ROW + k]


@cached_njit(error_model="numpy")
def energy_densities(blocks, worst, u, held, spent):  # type: ignore[no-untyped-def]
    """Add to (m,) arrays the energy the nodes' intact bonds hold and have spent on softening, J/m^3.

    On one thread: it is asked for once in many steps.
    """
    for b in range(len(blocks.start) - 1):
        for slot in range(blocks.start[b], blocks.start[b + 1]):
            _energies_of(blocks, u, b, slot, held)
            if blocks.softened[b]:
                _spent_of(blocks, worst, b, slot, spent)


@njit(**INNER)
def _energies_of(blocks, u, b, slot, held):  # type: ignore[no-untyped-def]
    vector = blocks.vectors[blocks.slots[slot, VECTOR]]
    x, y, inverse = vector[0], vector[1], vector[4]
    stiffness = blocks.stiffness[blocks.slots[slot, PULL]]
    for row in range(LANES // ROW):
        first, way = b * LANES + row * ROW, blocks.slots[slot, row]
        for k in range(ROW):
            i = np.uint64(first + k)
            j = np.uint64(first + way + k) if way < FAR else np.uint64(blocks.ids[way - FAR, k])
            eta_x, eta_y = u[0, j] - u[0, i], u[1, j] - u[1, i]
            e = inverse * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
            stretch = e / (np.sqrt(1 + e) + 1)
            held[i] += stiffness[row * ROW + k] / inverse / 4 * stretch * stretch


@njit(**INNER)
def _spent_of(blocks, worst, b, slot, spent):  # type: ignore[no-untyped-def]
    law, inverse = blocks.slots[slot, LIMITS], blocks.vectors[blocks.slots[slot, VECTOR], 4]
    for lane in range(LANES):
        largest = worst[slot, lane]
        if largest > 0 and blocks.near[blocks.slots[slot, BOUND], lane] < np.inf:
            peak, limit = blocks.peak[law, lane], blocks.limit[law, lane]
            whole = blocks.stiffness[blocks.whole[slot], lane] / inverse / 4
            spent[b * LANES + lane] += whole * peak * limit * spent_share(largest, peak, limit)
