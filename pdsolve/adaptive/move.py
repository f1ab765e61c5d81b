"""What moves nodes besides the fused sweep: half kicks where a sequence of steps begins and ends, and holds.

A hold prescribes the velocity until the next step; the sweep has moved its node as if it were free, which is undone.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptive.arrays import COARSE_ROWS, HOLDS, ROWS, WORK
from pdsolve.conditions import DISPLACEMENT, VELOCITY, factor_at
from pdsolve.operators.blocks.kernel import INNER
from pdsolve.operators.blocks.lanes import ROW


@njit(**INNER)
def _kick_and_drift(nodes, count, now, dt, drifts):  # type: ignore[no-untyped-def]
    """Half a kick by the forces that are kept, of all rows; and a drift, if wanted."""
    u, after, v, f = nodes.u[now], nodes.u[1 - now], nodes.v, nodes.f
    for n in range(count):
        row = nodes.rows[n]
        for axis in range(2):
            for p in range(row * ROW, row * ROW + ROW):
                kick = dt / 2 * (f[axis, p] * nodes.light[p])
                v[axis, p] += kick
                if drifts:
                    after[axis, p] = u[axis, p] + dt * v[axis, p]


@njit(**INNER)
def drift(ground, zone, now, drifts):  # type: ignore[no-untyped-def]
    """The same for all nodes."""
    _kick_and_drift(zone.fine, zone.number[ROWS], now, ground.dt, drifts)
    _kick_and_drift(zone.coarse, zone.number[COARSE_ROWS], now, ground.dt, drifts)


@njit(**INNER)
def begin_holds(zone):  # type: ignore[no-untyped-def]
    """Note forces and velocities of what is held."""
    for n in range(zone.number[HOLDS]):
        e, on = zone.holds.which[n], zone.holds.on[n]
        nodes, p = (zone.fine, on) if on >= 0 else (zone.coarse, -1 - on)
        zone.holds.force[e], zone.holds.last[e] = nodes.f[zone.holds.axis[e], p], nodes.v[zone.holds.axis[e], p]


@njit(**INNER)
def end_holds(zone):  # type: ignore[no-untyped-def]
    """Give what is held the velocities it has."""
    for n in range(zone.number[HOLDS]):
        e, on = zone.holds.which[n], zone.holds.on[n]
        nodes, p = (zone.fine, on) if on >= 0 else (zone.coarse, -1 - on)
        nodes.v[zone.holds.axis[e], p] = zone.holds.last[e]


@njit(**INNER)
def hold(ground, zone, profiles, now, step, ends, starts):  # type: ignore[no-untyped-def]
    """Book what it took to hold until `step`, unless a sequence `starts`, and hold on from there, unless it `ends`."""
    holds, dt, time = zone.holds, ground.dt, step * ground.dt
    for n in range(zone.number[HOLDS]):
        e, on = holds.which[n], holds.on[n]
        nodes, p = (zone.fine, on) if on >= 0 else (zone.coarse, -1 - on)
        axis = holds.axis[e]
        kind, value, profile = holds.kind[e], holds.value[e], holds.profile[e]
        u, after, v = nodes.u[now], nodes.u[1 - now], nodes.v
        mean, force = holds.speed[e], nodes.f[axis, p]
        now_speed = value * factor_at(profiles, profile, time) if kind == VELOCITY else mean
        if not starts:
            zone.total[WORK] -= (holds.force[e] + force) / 2 * dt * mean
            zone.total[WORK] += nodes.mass[p] / 2 * (now_speed**2 - holds.last[e] ** 2)
            holds.force[e], holds.last[e] = force, now_speed
        if ends:
            v[axis, p] = now_speed
            continue
        speed = value * factor_at(profiles, profile, time + dt / 2)
        if kind == DISPLACEMENT:
            speed = (value * factor_at(profiles, profile, time + dt) - u[axis, p]) / dt
        v[axis, p] = holds.speed[e] = speed
        after[axis, p] = u[axis, p] + dt * speed
