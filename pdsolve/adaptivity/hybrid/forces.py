"""Forces on all moving nodes: from loads, clipped bonds, fine rows and coarse rows.

Threads take rows dynamically. One thread sums and moves a whole row, so that results do not depend on which. The first
thread does the sequential work while the others process coarse rows on which only springs act. A fine row with a bond
about to break waits until all rows are summed, then it is processed in order. Forces on border nodes pass to the coarse
nodes that carry them before those are moved. Coarse rows are kicked and drifted at once, as displacements of two steps
are kept alternately.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.bond_breaking import break_bonds, pull_again
from pdsolve.adaptivity.hybrid.damping import book_damping, damp_forces
from pdsolve.adaptivity.hybrid.energy import piece_end_displacement, strain_e
from pdsolve.codegen.atomics import counted, take
from pdsolve.codegen.lanes import across
from pdsolve.codegen.plane_slots import kick_and_drift
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import factor_at
from pdsolve.lattice.rows import sum_green, sum_narrow, sum_wide
from pdsolve.numerics.thread_team import meet, wait
from pdsolve.operators.simd_lattice.kernel import INNER, PLANE, displaced

# Places in `PlateZone.turns`, in memory of its own each: how many parts of a job have been handed out to threads.
SUM = 0  # forces on fine rows
BROKEN = 8  # fine rows with a bond that is to break
MOVE = 16  # motion of fine rows
PLAIN = 24  # coarse rows on which springs alone act
TOUCHED = 32  # other coarse rows
STAGE = 40  # no job: the stage that the first thread has reached
FAR_PLAIN = 48  # far rows on which springs alone act
FAR_TOUCHED = 56  # other far rows
ACTED, BROKE, LOADED, REST = range(1, 5)  # stages of a step: the first two are those the others wait for
PART = 8  # fine rows that are handed out at once
COARSE_PART = 64


@njit(forceinline=True, **INNER)
def _add_clipped_bonds(zone, u, uc, f, fc):  # type: ignore[no-untyped-def]
    """Add the forces of clipped bonds; returns the largest e of those that could break."""
    pieces, largest = zone.pieces, 0.0
    end, value, relief = pieces.end, pieces.value, pieces.relief
    for n in range(zone.counts.pieces):
        eta_x = (
            piece_end_displacement(u, uc, pieces, n, 1, 0)
            - piece_end_displacement(u, uc, pieces, n, 0, 0)
            + relief[n, 0]
        )
        eta_y = (
            piece_end_displacement(u, uc, pieces, n, 1, 1)
            - piece_end_displacement(u, uc, pieces, n, 0, 1)
            + relief[n, 1]
        )
        x, y = value[n, 2], value[n, 3]
        e = value[n, 4] * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
        largest = max(largest, e * value[n, 6])
        pull = value[n, 5] * e / 2
        px, py = pull * (x + eta_x), pull * (y + eta_y)
        for which, sign in ((0, 1.0), (1, -1.0)):
            a, b, w = end[n, 2 * which], end[n, 2 * which + 1], value[n, which]
            if b < 0:
                f[0, a] += sign * px
                f[1, a] += sign * py
            else:
                fc[0, a] += (1 - w) * sign * px
                fc[1, a] += (1 - w) * sign * py
                fc[0, b] += w * sign * px
                fc[1, b] += w * sign * py
    return largest


@njit(**INNER)
def _sum_any_stretch(ground, fine, u, p0, count, s):  # type: ignore[no-untyped-def]
    """Forces on nodes of a row, one by one, for any stretch."""
    entry = fine.entry[p0 // ROW]
    for p in range(p0, p0 + count):
        lane, fx, fy = p % ROW, 0.0, 0.0
        for k in range(len(ground.ways)):
            pull = fine.own[entry, k, lane] if entry >= 0 else ground.table[k, 5]
            if pull == 0:
                continue
            j = p + ground.ways[k]
            eta_x, eta_y = displaced(u, fine.shrink, ground.table[k, 0], ground.table[k, 1], p, j)
            e = strain_e(ground.table, k, eta_x, eta_y)
            pull *= e / (1 + e + np.sqrt(1 + e))
            fx += pull * (ground.table[k, 0] + eta_x)
            fy += pull * (ground.table[k, 1] + eta_y)
        s[p - p0], s[ROW + p - p0] = fx, fy


def _make_fine_row_sum(sum_row: Any) -> Any:
    """The sum on some lanes of a fine row, whatever its entry has; `sum_row` is one of `pdsolve.lattice.rows`."""

    @njit(forceinline=True, **INNER)
    def add(ground, fine, u, entry, lane, p, s):  # type: ignore[no-untyped-def]
        table, ways, shrink, limit = ground.table, ground.ways, fine.shrink, ground.least[0]
        if entry < 0:
            return sum_row(u, PLANE, table, ways, None, None, shrink, entry, lane, p, limit, s)
        if ground.varied:
            return sum_row(u, PLANE, table, ways, fine.own, fine.edge, shrink, entry, lane, p, 0.0, s)
        if fine.masked[entry]:
            return sum_row(u, PLANE, table, ways, fine.masks, None, shrink, entry, lane, p, limit, s)
        return sum_row(u, PLANE, table, ways, fine.own, None, shrink, entry, lane, p, limit, s)

    return add


sum_fine_narrow, sum_fine_wide = _make_fine_row_sum(sum_narrow), _make_fine_row_sum(sum_wide)


@njit(**INNER)
def _sum_fine_rows(ground, zone, now, step, thread, job):  # type: ignore[no-untyped-def]
    """Forces f on all fine rows.

    Rows with a bond about to break are set aside for the job `BROKEN` of the first thread.
    """
    fine, s = zone.fine, zone.s[thread]
    wide, u, breaks, aside = across(s), fine.u[now], job == BROKEN, zone.rows_aside[thread]
    parts_per_row = ROW // wide
    count = zone.aside_counts[0] if breaks else zone.counts.fine_rows * parts_per_row
    while True:
        first = take(zone.turns, job) * PART
        if first >= count:
            return
        for n in range(first, min(first + PART, count)):
            p = aside[n] if breaks else fine.rows[n // parts_per_row] * ROW + n % parts_per_row * wide
            row, flags = p // ROW, 1
            if breaks:
                break_bonds(ground, zone, u, p, wide, step)
            elif fine.wide[row] == 0:
                flags = sum_fine_narrow(ground, fine, u, fine.entry[row], p % ROW, p, s)
            if flags & 1:
                fine.wide[row] = fine.wide[row] or not breaks
                flags = sum_fine_wide(ground, fine, u, fine.entry[row], p % ROW, p, s)
            if flags & 2 and not breaks and step > 0:
                aside[zone.aside_counts[8 * thread]] = p
                zone.aside_counts[8 * thread] += 1
                continue
            if flags & 1:
                _sum_any_stretch(ground, fine, u, p, wide, s)
            if breaks or fine.touched[row]:
                add_forces(fine.f, p, wide, s)
            store_forces(fine.f, p, wide, s)


@njit(forceinline=True, **INNER)
def add_forces(f, p, count, s):  # type: ignore[no-untyped-def]
    """Add up all forces in s."""
    for k in range(count):
        s[k] += f[0, p + k]
        s[ROW + k] += f[1, p + k]


@njit(forceinline=True, **INNER)
def store_forces(f, p, count, s):  # type: ignore[no-untyped-def]
    """Store the sums of a row of nodes in the forces f."""
    for k in range(count):
        f[0, p + k], f[1, p + k] = s[k], s[ROW + k]


@njit(**INNER)
def _merge_rows_set_aside(zone):  # type: ignore[no-untyped-def]
    """List the rows that all threads have set aside, in order."""
    aside, count = zone.rows_aside[0], zone.aside_counts[0]
    for thread in range(1, len(zone.s)):
        for n in range(zone.aside_counts[8 * thread]):
            p, m = zone.rows_aside[thread, n], count
            while m > 0 and aside[m - 1] > p:
                aside[m] = aside[m - 1]
                m -= 1
            aside[m] = p
            count += 1
    zone.aside_counts[0] = count


@njit(**INNER)
def _move_fine_rows(zone, now, dt, lag, ends, thread):  # type: ignore[no-untyped-def]
    """Kick and drift all fine rows; where a sequence `ends`, their damped forces are kept instead."""
    fine, s = zone.fine, zone.s[thread]
    wide, u, after, count = across(s), fine.u[now], fine.u[1 - now], zone.counts.fine_rows
    while True:
        first = take(zone.turns, MOVE) * PART
        if first >= count:
            return
        for row in fine.rows[first : min(first + PART, count)]:
            for p in range(row * ROW, row * ROW + ROW, wide):
                for k in range(wide):
                    s[k], s[ROW + k] = fine.f[0, p + k], fine.f[1, p + k]
                damp_forces(fine, p, wide, lag, s)
                if ends:
                    store_forces(fine.f, p, wide, s)
                else:
                    book_damping(fine, p, wide, dt, s, True, True)
                    kick_and_drift(u, after, fine.v, fine.inverse_mass, dt, dt / 2, p, s)


@njit(**INNER)
def _sweep_coarse(ground, zone, now, lag, ends, thread, stage):  # type: ignore[no-untyped-def]
    """Forces on coarse rows and their motion, see `_sweep`.

    The stage LOADED processes touched rows, an earlier stage the others until the first thread reaches LOADED.
    """
    nodes, rows, table, ways = zone.coarse, zone.counts.coarse_rows, ground.coarse_table, ground.coarse_ways
    touched = stage == LOADED
    job = TOUCHED if touched else PLAIN
    _sweep(ground, zone, nodes, rows, table, ways, now, lag, ends, thread, stage, job, touched)


@njit(**INNER)
def _sweep_far(ground, zone, now, lag, ends, thread, gate):  # type: ignore[no-untyped-def]
    """Forces on far rows and their motion, see `_sweep`, once forces on tied nodes are passed on."""
    nodes, rows, table, ways = zone.far, zone.counts.far_rows, ground.far_table, ground.far_ways
    meet(gate)
    if thread == 0:
        _pass_border_forces(zone.coarse.f, zone.far.f, zone.tied, zone.counts.tied_nodes)
    _sweep(ground, zone, nodes, rows, table, ways, now, lag, ends, thread, REST, FAR_PLAIN, False)
    meet(gate)
    _sweep(ground, zone, nodes, rows, table, ways, now, lag, ends, thread, REST, FAR_TOUCHED, True)


@njit(**INNER)
def _sweep(ground, zone, nodes, count, table, ways, now, lag, ends, thread, stage, job, touched):  # type: ignore[no-untyped-def]
    """Forces on rows of a compact lattice, followed by kick and drift unless a sequence `ends`; then forces are kept.

    Rows are those that are `touched`, or the others. Some are taken at a time, as the `job` counts them, until the
    first thread reaches `stage`. Notes rows with a hot bond.
    """
    s, dt, row_stiffness, limit = zone.s[thread], ground.dt, nodes.own, ground.least[2]
    wide, u, after = across(s), nodes.u[now], nodes.u[1 - now]
    while counted(zone.turns, STAGE) < stage:
        first = take(zone.turns, job) * COARSE_PART
        if first >= count:
            return
        for row in nodes.rows[first : min(first + COARSE_PART, count)]:
            if nodes.touched[row] != touched:
                continue
            entry, hot = nodes.entry[row], 0
            for lane in range(0, ROW, wide):
                q = row * ROW + lane
                if entry >= 0:
                    hot |= sum_green(u, PLANE, table, ways, row_stiffness, None, nodes.shrink, entry, lane, q, limit, s)
                else:
                    hot |= sum_green(u, PLANE, table, ways, None, None, nodes.shrink, entry, lane, q, limit, s)
                if touched:
                    add_forces(nodes.f, q, wide, s)
                damp_forces(nodes, q, wide, lag, s)
                if touched or ends:
                    store_forces(nodes.f, q, wide, s)
                if not ends:
                    book_damping(nodes, q, wide, dt, s, True, True)
                    kick_and_drift(u, after, nodes.v, nodes.inverse_mass, dt, dt / 2, q, s)
            nodes.wide[row] = hot > 0


@njit(**INNER)
def _clear_touched_rows(nodes, count):  # type: ignore[no-untyped-def]
    """Set the forces on touched rows to zero."""
    for n in range(count):
        row = nodes.rows[n]
        if nodes.touched[row]:
            for p in range(row * ROW, row * ROW + ROW):
                nodes.f[0, p] = nodes.f[1, p] = 0.0


@njit(**INNER)
def _pass_border_forces(f, fc, border, count):  # type: ignore[no-untyped-def]
    """Pass forces on border nodes to the coarser nodes that carry them."""
    for n in range(count):
        p, a, b, w = border.node[n], border.end[n, 0], border.end[n, 1], border.w[n]
        for axis in range(2):
            fc[axis, a] += (1 - w) * f[axis, p]
            fc[axis, b] += w * f[axis, p]


@njit(**INNER)
def interpolate_border_nodes(u, uc, border, count):  # type: ignore[no-untyped-def]
    """Interpolate border nodes from the coarser ones."""
    for n in range(count):
        p, a, b, w = border.node[n], border.end[n, 0], border.end[n, 1], border.w[n]
        for axis in range(2):
            u[axis, p] = (1 - w) * uc[axis, a] + w * uc[axis, b] + border.off[n, axis]


@njit(**INNER)
def _add_loads(count, loads, fine, coarse, totals, profiles, time, dt):  # type: ignore[no-untyped-def]
    """Add the loads at `time`, and their work since the last step by the trapezoidal rule."""
    last, now, then = -1, 0.0, 0.0
    for n in range(count):
        on, entry = loads.node_and_entry[n, 0], loads.entries[loads.node_and_entry[n, 1]]
        axis, profile, value = entry.axis, entry.profile, loads.share[n] * entry.value
        if profile != last:
            last = profile
            now, then = factor_at(profiles, profile, time), factor_at(profiles, profile, time - dt)
        after, before = value * now, value * then
        if on >= 0:
            fine.f[axis, on] += after
            totals.work += (before + after) / 2 * dt * fine.v[axis, on]
        else:
            coarse.f[axis, -1 - on] += after
            totals.work += (before + after) / 2 * dt * coarse.v[axis, -1 - on]


@njit(**INNER)
def _initialize_forces(ground, zone, profiles, now, step):  # type: ignore[no-untyped-def]
    """Initialize the forces with those of loads and of clipped bonds."""
    fine, coarse, dt = zone.fine, zone.coarse, ground.dt
    _clear_touched_rows(fine, zone.counts.fine_rows)
    _clear_touched_rows(coarse, zone.counts.coarse_rows)
    _clear_touched_rows(zone.far, zone.counts.far_rows)
    _add_loads(zone.counts.loads, zone.loads, fine, coarse, zone.totals, profiles, step * dt, dt if step > 0 else 0.0)
    interpolate_border_nodes(fine.u[now], coarse.u[now], zone.border, zone.counts.border_nodes)
    largest = _add_clipped_bonds(zone, fine.u[now], coarse.u[now], fine.f, coarse.f)
    zone.totals.clipped_e = largest
    zone.totals.largest_e = max(zone.totals.largest_e, largest)


@njit(**INNER)
def sum_and_move(ground, zone, profiles, now, step, lag, ends, thread, gate):  # type: ignore[no-untyped-def]
    """All forces at the displacements `now`, those of `step`; kick and drift unless the sequence `ends`.

    Velocities are those of half of `lag`, s, ago.
    All threads call this together; the first thread calls `reset_turns` before each further call.
    """
    for stage in (ACTED, BROKE, LOADED, REST):
        if thread == 0 and stage == ACTED:
            _initialize_forces(ground, zone, profiles, now, step)
            take(zone.turns, STAGE)
        elif thread == 0 and stage == BROKE:
            _merge_rows_set_aside(zone)
        else:
            _sweep_coarse(ground, zone, now, lag, ends, thread, stage)
            wait(zone.turns, STAGE, min(stage, BROKE), gate)
        if stage == ACTED or (thread == 0 and stage == BROKE):
            _sum_fine_rows(ground, zone, now, step, thread, SUM if stage == ACTED else BROKEN)
        if stage == ACTED:
            meet(gate)
        elif stage == BROKE:
            if thread == 0:
                if lag > 0:
                    pull_again(ground, zone, zone.fine.u[now], step)
                _pass_border_forces(zone.fine.f, zone.coarse.f, zone.border, zone.counts.border_nodes)
                take(zone.turns, STAGE)
            _move_fine_rows(zone, now, ground.dt, lag, ends, thread)
    if zone.counts.far_rows > 0:
        _sweep_far(ground, zone, now, lag, ends, thread, gate)
    meet(gate)


@njit(**INNER)
def reset_turns(zone):  # type: ignore[no-untyped-def]
    """Reset the counters from which threads take rows."""
    zone.turns[:] = 0
    zone.aside_counts[:] = 0
