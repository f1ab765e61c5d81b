"""Motion outside the fused sweep: half kicks at both ends of a sequence of steps, and prescribed velocities.

A hold prescribes the velocity until the next step, or what changes it. The sweep has moved its node as if free; the
hold undoes that.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import LONG, NEWLY
from pdsolve.adaptivity.hybrid.damping import record_damped_energy
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import ACCELERATION, DISPLACEMENT, VELOCITY, factor_at


@njit(**INNER)
def _half_kick_and_drift_rows(nodes, count, displacement_buffer_index, dt, drifts):  # type: ignore[no-untyped-def]
    """Half a kick, m/s, of all rows by the stored forces, and a drift over `dt`, s, if `drifts`.

    In the precision of the motion, as the lanes of the sweep: results do not depend on where sequences end.
    """
    u, after, v, f = nodes.u[displacement_buffer_index], nodes.u[1 - displacement_buffer_index], nodes.v, nodes.f
    step, half_step = v.dtype.type(dt), v.dtype.type(dt / 2)
    for n in range(count):
        row = nodes.active_rows[n]
        for axis in range(2):
            for p in range(row * ROW, row * ROW + ROW):
                v[axis, p] += half_step * (f[axis, p] * nodes.inverse_mass[p])
                if drifts:
                    after[axis, p] = u[axis, p] + step * v[axis, p]


@njit(**INNER)
def half_kick_and_drift_all_lattices(lattice, zone, displacement_buffer_index, drifts):  # type: ignore[no-untyped-def]
    """Half a kick of all nodes and a drift if `drifts`; what damping takes in that half of a step is booked."""
    counts, s = zone.counts, zone.lane_sums[0]
    lattices = (
        (zone.fine, counts.active_fine_rows),
        (zone.coarse, counts.active_coarse_rows),
        (zone.far, counts.active_coarsest_rows),
    )
    for nodes, rows in lattices:
        for row in nodes.active_rows[:rows]:
            for k in range(ROW):
                s[k], s[ROW + k] = nodes.f[0, row * ROW + k], nodes.f[1, row * ROW + k]
            record_damped_energy(nodes, row * ROW, ROW, lattice.dt, s, not drifts, drifts)
        _half_kick_and_drift_rows(nodes, rows, displacement_buffer_index, lattice.dt, drifts)


@njit(forceinline=True, **INNER)
def _nodes_and_place(fine, coarse, fine_or_coarse_place):  # type: ignore[no-untyped-def]
    """The lattice of a node of `LoadsOrPrescribedMotions.node_and_entry`, and its place there."""
    return (fine, fine_or_coarse_place) if fine_or_coarse_place >= 0 else (coarse, -1 - fine_or_coarse_place)


@njit(**INNER)
def store_constraint_forces(fine, coarse, holds, count, profiles, dt):  # type: ignore[no-untyped-def]
    """Store forces and velocities of held components at the start, as if steps of `dt`, s, had gone before."""
    for n in range(count):
        nodes, p = _nodes_and_place(fine, coarse, holds.node_and_entry[n, 0])
        entry = holds.entries[holds.node_and_entry[n, 1]]
        entry.force_on_prescribed_component, entry.speed_at_last_step = nodes.f[entry.axis, p], nodes.v[entry.axis, p]
        if entry.prescribed_kind == ACCELERATION:
            half_kick = dt / 2 * entry.value * factor_at(profiles, entry.profile, 0.0)
            entry.mean_speed_since_last_step = entry.speed_at_last_step - half_kick


@njit(**INNER)
def restore_prescribed_velocities(fine, coarse, holds, count):  # type: ignore[no-untyped-def]
    """Give held components their prescribed velocities."""
    for n in range(count):
        nodes, p = _nodes_and_place(fine, coarse, holds.node_and_entry[n, 0])
        entry = holds.entries[holds.node_and_entry[n, 1]]
        nodes.v[entry.axis, p] = entry.speed_at_last_step


@njit(**INNER)
def _speed_one_step_ago(entry, profiles, time, dt):  # type: ignore[no-untyped-def]
    """The velocity, one step before `time`, of a held component whose node has moved by itself since then alone."""
    before = entry.value * factor_at(profiles, entry.profile, time - dt)
    if entry.prescribed_kind == VELOCITY:
        return before
    if entry.prescribed_kind == ACCELERATION:
        return entry.mean_speed_since_last_step - dt / 2 * before
    return (before - entry.value * factor_at(profiles, entry.profile, time - 2 * dt)) / dt


@njit(**INNER)
def apply_prescribed_motions(  # type: ignore[no-untyped-def]
    fine, coarse, holds, count, totals, dt, profiles, displacement_buffer_index, step, ends_sequence, begins_sequence
):
    """Book the holding forces until `step`, unless `begins_sequence`, and hold from there on unless `ends_sequence`."""
    time = step * dt
    for n in range(count):
        nodes, p = _nodes_and_place(fine, coarse, holds.node_and_entry[n, 0])
        entry = holds.entries[holds.node_and_entry[n, 1]]
        axis, profile, speed = entry.axis, entry.profile, entry.mean_speed_since_last_step
        u, force = nodes.u, nodes.f[axis, p]
        half_kick = dt / 2 * entry.value * factor_at(profiles, profile, time)  # where that is an acceleration
        if entry.prescribed_kind == VELOCITY:
            speed = entry.value * factor_at(profiles, profile, time)
        elif entry.prescribed_kind == ACCELERATION:
            speed += half_kick
        if not begins_sequence:
            if entry.node_moves == NEWLY:
                entry.speed_at_last_step = _speed_one_step_ago(entry, profiles, time, dt)
            totals.work -= (entry.force_on_prescribed_component + force) / 2 * dt * entry.mean_speed_since_last_step
            totals.work += nodes.mass[p] / 2 * (speed**2 - entry.speed_at_last_step**2)
            entry.force_on_prescribed_component, entry.speed_at_last_step = force, speed
        entry.node_moves = LONG
        if ends_sequence:
            continue
        if entry.prescribed_kind == DISPLACEMENT:
            speed = (entry.value * factor_at(profiles, profile, time + dt) - u[displacement_buffer_index, axis, p]) / dt
        elif entry.prescribed_kind == ACCELERATION:
            speed = entry.speed_at_last_step + half_kick
        else:
            speed = entry.value * factor_at(profiles, profile, time + dt / 2)
        nodes.v[axis, p] = entry.mean_speed_since_last_step = speed
        u[1 - displacement_buffer_index, axis, p] = u[displacement_buffer_index, axis, p] + dt * speed
