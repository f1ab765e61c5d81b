"""Whole bonds in fine cells, and the pieces of bonds that leave them.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, with the reference vector (t1 -
t0) xi. Under a linear field it pulls as the whole bond does. After A. V. Shapeev, Multiscale Model. Simul. 9 (2011)
905-932.
"""

from __future__ import annotations

import numpy as np
from numba import njit

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
from pdsolve.adaptivity.hybrid.nodes import carriers_on_edge
from pdsolve.adaptivity.hybrid.precracks import bond_stiffness, has_bond, lasts, peak_and_limit
from pdsolve.adaptivity.hybrid.springs import WINDOW
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.pair_laws.bilinear import intact_share
from pdsolve.operators.simd_lattice.kernel import INNER

EVERY = (1 << WINDOW**2) - 1  # all cells that bonds of a node could pass through


@njit(**INNER)
def _cell_bits_around(ground, cells, ix, iy):  # type: ignore[no-untyped-def]
    """The cells around a fine node that are not coarse, so that bonds are whole there, and those of the plate: a bit
    each, as `BondParts.sides` has them."""
    passed, in_plate, reach = np.uint64(EVERY), np.uint64(0), (ground.reach + 1) // 2
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            cell_kind = cells[cell_place(ground.at, (ix >> 1) + x, (iy >> 1) + y)]
            bit = np.uint64(1) << np.uint64(WINDOW * (y + WINDOW // 2) + x + WINDOW // 2)
            passed &= np.uint64(EVERY) if cell_kind in (FINE, EMPTY) else ~bit
            in_plate |= bit if cell_kind < VOID else np.uint64(0)
    return passed, in_plate


@njit(forceinline=True, **INNER)
def _count_sides(ground, place, k, passed, in_plate):  # type: ignore[no-untyped-def]
    """On how many sides of a bond there are cells of the plate, on how many of them it is whole, and on how many it has
    a part in other cells than coarse ones."""
    sides = whole_sides = fine_sides = 0
    for side in range(2):
        bits = ground.bond_parts.sides[place, k, side]
        if in_plate & bits != 0:
            sides += 1
            whole_sides += passed & bits == bits
            fine_sides += passed & bits != 0
    return sides, whole_sides, fine_sides


@njit(forceinline=True, **INNER)
def _is_part_fine(at, cells, cut, x, y, part):  # type: ignore[no-untyped-def]
    """Whether a part of a bond lies in a fine cell and is not cut."""
    cell_kind = cells[cell_place(at, x + cut.cell[part, 0], y + cut.cell[part, 1])]
    return cell_kind in (FINE, EMPTY)


@njit(**INNER)
def set_row_stiffness(ground, zone, row):  # type: ignore[no-untyped-def]
    """Set the stiffnesses of the marked nodes of a row; returns whether all of the row are those of the table."""
    fine = zone.fine
    if not is_row_active(fine.kind, row):
        return
    if ground.varied and fine.entry[row] == -1:
        _initialize_peaks(ground, fine.edge[zone.counts.stiffness_rows], row)
    entry = own_entry(fine.entry, zone.counts, row)
    row_stiffness, same = fine.own[entry], True
    for lane in range(ROW):
        p = row * ROW + lane
        if zone.mark[p]:
            _set_lane_stiffness(ground, zone.cells, zone.lost, fine.kind, p, row_stiffness, lane)
            if ground.varied and zone.stirred[p]:
                _apply_softening(ground, p, row_stiffness, fine.edge[entry], lane)
    masks, alike = fine.masks[entry], not ground.varied
    for k in range(len(ground.dx)):
        full_stiffness, spring_lanes, half = ground.table[k, 5], 0, 0
        for lane in range(ROW):
            some = row_stiffness[k, lane]
            spring_lanes |= (some > 0) << lane
            half |= (some == 0.5 * full_stiffness) << lane
            alike &= some == full_stiffness or some == 0 or some == 0.5 * full_stiffness
            same &= some == full_stiffness
        masks[0, k], masks[1, k] = spring_lanes, half
    fine.masked[entry] = alike
    fine.entry[row] = -2 - entry if same else entry


@njit(**INNER)
def _initialize_peaks(ground, edge, row):  # type: ignore[no-untyped-def]
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
def _apply_softening(ground, p, row_stiffness, edge, lane):  # type: ignore[no-untyped-def]
    """Reduce the stiffnesses of a node by the softening so far."""
    for k in range(len(ground.dx)):
        peak, limit = peak_and_limit(ground, p, k)
        if row_stiffness[k, lane] > 0 and peak < edge[k, lane] < limit:
            row_stiffness[k, lane] *= share_of(edge[k, lane], peak, limit)


@njit(**INNER)
def is_row_active(kind, row):  # type: ignore[no-untyped-def]
    """Whether a row has a node that is not idle."""
    active = False
    for p in range(row * ROW, row * ROW + ROW):
        active |= kind[p] != IDLE
    return active


@njit(**INNER)
def _set_lane_stiffness(ground, cells, lost, kind, p, row_stiffness, lane):  # type: ignore[no-untyped-def]
    ix, iy = fine_column(ground.at, p), fine_row(ground.at, p)
    place = ix % 2 + 2 * (iy % 2)
    row_stiffness[:, lane] = 0.0
    if kind[p] == IDLE:
        return
    passed, in_plate = _cell_bits_around(ground, cells, ix, iy)
    for k in range(len(ground.dx)):
        if has_bond(ground, lost, p, k):
            sides, whole_sides, _ = _count_sides(ground, place, k, passed, in_plate)
            row_stiffness[k, lane] = bond_stiffness(ground, p, k) * (whole_sides / sides if sides > 0 else 0.0)


@njit(**INNER)
def own_entry(entries, counts, row):  # type: ignore[no-untyped-def]
    """Index of a row's own stiffnesses; a row that has none takes a new one."""
    entry = entries[row]
    if entry >= 0:
        return entry
    if entry < -1:
        return -2 - entry
    counts.stiffness_rows += 1
    return counts.stiffness_rows - 1


@njit(**INNER)
def append_pieces(ground, cells, lost, kind, p, pieces, count):  # type: ignore[no-untyped-def]
    """Append the pieces of the bonds that a fine node owns; returns the new number of pieces."""
    at, cut, half = ground.at, ground.bond_parts, len(ground.dx) // 2
    ix, iy = fine_column(at, p), fine_row(at, p)
    x, y, place = ix >> 1, iy >> 1, ix % 2 + 2 * (iy % 2)
    passed, in_plate = _cell_bits_around(ground, cells, ix, iy)
    if passed == EVERY:
        return count
    for k in range(half):
        sides, whole_sides, fine_sides = _count_sides(ground, place, k, passed, in_plate)
        if fine_sides == whole_sides or not has_bond(ground, lost, p, k):
            continue
        first = cut.first[place, k]
        for side in range(2):
            n, last = first[side], first[side + 1]
            if in_plate & cut.sides[place, k, side] == 0:
                continue
            while n < last:
                if not _is_part_fine(at, cells, cut, x, y, n):
                    n += 1
                    continue
                begin = n
                while n < last and _is_part_fine(at, cells, cut, x, y, n):
                    n += 1
                if begin == first[side] and n == last:
                    continue
                _set_piece(ground, kind, p, k, begin, n - 1, pieces, count)
                pieces.value[count, 5] /= sides
                count += 1
    return count


@njit(**INNER)
def _set_piece(ground, kind, p, k, first, last, pieces, count):  # type: ignore[no-untyped-def]
    """Set the piece of bond k of fine node p from its part `first` to `last`."""
    pieces.owner[count] = p
    _set_piece_end(ground, kind, p, k, first, 0, pieces, count)
    _set_piece_end(ground, kind, p, k, last, 1, pieces, count)
    value, length = pieces.value[count], ground.bond_parts.t[last, 1] - ground.bond_parts.t[first, 0]
    value[2], value[3] = length * ground.table[k, 0], length * ground.table[k, 1]
    value[4] = ground.table[k, 4] / length**2
    value[5] = bond_stiffness(ground, p, k) / length
    value[6] = 0.0 if lasts(ground, p) or lasts(ground, p + ground.ways[k]) else 1.0


@njit(**INNER)
def _set_piece_end(ground, kind, p, k, part, side, pieces, count):  # type: ignore[no-untyped-def]
    """Set one end of a piece: a fine node, or a place between two coarse nodes."""
    at, cut = ground.at, ground.bond_parts
    ix, iy, direction = fine_column(at, p), fine_row(at, p), cut.ends[part, side, 2]
    end = pieces.end[count]
    if direction < 0:
        end[2 * side], end[2 * side + 1] = fine_place(at, ix + side * ground.dx[k], iy + side * ground.dy[k]), -1
        pieces.value[count, side] = 0.0
        return
    x, y = (ix >> 1) + cut.ends[part, side, 0], (iy >> 1) + cut.ends[part, side, 1]
    a, b, w = carriers_on_edge(ground, kind, x, y, direction, cut.w[part, side])
    end[2 * side], end[2 * side + 1] = a, b
    pieces.value[count, side] = w


@njit(**INNER)
def replace_pieces(ground, zone, dirty):  # type: ignore[no-untyped-def]
    """Replace the pieces owned by these fine nodes, given in order; all pieces stay ordered by owner."""
    old, new, count = zone.pieces, zone.spare, zone.counts.pieces
    remaining = pieces = count - count  # a plain 0 would be compiled for once more
    for p in dirty:
        pieces = append_pieces(ground, zone.cells, zone.lost, zone.coarse.kind, p, new, pieces)
        zone.mark[p] = True
    for n in range(count):
        if not zone.mark[old.owner[n]]:
            if n > remaining:
                _copy_piece(old, n, old, remaining)
            remaining += 1
    for p in dirty:
        zone.mark[p] = False
    at, n, m = remaining + pieces - 1, remaining - 1, pieces - 1
    while m >= 0:
        if n >= 0 and old.owner[n] > new.owner[m]:
            _copy_piece(old, n, old, at)
            n -= 1
        else:
            _copy_piece(new, m, old, at)
            m -= 1
        at -= 1
    zone.counts.pieces = remaining + pieces


@njit(forceinline=True, **INNER)
def _copy_piece(source, n, target, m):  # type: ignore[no-untyped-def]
    target.owner[m] = source.owner[n]
    for c in range(4):
        target.end[m, c] = source.end[n, c]
    for c in range(7):
        target.value[m, c] = source.value[n, c]
