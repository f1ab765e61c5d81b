"""Prescribed and damped components of the motion, one at a time: Verlet's treatment before and after the forces."""

from __future__ import annotations

from numba import njit

from pdsolve.conditions import ACCELERATION, DISPLACEMENT, VELOCITY, factor_at


@njit
def prescribe_held_u_and_v(u, v, a, holds, profiles, held_speed, entry, dt, time):  # type: ignore[no-untyped-def]
    """Set the held component e to its prescribed value at `time`, s; u, v, a are (n, 2)."""
    i, axis = holds.node[entry], holds.axis[entry]
    held_speed[entry] = v[i, axis] - dt / 2 * a[i, axis]
    before = u[i, axis] - dt * v[i, axis]
    if holds.kind[entry] == DISPLACEMENT:
        u[i, axis] = holds.value[entry] * factor_at(profiles, holds.profile[entry], time)
        v[i, axis] = (u[i, axis] - before) / dt
    elif holds.kind[entry] == VELOCITY:
        v[i, axis] = holds.value[entry] * factor_at(profiles, holds.profile[entry], time - dt / 2)
        u[i, axis] = before + dt * v[i, axis]


@njit
def accelerate_held_component_and_book_work(v, a, rho, work, holds, profiles, held_speed, held_force, entry, dt, time):  # type: ignore[no-untyped-def]
    """Set the acceleration of the held component e, and book the work of holding it.

    The hold provides the change of kinetic energy and balances the mean force on the component.
    """
    i, axis = holds.node[entry], holds.axis[entry]
    force, way = rho[i] * a[i, axis], dt * v[i, axis]
    a[i, axis] = 0
    value = holds.value[entry] * factor_at(profiles, holds.profile[entry], time)
    if holds.kind[entry] == ACCELERATION:
        a[i, axis] = value
    elif holds.kind[entry] == VELOCITY:
        v[i, axis] = value
    speed = v[i, axis] + dt / 2 * a[i, axis]
    work[i] += rho[i] / 2 * (speed * speed - held_speed[entry] * held_speed[entry])
    work[i] -= (held_force[entry] + force) / 2 * way
    held_force[entry] = force


@njit
def damp_component_and_return_energy(v, a, previous_v, rho, damping, node, axis, dt):  # type: ignore[no-untyped-def]
    """Damp a component at the end of a step with c, 1/s, as at its beginning; the energy taken, J/m^3.

    v, a and `previous_v`, the velocities one step ago, are (n, d). The energy that Verlet takes out of the motion is
    the mean force of both ends times the displacement between them.
    """
    undamped = a[node, axis]
    middle = v[node, axis] - dt / 2 * undamped
    v[node, axis] /= 1 + damping * dt / 2
    a[node, axis] = undamped - damping * v[node, axis]
    return rho[node] * damping * (previous_v[node, axis] + v[node, axis]) / 2 * (dt * middle)
