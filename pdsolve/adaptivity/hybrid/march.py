"""Time steps by leapfrog (as in `pdsolve.steppers.verlet`) of free fine nodes and coarse nodes.

Every few steps, cells are refined near nodes with a broken or softened bond, and near stretched coarse bonds.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import AHEAD, EVERY
from pdsolve.adaptivity.hybrid.energy import strain_e
from pdsolve.adaptivity.hybrid.far_cells import divide_far_cells
from pdsolve.adaptivity.hybrid.forces import interpolate_border_nodes, reset_turns, sum_and_move
from pdsolve.adaptivity.hybrid.kicks_and_prescribed_velocities import (
    hold_components,
    kick_and_drift_all,
    restore_held_velocities,
    store_holding_forces,
)
from pdsolve.adaptivity.hybrid.lattice import (
    FINE,
    IDLE,
    coarse_column,
    coarse_row,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.node_rows import value_at_node
from pdsolve.adaptivity.hybrid.precracks import lasts
from pdsolve.adaptivity.hybrid.regrid import list_affected_nodes, mark_cells_in_disc, rebuild_lists, refine_cells
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.numerics.thread_team import meet
from pdsolve.operators.simd_lattice.kernel import INNER, displaced

DONE, ROOM, CLIP = 0, 1, 2  # how a march ends: at its last step; for want of room; as a clipped bond is over its limit
SPARE = 64  # rows: room for so many more is always kept


@njit(**INNER)
def _list_cells_near_broken(ground, zone):  # type: ignore[no-untyped-def]
    """List the cells to refine near nodes with a broken or softened bond."""
    at, count = ground.at, 0
    for n in range(zone.counts.refined_nodes, zone.counts.stirred_nodes):
        p = zone.stirs[n]
        count = mark_cells_in_disc(at, zone.cells, zone.new_cells, count, fine_column(at, p), fine_row(at, p), AHEAD)
    return count


@njit(**INNER)
def _list_cells_near_stretched(ground, zone, now, count):  # type: ignore[no-untyped-def]
    """List the cells to refine near the nodes of a stretched coarse bond; returns their new `count`."""
    at, coarse, table = ground.at, zone.coarse, ground.coarse_table
    u = coarse.u[now]
    for n in range(zone.counts.coarse_rows):
        row = coarse.rows[n]
        if coarse.wide[row] == 0:
            continue
        for lane in range(ROW):
            q = row * ROW + lane
            if coarse.kind[q] == IDLE or _is_coarse_unbreakable(ground, q):
                continue
            for k in range(8):
                entry, j = coarse.entry[row], q + ground.coarse_ways[k]
                if (entry >= 0 and coarse.own[entry, k, lane] == 0) or _is_coarse_unbreakable(ground, j):
                    continue
                eta_x, eta_y = displaced(u, coarse.shrink, table[k, 0], table[k, 1], q, j)
                if strain_e(table, k, eta_x, eta_y) > _refinement_e(ground, q):
                    x, y = 2 * coarse_column(at, q), 2 * coarse_row(at, q)
                    count = mark_cells_in_disc(at, zone.cells, zone.new_cells, count, x, y, AHEAD)
                    break
    return count


@njit(**INNER)
def _refinement_e(ground, q):  # type: ignore[no-untyped-def]
    """The e of a coarse bond at which the cells beside it are refined."""
    p = fine_place(ground.at, 2 * coarse_column(ground.at, q), 2 * coarse_row(ground.at, q))
    return ground.bounds[value_at_node(ground.nodes, ground.nodes.material, p), 2]


@njit(**INNER)
def _is_coarse_unbreakable(ground, q):  # type: ignore[no-untyped-def]
    """Whether the bonds of a coarse node are unbreakable."""
    return lasts(ground, fine_place(ground.at, 2 * coarse_column(ground.at, q), 2 * coarse_row(ground.at, q)))


@njit(**INNER)
def _has_room(zone, rows):  # type: ignore[no-untyped-def]
    """Whether the arrays have room for `rows` more fine rows, for new irregular rows, and for all bonds to break."""
    events = ROW * (zone.counts.fine_rows + rows) * zone.fine.own.shape[1]
    entries = zone.counts.stiffness_rows + rows + SPARE
    return entries <= len(zone.fine.own) and zone.counts.broken_bonds + events <= len(zone.breaks.step)


@njit(**INNER)
def _divide_far_cells(ground, zone, now):  # type: ignore[no-untyped-def]
    """Make far cells coarse where it is due, before the cells in `zone.new_cells` become fine."""
    count = zone.counts.new_cells
    if zone.counts.far_rows > 0 and divide_far_cells(ground, zone, now):
        rebuild_lists(ground, zone)
        zone.counts.new_cells = count
        for c in zone.new_cells[:count]:
            zone.cells[c] = FINE


@njit(**INNER)
def _adapt_cells(ground, zone, now, looks):  # type: ignore[no-untyped-def]
    """Refine where noted, or where found if it `looks`; or note that room is lacking."""
    if looks:
        zone.counts.new_cells = _list_cells_near_stretched(ground, zone, now, _list_cells_near_broken(ground, zone))
        _divide_far_cells(ground, zone, now)
    begins, rows = zone.counts.regrids == 0, 0
    if begins or zone.counts.new_cells > 0:
        rows = list_affected_nodes(ground, zone)
    zone.counts.lacks_room = not _has_room(zone, rows)
    if zone.counts.lacks_room == 0 and (begins or zone.counts.new_cells > 0):
        refine_cells(ground, zone, now)


@njit(**INNER)
def _drift_and_hold(ground, zone, profiles, now, step, starts, ends):  # type: ignore[no-untyped-def]
    """Begin a sequence by a drift and hold until the next step; at the start, only store the holding forces."""
    fine, coarse, holds, count = zone.fine, zone.coarse, zone.holds, zone.counts.holds
    if starts and ends:
        store_holding_forces(fine, coarse, holds, count)
    else:
        if starts:
            kick_and_drift_all(ground, zone, now, starts)
        hold_components(fine, coarse, holds, count, zone.totals, ground.dt, profiles, now, step, ends, starts)
    if not ends:
        interpolate_border_nodes(coarse.u[1 - now], zone.far.u[1 - now], zone.tied, zone.counts.tied_nodes)


@cached_njit(nogil=True, error_model="numpy")
def advance(ground, zone, profiles, now, first, last, drifted, thread, gate):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1; returns the end code, the step, and the current displacement buffer.

    At the end, velocities are synchronous with displacements and all forces are kept. `drifted` continues a march that
    ended for lack of room. With last = first, nodes are derived from the cells if needed, and the initial forces
    computed. All threads call this together.
    """
    for step in range(first if drifted else first - 1, max(first, last)):
        starts, ends, largest = step < first, step == last - 1, 0.0
        if not starts or ends:
            if starts or step % EVERY == 0:
                if thread == 0:
                    _adapt_cells(ground, zone, now, step >= first + drifted)
                meet(gate)
                if zone.counts.lacks_room != 0:
                    return ROOM, step, now
            sum_and_move(ground, zone, profiles, now, step, 0.0 if starts else ground.dt, ends, thread, gate)
            largest = zone.totals.clipped_e
            meet(gate)
        if thread == 0:
            reset_turns(zone)
            _drift_and_hold(ground, zone, profiles, now, step, starts, ends)
        meet(gate)
        if largest > ground.least[0]:
            return CLIP, step, now
        if not ends:
            now = 1 - now
    if thread == 0 and last > first:
        kick_and_drift_all(ground, zone, now, last == first)
        restore_held_velocities(zone.fine, zone.coarse, zone.holds, zone.counts.holds)
    return DONE, last - 1, now
