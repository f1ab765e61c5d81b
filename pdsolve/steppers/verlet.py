"""Velocity Verlet: thesis, eq. 15 to 17. Explicit, second order, the time loop inside compiled code.

Within a step from n to n + 1, `motion.v` is the mean velocity v_(n+1/2) from the drift to the kick. The work of
loads and holds is booked with the trapezoidal rule that Verlet itself follows, so that the balance of energy is
that of the scheme: kinetic energy changes by (F_n + F_(n+1)) / 2 . (u_(n+1) - u_n), and no more.
"""

from __future__ import annotations

import numpy as np
from numba import get_thread_id, njit, prange
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.conditions import ACCELERATION, DISPLACEMENT, VELOCITY, apply_loads, factor_at
from pdsolve.kernels.blocks import FX, FY, INNER, LANE_COUNT, sum_block
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
    for e in range(len(drive.holds.node)):
        _hold_component(motion.u, motion.v, motion.a, drive.holds, drive.profiles, drive.held_speed, e, dt, time)


@njit
def _hold_component(u, v, a, holds, profiles, held_speed, e, dt, time):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def _release(motion, drive, rho, dt, time):  # type: ignore[no-untyped-def]
    for e in range(len(drive.holds.node)):
        speed, force = drive.held_speed, drive.held_force
        _release_component(motion.v, motion.a, rho, motion.work, drive.holds, drive.profiles, speed, force, e, dt, time)


@njit
def _release_component(v, a, rho, work, holds, profiles, held_speed, held_force, e, dt, time):  # type: ignore[no-untyped-def]
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


# The same for blocks, one sweep a step: a block is summed, kicked and drifted on to the next step by one thread, as its
# neighbours look at the displacements of this step alone; those of three steps are kept in turn. Kick and drift are
# two roundings, and never contracted, so that it does not show where a sequence of steps was taken apart.


@njit(parallel=True, error_model="numpy", cache=True)
def advance_blocks(blocks, tracks, drive, holds, profiles, dt, first, last):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1; `tracks.u[0]` are the displacements before and after.

    `holds` and `profiles` are those of `drive`: a parallel loop knows the tuples among the arguments only.
    """
    u, speed, force, steps = tracks.u, drive.held_speed, drive.held_force, last - first
    for taken in range(steps + 1 if steps > 0 else 0):
        if taken > 0 and drive.varies:
            apply_loads(drive, (first + taken - 1) * dt)
        before, now, after = u[(taken + 2) % 3], u[taken % 3], u[(taken + 1) % 3]
        starts, ends, step = taken == 0, taken == steps, first + taken - 1
        for b in prange(len(tracks.loaded)):
            turn = tracks.turns[b]
            _sweep_block(
                blocks, tracks, now, before, after, holds, profiles, speed, force, dt, step, starts, ends, turn
            )
    if steps > 0 and steps % 3 != 0:
        _copy(u, steps % 3)


@njit(**INNER)
def _sweep_block(blocks, tracks, u, before, after, holds, profiles, speed, force, dt, step, starts, ends, b):  # type: ignore[no-untyped-def]
    """End `step` for block b, unless a sequence starts, and go on to the next one, unless it ends."""
    holds_some, thread = tracks.held_start[b] < tracks.held_start[b + 1], get_thread_id()
    s = blocks.scratch[thread]
    if starts:
        _take_acceleration(tracks.a, s, b)
    else:
        sum_block(blocks, tracks.broken, tracks.worst, u, before, tracks.dissipated, step, b, thread, s)
        if tracks.loaded[b]:
            _load_lanes(tracks.force, tracks.before, tracks.v, tracks.work, s, dt, b)
        _accelerate_lanes(tracks.rho, s, b)
        if ends or holds_some:
            _keep_acceleration(tracks.a, s, b)
        if holds_some:
            _release_block(tracks, holds, profiles, speed, force, dt, step * dt, b)
            _take_acceleration(tracks.a, s, b)
        if not (ends or holds_some):
            _kick_and_drift_lanes(tracks.v, u, after, s, dt, b)
            return
        _kick_lanes(tracks.v, s, dt, b)
    if not ends:
        _kick_lanes(tracks.v, s, dt, b)
        _drift_lanes(tracks.v, u, after, dt, b)
        if holds_some:
            _hold_block(tracks, after, holds, profiles, speed, dt, (step + 1) * dt, b)


@njit(**INNER)
def _copy(u, last):  # type: ignore[no-untyped-def]
    for axis in range(2):
        for i in range(u.shape[2]):
            u[0, axis, i] = u[last, axis, i]


@njit(**INNER)
def _release_block(tracks, holds, profiles, speed, force, dt, time, b):  # type: ignore[no-untyped-def]
    v, a = tracks.v.T, tracks.a.T
    for k in range(tracks.held_start[b], tracks.held_start[b + 1]):
        e = tracks.held[k]
        _release_component(v, a, tracks.rho, tracks.work, holds, profiles, speed, force, e, dt, time)


@njit(**INNER)
def _hold_block(tracks, u, holds, profiles, held_speed, dt, time, b):  # type: ignore[no-untyped-def]
    for k in range(tracks.held_start[b], tracks.held_start[b + 1]):
        _hold_component(u.T, tracks.v.T, tracks.a.T, holds, profiles, held_speed, tracks.held[k], dt, time)


@njit(**INNER)
def _load_lanes(force, before, v, work, s, dt, b):  # type: ignore[no-untyped-def]
    """Add the loads to the forces of block b, and the work they do."""
    first = np.uint64(b) * LANE_COUNT
    for lane in range(LANE_COUNT):
        i = first + lane
        s[FX + lane] += force[0, i]
        s[FY + lane] += force[1, i]
        work[i] += (before[0, i] + force[0, i]) / 2 * (dt * v[0, i])
        work[i] += (before[1, i] + force[1, i]) / 2 * (dt * v[1, i])


@njit(**INNER)
def _accelerate_lanes(rho, s, b):  # type: ignore[no-untyped-def]
    """From force densities to accelerations, which then are in FX and FY."""
    first = np.uint64(b) * LANE_COUNT
    for lane in range(LANE_COUNT):
        s[FX + lane] /= rho[first + lane]
        s[FY + lane] /= rho[first + lane]


@njit(**INNER)
def _keep_acceleration(a, s, b):  # type: ignore[no-untyped-def]
    first = np.uint64(b) * LANE_COUNT
    for lane in range(LANE_COUNT):
        a[0, first + lane] = s[FX + lane]
        a[1, first + lane] = s[FY + lane]


@njit(**INNER)
def _take_acceleration(a, s, b):  # type: ignore[no-untyped-def]
    first = np.uint64(b) * LANE_COUNT
    for lane in range(LANE_COUNT):
        s[FX + lane] = a[0, first + lane]
        s[FY + lane] = a[1, first + lane]


@njit(**INNER)
def _kick_lanes(v, s, dt, b):  # type: ignore[no-untyped-def]
    first, half = np.uint64(b) * LANE_COUNT, s.dtype.type(dt / 2)
    for lane in range(LANE_COUNT):
        v[0, first + lane] += half * s[FX + lane]
        v[1, first + lane] += half * s[FY + lane]


@njit(**INNER)
def _drift_lanes(v, u, after, dt, b):  # type: ignore[no-untyped-def]
    first, whole = np.uint64(b) * LANE_COUNT, v.dtype.type(dt)
    for lane in range(LANE_COUNT):
        after[0, first + lane] = u[0, first + lane] + whole * v[0, first + lane]
        after[1, first + lane] = u[1, first + lane] + whole * v[1, first + lane]


@njit(**INNER)
def _kick_and_drift_lanes(v, u, after, s, dt, b):  # type: ignore[no-untyped-def]
    """The last half of a step and the first of the next: to the same bits as one by one, in one sweep."""
    first, half, whole = np.uint64(b) * LANE_COUNT, s.dtype.type(dt / 2), s.dtype.type(dt)
    for axis, row in ((0, FX), (1, FY)):
        for lane in range(LANE_COUNT):
            kick = half * s[row + lane]
            speed = v[axis, first + lane] + kick + kick
            v[axis, first + lane] = speed
            after[axis, first + lane] = u[axis, first + lane] + whole * speed


def stability_bound(bonds: Bonds, rho: NDArray[np.floating], symmetric: bool) -> float:
    """Largest step that is surely stable, s, of the worst row; `rho` (n,), kg/m^3. Infinite without bonds.

    With k = stiffness / |xi| and n = xi / |xi| of the bonds as they are: sqrt(2 rho / sum k) after S. A. Silling,
    E. Askari, Comput. Struct. 83 (2005) 1526-1535, for any bonds. For `symmetric` ones sqrt(2 rho / the larger
    eigenvalue of sum k n n^T): (n . (u_i - u_j))^2 <= 2 (n . u_i)^2 + 2 (n . u_j)^2 in their energy. That is the
    square root of 2 times as long inside a square lattice, less at corrected edges, which are stiffer along
    themselves. True limits of plates are 1.15 to 1.27 times that, and 1.66 times the bound for any bonds.
    """
    length = np.hypot(bonds.xi[:, 0], bonds.xi[:, 1])
    k, (x, y) = bonds.stiffness / length, (bonds.xi / length[:, None]).T
    row = np.repeat(np.arange(len(rho)), np.diff(bonds.start))

    def total(terms: NDArray[np.floating]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(row, terms, minlength=len(rho)))

    if symmetric:
        xx, xy, yy = total(k * x * x), total(k * x * y), total(k * y * y)
        stiffness = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    else:
        stiffness = total(k)
    stiffest = float((stiffness / rho).max(initial=0.0))
    return float(np.sqrt(2 / stiffest)) if stiffest > 0 else float("inf")
