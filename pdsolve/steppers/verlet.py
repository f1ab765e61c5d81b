"""Velocity Verlet: thesis, eq. 15 to 17. Explicit, second order, the time loop inside compiled code.

Within a step from n to n + 1, `motion.v` is the mean velocity v_(n+1/2) from the drift to the kick. The work of
loads and holds is booked with the trapezoidal rule that Verlet itself follows, so that the balance of energy is
that of the scheme: kinetic energy changes by (F_n + F_(n+1)) / 2 . (u_(n+1) - u_n), and no more.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.conditions import ACCELERATION, DISPLACEMENT, VELOCITY, apply_loads, factor_at
from pdsolve.kernels.bond_sums import force_on


@njit(cache=True)
def advance(bonds, motion, drive, rho, dt, first, last):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1, of size `dt` (s), in place; `rho` (n,) is the density, kg/m^3."""
    for step in range(first, last):
        _drift(motion, dt)
        _hold(motion, drive, dt, step * dt)
        if drive.varies:
            apply_loads(drive, step * dt)
        _accelerate(bonds, motion, drive.force, drive.before, rho, dt, step)
        _release(motion, drive, rho, dt, step * dt)
        _kick(motion, dt)


# A parallel loop only calls a function of its row, and no function holds two such loops: numba drops updates in
# place of a tuple's arrays and merges sweeps that must follow each other, without a word.


@njit(parallel=True, cache=True)
def _drift(motion, dt):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _drift_node(motion, dt, i)


@njit
def _drift_node(motion, dt, i):  # type: ignore[no-untyped-def]
    for axis in range(2):
        motion.v[i, axis] += dt / 2 * motion.a[i, axis]
        motion.u[i, axis] += dt * motion.v[i, axis]


@njit(parallel=True, cache=True)
def _accelerate(bonds, motion, load, before, rho, dt, step):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _accelerate_node(bonds, motion, load, before, rho, dt, step, i)


@njit
def _accelerate_node(bonds, motion, load, before, rho, dt, step, i):  # type: ignore[no-untyped-def]
    force_x, force_y = force_on(bonds, motion, i, step, dt)
    motion.a[i, 0] = (force_x + load[i, 0]) / rho[i]
    motion.a[i, 1] = (force_y + load[i, 1]) / rho[i]
    for axis in range(2):
        motion.work[i] += (before[i, axis] + load[i, axis]) / 2 * (dt * motion.v[i, axis])


@njit(parallel=True, cache=True)
def _kick(motion, dt):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _kick_node(motion, dt, i)


@njit
def _kick_node(motion, dt, i):  # type: ignore[no-untyped-def]
    for axis in range(2):
        motion.v[i, axis] += dt / 2 * motion.a[i, axis]


@njit(cache=True)
def _hold(motion, drive, dt, time):  # type: ignore[no-untyped-def]
    """Put the held components where they are to be at `time`, s."""
    holds = drive.holds
    for e in range(len(holds.node)):
        i, axis = holds.node[e], holds.axis[e]
        drive.held_speed[e] = motion.v[i, axis] - dt / 2 * motion.a[i, axis]
        before = motion.u[i, axis] - dt * motion.v[i, axis]
        if holds.kind[e] == DISPLACEMENT:
            motion.u[i, axis] = holds.value[e] * factor_at(drive.profiles, holds.profile[e], time)
            motion.v[i, axis] = (motion.u[i, axis] - before) / dt
        elif holds.kind[e] == VELOCITY:
            motion.v[i, axis] = holds.value[e] * factor_at(drive.profiles, holds.profile[e], time - dt / 2)
            motion.u[i, axis] = before + dt * motion.v[i, axis]


@njit(cache=True)
def _release(motion, drive, rho, dt, time):  # type: ignore[no-untyped-def]
    """Give the held components the acceleration they are to have, and book what holding them took.

    The hold must supply the change of kinetic energy and stand against the mean force on the component.
    """
    holds = drive.holds
    for e in range(len(holds.node)):
        i, axis = holds.node[e], holds.axis[e]
        force, way = rho[i] * motion.a[i, axis], dt * motion.v[i, axis]
        motion.a[i, axis] = 0
        value = holds.value[e] * factor_at(drive.profiles, holds.profile[e], time)
        if holds.kind[e] == ACCELERATION:
            motion.a[i, axis] = value
        elif holds.kind[e] == VELOCITY:
            motion.v[i, axis] = value
        speed = motion.v[i, axis] + dt / 2 * motion.a[i, axis]
        motion.work[i] += rho[i] / 2 * (speed * speed - drive.held_speed[e] * drive.held_speed[e])
        motion.work[i] -= (drive.held_force[e] + force) / 2 * way
        drive.held_force[e] = force


def stability_bound(bonds: Bonds, rho: NDArray[np.floating]) -> float:
    """Largest step that is surely stable, s: sqrt(2 rho_i / sum_j stiffness / |xi|) of the worst row.

    S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535, for the bonds as they are; `rho` (n,), kg/m^3.
    Infinite without bonds. The true limit is 1.5 to 1.7 times as large on square lattices.
    """
    per_bond = bonds.stiffness / np.hypot(bonds.xi[:, 0], bonds.xi[:, 1])
    row = np.repeat(np.arange(len(rho)), np.diff(bonds.start))
    stiffest = float((np.bincount(row, per_bond, minlength=len(rho)) / rho).max(initial=0.0))
    return float(np.sqrt(2 / stiffest)) if stiffest > 0 else float("inf")
