"""Cells become fine: what that changes around them, and nothing else."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptive.arrays import BORDERS, COARSE_ROWS, FINE_CELLS, HOLDS, LOADS, PIECES, REFINEMENT, REGRIDS, ROWS
from pdsolve.adaptive.clip import put_pieces, set_row
from pdsolve.adaptive.energy import copy_border_node, energy_of
from pdsolve.adaptive.lattice import (
    AROUND,
    BORDER,
    COARSE,
    FINE,
    FREE,
    cell_place,
    coarse_place,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptive.nodes import border_end, coarse_cell_at, interpolate, set_coarse, set_coarse_row, set_fine
from pdsolve.operators.blocks.kernel import INNER
from pdsolve.operators.blocks.lanes import ROW

SORTING = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@njit(**INNER)
def begin_coarse_nodes(ground, zone):  # type: ignore[no-untyped-def]
    """Make all coarse nodes what the cells say."""
    at = ground.at
    for y in range(at.ny // 2 + 1):
        for x in range(at.nx // 2 + 1):
            set_coarse(ground, zone, coarse_place(at, x, y))
        for row in range(coarse_place(at, 0, y) // ROW, coarse_place(at, at.nx // 2, y) // ROW + 1):
            set_coarse_row(zone, row, ground.coarse_table)


@njit(**INNER)
def mark_disc(at, cells, new, count, ix, iy, radius):  # type: ignore[no-untyped-def]
    """List the coarse cells nearer to a place (fine spacings) than `radius`; returns how many are listed then.

    They are marked as fine at once; `refine` knows them from the list.
    """
    for y in range(int(np.floor((iy - radius) / 2)), int(np.ceil((iy + radius) / 2))):
        for x in range(int(np.floor((ix - radius) / 2)), int(np.ceil((ix + radius) / 2))):
            if not (0 <= x < at.nx // 2 and 0 <= y < at.ny // 2):
                continue
            c = cell_place(at, x, y)
            if cells[c] != COARSE:
                continue
            away_x, away_y = max(abs(ix - (2 * x + 1)) - 1, 0), max(abs(iy - (2 * y + 1)) - 1, 0)
            if away_x * away_x + away_y * away_y < radius * radius:
                cells[c] = FINE
                new[count] = c
                count += 1
    return count


@njit(**INNER)
def _mark_around(ground, zone, c, mark, count):  # type: ignore[no-untyped-def]
    """Mark the fine nodes within reach of a cell; or list those that are marked, and unmark them."""
    at, reach = ground.at, ground.reach
    x, y = c % at.cell_stride - AROUND, c // at.cell_stride - AROUND
    for iy in range(max(0, 2 * y - reach), min(at.ny, 2 * y + 2 + reach) + 1):
        for ix in range(max(0, 2 * x - reach), min(at.nx, 2 * x + 2 + reach) + 1):
            p = fine_place(at, ix, iy)
            if not mark and zone.mark[p]:
                zone.dirty[count] = p
                count += 1
            zone.mark[p] = mark
    return count


@njit(**SORTING)
def _find_dirty(ground, zone, new):  # type: ignore[no-untyped-def]
    """List what the new cells concern, in order: fine nodes within reach, coarse nodes at corners; returns how many."""
    at, count, coarse = ground.at, 0, 0
    for c in new:
        _mark_around(ground, zone, c, True, 0)
    for c in new:
        count = _mark_around(ground, zone, c, False, count)
        corner = coarse_place(at, c % at.cell_stride - AROUND, c // at.cell_stride - AROUND)
        if coarse > len(zone.dirty_coarse) - 4:
            coarse = _unique(zone.dirty_coarse, coarse)
        for q in (corner, corner + 1, corner + at.coarse_stride, corner + at.coarse_stride + 1):
            zone.dirty_coarse[coarse] = q
            coarse += 1
    zone.dirty[:count].sort()
    return count, _unique(zone.dirty_coarse, coarse)


@njit(**SORTING)
def _unique(values, count):  # type: ignore[no-untyped-def]
    """Sort the first values and drop those that are there twice."""
    values[:count].sort()
    kept = 0
    for n in range(count):
        if kept == 0 or values[kept - 1] != values[n]:
            values[kept] = values[n]
            kept += 1
    return kept


@njit(**SORTING)
def refine(ground, zone, count, now):  # type: ignore[no-untyped-def]
    """Make the first `count` cells of `zone.new`, which are marked as fine, fine; displacements are those of `now`.

    New nodes begin with what the coarse ones had; what energy that makes or loses is booked.
    """
    new = zone.new[:count]
    fines, coarses = _find_dirty(ground, zone, new)
    dirty, dirty_coarse = zone.dirty[:fines], zone.dirty_coarse[:coarses]
    for p in dirty:
        zone.mark[p] = True
    for c in new:
        zone.cells[c] = COARSE
    before = energy_of(ground, zone, now, dirty, dirty_coarse)
    _begin_new(ground, zone, new, dirty, now)
    _set_nodes(ground, zone, dirty, dirty_coarse, now)
    put_pieces(ground, zone, dirty)
    for p in dirty:
        zone.mark[p] = True
    zone.total[REFINEMENT] += energy_of(ground, zone, now, dirty, dirty_coarse) - before
    for p in dirty:
        zone.mark[p] = False
    zone.number[FINE_CELLS] += count
    zone.number[REGRIDS] += 1
    number(ground, zone)


@njit(**INNER)
def _set_nodes(ground, zone, dirty, dirty_coarse, now):  # type: ignore[no-untyped-def]
    """Kinds, masses and springs of these nodes."""
    fine, coarse, last = zone.fine, zone.coarse, -1
    for p in dirty:
        set_fine(ground, zone, p)
        if fine.kind[p] == BORDER:
            copy_border_node(ground, fine.u[now], coarse.u[now], p)
            fine.v[0, p] = fine.v[1, p] = 0.0
    for q in dirty_coarse:
        set_coarse(ground, zone, q)
    for q in dirty_coarse:
        set_coarse_row(zone, q // ROW, ground.coarse_table)
    for p in dirty:
        if p // ROW != last:
            last = p // ROW
            set_row(ground, zone, last)


@njit(**INNER)
def _begin_new(ground, zone, new, dirty, now):  # type: ignore[no-untyped-def]
    """Give the nodes that are to be free the motion of the coarse ones around them; then the new cells are fine."""
    at, fine, coarse, two = ground.at, zone.fine, zone.coarse, zone.s[:2]
    for p in dirty:
        if fine.kind[p] == FREE:
            continue
        ix, iy = fine_column(at, p), fine_row(at, p)
        x, y = coarse_cell_at(at, zone.cells, ix, iy)
        if x < 0:
            continue
        interpolate(ground, coarse.u[now], ix, iy, x, y, two)
        fine.u[now, 0, p], fine.u[now, 1, p] = two[0], two[1]
        interpolate(ground, coarse.v, ix, iy, x, y, two)
        fine.v[0, p], fine.v[1, p] = two[0], two[1]
    for c in new:
        zone.cells[c] = FINE


@njit(**INNER)
def _list_fine(ground, zone):  # type: ignore[no-untyped-def]
    """List rows with fine nodes, and those on the border."""
    fine, coarse, rows, borders = zone.fine, zone.coarse, 0, 0
    for row in range(len(fine.entry)):
        if fine.entry[row] == -1:
            continue
        fine.rows[rows] = row
        rows += 1
        for p in range(row * ROW, row * ROW + ROW):
            if fine.kind[p] != BORDER:
                continue
            a, b, w = border_end(ground, p)
            zone.border.node[borders], zone.border.w[borders] = p, w
            zone.border.end[borders, 0], zone.border.end[borders, 1] = a, b
            fine.touched[row] = coarse.touched[a // ROW] = coarse.touched[b // ROW] = True
            borders += 1
    zone.number[ROWS], zone.number[BORDERS] = rows, borders


@njit(**INNER)
def _list_coarse(ground, zone):  # type: ignore[no-untyped-def]
    """List rows with coarse nodes."""
    at, coarse, rows = ground.at, zone.coarse, 0
    for y in range(at.ny // 2 + 1):
        for row in range(coarse_place(at, 0, y) // ROW, coarse_place(at, at.nx // 2, y) // ROW + 1):
            some = False
            for q in range(row * ROW, row * ROW + ROW):
                some |= coarse.kind[q] == FREE
            if some:
                coarse.rows[rows] = row
                rows += 1
    zone.number[COARSE_ROWS] = rows


@njit(**INNER)
def number(ground, zone):  # type: ignore[no-untyped-def]
    """List rows and border nodes anew, and what acts on whom."""
    fine, coarse = zone.fine, zone.coarse
    fine.touched[:] = False
    coarse.touched[:] = False
    _list_fine(ground, zone)
    _list_coarse(ground, zone)
    for n in range(zone.number[PIECES]):
        for which in range(2):
            a, b = zone.pieces.end[n, 2 * which], zone.pieces.end[n, 2 * which + 1]
            if b < 0:
                fine.touched[a // ROW] = True
            else:
                coarse.touched[a // ROW] = coarse.touched[b // ROW] = True
    _place_loads(ground, zone)
    _place_holds(ground, zone)


@njit(**INNER)
def _place_loads(ground, zone):  # type: ignore[no-untyped-def]
    """Hand loads to the nodes that move: those of idle and border nodes to the coarse nodes they lie between."""
    at, loads, count = ground.at, zone.loads, 0
    for n in range(len(loads.node)):
        p = loads.node[n]
        if zone.fine.kind[p] == FREE:
            count = _load(zone, loads, count, p, n, 1.0)
            continue
        ix, iy = fine_column(at, p), fine_row(at, p)
        x, y = coarse_cell_at(at, zone.cells, ix, iy)
        for dy in range(2):
            for dx in range(2):
                wx, wy = (ix - 2 * x) / 2, (iy - 2 * y) / 2
                w = (wx if dx else 1 - wx) * (wy if dy else 1 - wy)
                if w > 0:
                    count = _load(zone, loads, count, -1 - coarse_place(at, x + dx, y + dy), n, w)
    zone.number[LOADS] = count


@njit(**INNER)
def _load(zone, loads, count, on, n, part):  # type: ignore[no-untyped-def]
    loads.on[count], loads.which[count], loads.part[count] = on, n, part
    if on >= 0:
        zone.fine.touched[on // ROW] = True
    else:
        zone.coarse.touched[(-1 - on) // ROW] = True
    return count + 1


@njit(**INNER)
def _place_holds(ground, zone):  # type: ignore[no-untyped-def]
    """Hold the nodes that move of those that are held."""
    at, holds, count = ground.at, zone.holds, 0
    for n in range(len(holds.node)):
        p = holds.node[n]
        ix, iy = fine_column(at, p), fine_row(at, p)
        if zone.fine.kind[p] == FREE:
            holds.on[count] = p
            zone.fine.touched[p // ROW] = True
        elif ix % 2 == 0 and iy % 2 == 0 and zone.coarse.kind[coarse_place(at, ix // 2, iy // 2)] == FREE:
            q = coarse_place(at, ix // 2, iy // 2)
            holds.on[count] = -1 - q
            zone.coarse.touched[q // ROW] = True
        else:
            continue
        holds.which[count] = n
        count += 1
    zone.number[HOLDS] = count
