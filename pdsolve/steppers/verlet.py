"""Velocity Verlet: thesis, eq. 15 to 17. Explicit, second order.

Within a step from n to n + 1, `state.rate` is the mean velocity v_(n+1/2) from the drift to the kick. The work of loads
and holds is booked by the trapezoidal rule that Verlet itself follows, so that the energy balance is that of the
scheme: kinetic energy changes by (F_n + F_(n+1)) / 2 . (u_(n+1) - u_n), and no more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.conditions import (
    Drive,
    accelerate_held_component_and_book_work,
    apply_loads,
    constrained_components,
    damp_component_and_return_energy,
    prescribe_held_u_and_v,
)
from pdsolve.operators.ghosts import Ghosts
from pdsolve.operators.protocol import Forces
from pdsolve.state import State
from pdsolve.stepper import Stepper


class Verlet(Stepper):
    """Velocity Verlet with any operator."""

    integrator = "Verlet"

    def __init__(
        self,
        operator: Forces,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64] | None = None,
        ghosts: Ghosts | None = None,
        *,
        active_rows: Callable[[], NDArray[np.int64] | None] = lambda: None,
    ) -> None:
        """`rho` (n,) is the density, kg/m^3, `dt` the step, s, `damping` (n,) the damping of free components, 1/s.

        Damping is the force against motion over mass and velocity. `ghosts` get their motion from other ranks.
        `active_rows` lists the rows of nodes that move, the others being idle; None: all move. While forces are summed,
        more rows may become active, with a motion of their own, but none idle.
        """
        self._operator, self._drive, self._rho, self._dt = operator, drive, rho, dt
        self._ghosts, self._active_rows = ghosts, active_rows
        self._damping = damping if damping is not None and damping.any() else None
        self._held = constrained_components(drive) if self._damping is not None else None

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last one."""
        drive, dt = self._drive, self._dt
        # forces take the place of the accelerations that they become, where those are as precise and damping does not
        # ask for what they were
        in_place = self._damping is None and state.second.dtype == np.float64
        out = state.second if in_place else np.zeros(state.value.shape)
        previous_velocity = None if self._damping is None else np.zeros_like(state.rate)
        for step in range(first_step, end_step):
            rows = self._active_rows()
            _kick_drift_and_apply_conditions(state, drive, rows, dt, step * dt)
            if self._ghosts is not None:
                self._ghosts.receive_values(state.value.T)
                self._ghosts.receive_values(state.rate.T)  # with which some operators know where nodes were a step ago
            _set_rows_to_zero(out, rows)
            self._operator.accumulate_force(state, out, step, dt)
            rows = self._active_rows()
            _accelerate_kick_and_add_work(state, drive, out, self._rho, rows, previous_velocity, dt, step * dt)
            if previous_velocity is not None:
                _damp_velocity_and_add_energy(state, previous_velocity, self._rho, self._held, self._damping, rows, dt)
        return end_step - 1


@overloaded({"error_model": "numpy"})  # not INNER, whose functions return no arrays
def _rows_or_all(rows, count):  # type: ignore[no-untyped-def]
    """The `rows`, or without any, None, so many from 0 on."""
    return (lambda rows, count: range(count)) if is_none(rows) else lambda rows, count: rows


@cached_njit(error_model="numpy")
def _set_rows_to_zero(array, rows):  # type: ignore[no-untyped-def]
    """Set these rows of an array (n, w) to 0."""
    for i in _rows_or_all(rows, len(array)):
        for axis in range(array.shape[1]):
            array[i, axis] = 0


@cached_njit(error_model="numpy")
def _kick_drift_and_apply_conditions(state, drive, rows, dt, time):  # type: ignore[no-untyped-def]
    """Half a kick and the drift to the displacements at `time`, s."""
    u, v, a = state.value, state.rate, state.second
    for i in _rows_or_all(rows, len(u)):
        for axis in range(u.shape[1]):
            v[i, axis] += dt / 2 * a[i, axis]
            u[i, axis] += dt * v[i, axis]
    for e in range(len(drive.holds.node)):
        prescribe_held_u_and_v(u, v, a, drive.holds, drive.profiles, drive.held_speed, e, dt, time)
    if drive.varies:
        apply_loads(drive, time)


@cached_njit(error_model="numpy")
def _accelerate_kick_and_add_work(state, drive, force_density, rho, rows, previous_velocity, dt, time):  # type: ignore[no-untyped-def]
    """From `force_density` (n, w), N/m^3, to accelerations, and the second half of the kick.

    `previous_velocity` (n, w) takes the velocities one step ago; None: nobody asks for them.
    """
    v, a, work, load, before = state.rate, state.second, state.work, drive.force, drive.before
    half = a.dtype.type(dt / 2)
    for i in _rows_or_all(rows, len(a)):
        if previous_velocity is not None:
            for axis in range(a.shape[1]):
                previous_velocity[i, axis] = v[i, axis] - half * a[i, axis]
        for axis in range(a.shape[1]):
            a[i, axis] = (force_density[i, axis] + load[i, axis]) / rho[i]
        for axis in range(a.shape[1]):
            work[i] += (before[i, axis] + load[i, axis]) / 2 * (dt * v[i, axis])
    for e in range(len(drive.holds.node)):
        speed, force = drive.held_speed, drive.held_force
        accelerate_held_component_and_book_work(v, a, rho, work, drive.holds, drive.profiles, speed, force, e, dt, time)
    for i in _rows_or_all(rows, len(a)):
        for axis in range(a.shape[1]):
            v[i, axis] += dt / 2 * a[i, axis]


@cached_njit(error_model="numpy")
def _damp_velocity_and_add_energy(state, previous_velocity, rho, constrained, damping, rows, dt):  # type: ignore[no-untyped-def]
    """Damp the end of a step with c (n,), 1/s, as its beginning, and book the energy taken.

    `previous_velocity` (n, w) are the velocities one step ago.
    """
    v, a = state.rate, state.second
    for i in _rows_or_all(rows, len(v)):
        for axis in range(v.shape[1]):
            if damping[i] > 0 and not constrained[i, axis]:
                state.damped[i] += damp_component_and_return_energy(
                    v, a, previous_velocity, rho, damping[i], i, axis, dt
                )
