"""Motion outside the fused sweep: half kicks at both ends of a sequence of steps, and prescribed velocities.

A hold prescribes the velocity until the next step. The sweep has moved its node as if free; the hold undoes that.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import (
    AXIS,
    COARSE_ROWS,
    FAR_ROWS,
    FORCE,
    KIND,
    LAST,
    PROFILE,
    ROWS,
    SPEED,
    VALUE,
    WORK,
)
from pdsolve.adaptivity.hybrid.damping import tally
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import DISPLACEMENT, VELOCITY, factor_at
from pdsolve.operators.simd_lattice.kernel import INNER


@njit(**INNER)
def _kick_and_drift(nodes, count, now, dt, drifts):  # type: ignore[no-untyped-def]
    """Half a kick, m/s, of all rows by the stored forces, and a drift over `dt`, s, if `drifts`."""
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
def _tally_rows(nodes, count, dt, s, starts):  # type: ignore[no-untyped-def]
    """Book what damping takes in the half of a step with which a sequence `starts`, or else ends; `s` is scratch."""
    for n in range(count):
        p = nodes.rows[n] * ROW
        for k in range(ROW):
            s[k], s[ROW + k] = nodes.f[0, p + k], nodes.f[1, p + k]
        tally(nodes, p, ROW, dt, s, not starts, starts)


@njit(**INNER)
def drift(ground, zone, now, drifts):  # type: ignore[no-untyped-def]
    """Half a kick of all nodes and a drift if `drifts`."""
    for nodes, count in ((zone.fine, ROWS), (zone.coarse, COARSE_ROWS), (zone.far, FAR_ROWS)):
        _tally_rows(nodes, zone.number[count], ground.dt, zone.s[0], drifts)
        _kick_and_drift(nodes, zone.number[count], now, ground.dt, drifts)


@njit(**INNER)
def begin_holds(fine, coarse, holds, count):  # type: ignore[no-untyped-def]
    """Store forces and velocities of held components."""
    for n in range(count):
        on, e = holds.on[n, 0], holds.on[n, 1]
        axis = holds.what[e, AXIS]
        if on >= 0:
            holds.value[e, FORCE], holds.value[e, LAST] = fine.f[axis, on], fine.v[axis, on]
        else:
            holds.value[e, FORCE], holds.value[e, LAST] = coarse.f[axis, -1 - on], coarse.v[axis, -1 - on]


@njit(**INNER)
def end_holds(fine, coarse, holds, count):  # type: ignore[no-untyped-def]
    """Give held components their prescribed velocities."""
    for n in range(count):
        on, e = holds.on[n, 0], holds.on[n, 1]
        if on >= 0:
            fine.v[holds.what[e, AXIS], on] = holds.value[e, LAST]
        else:
            coarse.v[holds.what[e, AXIS], -1 - on] = holds.value[e, LAST]


@njit(**INNER)
def hold(fine, coarse, holds, count, total, dt, profiles, now, step, ends, starts):  # type: ignore[no-untyped-def]
    """Book the holding forces until `step` unless a sequence `starts`, and hold on from there unless it `ends`."""
    for n in range(count):
        on = holds.on[n, 0]
        if on >= 0:
            _hold(fine.u, fine.v, fine.f, fine.mass, on, holds, n, total, dt, profiles, now, step, ends, starts)
        else:
            p = -1 - on
            _hold(coarse.u, coarse.v, coarse.f, coarse.mass, p, holds, n, total, dt, profiles, now, step, ends, starts)


@njit(**INNER)
def _hold(u, v, f, mass, p, holds, n, total, dt, profiles, now, step, ends, starts):  # type: ignore[no-untyped-def]
    """Book the force on one held component n until `step`, and hold it from there; see `hold`."""
    e, time = holds.on[n, 1], step * dt
    axis, profile, kind = holds.what[e, AXIS], holds.what[e, PROFILE], holds.what[e, KIND]
    value, mean, speed = holds.value[e, VALUE], holds.value[e, SPEED], holds.value[e, SPEED]
    if kind == VELOCITY:
        speed = value * factor_at(profiles, profile, time)
    if not starts:
        total[WORK] -= (holds.value[e, FORCE] + f[axis, p]) / 2 * dt * mean
        total[WORK] += mass[p] / 2 * (speed**2 - holds.value[e, LAST] ** 2)
        holds.value[e, FORCE], holds.value[e, LAST] = f[axis, p], speed
    if ends:
        return
    if kind == DISPLACEMENT:
        speed = (value * factor_at(profiles, profile, time + dt) - u[now, axis, p]) / dt
    else:
        speed = value * factor_at(profiles, profile, time + dt / 2)
    v[axis, p] = holds.value[e, SPEED] = speed
    u[1 - now, axis, p] = u[now, axis, p] + dt * speed
