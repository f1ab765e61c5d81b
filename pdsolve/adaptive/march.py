"""Steps: leapfrog, as `pdsolve.steppers.verlet` has it, for free fine nodes and coarse nodes alike.

Every few steps it is looked whether cells are to become fine: those near a node one of whose bonds has broken, or begun
to soften, or near a coarse bond that is stretched.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptive.arrays import AHEAD, BREAKS, CLIPPED, COARSE_ROWS, EVERY, HOLDS, KNOWN, ROWS, STIRS
from pdsolve.adaptive.energy import strain_e
from pdsolve.adaptive.forces import forces
from pdsolve.adaptive.lattice import IDLE, coarse_column, coarse_row, fine_column, fine_place, fine_row
from pdsolve.adaptive.move import begin_holds, drift, end_holds, hold
from pdsolve.adaptive.regrid import mark_disc
from pdsolve.operators.blocks.kernel import INNER
from pdsolve.operators.blocks.lanes import ROW

DONE, MORE, CLIP = 0, 1, 2  # how a march ends: at its last step; as there is more to refine, or to make room for; as a
# clipped bond is over its limit


@njit(**INNER)
def _look(ground, zone):  # type: ignore[no-untyped-def]
    """List the cells that are to be fine as they are near nodes one of whose bonds has broken or softened."""
    at, count = ground.at, 0
    for n in range(zone.number[KNOWN], zone.number[STIRS]):
        p = zone.stirs[n]
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
                if strain_e(ground.coarse_table, k, u[0, j] - u[0, q], u[1, j] - u[1, q]) > _hot(ground, q):
                    x, y = 2 * coarse_column(at, q), 2 * coarse_row(at, q)
                    count = mark_disc(at, zone.cells, zone.new, count, x, y, AHEAD)
                    break
    return count


@njit(**INNER)
def _hot(ground, q):  # type: ignore[no-untyped-def]
    """The e of a coarse bond beside which cells become fine."""
    p = fine_place(ground.at, 2 * coarse_column(ground.at, q), 2 * coarse_row(ground.at, q))
    return ground.bounds[ground.material[p], 2]


@njit(**INNER)
def _lasts(ground, q):  # type: ignore[no-untyped-def]
    """Whether the bonds of a coarse node do not break."""
    return ground.lasting[fine_place(ground.at, 2 * coarse_column(ground.at, q), 2 * coarse_row(ground.at, q))]


@njit(**INNER)
def _is_short(zone):  # type: ignore[no-untyped-def]
    """Whether there may not be room for what the next steps break."""
    return zone.number[BREAKS] + ROW * zone.number[ROWS] * zone.fine.own.shape[1] > len(zone.breaks.step)


@njit(cache=True, nogil=True, error_model="numpy")
def march(ground, zone, profiles, now, first, last, drifted):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1; returns how it ended, in which step, which displacements are now, and how
    many cells of `zone.new` are to become fine.

    At the end velocities are those of displacements, and all forces are kept. `drifted` goes on where a march ended as
    there was more to refine. With last = first the forces at the start are computed.
    """
    if last == first:
        forces(ground, zone, profiles, now, 0, True)
        begin_holds(zone.fine, zone.coarse, zone.holds, zone.number[HOLDS])
        return DONE, first, now, 0
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
        if step % EVERY == 0 and not (drifted and step == first):
            count = _look_for_hot(ground, zone, now, _look(ground, zone))
            if count > 0 or _is_short(zone):
                return MORE, step, now, count
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
        if zone.total[CLIPPED] > ground.least[0]:
            return CLIP, step, now, 0
        if not ends:
            now = 1 - now
    drift(ground, zone, now, False)
    end_holds(zone.fine, zone.coarse, zone.holds, zone.number[HOLDS])
    return DONE, last - 1, now, 0
