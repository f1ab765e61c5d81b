"""Fine cells that may become coarse again: those far behind crack tips.

They are farther than BEHIND from every node that has lost its first bond in the last PAST steps and from the ends of
cracks, and farther than AHEAD from every stretched bond, and from bonds between the faces of a crack that are pressed:
a coarse cell does not have these. Bonds that still join the faces of a crack behind its tip may break one by one; they
are of nodes that have lost others long before.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import AHEAD, BREAKS, PLACE, ROWS
from pdsolve.adaptivity.hybrid.crack_faces import EAST, HALF, NORTH, WHOLE, bridges, is_cut
from pdsolve.adaptivity.hybrid.energy import strain_e
from pdsolve.adaptivity.hybrid.forces import sum_narrow
from pdsolve.adaptivity.hybrid.lattice import (
    BORDER,
    EMPTY,
    FINE,
    IDLE,
    cell_column,
    cell_place,
    cell_row,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.precracks import has_bond, lasts
from pdsolve.adaptivity.hybrid.regrid import mark_disc
from pdsolve.codegen.lanes import across
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER, displaced

PAST = 100  # steps: bonds that broke so long ago are behind a tip
BEHIND = 16  # h: cells this near to a node whose first bond broke since then stay fine
LOOK = 3  # cells: a crack that crosses a ring so far away once ends inside
FIRM = 0.5  # of what is calm: cells near bonds between the faces of a crack that are so stretched or pressed stay fine
KEPT = EMPTY + 1  # fine cells that are to stay so, for the time being


@njit(**INNER)
def list_cells(ground, zone, now, step):  # type: ignore[no-untyped-def]
    """List fine cells that may become coarse; returns how many."""
    at, fine, cells, new = ground.at, zone.fine, zone.cells, zone.new
    count = _keep_near(ground, zone, now, step)
    for n in range(zone.number[ROWS]):
        for p in range(fine.rows[n] * ROW, fine.rows[n] * ROW + ROW, 2):
            c = _cell_at(at, p)
            if c >= 0 and cells[c] == FINE and not ground.stays[c]:
                x, y = cell_column(at, c), cell_row(at, c)
                cut = ground.cut_cells[c] or is_cut(ground, zone.lost, x, y)
                if cut and _ends_in(ground, zone.lost, x, y):
                    count = mark_disc(at, cells, new, count, 2 * x + 1, 2 * y + 1, BEHIND, FINE, KEPT)
    found = count
    for n in range(zone.number[ROWS]):
        for p in range(fine.rows[n] * ROW, fine.rows[n] * ROW + ROW, 2):
            c = _cell_at(at, p)
            if c >= 0 and cells[c] == FINE and not ground.stays[c]:
                new[found] = c
                found += 1
    for c in new[:count]:
        cells[c] = FINE
    for n in range(count, found):
        new[n - count] = new[n]
    return found - count


@njit(forceinline=True, **INNER)
def _cell_at(at, p):  # type: ignore[no-untyped-def]
    """The cell whose lower left node is at fine place p; -1 without one."""
    ix, iy = fine_column(at, p), fine_row(at, p)
    if ix % 2 or iy % 2 or not (0 <= ix < at.nx and 0 <= iy < at.ny):
        return -1
    return cell_place(at, ix // 2, iy // 2)


@njit(**INNER)
def _keep_near(ground, zone, now, step):  # type: ignore[no-untyped-def]
    """Mark the cells near what has broken lately, what is held, and what is stretched; returns how many."""
    at, cells, new, breaks = ground.at, zone.cells, zone.new, zone.breaks
    count, old = 0, zone.number[BREAKS]
    while old > 0 and breaks.step[old - 1] > step - PAST:
        old -= 1
    for p in breaks.node[:old]:
        zone.mark[p] = True
    for p in breaks.node[old : zone.number[BREAKS]]:
        if not zone.mark[p]:
            count = mark_disc(at, cells, new, count, fine_column(at, p), fine_row(at, p), BEHIND, FINE, KEPT)
            zone.mark[p] = True
    for p in breaks.node[: zone.number[BREAKS]]:
        zone.mark[p] = False
    for n in range(len(zone.holds.what)):
        p = zone.holds.what[n, PLACE]
        count = mark_disc(at, cells, new, count, fine_column(at, p), fine_row(at, p), 1, FINE, KEPT)
    return _keep_stretched(ground, zone, now, count)


@njit(**INNER)
def _keep_stretched(ground, zone, now, count):  # type: ignore[no-untyped-def]
    """Mark the cells near what is stretched, besides `count` others; returns how many."""
    at, fine, cells, new = ground.at, zone.fine, zone.cells, zone.new
    u, s = fine.u[now], zone.s[0]
    wide = across(s)
    for row in fine.rows[: zone.number[ROWS]]:
        for p in range(row * ROW, row * ROW + ROW):
            if zone.lost[p] != 0 and fine.kind[p] != IDLE and _holds_faces(ground, zone, u, p):
                count = mark_disc(at, cells, new, count, fine_column(at, p), fine_row(at, p), AHEAD, FINE, KEPT)
    for row in fine.rows[: zone.number[ROWS]]:
        for p0 in range(row * ROW, row * ROW + ROW, wide):
            if sum_narrow(ground, fine, u, fine.entry[row], p0 % ROW, p0, ground.calm, s) == 0:
                continue
            for p in range(p0, p0 + wide):
                if is_stretched(ground, fine, u, p, False):
                    count = mark_disc(at, cells, new, count, fine_column(at, p), fine_row(at, p), AHEAD, FINE, KEPT)
    return count


@njit(**INNER)
def _holds_faces(ground, zone, u, p):  # type: ignore[no-untyped-def]
    """Whether a bond of a fine node between two faces of a crack is stretched or pressed: its energy would be lost."""
    fine = zone.fine
    entry, lane = fine.entry[p // ROW], p % ROW
    for k in range(len(ground.ways) // 2):
        if entry >= 0 and fine.own[entry, k, lane] == 0:
            continue
        eta_x, eta_y = displaced(u, fine.shrink, ground.table[k, 0], ground.table[k, 1], p, p + ground.ways[k])
        if abs(strain_e(ground.table, k, eta_x, eta_y)) > FIRM * ground.calm and bridges(ground, zone.lost, p, k):
            return True
    return False


@njit(**INNER)
def is_stretched(ground, fine, u, p, border):  # type: ignore[no-untyped-def]
    """Whether a bond of a fine node is stretched beyond what is calm; with `border`, one to a border node."""
    if fine.kind[p] == IDLE or lasts(ground, p):
        return False
    entry, lane = fine.entry[p // ROW], p % ROW
    for k in range(len(ground.ways)):
        j = p + ground.ways[k]
        if (entry >= 0 and fine.own[entry, k, lane] == 0) or lasts(ground, j):
            continue
        if border and fine.kind[p] != BORDER and fine.kind[j] != BORDER:
            continue
        eta_x, eta_y = displaced(u, fine.shrink, ground.table[k, 0], ground.table[k, 1], p, j)
        if strain_e(ground.table, k, eta_x, eta_y) > ground.calm:
            return True
    return False


@njit(**INNER)
def _ends_in(ground, lost, x, y):  # type: ignore[no-untyped-def]
    """Whether a crack ends in or near cell x, y: it crosses a ring of cells around it once."""
    at, side = ground.at, 2 * LOOK + 1
    x0, y0 = x - LOOK, y - LOOK
    if x0 < 0 or y0 < 0 or x0 + side > at.nx // 2 or y0 + side > at.ny // 2:
        return False
    crossings, before = 0, _crosses(ground, lost, x0, y0, side, 4 * side - 1)
    for n in range(4 * side):
        here = _crosses(ground, lost, x0, y0, side, n)
        crossings += here and not before
        before = here
    return crossings == 1


@njit(**INNER)
def _crosses(ground, lost, x0, y0, side, n):  # type: ignore[no-untyped-def]
    """Whether a crack cuts edge n of a square of `side` cells from x0, y0, counted all around."""
    turn, step = n // side, n % side
    if turn == 0:
        x, y = x0 + step, y0
    elif turn == 1:
        x, y = x0 + side, y0 + step
    elif turn == 2:
        x, y = x0 + side - 1 - step, y0 + side
    else:
        x, y = x0, y0 + side - 1 - step
    which, way = (NORTH, ground.at.stride) if turn % 2 else (EAST, 1)
    p, half = fine_place(ground.at, 2 * x, 2 * y), ground.alike[HALF, which]
    whole = has_bond(ground, lost, p, ground.alike[WHOLE, which])
    return not (whole and has_bond(ground, lost, p, half) and has_bond(ground, lost, p + way, half))
