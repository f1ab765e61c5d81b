"""Velocity Verlet for blocks, one sweep a step: as `verlet`, which says what is done.

A block is summed, kicked and drifted on to the next step by one thread, as its neighbours look at the displacements
of this step alone; those of three steps are kept in turn. Kick and drift are two roundings, and never contracted, so
that it does not show where a sequence of steps was taken apart.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, get_thread_id, njit, prange
from numpy.typing import NDArray

from pdsolve.conditions import Drive, apply_loads
from pdsolve.operators.blocks.kernel import FX, FY, INNER, LANE_COUNT, LANES, sum_block
from pdsolve.operators.blocks.layout import aligned
from pdsolve.operators.blocks.operator import InBlocks
from pdsolve.state import State
from pdsolve.steppers.holds import hold_component, release_component


class Course(NamedTuple):
    """What moves the blocks' nodes besides their bonds; m nodes in whole blocks, the last may be idle."""

    force: NDArray[np.floating]  # (2, m) body force now, N/m^3
    before: NDArray[np.floating]  # (2, m) body force one step ago
    rho: NDArray[np.floating]  # (m,) kg/m^3
    loaded: NDArray[np.bool_]  # (blocks,) whether a load acts on the block
    held: NDArray[np.int64]  # (holds,) the held components in the order of their blocks
    held_start: NDArray[np.int64]  # (blocks + 1,) those of a block
    turns: NDArray[np.int64]  # (blocks,) the order in which blocks are shared out to threads


class VerletBlocks:
    """Takes steps with bonds in blocks, whose placed state it changes."""

    def __init__(self, operator: InBlocks, drive: Drive, rho: NDArray[np.floating], dt: float) -> None:
        """`rho` (n,) is the density, kg/m^3, `dt` the step, s."""
        count = len(operator.blocks.softened)
        block = drive.holds.node // LANES
        held, loaded = np.argsort(block, kind="stable"), np.zeros(count, dtype=np.bool_)
        loaded[drive.loads.node // LANES] = True
        self._operator, self._dt = operator, dt
        self._course = Course(
            force=_spread(drive.force, count),
            before=_spread(drive.before, count),
            rho=_spread(rho, count, 1.0),
            loaded=loaded,
            held=held,
            held_start=np.searchsorted(block[held], np.arange(count + 1)),
            turns=_turns(count, get_num_threads()),
        )
        nodes = len(rho)
        self.drive = drive._replace(force=self._course.force[:, :nodes].T, before=self._course.before[:, :nodes].T)

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        drive, operator = self.drive, self._operator
        advance_blocks(
            operator.blocks, operator.tracks, self._course, drive, drive.holds, drive.profiles, self._dt, first, last
        )


def _spread(values: NDArray[Any], count: int, idle: float = 0.0) -> NDArray[Any]:
    """Values of nodes (n, ...) in `count` whole blocks (..., m)."""
    wide = np.full((*values.shape[1:], LANES * count), idle, dtype=values.dtype)
    wide[..., : len(values)] = values.T
    return aligned(wide)


def _turns(count: int, threads: int) -> NDArray[np.int64]:
    """All of `count` blocks in an order whose equal parts, one for each of the threads, are equal work.

    Blocks at an interface between spacings cost more than others, so that a part takes groups from all over.
    """
    group = max(1, count // (16 * threads))
    return np.argsort(np.arange(count) // group % threads, kind="stable").astype(np.int64)


@njit(parallel=True, error_model="numpy", cache=True)
def advance_blocks(blocks, tracks, course, drive, holds, profiles, dt, first, last):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1; `tracks.u[0]` are the displacements before and after.

    `holds` and `profiles` are those of `drive`: a parallel loop knows the tuples among the arguments only.
    """
    u, speed, force, steps = tracks.u, drive.held_speed, drive.held_force, last - first
    for taken in range(steps + 1 if steps > 0 else 0):
        if taken > 0 and drive.varies:
            apply_loads(drive, (first + taken - 1) * dt)
        before, now, after = u[(taken + 2) % 3], u[taken % 3], u[(taken + 1) % 3]
        starts, ends, step = taken == 0, taken == steps, first + taken - 1
        for b in prange(len(course.loaded)):
            turn = course.turns[b]
            _sweep_block(
                blocks, tracks, course, now, before, after, holds, profiles, speed, force, dt, step, starts, ends, turn
            )
    if steps > 0 and steps % 3 != 0:
        _copy(u, steps % 3)


@njit(**INNER)
def _sweep_block(blocks, tracks, course, u, before, after, holds, profiles, speed, force, dt, step, starts, ends, b):  # type: ignore[no-untyped-def]
    """End `step` for block b, unless a sequence starts, and go on to the next one, unless it ends."""
    holds_some, thread = course.held_start[b] < course.held_start[b + 1], get_thread_id()
    s = blocks.scratch[thread]
    if starts:
        _take_acceleration(tracks.a, s, b)
    else:
        sum_block(blocks, tracks.broken, tracks.worst, u, before, tracks.dissipated, step, b, thread, s)
        if course.loaded[b]:
            _load_lanes(course.force, course.before, tracks.v, tracks.work, s, dt, b)
        _accelerate_lanes(course.rho, s, b)
        if ends or holds_some:
            _keep_acceleration(tracks.a, s, b)
        if holds_some:
            _release_block(tracks, course, holds, profiles, speed, force, dt, step * dt, b)
            _take_acceleration(tracks.a, s, b)
        if not (ends or holds_some):
            _kick_and_drift_lanes(tracks.v, u, after, s, dt, b)
            return
        _kick_lanes(tracks.v, s, dt, b)
    if not ends:
        _kick_lanes(tracks.v, s, dt, b)
        _drift_lanes(tracks.v, u, after, dt, b)
        if holds_some:
            _hold_block(tracks, course, after, holds, profiles, speed, dt, (step + 1) * dt, b)


@njit(**INNER)
def _copy(u, last):  # type: ignore[no-untyped-def]
    for axis in range(2):
        for i in range(u.shape[2]):
            u[0, axis, i] = u[last, axis, i]


@njit(**INNER)
def _release_block(tracks, course, holds, profiles, speed, force, dt, time, b):  # type: ignore[no-untyped-def]
    v, a = tracks.v.T, tracks.a.T
    for k in range(course.held_start[b], course.held_start[b + 1]):
        e = course.held[k]
        release_component(v, a, course.rho, tracks.work, holds, profiles, speed, force, e, dt, time)


@njit(**INNER)
def _hold_block(tracks, course, u, holds, profiles, held_speed, dt, time, b):  # type: ignore[no-untyped-def]
    for k in range(course.held_start[b], course.held_start[b + 1]):
        hold_component(u.T, tracks.v.T, tracks.a.T, holds, profiles, held_speed, course.held[k], dt, time)


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
