"""Whole bonds in fine cells, and the pieces of bonds that leave them.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, with the reference vector (t1 -
t0) xi. Under a linear field it pulls as the whole bond does. After A. V. Shapeev, Multiscale Model. Simul. 9 (2011)
905-932.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.arrays import ENTRIES, PIECES
from pdsolve.adaptivity.hybrid.lattice import (
    EMPTY,
    FINE,
    IDLE,
    VOID,
    cell_place,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.nodes import end_on
from pdsolve.adaptivity.hybrid.precracks import has_bond, lasts, peak_and_limit, stiffness
from pdsolve.adaptivity.hybrid.springs import WINDOW
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.pair_laws.bilinear import intact_share
from pdsolve.operators.simd_lattice.kernel import INNER

EVERY = (1 << WINDOW**2) - 1  # all cells that bonds of a node could pass through


@njit(**INNER)
def _cells_around(ground, cells, ix, iy):  # type: ignore[no-untyped-def]
    """The cells around a fine node that are not coarse, so that bonds are whole there, and those of the plate: a bit
    each, as `Stretches.sides` has them."""
    passed, there, reach = np.uint64(EVERY), np.uint64(0), (ground.reach + 1) // 2
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            found = cells[cell_place(ground.at, (ix >> 1) + x, (iy >> 1) + y)]
            bit = np.uint64(1) << np.uint64(WINDOW * (y + WINDOW // 2) + x + WINDOW // 2)
            passed &= np.uint64(EVERY) if found in (FINE, EMPTY) else ~bit
            there |= bit if found < VOID else np.uint64(0)
    return passed, there


@njit(forceinline=True, **INNER)
def _shares(ground, place, k, passed, there):  # type: ignore[no-untyped-def]
    """On how many sides of a bond there are cells of the plate, on how many of them it is whole, and on how many it has
    a part in other cells than coarse ones."""
    sides = whole = some = 0
    for side in range(2):
        bits = ground.cut.sides[place, k, side]
        if there & bits != 0:
            sides += 1
            whole += passed & bits == bits
            some += passed & bits != 0
    return sides, whole, some


@njit(forceinline=True, **INNER)
def _is_passed(at, cells, cut, x, y, n):  # type: ignore[no-untyped-def]
    """Whether stretch n of a bond lies in a fine cell and is not cut."""
    found = cells[cell_place(at, x + cut.cell[n, 0], y + cut.cell[n, 1])]
    return found in (FINE, EMPTY)


@njit(**INNER)
def set_row(ground, zone, row):  # type: ignore[no-untyped-def]
    """Set the stiffnesses of the marked nodes of a row; returns whether all of the row are those of the table."""
    fine = zone.fine
    if not is_active(fine.kind, row):
        return
    if ground.varied and fine.entry[row] == -1:
        _begin_edges(ground, fine.edge[zone.number[ENTRIES]], row)
    entry = own_entry(fine.entry, zone.number, row)
    own, same = fine.own[entry], True
    for lane in range(ROW):
        p = row * ROW + lane
        if zone.mark[p]:
            _set_lane(ground, zone.cells, zone.lost, fine.kind, p, own, lane)
            if ground.varied and zone.stirred[p]:
                _soften(ground, p, own, fine.edge[entry], lane)
    masks, alike = fine.masks[entry], not ground.varied
    for k in range(len(ground.dx)):
        whole, there, half = ground.table[k, 5], 0, 0
        for lane in range(ROW):
            some = own[k, lane]
            there |= (some > 0) << lane
            half |= (some == 0.5 * whole) << lane
            alike &= some == whole or some == 0 or some == 0.5 * whole
            same &= some == whole
        masks[0, k], masks[1, k] = there, half
    fine.masked[entry] = alike
    fine.entry[row] = -2 - entry if same else entry


@njit(**INNER)
def _begin_edges(ground, edge, row):  # type: ignore[no-untyped-def]
    """Initialize the peaks of a row's bonds, below which they do not soften."""
    for k in range(len(ground.dx)):
        for lane in range(ROW):
            p = row * ROW + lane
            j = p + ground.ways[k]
            edge[k, lane] = np.inf if lasts(ground, p) or lasts(ground, j) else peak_and_limit(ground, p, k)[0]


@njit(**INNER)
def stretch_of(e):  # type: ignore[no-untyped-def]
    """The stretch s with e = s (s + 2)."""
    return e / (np.sqrt(1 + e) + 1)


@njit(**INNER)
def share_of(e, peak, limit):  # type: ignore[no-untyped-def]
    """Remaining share of the stiffness of a bond that has been stretched to e."""
    if e <= peak:
        return 1.0
    return intact_share(stretch_of(e), stretch_of(peak), stretch_of(limit))


@njit(**INNER)
def _soften(ground, p, own, edge, lane):  # type: ignore[no-untyped-def]
    """Reduce the stiffnesses of a node by the softening so far."""
    for k in range(len(ground.dx)):
        peak, limit = peak_and_limit(ground, p, k)
        if own[k, lane] > 0 and peak < edge[k, lane] < limit:
            own[k, lane] *= share_of(edge[k, lane], peak, limit)


@njit(**INNER)
def is_active(kind, row):  # type: ignore[no-untyped-def]
    """Whether a row has a node that is not idle."""
    some = False
    for p in range(row * ROW, row * ROW + ROW):
        some |= kind[p] != IDLE
    return some


@njit(**INNER)
def _set_lane(ground, cells, lost, kind, p, own, lane):  # type: ignore[no-untyped-def]
    ix, iy = fine_column(ground.at, p), fine_row(ground.at, p)
    place = ix % 2 + 2 * (iy % 2)
    own[:, lane] = 0.0
    if kind[p] == IDLE:
        return
    passed, there = _cells_around(ground, cells, ix, iy)
    for k in range(len(ground.dx)):
        if has_bond(ground, lost, p, k):
            sides, whole, _ = _shares(ground, place, k, passed, there)
            own[k, lane] = stiffness(ground, p, k) * (whole / sides if sides > 0 else 0.0)


@njit(**INNER)
def own_entry(entries, number, row):  # type: ignore[no-untyped-def]
    """Index of a row's own stiffnesses; a row that has none takes a new one."""
    entry = entries[row]
    if entry >= 0:
        return entry
    if entry < -1:
        return -2 - entry
    number[ENTRIES] += 1
    return number[ENTRIES] - 1


@njit(**INNER)
def add_pieces(ground, cells, lost, kind, p, pieces, count):  # type: ignore[no-untyped-def]
    """Append the pieces of the bonds that a fine node owns; returns the new number of pieces."""
    at, cut, half = ground.at, ground.cut, len(ground.dx) // 2
    ix, iy = fine_column(at, p), fine_row(at, p)
    x, y, place = ix >> 1, iy >> 1, ix % 2 + 2 * (iy % 2)
    passed, there = _cells_around(ground, cells, ix, iy)
    if passed == EVERY:
        return count
    for k in range(half):
        sides, whole, some = _shares(ground, place, k, passed, there)
        if some == whole or not has_bond(ground, lost, p, k):
            continue
        first = cut.first[place, k]
        for side in range(2):
            n, last = first[side], first[side + 1]
            if there & cut.sides[place, k, side] == 0:
                continue
            while n < last:
                if not _is_passed(at, cells, cut, x, y, n):
                    n += 1
                    continue
                begin = n
                while n < last and _is_passed(at, cells, cut, x, y, n):
                    n += 1
                if begin == first[side] and n == last:
                    continue
                _set_piece(ground, kind, p, k, (begin, n - 1), pieces, count)
                pieces.value[count, 5] /= sides
                count += 1
    return count


@njit(**INNER)
def _set_piece(ground, kind, p, k, stretches, pieces, count):  # type: ignore[no-untyped-def]
    """Set the piece of bond k of fine node p from the first to the last of two stretches."""
    pieces.owner[count] = p
    for which in range(2):
        _set_end(ground, kind, p, k, stretches[which], which, pieces, count)
    value, length = pieces.value[count], ground.cut.t[stretches[1], 1] - ground.cut.t[stretches[0], 0]
    value[2], value[3] = length * ground.table[k, 0], length * ground.table[k, 1]
    value[4] = ground.table[k, 4] / length**2
    value[5] = stiffness(ground, p, k) / length
    value[6] = 0.0 if lasts(ground, p) or lasts(ground, p + ground.ways[k]) else 1.0


@njit(**INNER)
def _set_end(ground, kind, p, k, n, which, pieces, count):  # type: ignore[no-untyped-def]
    """Set one end of a piece: a fine node, or a place between two coarse nodes."""
    at, cut = ground.at, ground.cut
    ix, iy, direction = fine_column(at, p), fine_row(at, p), cut.ends[n, which, 2]
    end = pieces.end[count]
    if direction < 0:
        end[2 * which], end[2 * which + 1] = fine_place(at, ix + which * ground.dx[k], iy + which * ground.dy[k]), -1
        pieces.value[count, which] = 0.0
        return
    x, y = (ix >> 1) + cut.ends[n, which, 0], (iy >> 1) + cut.ends[n, which, 1]
    a, b, w = end_on(ground, kind, x, y, direction, cut.w[n, which])
    end[2 * which], end[2 * which + 1] = a, b
    pieces.value[count, which] = w


@njit(**INNER)
def put_pieces(ground, zone, dirty):  # type: ignore[no-untyped-def]
    """Replace the pieces owned by these fine nodes, given in order; all pieces stay ordered by owner."""
    old, new, count = zone.pieces, zone.spare, zone.number[PIECES]
    kept = pieces = count - count  # a plain 0 would be compiled for once more
    for p in dirty:
        pieces = add_pieces(ground, zone.cells, zone.lost, zone.coarse.kind, p, new, pieces)
        zone.mark[p] = True
    for n in range(count):
        if not zone.mark[old.owner[n]]:
            if n > kept:
                _move(old, n, old, kept)
            kept += 1
    for p in dirty:
        zone.mark[p] = False
    at, n, m = kept + pieces - 1, kept - 1, pieces - 1
    while m >= 0:
        if n >= 0 and old.owner[n] > new.owner[m]:
            _move(old, n, old, at)
            n -= 1
        else:
            _move(new, m, old, at)
            m -= 1
        at -= 1
    zone.number[PIECES] = kept + pieces


@njit(forceinline=True, **INNER)
def _move(source, n, target, m):  # type: ignore[no-untyped-def]
    target.owner[m] = source.owner[n]
    for c in range(4):
        target.end[m, c] = source.end[n, c]
    for c in range(7):
        target.value[m, c] = source.value[n, c]
