"""Velocity Verlet for bonds in tiles, in one sweep a step; the scheme and each bit are Verlet's, in double precision.

The forces of some lanes stay in registers until their nodes have moved, as their neighbours read only the displacements
and the velocities of this step: those of two steps are kept alternately. A sequence of s steps has s + 1 sweeps: the
first one begins a step, the last one ends one, and each other one ends a step and begins the next.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive, apply_loads, constrained_components
from pdsolve.lattice.bond import IN_PLACE, advanced, divided, zeros
from pdsolve.lattice.sums import (
    EMPTY,
    UNAGED,
    UNDONE,
    Breaks,
    Motion,
    copy_breaks,
    has_room,
    join_breaks,
    pull_again,
    room_for,
    select_breaks,
    sum_lanes,
)
from pdsolve.numerics.thread_team import gate_of, meet, side_by_side
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.space_lattice.operator import SpaceLattice
from pdsolve.state import State
from pdsolve.steppers.holds import (
    accelerate_held_component_and_book_work,
    damp_component_and_return_energy,
    prescribe_held_u_and_v,
)

READY, NO_ROOM, NO_MEMORY = range(3)  # what a tile waits for
BETWEEN_LOOKS = 16  # sweeps in which nobody else can ask which bonds are broken
ROOM = 16  # tiles of a thread all of whose bonds may break before it stops for more room


class TileMotion(NamedTuple):
    """The motion of m sites in t tiles, along d axes; what acts on them besides bonds."""

    u_buffers: tuple[NDArray[np.floating], NDArray[np.floating]]  # (d, m) displacements, m, of even and of odd sweeps
    v_buffers: tuple[NDArray[np.floating], NDArray[np.floating]]  # (d, m) velocities, m/s, likewise
    next_v_has_failure_forces: NDArray[np.bool_]  # (t,) whether its next velocities are forces of failing bonds yet
    rho: NDArray[np.floating]  # (m,) kg/m^3, 1 without a node
    damping: NDArray[np.float64]  # (n,) of nodes, 1/s
    constrained: NDArray[np.bool_]  # (n, d) whether a component is prescribed
    has_only_bond_forces: NDArray[np.bool_]  # (t,) whether neither a load nor a hold nor damping acts on the tile
    held_entries_by_tile: NDArray[np.int64]  # (holds,) prescribed components in the order of their tiles
    first_held_entry_of_tile: NDArray[np.int64]  # (t + 1,) those of a tile
    waiting_reason: NDArray[np.uint8]  # (t,) READY, or what a tile waits for
    stalled_sweep: NDArray[np.int64]  # (1,) the sweep in which tiles wait, or -1


class TileBuffers(NamedTuple):
    """A tile's motion while it is advanced, along d axes."""

    force: NDArray[np.floating]  # (d, 16) force densities, N/m^3
    a: NDArray[np.floating]  # (d, 16) accelerations, m/s^2
    previous_v: NDArray[np.floating]  # (d, 16) velocities one step ago, m/s
    work: NDArray[np.float64]  # (16,) see `State`


class SweepRange(NamedTuple):
    """Sweeps of a sequence of steps."""

    first_step: int  # step
    end_step: int  # step after the last one
    first_sweep: int  # sweep
    end_sweep: int  # sweep after the last one
    only_waiting_tiles: bool  # only tiles that wait are swept


class SweepArguments(NamedTuple):
    """One sweep."""

    motion: Motion  # at its beginning
    state: State
    breaks_of_thread: Breaks
    next_buffer: int  # which of `TileMotion.u_buffers` and `TileMotion.v_buffers` the motion goes to
    is_first_sweep: bool  # it ends no step
    is_last_sweep: bool  # it begins no step


class VerletTiles:
    """Takes steps of bonds in tiles."""

    def __init__(
        self,
        operator: SpaceLattice,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64],
    ) -> None:
        """`rho` (n,) is the density, kg/m^3, `dt` the step, s, `damping` (n,) the damping of free components, 1/s."""
        sites, kind, count = operator.sites, rho.dtype, operator.sites.tiles
        axes, size = len(operator.tiles.axes), operator.sites.size
        tile, lane = np.divmod(sites.site[drive.holds.node].astype(np.int64) - sites.margin, ROW)
        spread_rho = np.ones(size, dtype=kind)
        spread_rho[sites.site] = rho
        plain = np.ones(count, dtype=np.bool_)
        plain[tile] = False
        for nodes in (drive.loads.node, np.flatnonzero(damping)):
            plain[(sites.site[nodes] - sites.margin) // ROW] = False

        def zeros_like_u() -> NDArray[np.floating]:
            return aligned(np.zeros((axes, size), dtype=kind))

        self._operator, self._dt = operator, dt
        self._of_lanes = drive._replace(holds=drive.holds._replace(node=lane))
        self._breaks = [room_for(ROOM * ROW * len(sites.ways)) for _ in range(operator.threads)]
        self._shared = [0] * operator.threads  # bonds at the beginning of these that the operator knows already
        self._course = TileMotion(
            u_buffers=(operator.u, zeros_like_u()),
            v_buffers=(zeros_like_u(), zeros_like_u()),
            next_v_has_failure_forces=np.zeros(count, dtype=np.bool_),
            rho=aligned(spread_rho),
            damping=damping,
            constrained=constrained_components(drive),
            has_only_bond_forces=plain,
            held_entries_by_tile=np.argsort(tile, kind="stable"),
            first_held_entry_of_tile=np.searchsorted(np.sort(tile), np.arange(count + 1)),
            waiting_reason=np.zeros(count, dtype=np.uint8),
            stalled_sweep=np.zeros(1, dtype=np.int64),
        )

    def advance(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        site, tile_motion = self._operator.sites.site, self._course
        for axis in range(len(tile_motion.u_buffers[0])):
            tile_motion.u_buffers[0][axis, site] = state.value[:, axis]
            tile_motion.v_buffers[0][axis, site] = state.rate[:, axis]
        sweep, ends = 0, last - first + 1 if last > first else 0
        while sweep < ends or ends == 0:
            with self._operator.breaking:
                sweep = self._sweep_tiles_in_threads(state, first, last, sweep, min(sweep + BETWEEN_LOOKS, ends))
            if ends == 0:
                return  # compiled
        self._operator.drop_pending_before(last - 1)
        after = (last - first + 1) % 2
        for axis in range(len(tile_motion.u_buffers[0])):
            state.value[:, axis], state.rate[:, axis] = (
                tile_motion.u_buffers[after][axis, site],
                tile_motion.v_buffers[after][axis, site],
            )

    def _sweep_tiles_in_threads(
        self, state: State, first_step: int, end_step: int, first_sweep: int, end_sweep: int
    ) -> int:
        """Do the sweeps `first_sweep` to `end_sweep` - 1 of these steps, or fewer; returns the one to go on with."""
        threads, stop = self._operator.threads, self._course.stalled_sweep

        def sweep_tiles(thread: int, begin: int, end: int, only_waiting_tiles: bool, gate: Any) -> None:
            sweeps = SweepRange(first_step, end_step, begin, end, only_waiting_tiles)
            drive, breaks = self._of_lanes, self._breaks[thread]
            sweep_tiles_of_thread(
                self._operator.tiles, self._course, drive, state, self._dt, sweeps, breaks, thread, gate
            )

        breaks: list[Breaks] = []
        self._hand_pending_breaks_to_threads()
        stop[0], gate = -1, gate_of(threads)
        side_by_side(lambda thread: sweep_tiles(thread, first_sweep, end_sweep, False, gate), threads)
        while stop[0] >= 0:
            end_sweep = int(stop[0]) + 1
            breaks += self._collect_and_clear_new_breaks()
            self._operator.extend(np.flatnonzero(self._course.waiting_reason == NO_MEMORY))
            stop[0] = -1
            sweep_tiles(0, end_sweep - 1, end_sweep, True, gate_of(1))
        new = join_breaks(breaks + self._collect_and_clear_new_breaks())
        if new.used[0]:  # the same on any number of threads: in the order of steps, and of tiles
            self._operator.take_out(select_breaks(new, np.lexsort((new.places[:, 0] // ROW, new.bonds[:, 0]))))
        return end_sweep

    def _hand_pending_breaks_to_threads(self) -> None:
        """Give each thread the bonds of its tiles that broke in the last step, before those that it will break."""
        pending, count, threads = self._operator.pending, len(self._operator.tiles.kind), self._operator.threads
        tile = pending.places[:, 0] // ROW
        for thread in range(threads):
            own = (tile >= count * thread // threads) & (tile < count * (thread + 1) // threads)
            breaks = self._breaks[thread]
            used = self._shared[thread] = int(np.count_nonzero(own))
            room = used + ROOM * ROW * len(self._operator.sites.ways)
            if room > len(breaks.bonds):
                breaks = self._breaks[thread] = room_for(room)
            for column, values in zip(breaks[1:], pending[1:], strict=True):
                column[:used] = values[own]
            breaks.used[0] = used

    def _collect_and_clear_new_breaks(self) -> list[Breaks]:
        """The bonds of each thread that broke since the last call, whose room is free again."""
        new = [copy_breaks(breaks, shared) for breaks, shared in zip(self._breaks, self._shared, strict=True)]
        for breaks, shared in zip(self._breaks, self._shared, strict=True):
            breaks.used[0] = shared
        return new


@cached_njit(nogil=True, error_model="numpy")
def sweep_tiles_of_thread(tiles, tile_motion, drive, state, dt, sweep_range, breaks, thread, gate):  # type: ignore[no-untyped-def]
    """Do sweeps of a sequence of steps; all threads call this together, each with a share of the tiles.

    It stops after a sweep in which tiles wait. Prescribed components of `drive` are numbered by the lanes of their
    tiles, loads by nodes. The accelerations of `state` are those of the last step of a node whose tile is not plain,
    and of all nodes after the last sweep.
    """
    first, last, begin, end, only_waiting_tiles = sweep_range
    force, a, before = np.zeros((3, len(tiles.axes), ROW), tile_motion.rho.dtype)
    buffers = TileBuffers(force, a, before, np.zeros(ROW))
    count = len(tiles.kind)
    first_tile, end_tile = count * thread // gate.threads, count * (thread + 1) // gate.threads
    for sweep in range(begin, end):
        step, starts, ends = first + sweep - 1, sweep == 0, sweep == last - first
        if not starts and drive.varies and not only_waiting_tiles:
            if thread == 0:
                apply_loads(drive, step * dt)
            meet(gate)
        now, after = sweep % 2, (sweep + 1) % 2
        motion = Motion(tile_motion.u_buffers[now], tile_motion.v_buffers[now], True, dt, step)
        sweep_arguments = SweepArguments(motion, state, breaks, after, starts, ends)
        if not starts and not only_waiting_tiles:
            _add_second_forces_of_broken_bonds(tiles, tile_motion, sweep_arguments)
        for t in range(first_tile, end_tile):
            if only_waiting_tiles and tile_motion.waiting_reason[t] == READY:
                continue
            tile_motion.waiting_reason[t] = _sweep_tile_or_return_waiting_reason(
                tiles, tile_motion, drive, sweep_arguments, buffers, t
            )
            if tile_motion.waiting_reason[t] != READY:
                tile_motion.stalled_sweep[0] = sweep
        meet(gate)
        if tile_motion.stalled_sweep[0] == sweep:
            return


@njit(**INNER)
def _add_second_forces_of_broken_bonds(tiles, tile_motion, sweep_arguments):  # type: ignore[no-untyped-def]
    """Add the second forces of the thread's bonds that broke one step ago to the failure forces of its tiles."""
    breaks = sweep_arguments.breaks_of_thread
    motion = sweep_arguments.motion
    failure_force = tile_motion.v_buffers[sweep_arguments.next_buffer]
    last = first = breaks.used[0]
    while first > 0 and breaks.bonds[first - 1, 0] == motion.step - 1:
        first -= 1
    for n in range(first, last):
        tile = breaks.places[n, 0] // ROW
        if not tile_motion.next_v_has_failure_forces[tile]:
            _begin_sum_of_failure_forces(tiles, tile_motion, failure_force, tile)
        pull_again(tiles, motion, failure_force, breaks, n)


@njit(**INNER)
def _begin_sum_of_failure_forces(tiles, tile_motion, failure_force, tile):  # type: ignore[no-untyped-def]
    """Begin the sum of the failure forces of a tile's bonds."""
    tile_motion.next_v_has_failure_forces[tile] = True
    failure_force[:, tiles.margin + tile * ROW : tiles.margin + tile * ROW + ROW] = 0


@njit(**IN_PLACE)
def _sweep_tile_or_return_waiting_reason(tiles, tile_motion, drive, sweep_arguments, buffers, tile):  # type: ignore[no-untyped-def]
    """End a step for a tile and begin the next one, or one of both; returns what it waits for."""
    motion, starts = sweep_arguments.motion, sweep_arguments.is_first_sweep
    if tiles.kind[tile] == EMPTY:
        return READY
    if not starts:
        waits_for = _sum_tile_forces_and_break_bonds(tiles, tile_motion, sweep_arguments, buffers, tile)
        if waits_for != READY:
            return waits_for
    if tile_motion.has_only_bond_forces[tile] and not starts and not sweep_arguments.is_last_sweep:
        for lane in range(0, ROW, across(motion.u)):
            _advance_lanes_without_loads(
                tiles, tile_motion, motion, buffers.force, sweep_arguments.next_buffer, tiles.margin + tile * ROW, lane
            )
    else:
        _advance_tile_with_loads_and_holds(tiles, tile_motion, drive, sweep_arguments, buffers, tile)
    return READY


@njit(**IN_PLACE)
def _sum_tile_forces_and_break_bonds(tiles, tile_motion, sweep_arguments, buffers, tile):  # type: ignore[no-untyped-def]
    """Fill the force densities on a tile; returns what it waits for."""
    motion = sweep_arguments.motion
    breaks = sweep_arguments.breaks_of_thread
    dissipated = sweep_arguments.state.dissipated
    failure_force = tile_motion.v_buffers[
        sweep_arguments.next_buffer
    ]  # of bonds that soften or break: their place is free until the tile is advanced
    if not has_room(tiles, breaks):
        return NO_ROOM
    if not tile_motion.next_v_has_failure_forces[tile]:
        for lane in range(0, ROW, across(motion.u)):
            keep(zeros(motion.u, tiles.axes), failure_force, tiles.margin + tile * ROW + lane)
    for lane in range(0, ROW, across(motion.u)):
        status, f = sum_lanes(tiles, motion, failure_force, dissipated, breaks, tile, lane)
        keep(f, buffers.force, lane)
        if status != UNAGED:
            tile_motion.next_v_has_failure_forces[tile] = True
        if status == UNDONE:
            return NO_MEMORY
    if tile_motion.next_v_has_failure_forces[tile]:
        _add_failure_forces(tiles, tile_motion, failure_force, buffers.force, tile)
    return READY


@njit(**INNER)
def _add_failure_forces(tiles, tile_motion, failure_force, force, tile):  # type: ignore[no-untyped-def]
    """Add the forces of bonds that softened or broke to the force densities (d, 16) of a tile."""
    tile_motion.next_v_has_failure_forces[tile] = False
    for axis in range(len(force)):
        for lane in range(ROW):
            force[axis, lane] += failure_force[axis, tiles.margin + tile * ROW + lane]


@njit(**IN_PLACE)
def _advance_lanes_without_loads(tiles, tile_motion, motion, force, next_buffer, first_site, lane):  # type: ignore[no-untyped-def]
    """End a step for some lanes, on which only bonds act, and begin the next one; `first_site` is the tile's first
    site."""
    axes, dt, half, at = tiles.axes, same(motion.u, motion.dt), same(motion.u, motion.dt / 2), first_site + lane
    (rho,) = beside(tile_motion.rho, (0,), at)
    a, v = divided(beside(force, axes, lane), rho), beside(motion.rate, axes, at)
    v = advanced(advanced(v, a, half), a, half)
    keep(v, tile_motion.v_buffers[next_buffer], at)
    keep(advanced(beside(motion.u, axes, at), v, dt), tile_motion.u_buffers[next_buffer], at)


@njit(**INNER)
def _advance_tile_with_loads_and_holds(tiles, tile_motion, drive, sweep_arguments, buffers, tile):  # type: ignore[no-untyped-def]
    """End a step for a tile with its force densities, and begin the next one, or one of both."""
    motion, state, after = sweep_arguments.motion, sweep_arguments.state, sweep_arguments.next_buffer
    first_site, dt = tiles.margin + tile * ROW, motion.dt
    u, v = (
        tile_motion.u_buffers[after][:, first_site : first_site + ROW],
        tile_motion.v_buffers[after][:, first_site : first_site + ROW],
    )
    for lane in range(ROW):
        i = tiles.node[tile * ROW + lane]
        for axis in range(len(u)):
            u[axis, lane], v[axis, lane] = motion.u[axis, first_site + lane], motion.rate[axis, first_site + lane]
            buffers.a[axis, lane] = state.second[i, axis] if i >= 0 else 0
            buffers.previous_v[axis, lane] = v[axis, lane] - dt / 2 * buffers.a[axis, lane]
    if not sweep_arguments.is_first_sweep:
        _accelerate_kick_and_damp_tile(tiles, tile_motion, drive, motion, state, v, buffers, tile)
    if not sweep_arguments.is_last_sweep:
        _kick_and_drift_tile(tile_motion, drive, u, v, buffers.a, dt, (motion.step + 1) * dt, tile)
    for lane in range(ROW):
        i = tiles.node[tile * ROW + lane]
        if i >= 0:
            for axis in range(len(u)):
                state.second[i, axis] = buffers.a[axis, lane]


@njit(**INNER)
def _kick_and_drift_tile(tile_motion, drive, u, v, a, dt, time, tile):  # type: ignore[no-untyped-def]
    """The first half of the kick of a tile, and the drift to the displacements at `time`, s."""
    for axis in range(len(u)):
        for lane in range(ROW):
            v[axis, lane] += dt / 2 * a[axis, lane]
            u[axis, lane] += dt * v[axis, lane]
    for k in range(tile_motion.first_held_entry_of_tile[tile], tile_motion.first_held_entry_of_tile[tile + 1]):
        prescribe_held_u_and_v(
            u.T, v.T, a.T, drive.holds, drive.profiles, drive.held_speed, tile_motion.held_entries_by_tile[k], dt, time
        )


@njit(**INNER)
def _accelerate_kick_and_damp_tile(tiles, tile_motion, drive, motion, state, v, buffers, tile):  # type: ignore[no-untyped-def]
    """From the force densities on a tile to accelerations, the second half of the kick, and damping; v are (d, 16)."""
    first_site, a, dt, axes, work = tiles.margin + tile * ROW, buffers.a, motion.dt, len(v), buffers.work
    rho = tile_motion.rho[first_site : first_site + ROW]
    for lane in range(ROW):
        i = tiles.node[tile * ROW + lane]
        if i < 0:
            continue
        work[lane] = state.work[i]
        for axis in range(axes):
            a[axis, lane] = (buffers.force[axis, lane] + drive.force[i, axis]) / rho[lane]
        for axis in range(axes):
            work[lane] += (drive.before[i, axis] + drive.force[i, axis]) / 2 * (dt * v[axis, lane])
    for k in range(tile_motion.first_held_entry_of_tile[tile], tile_motion.first_held_entry_of_tile[tile + 1]):
        speed, force, time = drive.held_speed, drive.held_force, motion.step * dt
        of_holds = drive.holds, drive.profiles, speed, force
        accelerate_held_component_and_book_work(
            v.T, a.T, rho, work, *of_holds, tile_motion.held_entries_by_tile[k], dt, time
        )
    for lane in range(ROW):
        i = tiles.node[tile * ROW + lane]
        if i < 0:
            continue
        c, state.work[i] = tile_motion.damping[i], work[lane]
        for axis in range(axes):
            v[axis, lane] += dt / 2 * a[axis, lane]
            if c > 0 and not tile_motion.constrained[i, axis]:
                state.damped[i] += damp_component_and_return_energy(
                    v.T, a.T, buffers.previous_v.T, rho, c, lane, axis, dt
                )
