"""Time steps by velocity Verlet (as in `pdsolve.steppers.verlet`) of active fine and coarse nodes.

After each drift, fictitious nodes are interpolated. Every few steps, pairs of coarse nodes are checked. If one is
stretched so far that fine nodes are needed, or if a bond to a fictitious node breaks, the march ends so that they can
be made.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.collocation.simd_rows import (
    add_row,
    add_row_exactly,
    break_bond,
    e_before,
    e_of_bond,
    is_over,
    stiffness,
    store_row_energies,
)
from pdsolve.adaptivity.collocation.zone import COARSE, FINE
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import apply_loads
from pdsolve.laws.calls import added_force, broken_energy, second_share
from pdsolve.numerics.thread_team import meet
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.steppers.holds import accelerate_held_component, prescribe_component

DONE, SWITCH, ROOM = range(3)  # how a march ends: at its last step; as nodes are to be made fine; for want of room
BEGIN, FORCES, SUM = range(3)  # where in a step it goes on; with `SUM` it ends once forces are summed


@njit(**INNER)
def _drift(ground, zone, drive, time):  # type: ignore[no-untyped-def]
    """Half a kick and the drift to the displacements at `time`, s."""
    dt, u, v, a = ground.dt, zone.u, zone.v, zone.a
    for row in zone.rows:
        for p in range(row * ROW, row * ROW + ROW):
            if zone.node[p] == FINE:
                for axis in range(2):
                    v[axis, p] += dt / 2 * a[axis, p]
                    u[axis, p] += dt * v[axis, p]
    for p in zone.coarse:
        for axis in range(2):
            v[axis, p] += dt / 2 * a[axis, p]
            u[axis, p] += dt * v[axis, p]
    for e in range(len(drive.holds.node)):
        prescribe_component(u.T, v.T, a.T, drive.holds, drive.profiles, drive.held_speed, e, dt, time)
    if drive.varies:
        apply_loads(drive, time)


@njit(**INNER)
def follow(zone, field):  # type: ignore[no-untyped-def]
    """Interpolate a field at the fictitious nodes."""
    for n in range(len(zone.between)):
        p, i, j, k, m = zone.between[n]
        for axis in range(2):
            field[axis, p] = 0.25 * ((field[axis, i] + field[axis, j]) + (field[axis, k] + field[axis, m]))


@njit(**INNER)
def look(ground, zone, kappa):  # type: ignore[no-untyped-def]
    """Mark both nodes of each coarse pair stretched beyond `kappa` times the critical stretch."""
    stretch = np.sqrt(1 + ground.limit) - 1
    hot = kappa * stretch * (kappa * stretch + 2)
    u, any_hot = zone.u, False
    for q in zone.coarse:
        for s in range(len(ground.stencil_ways)):
            j = q + ground.stencil_ways[s]
            x, y = u[0, j] - u[0, q], u[1, j] - u[1, q]
            inverse = ground.pairs[s, 2]
            e = (x * inverse + ground.pairs[s, 0]) * x + (y * inverse + ground.pairs[s, 1]) * y
            if e > hot and not (ground.no_fail[q] or ground.no_fail[j]):
                zone.hot[q] = zone.hot[j] = any_hot = True
            if zone.node[j] == COARSE:
                zone.totals.largest_e = max(zone.totals.largest_e, e)
    return any_hot


@njit(**INNER)
def sum_coarse(ground, zone):  # type: ignore[no-untyped-def]
    """Accelerations of active coarse nodes from their stencils."""
    u = zone.u
    for q in zone.coarse:
        x, y = 0.0, 0.0
        for s in range(len(ground.stencil_ways)):
            j = q + ground.stencil_ways[s]
            x += ground.theta[s, 0] * u[0, j] + ground.theta[s, 1] * u[1, j]
            y += ground.theta[s, 1] * u[0, j] + ground.theta[s, 2] * u[1, j]
        zone.f[0, q], zone.f[1, q] = x, y


@njit(**INNER)
def add_rows(ground, zone, first, last):  # type: ignore[no-untyped-def]
    """Add the forces on the nodes of active rows."""
    for n in range(first, last):
        zone.flags[n] = _add(ground, zone, zone.rows[n])


@njit(**INNER)
def _add(ground, zone, row):  # type: ignore[no-untyped-def]
    """Add the forces on the nodes of one row; returns a bit for each node with a bond over its bound."""
    over, exact = add_row(ground, zone.cut, zone.kinds[row], zone.bounds, zone.u, zone.f, row)
    if not exact:
        add_row_exactly(ground, zone.cut, zone.kinds[row], zone.u, zone.f, row)
    return over


@njit(**INNER)
def _room(ground, zone):  # type: ignore[no-untyped-def]
    """Whether the arrays have room for all bonds of the flagged rows to break."""
    flagged = 0
    for n in range(len(zone.rows)):
        flagged += zone.flags[n] != 0
    return zone.counts.broken_bonds + flagged * ROW * len(ground.ways) <= len(zone.breaks.step)


@njit(**INNER)
def _break(ground, zone, step):  # type: ignore[no-untyped-def]
    """Break bonds over their limit, book their energy, and recompute forces there; returns whether fine nodes are
    needed."""
    any_broken = False
    zone.counts.any_hot = 0
    for n in range(len(zone.rows)):
        if zone.flags[n] == 0:
            continue
        for p in range(zone.rows[n] * ROW, zone.rows[n] * ROW + ROW):
            if not (zone.flags[n] >> (p % ROW)) & 1:
                continue
            for k in range(len(ground.ways)):
                if not is_over(ground, zone, zone.u, p, k):
                    continue
                any_broken = True
                _break_one(ground, zone, step, p, k)
    if any_broken:
        for row in zone.rows:
            if zone.again[row]:
                _add(ground, zone, row)
        zone.again[:] = 0
    _pull_broken(ground, zone, step)
    return zone.counts.any_hot != 0


@njit(**INNER)
def _pull_broken(ground, zone, step):  # type: ignore[no-untyped-def]
    """Let the bonds that broke in this step pull once, and those of the last step a second time."""
    breaks, n = zone.breaks, zone.counts.broken_bonds
    while n > 0 and breaks.step[n - 1] >= step - 1:
        n -= 1
        p, k = breaks.node[n], breaks.spring[n]
        stretch, before, _ = _stretches(ground, zone, p, k)
        share = 1.0 if breaks.step[n] == step else second_share(breaks.growth[n], stretch - before)
        _add_pull(ground, zone, p, k, breaks.pull[n] * share / (1 + stretch))


@njit(**INNER)
def _stretches(ground, zone, p, k):  # type: ignore[no-untyped-def]
    """The stretch of bond k of node p now and one step ago, and its limit."""
    e, e0 = e_of_bond(ground, zone.u, p, k), e_before(ground, zone.u, zone.v, p, k)
    return e / (1 + np.sqrt(1 + e)), e0 / (1 + np.sqrt(1 + e0)), ground.limit / (1 + np.sqrt(1 + ground.limit))


@njit(**INNER)
def _add_pull(ground, zone, p, k, pull):  # type: ignore[no-untyped-def]
    """Add a pull of bond k of node p, which has broken, to the forces on both its ends."""
    j, half = p + ground.ways[k], len(ground.ways) // 2
    for axis in range(2):
        along = pull * (ground.table[k, axis] + zone.u[axis, j] - zone.u[axis, p])
        zone.f[axis, p] += stiffness(ground, p, k) * along
        zone.f[axis, j] -= stiffness(ground, j, k + half if k < half else k - half) * along


@njit(**INNER)
def _break_one(ground, zone, step, p, k):  # type: ignore[no-untyped-def]
    """Break bond k of node p, and book the energy it has dissipated."""
    j, half, count = p + ground.ways[k], len(ground.ways) // 2, zone.counts.broken_bonds
    stretch, before, limit = _stretches(ground, zone, p, k)
    spring = stiffness(ground, p, k) * ground.there[0, p] / ground.table[k, 4]
    energy = broken_energy(ground.law, spring / 4, stretch, before, limit, limit)
    zone.totals.dissipated += 2 * energy
    for node in (p, j) if zone.node[j] == FINE else (p, p):
        zone.spent[node] += energy
    break_bond(ground, zone, p, k)
    zone.again[p // ROW] = zone.again[j // ROW] = 1
    zone.breaks.step[count] = step
    zone.breaks.node[count], zone.breaks.spring[count] = (p, k) if k < half else (j, k - half)
    zone.breaks.pull[count] = added_force(ground.law, stretch, before, 0.0, limit, limit)
    zone.breaks.growth[count] = stretch - before
    zone.counts.broken_bonds += 1
    if zone.node[j] != FINE:
        zone.counts.any_hot = 1
        _warm(ground, zone, j)


@njit(**INNER)
def _warm(ground, zone, p):  # type: ignore[no-untyped-def]
    """Mark the coarse nodes that a node lies on or between."""
    at = ground.at
    right, up = (p % at.stride - at.left) % 2, (p // at.stride - at.below) % 2
    corner = p - right - up * at.stride
    for y in range(up + 1):
        for x in range(right + 1):
            zone.hot[corner + 2 * x + 2 * y * at.stride] = True


@njit(**INNER)
def _kick(ground, zone, drive, work):  # type: ignore[no-untyped-def]
    """Turn forces into accelerations and apply the second half of the kick; books work and damping."""
    v, a, dt, light = zone.v, zone.a, ground.dt, 1 / (ground.rho * ground.h**2)
    for row in zone.rows:
        for p in range(row * ROW, row * ROW + ROW):
            if zone.node[p] == FINE:
                for axis in range(2):
                    load, before = drive.force[p, axis], drive.before[p, axis]
                    _kick_one(ground, zone, p, axis, zone.f[axis, p] * light + load / ground.rho, dt)
                    work[p] += (before + load) / 2 * (dt * (v[axis, p] - dt / 2 * a[axis, p]))
    for p in zone.coarse:
        for axis in range(2):
            _kick_one(ground, zone, p, axis, zone.f[axis, p], dt)


@njit(forceinline=True, **INNER)
def _kick_one(ground, zone, p, axis, undamped, dt):  # type: ignore[no-untyped-def]
    """Kick one component of the velocity of a node, damped; held components are overwritten afterwards."""
    v, a, c = zone.v, zone.a, zone.damping[p]
    middle = v[axis, p]
    speed = (middle + dt / 2 * undamped) / (1 + c * dt / 2)
    if c > 0:
        before = middle - dt / 2 * a[axis, p]
        zone.damped[p] += ground.rho * c * (before + speed) / 2 * (dt * middle)
    a[axis, p] = undamped - c * speed
    v[axis, p] = middle + dt / 2 * a[axis, p]


@njit(**INNER)
def _release(ground, zone, drive, work, rho, time):  # type: ignore[no-untyped-def]
    """Give held components their prescribed motion."""
    v, a, dt = zone.v, zone.a, ground.dt
    for e in range(len(drive.holds.node)):
        p, axis = drive.holds.node[e], drive.holds.axis[e]
        v[axis, p] -= dt / 2 * a[axis, p]
        accelerate_held_component(
            v.T, a.T, rho, work, drive.holds, drive.profiles, drive.held_speed, drive.held_force, e, dt, time
        )
        v[axis, p] += dt / 2 * a[axis, p]


@cached_njit(nogil=True, error_model="numpy")
def advance(ground, zone, drive, work, rho, kappa, every, first, last, where, thread, gate):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1, from stage `where` of the first; returns the end code and the step.

    All threads call this together.
    """
    threads, rows = gate.threads, len(zone.rows)
    for step in range(first, last):
        if thread == 0:
            zone.counts.any_hot = 0
            if step > first or where == BEGIN:
                _drift(ground, zone, drive, step * ground.dt)
                follow(zone, zone.u)
                zone.counts.any_hot = step % every == 0 and look(ground, zone, kappa)
            else:
                follow(zone, zone.u)
        meet(gate)
        if zone.counts.any_hot != 0:
            return SWITCH, step
        add_rows(ground, zone, rows * thread // threads, rows * (thread + 1) // threads)
        meet(gate)
        if not _room(ground, zone):
            return ROOM, step
        meet(gate)
        if thread == 0 and (not _break(ground, zone, step) or where == SUM):
            sum_coarse(ground, zone)
            if where != SUM:
                _kick(ground, zone, drive, work)
                _release(ground, zone, drive, work, rho, step * ground.dt)
        meet(gate)
        hot = zone.counts.any_hot != 0 and where != SUM
        meet(gate)
        if hot:
            return SWITCH, step
    return DONE, last - 1


@cached_njit(error_model="numpy")
def store_strain_energies(ground, zone, rows, densities):  # type: ignore[no-untyped-def]
    """Store energy densities, J/m^3, of nodes in these rows and of active coarse nodes in `densities` (1, places).

    Those of coarse nodes are also half of each pair's, with the stencil as springs: the energy that motion conserves.
    """
    follow(zone, zone.u)
    for row in rows:
        store_row_energies(ground, zone.cut, zone.kinds[row], zone.u, densities, row)
    u = zone.u
    for q in zone.coarse:
        energy = 0.0
        for s in range(len(ground.stencil_ways)):
            j = q + ground.stencil_ways[s]
            x, y = u[0, j] - u[0, q], u[1, j] - u[1, q]
            energy += ground.theta[s, 0] * x * x + 2 * ground.theta[s, 1] * x * y + ground.theta[s, 2] * y * y
        densities[0, q] = ground.rho / 4 * energy
