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

from pdsolve.adaptivity.hybrid.bond_breaking import (
    add_second_release_forces,
    soften_and_break_bonds,
)
from pdsolve.adaptivity.hybrid.clipped_bonds import strain_of_first_change, stretch_from_double_green_strain
from pdsolve.adaptivity.hybrid.damping import damp_forces, record_damped_energy
from pdsolve.adaptivity.hybrid.energy import (
    bond_piece_double_green_strain,
    bond_piece_elongation,
    spring_double_green_strain,
)
from pdsolve.codegen.atomics import counted, take
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.lanes import across, beside
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import factor_at
from pdsolve.lattice.bond import IN_PLACE, displaced, kick_and_drift, multiplied, sums_in
from pdsolve.lattice.layout import ONE, PLANE
from pdsolve.lattice.row_histories import edges_off_straight, of_usual_rows, secant_of_bond, strain_off_straight
from pdsolve.lattice.rows import sum_green, sum_narrow, sum_wide
from pdsolve.numerics.thread_team import meet, wait

# Places in `PlateZone.job_counters`, in memory of its own each: how many parts of a job threads have taken.
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
LOOKED_AT = 0.5  # of the e of coarse bonds that makes cells fine: those above it may be there a step later


@njit(forceinline=True, **INNER)
def _add_bond_piece_forces(zone, u, coarse_u, f, coarse_f):  # type: ignore[no-untyped-def]
    """Add the forces of clipped bonds; returns the largest e of those that could break."""
    pieces, largest = zone.clipped_pieces, 0.0
    for n in range(zone.counts.clipped_pieces):
        spring = pieces.springs[n]
        eta_x, eta_y = bond_piece_elongation(pieces, u, coarse_u, n)
        e = bond_piece_double_green_strain(spring, eta_x, eta_y)
        largest = max(largest, strain_off_straight(zone.history, e) * spring.is_breakable)
        pull = spring.stiffness * e / 2
        px, py = pull * (spring.xi_x + eta_x), pull * (spring.xi_y + eta_y)
        for side, sign in ((0, 1.0), (1, -1.0)):
            end = pieces.ends[n, side]
            a, b, w = end.first_node, end.second_node, end.second_weight
            if b < 0:
                f[0, a] += sign * px
                f[1, a] += sign * py
            else:
                coarse_f[0, a] += (1 - w) * sign * px
                coarse_f[1, a] += (1 - w) * sign * py
                coarse_f[0, b] += w * sign * px
                coarse_f[1, b] += w * sign * py
    return largest


@njit(**INNER)
def _sum_row_forces_with_exact_stretch(lattice, fine, history, u, first_node, count, lane_sums):  # type: ignore[no-untyped-def]
    """Forces on nodes of a row, one by one, for any stretch."""
    entry = fine.stiffness_index_of_row[first_node // ROW]
    for p in range(first_node, first_node + count):
        lane, fx, fy = p % ROW, 0.0, 0.0
        for k in range(len(lattice.neighbour_offsets)):
            pull = fine.row_stiffness[entry, k, lane] if entry >= 0 else lattice.spring_table[k, 5]
            if pull == 0:
                continue
            j = p + lattice.neighbour_offsets[k]
            eta_x, eta_y = displaced(
                u, fine.negative_half_swelling, lattice.spring_table[k, 0], lattice.spring_table[k, 1], p, j
            )
            e = spring_double_green_strain(lattice.spring_table, k, eta_x, eta_y)
            pull *= e / (1 + e + np.sqrt(1 + e))
            pull *= secant_of_bond(history, stretch_from_double_green_strain(e), entry, k, lane)
            fx += pull * (lattice.spring_table[k, 0] + eta_x)
            fy += pull * (lattice.spring_table[k, 1] + eta_y)
        lane_sums[p - first_node], lane_sums[ROW + p - first_node] = fx, fy


def _make_fine_row_sum(sum_row: Any) -> Any:
    """The sum on some lanes of a fine row, whatever its entry has; `sum_row` is one of `pdsolve.lattice.rows`."""

    @njit(forceinline=True, **INNER)
    def sum_forces_of_lanes_of_row(lattice, fine, history, u, stiffness_index, lane, p, lane_sums):  # type: ignore[no-untyped-def]
        springs = u, PLANE, lattice.spring_table, lattice.neighbour_offsets
        shrink, n = fine.negative_half_swelling, stiffness_index
        limit = strain_of_first_change(lattice, lattice.least_strain_bounds[0], lattice.least_strain_bounds[1])
        if n < 0:
            return sum_row(*springs, None, None, of_usual_rows(history), shrink, n, lane, p, limit, lane_sums)
        if lattice.softens_or_limits_vary:
            edges = fine.threshold_strain
            return sum_row(*springs, fine.row_stiffness, edges, history, shrink, n, lane, p, 0.0, lane_sums)
        if fine.uses_spring_lane_masks[n]:
            return sum_row(*springs, fine.spring_lane_masks, None, None, shrink, n, lane, p, limit, lane_sums)
        return sum_row(*springs, fine.row_stiffness, None, None, shrink, n, lane, p, limit, lane_sums)

    return sum_forces_of_lanes_of_row


sum_fine_narrow, sum_fine_wide = _make_fine_row_sum(sum_narrow), _make_fine_row_sum(sum_wide)


@njit(**INNER)
def _sum_forces_of_fine_rows(lattice, zone, displacement_buffer_index, step, thread, job):  # type: ignore[no-untyped-def]
    """Forces f on all fine rows.

    Rows with a bond about to break are set aside for the job `BROKEN` of the first thread.
    """
    fine, history, s = zone.fine, zone.history, zone.lane_sums[thread]
    wide, u, breaks, aside = across(s), fine.u[displacement_buffer_index], job == BROKEN, zone.breaking_rows[thread]
    parts_per_row = ROW // wide
    count = zone.breaking_row_counts[0] if breaks else zone.counts.active_fine_rows * parts_per_row
    while True:
        first = take(zone.job_counters, job) * PART
        if first >= count:
            return
        for n in range(first, min(first + PART, count)):
            p = aside[n] if breaks else fine.active_rows[n // parts_per_row] * ROW + n % parts_per_row * wide
            row, flags = p // ROW, 1
            if breaks:
                soften_and_break_bonds(lattice, zone, u, p, wide, step)
            elif fine.has_large_stretch[row] == 0:
                flags = sum_fine_narrow(lattice, fine, history, u, fine.stiffness_index_of_row[row], p % ROW, p, s)
            if flags & 1:
                fine.has_large_stretch[row] = fine.has_large_stretch[row] or not breaks
                flags = sum_fine_wide(lattice, fine, history, u, fine.stiffness_index_of_row[row], p % ROW, p, s)
            if flags & 2 and not breaks and step > 0:
                aside[zone.breaking_row_counts[8 * thread]] = p
                zone.breaking_row_counts[8 * thread] += 1
                continue
            if flags & 1:
                _sum_row_forces_with_exact_stretch(lattice, fine, history, u, p, wide, s)
            if breaks or fine.has_extra_forces[row]:
                add_stored_forces_to_lane_sums(fine.f, p, wide, s)
            store_lane_sums_as_forces(fine.f, p, wide, s)


@njit(forceinline=True, **INNER)
def add_stored_forces_to_lane_sums(f, p, count, lane_sums):  # type: ignore[no-untyped-def]
    """Add up all forces in s."""
    for k in range(count):
        lane_sums[k] += f[0, p + k]
        lane_sums[ROW + k] += f[1, p + k]


@njit(forceinline=True, **INNER)
def store_lane_sums_as_forces(f, p, count, lane_sums):  # type: ignore[no-untyped-def]
    """Store the sums of a row of nodes in the forces f."""
    for k in range(count):
        f[0, p + k], f[1, p + k] = lane_sums[k], lane_sums[ROW + k]


@njit(**INNER)
def _list_breaking_rows_of_all_threads(zone):  # type: ignore[no-untyped-def]
    """List the rows that all threads have set aside, in order."""
    aside, count = zone.breaking_rows[0], zone.breaking_row_counts[0]
    for thread in range(1, len(zone.lane_sums)):
        for n in range(zone.breaking_row_counts[8 * thread]):
            p, m = zone.breaking_rows[thread, n], count
            while m > 0 and aside[m - 1] > p:
                aside[m] = aside[m - 1]
                m -= 1
            aside[m] = p
            count += 1
    zone.breaking_row_counts[0] = count


@njit(**IN_PLACE)
def _kick_and_drift(nodes, u, after, dt, at, s):  # type: ignore[no-untyped-def]
    """Kick and drift the nodes of some lanes from `at` on, whose forces are in s."""
    a = multiplied(beside(sums_in(s, PLANE), PLANE, 0), beside(nodes.inverse_mass, ONE, at)[0])
    kick_and_drift(u, after, nodes.v, nodes.v, a, dt, PLANE, at)


@njit(**INNER)
def _kick_and_drift_fine_rows(zone, displacement_buffer_index, dt, velocity_lag, ends_sequence, thread):  # type: ignore[no-untyped-def]
    """Kick and drift all fine rows; where a sequence `ends_sequence`, their damped forces are kept instead."""
    fine, s = zone.fine, zone.lane_sums[thread]
    wide, u, after, count = (
        across(s),
        fine.u[displacement_buffer_index],
        fine.u[1 - displacement_buffer_index],
        zone.counts.active_fine_rows,
    )
    while True:
        first = take(zone.job_counters, MOVE) * PART
        if first >= count:
            return
        for row in fine.active_rows[first : min(first + PART, count)]:
            for p in range(row * ROW, row * ROW + ROW, wide):
                for k in range(wide):
                    s[k], s[ROW + k] = fine.f[0, p + k], fine.f[1, p + k]
                damp_forces(fine, p, wide, velocity_lag, s)
                if ends_sequence:
                    store_lane_sums_as_forces(fine.f, p, wide, s)
                else:
                    record_damped_energy(fine, p, wide, dt, s, True, True)
                    _kick_and_drift(fine, u, after, dt, p, s)


@njit(**INNER)
def _sum_forces_and_move_rows(  # type: ignore[no-untyped-def]
    lattice,
    zone,
    rows_of_lattice,
    displacement_buffer_index,
    velocity_lag,
    ends_sequence,
    thread,
    stage,
    has_extra_forces,
):
    """Forces on rows of a compact lattice, then kick and drift; with `ends_sequence`, forces are kept instead.

    `rows_of_lattice` are its nodes, the number of their rows, their springs and offsets, and two jobs. Rows are those
    with forces besides the springs', of the second job, if `has_extra_forces`, or the others. Some are taken at a time,
    as the job counts them, until the first thread reaches `stage`. Marks rows with a bond near or over its bound.
    """
    nodes, count, spring_table, offsets, plain_job, touched_job = rows_of_lattice
    job = touched_job if has_extra_forces else plain_job
    s, dt, limit = zone.lane_sums[thread], lattice.dt, LOOKED_AT * lattice.least_strain_bounds[2]
    edges = edges_off_straight(zone.history)
    wide, u, after = across(s), nodes.u[displacement_buffer_index], nodes.u[1 - displacement_buffer_index]
    while counted(zone.job_counters, STAGE) < stage:
        first = take(zone.job_counters, job) * COARSE_PART
        if first >= count:
            return
        for row in nodes.active_rows[first : min(first + COARSE_PART, count)]:
            if nodes.has_extra_forces[row] != has_extra_forces:
                continue
            entry, hot = nodes.stiffness_index_of_row[row], 0
            for lane in range(0, ROW, wide):
                q = row * ROW + lane
                lanes = edges, None, nodes.negative_half_swelling, entry, lane, q, limit, s
                if entry >= 0:
                    hot |= sum_green(u, PLANE, spring_table, offsets, nodes.row_stiffness, *lanes)
                else:
                    hot |= sum_green(u, PLANE, spring_table, offsets, None, *lanes)
                if has_extra_forces:
                    add_stored_forces_to_lane_sums(nodes.f, q, wide, s)
                damp_forces(nodes, q, wide, velocity_lag, s)
                if has_extra_forces or ends_sequence:
                    store_lane_sums_as_forces(nodes.f, q, wide, s)
                if not ends_sequence:
                    record_damped_energy(nodes, q, wide, dt, s, True, True)
                    _kick_and_drift(nodes, u, after, dt, q, s)
            nodes.has_large_stretch[row] = hot > 0


@njit(**INNER)
def _set_forces_to_zero_in_rows_with_extra_forces(nodes, count):  # type: ignore[no-untyped-def]
    """Set the forces on touched rows to zero."""
    for n in range(count):
        row = nodes.active_rows[n]
        if nodes.has_extra_forces[row]:
            for p in range(row * ROW, row * ROW + ROW):
                nodes.f[0, p] = nodes.f[1, p] = 0.0


@njit(**INNER)
def _distribute_border_forces_to_coarser_nodes(f, coarse_f, border, count):  # type: ignore[no-untyped-def]
    """Pass forces on border nodes to the coarser nodes that carry them."""
    for n in range(count):
        node = border[n]
        p, a, b, w = node.border_node, node.first_coarser_node, node.second_coarser_node, node.second_weight
        for axis in range(2):
            coarse_f[axis, a] += (1 - w) * f[axis, p]
            coarse_f[axis, b] += w * f[axis, p]


@njit(**INNER)
def interpolate_border_nodes(u, coarse_u, border, count):  # type: ignore[no-untyped-def]
    """Interpolate border nodes from the coarser ones."""
    for n in range(count):
        node = border[n]
        p, a, b, w = node.border_node, node.first_coarser_node, node.second_coarser_node, node.second_weight
        u[0, p] = (1 - w) * coarse_u[0, a] + w * coarse_u[0, b] + node.swelling_x
        u[1, p] = (1 - w) * coarse_u[1, a] + w * coarse_u[1, b] + node.swelling_y


@njit(**INNER)
def _add_loads(count, loads, fine, coarse, totals, profiles, time, dt):  # type: ignore[no-untyped-def]
    """Add the loads at `time`, and their work since the last step by the trapezoidal rule."""
    last, now, then = -1, 0.0, 0.0
    for n in range(count):
        on, entry = loads.node_and_entry[n, 0], loads.entries[loads.node_and_entry[n, 1]]
        axis, profile, value = entry.axis, entry.profile, loads.node_share[n] * entry.value
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
def _add_support_forces(count, supports, fine, coarse, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Add the forces of springs to the ground."""
    for n in range(count):
        on, entry = supports.node_and_entry[n, 0], supports.entries[supports.node_and_entry[n, 1]]
        nodes, p = (fine, on) if on >= 0 else (coarse, -1 - on)
        stiffness = supports.node_share[n] * entry.value
        nodes.f[entry.axis, p] -= stiffness * nodes.u[displacement_buffer_index, entry.axis, p]


@njit(**INNER)
def _start_forces_with_loads_and_bond_pieces(lattice, zone, profiles, displacement_buffer_index, step):  # type: ignore[no-untyped-def]
    """Initialize the forces with those of loads and of clipped bonds."""
    fine, coarse, dt = zone.fine, zone.coarse, lattice.dt
    _set_forces_to_zero_in_rows_with_extra_forces(fine, zone.counts.active_fine_rows)
    _set_forces_to_zero_in_rows_with_extra_forces(coarse, zone.counts.active_coarse_rows)
    _set_forces_to_zero_in_rows_with_extra_forces(zone.far, zone.counts.active_coarsest_rows)
    _add_loads(
        zone.counts.node_loads, zone.loads, fine, coarse, zone.totals, profiles, step * dt, dt if step > 0 else 0.0
    )
    _add_support_forces(zone.counts.node_supports, zone.supports, fine, coarse, displacement_buffer_index)
    interpolate_border_nodes(
        fine.u[displacement_buffer_index],
        coarse.u[displacement_buffer_index],
        zone.border_nodes,
        zone.counts.border_nodes,
    )
    largest = _add_bond_piece_forces(
        zone, fine.u[displacement_buffer_index], coarse.u[displacement_buffer_index], fine.f, coarse.f
    )
    zone.totals.clipped_strain = largest
    zone.totals.largest_clipped_strain = max(zone.totals.largest_clipped_strain, largest)


@njit(**INNER)
def _sum_forces_and_move_coarsest_rows(  # type: ignore[no-untyped-def]
    lattice, zone, displacement_buffer_index, velocity_lag, ends_sequence, thread, barrier
):
    """Forces on far rows and their motion, once forces on tied nodes are passed on."""
    table, offsets = lattice.coarsest_spring_table, lattice.coarsest_neighbour_offsets
    of_step = displacement_buffer_index, velocity_lag, ends_sequence, thread
    far = zone.far, zone.counts.active_coarsest_rows, table, offsets, FAR_PLAIN, FAR_TOUCHED
    meet(barrier)
    if thread == 0:
        _distribute_border_forces_to_coarser_nodes(
            zone.coarse.f, zone.far.f, zone.tied_coarse_nodes, zone.counts.tied_nodes
        )
    _sum_forces_and_move_rows(lattice, zone, far, *of_step, REST, False)
    meet(barrier)
    _sum_forces_and_move_rows(lattice, zone, far, *of_step, REST, True)


@njit(**INNER)
def sum_forces_and_move_nodes(  # type: ignore[no-untyped-def]
    lattice, zone, profiles, displacement_buffer_index, step, velocity_lag, ends_sequence, thread, barrier
):
    """All forces at the displacements of a buffer, those of `step`; kick and drift unless the sequence ends.

    Velocities are those of half of `velocity_lag`, s, ago.
    All threads call this together; the first thread calls `reset_job_counters` before each further call.
    """
    counts = zone.counts
    table, offsets = lattice.coarse_spring_table, lattice.coarse_neighbour_offsets
    coarse = zone.coarse, counts.active_coarse_rows, table, offsets, PLAIN, TOUCHED
    for stage in (ACTED, BROKE, LOADED, REST):
        if thread == 0 and stage == ACTED:
            _start_forces_with_loads_and_bond_pieces(lattice, zone, profiles, displacement_buffer_index, step)
            take(zone.job_counters, STAGE)
        elif thread == 0 and stage == BROKE:
            _list_breaking_rows_of_all_threads(zone)
        else:
            of_step = displacement_buffer_index, velocity_lag, ends_sequence, thread
            _sum_forces_and_move_rows(lattice, zone, coarse, *of_step, stage, stage == LOADED)
            wait(zone.job_counters, STAGE, min(stage, BROKE), barrier)
        if stage == ACTED or (thread == 0 and stage == BROKE):
            _sum_forces_of_fine_rows(
                lattice, zone, displacement_buffer_index, step, thread, SUM if stage == ACTED else BROKEN
            )
        if stage == ACTED:
            meet(barrier)
        elif stage == BROKE:
            if thread == 0:
                if velocity_lag > 0:
                    add_second_release_forces(lattice, zone, zone.fine.u[displacement_buffer_index], step)
                _distribute_border_forces_to_coarser_nodes(
                    zone.fine.f, zone.coarse.f, zone.border_nodes, zone.counts.border_nodes
                )
                take(zone.job_counters, STAGE)
            _kick_and_drift_fine_rows(zone, displacement_buffer_index, lattice.dt, velocity_lag, ends_sequence, thread)
    if counts.active_coarsest_rows > 0:
        _sum_forces_and_move_coarsest_rows(
            lattice, zone, displacement_buffer_index, velocity_lag, ends_sequence, thread, barrier
        )
    meet(barrier)


@njit(**INNER)
def reset_job_counters(zone):  # type: ignore[no-untyped-def]
    """Reset the counters from which threads take rows."""
    zone.job_counters[:] = 0
    zone.breaking_row_counts[:] = 0
