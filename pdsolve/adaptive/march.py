"""Steps: leapfrog, as `pdsolve.steppers.verlet` has it, for free fine nodes and coarse nodes alike.

Every few steps cells become fine that are near a node which has lost a bond, or near a coarse bond that is stretched.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptive.arrays import AHEAD, BORDERS, BREAKS, CLIPPED, COARSE_ROWS, ENTRIES, EVERY, HOLDS, KNOWN, ROWS
from pdsolve.adaptive.energy import strain_e
from pdsolve.adaptive.forces import follow, forces
from pdsolve.adaptive.lattice import COARSE, IDLE, coarse_column, coarse_row, fine_column, fine_place, fine_row
from pdsolve.adaptive.move import begin_holds, drift, end_holds, hold
from pdsolve.adaptive.regrid import SORTING, begin_coarse_nodes, mark_disc, refine
from pdsolve.operators.blocks.kernel import INNER
from pdsolve.operators.blocks.lanes import ROW

DONE, ROOM, CLIP = 0, 1, 2  # how a march ends: at its last step; for want of room; a clipped bond is over its limit
GROWN = 64  # rows: room for so many more is always kept


@njit(**INNER)
def _look(ground, zone):  # type: ignore[no-untyped-def]
    """List the cells that are to be fine as they are near nodes that have lost a bond."""
    at, count = ground.at, 0
    for n in range(zone.number[KNOWN], zone.number[BREAKS]):
        p = zone.breaks.node[n]
        count = mark_disc(at, zone.cells, zone.new, count, fine_column(at, p), fine_row(at, p), AHEAD)
    return count


@njit(**INNER)
def _look_for_hot(ground, zone, now, count):  # type: ignore[no-untyped-def]
    """The same around both nodes of each coarse bond that is stretched."""
    at, coarse = ground.at, zone.coarse
    u = coarse.u[now]
    for n in range(zone.number[COARSE_ROWS]):
        row = coarse.rows[n]
        if coarse.wide[row] == 0:
            continue
        for lane in range(ROW):
            q = row * ROW + lane
            if coarse.kind[q] == IDLE or _lasts(ground, q):
                continue
            for k in range(8):
                entry, j = coarse.entry[row], q + ground.coarse_ways[k]
                if (entry >= 0 and coarse.own[entry, k, lane] == 0) or _lasts(ground, j):
                    continue
                if strain_e(ground.coarse_table, k, u[0, j] - u[0, q], u[1, j] - u[1, q]) > ground.e_hot:
                    x, y = 2 * coarse_column(at, q), 2 * coarse_row(at, q)
                    count = mark_disc(at, zone.cells, zone.new, count, x, y, AHEAD)
                    break
    return count


@njit(**INNER)
def _lasts(ground, q):  # type: ignore[no-untyped-def]
    """Whether the bonds of a coarse node do not break."""
    return ground.lasting[fine_place(ground.at, 2 * coarse_column(ground.at, q), 2 * coarse_row(ground.at, q))]


@njit(**INNER)
def _is_short(zone, cells):  # type: ignore[no-untyped-def]
    """Whether there may not be room for what so many new cells bring, and what the next steps break."""
    rows, room = zone.number[ENTRIES] + GROWN + 24 * cells, zone.fine.own.shape[0]
    some = ROW * zone.number[ROWS] * zone.fine.own.shape[1]
    return rows > room or zone.number[BREAKS] + some > len(zone.breaks.step)


@njit(**SORTING)
def _regrid(ground, zone, now):  # type: ignore[no-untyped-def]
    """Make cells fine that are to be; returns whether there was room."""
    count = _look_for_hot(ground, zone, now, _look(ground, zone))
    if _is_short(zone, count):
        for n in range(count):
            zone.cells[zone.new[n]] = COARSE
        return False
    if count > 0:
        follow(zone.fine.u[now], zone.coarse.u[now], zone.border, zone.number[BORDERS])
        refine(ground, zone, count, now)
    zone.number[KNOWN] = zone.number[BREAKS]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def march(ground, zone, profiles, now, first, last, drifted, cells):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1; returns how it ended, in which step, and which displacements are now.

    At the end velocities are those of displacements, and all forces are kept. `drifted` goes on where a march ended
    for want of room. With last = first the forces at the start are computed, with last < first all is numbered, and
    the first `cells` of `zone.new` become fine.
    """
    if last < first:
        begin_coarse_nodes(ground, zone)
        refine(ground, zone, cells, now)
        zone.total[:] = 0.0
        return DONE, first, now
    if last == first:
        forces(ground, zone, profiles, now, 0, True)
        begin_holds(zone.fine, zone.coarse, zone.holds, zone.number[HOLDS])
        return DONE, first, now
    if not drifted:
        drift(ground, zone, now, True)
        hold(
            zone.fine,
            zone.coarse,
            zone.holds,
            zone.number[HOLDS],
            zone.total,
            ground.dt,
            profiles,
            now,
            first - 1,
            False,
            True,
        )
        now = 1 - now
    for step in range(first, last):
        if step % EVERY == 0 and not _regrid(ground, zone, now):
            return ROOM, step, now
        ends = step == last - 1
        forces(ground, zone, profiles, now, step, ends)
        hold(
            zone.fine,
            zone.coarse,
            zone.holds,
            zone.number[HOLDS],
            zone.total,
            ground.dt,
            profiles,
            now,
            step,
            ends,
            False,
        )
        if zone.total[CLIPPED] > ground.e_limit:
            return CLIP, step, now
        if not ends:
            now = 1 - now
    drift(ground, zone, now, False)
    end_holds(zone.fine, zone.coarse, zone.holds, zone.number[HOLDS])
    return DONE, last - 1, now
