"""Components of the motion that are held, one at a time: what Verlet does to them before and after the forces."""

from __future__ import annotations

from numba import njit

from pdsolve.conditions import ACCELERATION, DISPLACEMENT, VELOCITY, factor_at


@njit
def hold_component(u, v, a, holds, profiles, held_speed, e, dt, time):  # type: ignore[no-untyped-def]
    """Put the held component e where it is to be at `time`, s; u, v, a are (n, 2)."""
    i, axis = holds.node[e], holds.axis[e]
    held_speed[e] = v[i, axis] - dt / 2 * a[i, axis]
    before = u[i, axis] - dt * v[i, axis]
    if holds.kind[e] == DISPLACEMENT:
        u[i, axis] = holds.value[e] * factor_at(profiles, holds.profile[e], time)
        v[i, axis] = (u[i, axis] - before) / dt
    elif holds.kind[e] == VELOCITY:
        v[i, axis] = holds.value[e] * factor_at(profiles, holds.profile[e], time - dt / 2)
        u[i, axis] = before + dt * v[i, axis]


@njit
def release_component(v, a, rho, work, holds, profiles, held_speed, held_force, e, dt, time):  # type: ignore[no-untyped-def]
    """Give the held component e the acceleration it is to have, and book what holding it took.

    The hold must supply the change of kinetic energy and stand against the mean force on the component.
    """
    i, axis = holds.node[e], holds.axis[e]
    force, way = rho[i] * a[i, axis], dt * v[i, axis]
    a[i, axis] = 0
    value = holds.value[e] * factor_at(profiles, holds.profile[e], time)
    if holds.kind[e] == ACCELERATION:
        a[i, axis] = value
    elif holds.kind[e] == VELOCITY:
        v[i, axis] = value
    speed = v[i, axis] + dt / 2 * a[i, axis]
    work[i] += rho[i] / 2 * (speed * speed - held_speed[e] * held_speed[e])
    work[i] -= (held_force[e] + force) / 2 * way
    held_force[e] = force
