"""The sum over a node's bonds, fast: 64 nodes at a time, for nodes on lattices, best if numbered row by row.

Layout, after the sliced ELL format of sparse matrices:
    block    64 consecutive nodes; a node's place in it is its lane
    slot     the bonds of a block with one reference vector, at most one a lane. Where the neighbours of the lanes
             are consecutive too, which is nearly everywhere, a slot stores the first one (base), else all 64 (ids).
    table    reference vectors, rows of 64 stiffnesses and rows of 64 limits are stored once and shared by slots:
             inside a lattice all lanes have one stiffness and one limit, so that a slot is a few small numbers.
             A slot gets a row of stiffnesses of its own when its first bond breaks.
    mask     one bit a lane: there is a bond, and it is intact. As the stiffness says where there is none, only what
             looks at single bonds needs it.
    spare    64 nodes a thread behind the others, to line up neighbours that are not consecutive

What numba makes of the loops over lanes is vector code as long as they write to one scratch array at places known to
the compiler, read consecutive nodes and count in unsigned integers; benchmarks/ watches over that.

Symbols as in pdsolve.laws.law; pdsolve.laws.bilinear says the same in a few lines and is what this is tested against.
A block is first summed as if nothing broke. Where every e is below the lowest peak of the block's bonds nothing can
have broken or softened; otherwise, and where a bond has softened before, the block is summed again with the laws
asked. Which of the two it is depends on the state alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import get_thread_id, njit
from numpy.typing import NDArray

from pdsolve.laws.bilinear import intact_share, spent_share

LANES = 64
# Only compiled code calls such a function: leaving out what Python would call it by saves a quarter of the compile.
# Nor does it make arrays: counting references to those it is given took a tenth of a step
INNER = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
NO_BOND = -1.0  # stiffness of a lane without an intact bond; at the edge of a horizon that of a bond may be 0

# Where the rows of 64 begin in a thread's scratch array
_UX, _UY, FX, FY, _TOP, _STRETCH, _WORST, END = (np.uint64(LANES * row) for row in range(8))
LANE_COUNT, _ONE = np.uint64(LANES), np.uint64(1)


class Blocks(NamedTuple):
    """Bonds in blocks: s slots."""

    start: NDArray[np.int64]  # (blocks + 1,) slots of a block
    vector: NDArray[np.int32]  # (s,) row of `vectors`
    base: NDArray[np.int64]  # (s,) node next to lane 0, or -1 - row of `ids`
    pull: NDArray[np.int32]  # (s,) row of `stiffness`, whole[slot] or its own, which is (rows - s) + slot
    whole: NDArray[np.int32]  # (s,) row of `stiffness` while no bond is broken
    bound: NDArray[np.int32]  # (s,) row of `peak` and `limit`
    mask: NDArray[np.uint64]  # (s,) lanes with an intact bond
    ids: NDArray[np.uint32]  # (., 64) neighbours
    vectors: NDArray[np.floating]  # (., 3) xi_x, xi_y and 1/|xi|^2
    stiffness: NDArray[np.floating]  # (., 64) stiffness / |xi|, below 0 without a bond; at the end one for each slot
    peak: NDArray[np.floating]  # (., 64)
    limit: NDArray[np.floating]  # (., 64)
    threshold: NDArray[np.floating]  # (blocks,) of e, below which nothing breaks or softens
    softened: NDArray[np.bool_]  # (blocks,) whether a bond has been above its peak
    scratch: NDArray[np.floating]  # (threads, .) room for the sums of a block


class Tracks(NamedTuple):
    """The state of all blocks' nodes, component by component; m nodes in whole blocks, the last may be idle."""

    u: NDArray[np.floating]  # (3, 2, m + spare) displacements of three steps in turn, m; at rest in the first
    v: NDArray[np.floating]  # (2, m) velocity, m/s; from a drift to the next kick the mean velocity between them
    a: NDArray[np.floating]  # (2, m) acceleration, m/s^2
    dissipated: NDArray[np.float64]  # (m,) spent by the node's broken bonds so far, J/m^3
    work: NDArray[np.float64]  # (m,) done on the node by loads and holds so far, J/m^3
    broken: NDArray[np.int32]  # (s, 64) step in which the bond broke, 0 while intact
    worst: NDArray[np.floating]  # (s, 64) or (0, 64): largest stretch above the peak, 0 if never there


@njit(**INNER)
def sum_block(blocks, broken, worst, u, before, dissipated, step, b, thread, s):  # type: ignore[no-untyped-def]
    """Force densities on the nodes of block b, N/m^3, at u (2, m + spare): in the rows FX and FY of `s`.

    Bonds over their limit break in this `step`; `before` are the displacements one step ago; `s` is the thread's row
    of scratch.
    """
    first, spare = np.uint64(b) * LANE_COUNT, LANE_COUNT * np.uint64(len(blocks.start) - 1 + thread)
    if not blocks.softened[b]:
        _begin(u, first, s)
        _add_intact(blocks, u, b, spare, s)
        if not _exceeds(s):
            return
    _begin(u, first, s)
    for slot in range(np.uint64(blocks.start[b]), np.uint64(blocks.start[b + 1])):
        lined_up = _lined_up(blocks, u, slot, spare)
        if len(worst) > 0:
            _add_softening(blocks, worst, u, slot, lined_up, s)
            if _remember(worst, slot, s):
                blocks.softened[b] = True
        else:
            _add_brittle(blocks, u, slot, lined_up, s)
        if _exceeds(s):
            _break(blocks, broken, worst, before, dissipated, step, slot, first, s)


@njit(**INNER)
def _begin(u, first, s):  # type: ignore[no-untyped-def]
    """The block's displacements, and nothing else yet."""
    zero = s.dtype.type(0)
    for lane in range(LANE_COUNT):
        s[_UX + lane] = u[0, first + lane]
        s[_UY + lane] = u[1, first + lane]
    for lane in range(LANE_COUNT):
        s[FX + lane] = zero
        s[FY + lane] = zero
        s[_TOP + lane] = zero


@njit(**INNER)
def _lined_up(blocks, u, slot, spare):  # type: ignore[no-untyped-def]
    """The first of a slot's 64 neighbours; where they are not consecutive, copies of them from `spare` on."""
    base = blocks.base[slot]
    if base >= 0:
        return np.uint64(base)
    ids, row = blocks.ids, np.uint64(-1 - base)
    for lane in range(LANE_COUNT):
        u[0, spare + lane] = u[0, ids[row, lane]]
        u[1, spare + lane] = u[1, ids[row, lane]]
    return spare


@njit(**INNER)
def _vector(vectors, row):  # type: ignore[no-untyped-def]
    """xi_x, xi_y and 1 / |xi|^2 of a row of the table."""
    at = np.uint64(row)
    return vectors[at, 0], vectors[at, 1], vectors[at, 2]


@njit(fastmath={"contract"}, **INNER)
def _add_intact(blocks, u, b, spare, s):  # type: ignore[no-untyped-def]
    """Forces as if nothing broke; in _TOP how many of a lane's bonds have an e above the threshold.

    What a lane without a bond finds in `u` does not matter.
    """
    stiffness, threshold, zero, one = blocks.stiffness, blocks.threshold[b], s.dtype.type(0), s.dtype.type(1)
    for slot in range(np.uint64(blocks.start[b]), np.uint64(blocks.start[b + 1])):
        first, row = _lined_up(blocks, u, slot, spare), np.uint64(blocks.pull[slot])
        x, y, inverse = _vector(blocks.vectors, blocks.vector[slot])
        x2, y2 = (x + x) * inverse, (y + y) * inverse
        for lane in range(LANE_COUNT):
            eta_x, eta_y = u[0, first + lane] - s[_UX + lane], u[1, first + lane] - s[_UY + lane]
            w = stiffness[row, lane]
            e = (x2 + inverse * eta_x) * eta_x + (y2 + inverse * eta_y) * eta_y
            e = e if w >= zero else zero
            pull = w * e / (one + e + np.sqrt(one + e))  # q (q + 1) = q^2 + q
            s[FX + lane] += pull * (x + eta_x)
            s[FY + lane] += pull * (y + eta_y)
            # The largest e would do, but is a store under a mask, which some processors take ten times as long for
            s[_TOP + lane] += one if e > threshold else zero


@njit(fastmath={"contract"}, **INNER)
def _add_brittle(blocks, u, slot, first, s):  # type: ignore[no-untyped-def]
    """Forces of the bonds below their limit; how far stretches are above it."""
    stiffness, limit, zero, one = blocks.stiffness, blocks.limit, s.dtype.type(0), s.dtype.type(1)
    row, bound = np.uint64(blocks.pull[slot]), np.uint64(blocks.bound[slot])
    x, y, inverse = _vector(blocks.vectors, blocks.vector[slot])
    x2, y2 = (x + x) * inverse, (y + y) * inverse
    for lane in range(LANE_COUNT):
        eta_x, eta_y = u[0, first + lane] - s[_UX + lane], u[1, first + lane] - s[_UY + lane]
        w = stiffness[row, lane]
        e = (x2 + inverse * eta_x) * eta_x + (y2 + inverse * eta_y) * eta_y
        e = e if w >= zero else zero
        q = np.sqrt(one + e)
        loss = e / (one + e + q)  # e / (q (q + 1)): one division for the two below
        pull, stretch = w * loss, q * loss
        pull = zero if stretch > limit[bound, lane] else pull
        s[FX + lane] += pull * (x + eta_x)
        s[FY + lane] += pull * (y + eta_y)
        s[_STRETCH + lane] = stretch
        s[_TOP + lane] = stretch - limit[bound, lane]


@njit(fastmath={"contract"}, **INNER)
def _add_softening(blocks, worst, u, slot, first, s):  # type: ignore[no-untyped-def]
    """The same where bonds soften, and the largest stretches above their peaks so far."""
    stiffness, peaks, limits, zero, one = blocks.stiffness, blocks.peak, blocks.limit, s.dtype.type(0), s.dtype.type(1)
    row, bound = np.uint64(blocks.pull[slot]), np.uint64(blocks.bound[slot])
    x, y, inverse = _vector(blocks.vectors, blocks.vector[slot])
    x2, y2 = (x + x) * inverse, (y + y) * inverse
    for lane in range(LANE_COUNT):
        eta_x, eta_y = u[0, first + lane] - s[_UX + lane], u[1, first + lane] - s[_UY + lane]
        w = stiffness[row, lane]
        e = (x2 + inverse * eta_x) * eta_x + (y2 + inverse * eta_y) * eta_y
        e = e if w >= zero else zero
        q = np.sqrt(one + e)
        loss = e / (one + e + q)  # e / (q (q + 1)): one division for the two below
        pull, stretch = w * loss, q * loss
        peak, limit, known = peaks[bound, lane], limits[bound, lane], worst[slot, lane]
        so_far = known if w >= zero else zero
        risen = stretch if stretch > peak else so_far
        risen = risen if risen > so_far else so_far
        largest = so_far if stretch > limit else risen
        share = intact_share(largest, peak, limit)
        share = share if largest > zero else one
        share = zero if stretch > limit else share
        s[FX + lane] += share * pull * (x + eta_x)
        s[FY + lane] += share * pull * (y + eta_y)
        s[_WORST + lane] = largest if w >= zero else known
        s[_STRETCH + lane] = stretch
        s[_TOP + lane] = stretch - limit


@njit(**INNER)
def _exceeds(s):  # type: ignore[no-untyped-def]
    """Whether a lane's top is above 0. Counting is vector code, looking for the largest is not."""
    above, zero = 0, s.dtype.type(0)
    for lane in range(LANE_COUNT):
        above += 1 if s[_TOP + lane] > zero else 0
    return above > 0


@njit(**INNER)
def _remember(worst, slot, s):  # type: ignore[no-untyped-def]
    """Write the largest stretches down; returns whether there are any."""
    some, zero = 0, s.dtype.type(0)
    for lane in range(LANE_COUNT):
        some += 1 if s[_WORST + lane] > zero else 0
    if some > 0:
        for lane in range(LANE_COUNT):
            worst[slot, lane] = s[_WORST + lane]
    return some > 0


@njit(**INNER)
def _break(blocks, broken, worst, before, dissipated, step, slot, first, s):  # type: ignore[no-untyped-def]
    """Take out the bonds over their limit, one by one, and book what they have spent."""
    x, y, inverse = _vector(blocks.vectors, blocks.vector[slot])
    for lane in range(LANE_COUNT):
        if s[_TOP + lane] > 0:
            i, j = first + lane, _neighbour(blocks, slot, lane)
            peak, limit = blocks.peak[blocks.bound[slot], lane], blocks.limit[blocks.bound[slot], lane]
            if len(worst) > 0 and peak < limit:
                spent = peak * limit
            else:
                eta_x, eta_y = before[0, j] - before[0, i], before[1, j] - before[1, i]
                e = inverse * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
                spent = s[_STRETCH + lane] * (e / (np.sqrt(1 + e) + 1))
            dissipated[i] += blocks.stiffness[blocks.pull[slot], lane] / inverse * spent / 4
            broken[slot, lane] = step
            blocks.mask[slot] &= ~(_ONE << lane)
            _tear(blocks, slot, lane)


@njit(**INNER)
def _tear(blocks, slot, lane):  # type: ignore[no-untyped-def]
    """Mark a lane of a slot as being without a bond from now on, in a row of stiffnesses of the slot's own."""
    own, row = len(blocks.stiffness) - len(blocks.pull) + np.int64(slot), blocks.pull[slot]
    if row != own:
        for other in range(LANE_COUNT):
            blocks.stiffness[own, other] = blocks.stiffness[row, other]
        blocks.pull[slot] = own
    blocks.stiffness[own, lane] = NO_BOND


@njit(**INNER)
def _neighbour(blocks, slot, lane):  # type: ignore[no-untyped-def]
    """The node that the bond of a lane goes to."""
    base = blocks.base[slot]
    return np.uint64(base) + lane if base >= 0 else np.uint64(blocks.ids[-1 - base, lane])


@njit(cache=True, error_model="numpy")
def sum_blocks(blocks, tracks, before, out, step):  # type: ignore[no-untyped-def]
    """Add the force densities of all blocks, N/m^3, to `out` (n, 2), on one thread; else as `sum_block`."""
    for b in range(len(blocks.start) - 1):
        _sum_into(blocks, tracks, before, out, step, np.int64(b))


@njit(**INNER)
def _sum_into(blocks, tracks, before, out, step, b):  # type: ignore[no-untyped-def]
    s, first = blocks.scratch[0], b * LANES
    sum_block(blocks, tracks.broken, tracks.worst, tracks.u[0], before, tracks.dissipated, step, b, 0, s)
    for lane in range(min(LANES, len(out) - first)):
        out[first + lane, 0] += s[FX + np.uint64(lane)]
        out[first + lane, 1] += s[FY + np.uint64(lane)]


@njit(cache=True, error_model="numpy")
def energy_densities(blocks, worst, u, strain, softened):  # type: ignore[no-untyped-def]
    """Add to (m,) arrays the energy the nodes' intact bonds hold and have spent on softening, J/m^3.

    On one thread: it is asked for once in many steps, and a parallel loop would take a second more to compile.
    """
    for b in range(len(blocks.start) - 1):
        _energies_of(blocks, worst, u, strain, softened, np.int64(b))


@njit(**INNER)
def _energies_of(blocks, worst, u, strain, softened, b):  # type: ignore[no-untyped-def]
    thread = get_thread_id()
    s, spare = blocks.scratch[thread], LANE_COUNT * np.uint64(len(blocks.start) - 1 + thread)
    own, zero = np.uint64(b) * LANE_COUNT, blocks.scratch.dtype.type(0)
    _begin(u, own, s)
    for slot in range(np.uint64(blocks.start[b]), np.uint64(blocks.start[b + 1])):
        first, row = _lined_up(blocks, u, slot, spare), np.uint64(blocks.pull[slot])
        x, y, inverse = _vector(blocks.vectors, blocks.vector[slot])
        for lane in range(LANE_COUNT):
            eta_x, eta_y = u[0, first + lane] - s[_UX + lane], u[1, first + lane] - s[_UY + lane]
            w = blocks.stiffness[row, lane]
            e = inverse * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
            stretch = e / (np.sqrt(1 + e) + 1)
            energy = w / inverse / 4 * stretch * stretch
            s[_STRETCH + lane] = energy if w >= zero else zero
        if blocks.softened[b]:
            bound = np.uint64(blocks.bound[slot])
            for lane in range(LANE_COUNT):
                largest, w = worst[slot, lane], blocks.stiffness[row, lane]
                if largest > zero and w >= zero:
                    peak, limit = blocks.peak[bound, lane], blocks.limit[bound, lane]
                    softened[own + lane] += w / inverse / 4 * peak * limit * spent_share(largest, peak, limit)
                    s[_STRETCH + lane] *= intact_share(largest, peak, limit)
        for lane in range(LANE_COUNT):
            strain[own + lane] += s[_STRETCH + lane]
