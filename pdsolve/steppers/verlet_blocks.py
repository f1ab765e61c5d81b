"""Velocity Verlet for blocks in one sweep a step; the scheme is that of `verlet`.

One thread sums, kicks and drifts a block to the next step, as its neighbours read only the displacements of this step;
those of three steps are kept alternately. Kick and drift are rounded separately and never contracted, so that results
do not depend on where a sequence of steps is divided.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across
from pdsolve.codegen.plane_slots import kick_and_drift
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive, apply_loads
from pdsolve.numerics.thread_team import gate_of, meet, side_by_side
from pdsolve.operators.contact.kernel import Pushes, push_anew
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.operators.simd_lattice.kernel import FX, FY, INNER, LANES, sum_lanes
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.state import State
from pdsolve.steppers.ghosts import Ghosts
from pdsolve.steppers.holds import accelerate_held_component_and_book_work, prescribe_held_u_and_v


class BlockMotion(NamedTuple):
    """Motion of the blocks' nodes besides their bonds; m nodes in whole blocks, the last may be idle."""

    body_force: NDArray[np.floating]  # (2, m) body force now, N/m^3
    previous_body_force: NDArray[np.floating]  # (2, m) body force one step ago
    rho: NDArray[np.floating]  # (m,) kg/m^3
    inverse_rho: NDArray[np.floating]  # (m,) 1 / rho
    has_loads: NDArray[np.bool_]  # (blocks,) whether a load acts on the block
    is_without_loads_and_holds: NDArray[np.bool_]  # (blocks,) whether only bonds and contact act on the block
    held_entries_by_block: NDArray[np.int64]  # (holds,) the held components in the order of their blocks
    first_held_entry_of_block: NDArray[np.int64]  # (blocks + 1,) those of a block
    block_order_for_threads: NDArray[np.int64]  # (own blocks,) the order in which blocks are shared out to threads
    contact_force: NDArray[np.float64]  # (2, m) force density of contact now, N/m^3
    adds_contact_force: NDArray[np.bool_]  # (blocks,) whether contact may act on the block
    next_sweep: NDArray[np.int64]  # (1,) the sweep to go on with


class VerletBlocks:
    """Takes steps with bonds in blocks, changing the placed state."""

    def __init__(
        self,
        operator: SimdLattice,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        contact: PenaltyContact | None = None,
        ghosts: Ghosts | None = None,
    ) -> None:
        """`rho` (n,) is the density, kg/m^3, `dt` the step, s; with `ghosts`, only the blocks of own nodes move."""
        count, threads = len(operator.blocks.softened), len(operator.blocks.scratch)
        block = drive.holds.node // LANES
        hold_order, loaded = np.argsort(block, kind="stable"), np.zeros(count, dtype=np.bool_)
        loaded[drive.loads.node // LANES] = True
        held_start = np.searchsorted(block[hold_order], np.arange(count + 1))
        block_range = (0, count) if ghosts is None else ghosts.own_block_range
        # Equal parts of the blocks, one a thread, are to be equal work: blocks at an interface between spacings cost
        # more than others, so that each part takes groups from everywhere
        moving = block_range[1] - block_range[0]
        thread_of_block = np.arange(moving) // max(1, moving // (16 * threads)) % threads
        turns = block_range[0] + np.argsort(thread_of_block, kind="stable").astype(np.int64)
        self._operator, self._dt, self._threads, self._contact = operator, dt, threads, contact
        self._ghosts = ghosts
        self._rows = np.zeros(0, dtype=np.int64)  # on which contact acted
        self._course = BlockMotion(
            body_force=_pad_to_blocks(drive.force, count),
            previous_body_force=_pad_to_blocks(drive.before, count),
            rho=_pad_to_blocks(rho, count, 1.0),
            inverse_rho=_pad_to_blocks(1 / rho, count, 1.0),
            has_loads=loaded,
            is_without_loads_and_holds=~loaded & (np.diff(held_start) == 0),
            held_entries_by_block=hold_order,
            first_held_entry_of_block=held_start,
            block_order_for_threads=turns,
            contact_force=np.zeros((2, LANES * count if contact is not None else 0)),
            adds_contact_force=np.zeros(count, dtype=np.bool_),
            next_sweep=np.zeros(1, dtype=np.int64),
        )
        nodes = len(rho)
        self.drive = drive._replace(
            force=self._course.body_force[:, :nodes].T, before=self._course.previous_body_force[:, :nodes].T
        )

    def advance(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        sweep, ends = 0, last - first + 1 if last > first else 0
        while sweep < ends:
            sweep_count, pushes = ends - sweep if self._ghosts is None else 1, None
            if self._contact is not None:
                lasts = 1
                if sweep > 0:
                    lasts, pushes = self._update_contact_forces(self._contact, state, first + sweep - 1, sweep)
                sweep_count = min(sweep_count, lasts)
            sweep = self._sweep_blocks_in_threads(first, last, sweep, sweep + sweep_count, pushes)
            if self._ghosts is not None and sweep < ends:
                self._ghosts.receive_values(self._operator.tracks.u[sweep % 3])

    def _sweep_blocks_in_threads(
        self, first_step: int, end_step: int, first_sweep: int, end_sweep: int, pushes: Pushes | None
    ) -> int:
        """Do the sweeps `first_sweep` to `end_sweep` - 1 of these steps, fewer if pairs are to be found; returns the
        sweep to go on with."""
        operator, block_motion, gate = self._operator, self._course, gate_of(self._threads)
        block_motion.next_sweep[0] = end_sweep
        arguments = (
            operator.blocks,
            operator.tracks,
            block_motion,
            self.drive,
            pushes,
            self._dt,
            first_step,
            end_step,
            first_sweep,
            end_sweep,
        )
        side_by_side(lambda thread: advance_blocks_of_thread(*arguments, thread, gate), self._threads)
        return int(block_motion.next_sweep[0])

    def _update_contact_forces(
        self, contact: PenaltyContact, state: State, step: int, sweep: int
    ) -> tuple[int, Pushes | None]:
        """Set the forces of contact in a step, with the displacements of the sweep `sweep`; returns for how many steps
        they hold, or those of the pairs: None where nothing touches."""
        nodes, block_motion = len(state.value), self._course
        now = state._replace(value=self._operator.tracks.u[sweep % 3][:, :nodes].T)
        free = contact.free_steps(now, step, self._dt)
        rows = contact.rows if free == 0 else self._rows[:0]
        _clear_contact_forces_and_mark_blocks(
            block_motion.contact_force, block_motion.adds_contact_force, self._rows, rows
        )
        self._rows = rows
        if free > 0:
            return free, None
        contact.push(now, block_motion.contact_force[:, :nodes].T, step, self._dt)
        pushes, lasts = contact.pushes(step)
        return lasts, pushes if lasts > 1 else None


def _pad_to_blocks(values: NDArray[Any], block_count: int, padding: float = 0.0) -> NDArray[Any]:
    """Nodal values (n, ...) in `block_count` whole blocks (..., m)."""
    wide = np.full((*values.shape[1:], LANES * block_count), padding, dtype=values.dtype)
    wide[..., : len(values)] = values.T
    return aligned(wide)


@cached_njit(nogil=True, error_model="numpy")
def advance_blocks_of_thread(  # type: ignore[no-untyped-def]
    blocks, tracks, block_motion, drive, pushes, dt, first_step, end_step, first_sweep, end_sweep, thread, gate
):
    """Take the steps `first_step` to `end_step` - 1; `tracks.u[0]` are the displacements before and after.

    A sequence of s steps has s + 1 sweeps, of which those from `first_sweep` to `block_motion.next_sweep` - 1 are done.
    All threads call this together, each with a share of the blocks, and `meet` once a step, twice with `pushes` (None:
    none change).
    """
    u, steps, count = tracks.u, end_step - first_step, len(block_motion.block_order_for_threads)
    first_turn, end_turn, scratch = (
        count * thread // gate.threads,
        count * (thread + 1) // gate.threads,
        blocks.scratch[thread],
    )
    for sweep in range(first_sweep, end_sweep):
        if pushes is not None and sweep > first_sweep:
            if thread == 0 and not push_anew(pushes, u[sweep % 3].T, block_motion.contact_force.T):
                block_motion.next_sweep[0] = sweep
            meet(gate)
            if block_motion.next_sweep[0] == sweep:
                return
        if sweep > 0 and drive.varies:
            if thread == 0:
                apply_loads(drive, (first_step + sweep - 1) * dt)
            meet(gate)
        previous_u, current_u, next_u = u[(sweep + 2) % 3], u[sweep % 3], u[(sweep + 1) % 3]
        for turn in range(first_turn, end_turn):
            block = block_motion.block_order_for_threads[turn]
            step = first_step + sweep - 1
            starts = sweep == 0
            ends = sweep == steps
            if not starts and not ends and block_motion.is_without_loads_and_holds[block]:
                _advance_block_without_loads(
                    blocks, tracks, block_motion, current_u, previous_u, next_u, dt, step, block, scratch
                )
            else:
                _advance_block_with_loads(
                    blocks,
                    tracks,
                    block_motion,
                    drive,
                    current_u,
                    previous_u,
                    next_u,
                    dt,
                    step,
                    starts,
                    ends,
                    block,
                    scratch,
                )
        meet(gate)
    if thread == 0 and end_sweep == steps + 1 and steps % 3 != 0:
        _copy_displacements_to_first_buffer(u, steps % 3)


@cached_njit(error_model="numpy")
def _clear_contact_forces_and_mark_blocks(contact_force, adds_contact_force, previous_rows, rows):  # type: ignore[no-untyped-def]
    """Clear the forces of contact on the rows `previous_rows`, and set the mask of the blocks of `rows`."""
    adds_contact_force[:] = False
    for i in previous_rows:
        contact_force[0, i] = contact_force[1, i] = 0.0
    for i in rows:
        adds_contact_force[i // LANES] = True


@njit(forceinline=True, **INNER)
def _advance_block_without_loads(blocks, tracks, block_motion, u, previous_u, next_u, dt, step, block, scratch):  # type: ignore[no-untyped-def]
    """End `step` for `block`, on which only bonds and contact act, and go on to the next one."""
    full_step, half, lightness = u.dtype.type(dt), u.dtype.type(dt / 2), block_motion.inverse_rho
    for lane in range(0, LANES, across(scratch)):
        sum_lanes(blocks, tracks, u, previous_u, step, block, lane, scratch)
        if block_motion.adds_contact_force[block]:
            for k in range(across(scratch)):
                scratch[k] += block_motion.contact_force[0, block * LANES + lane + k]
                scratch[ROW + k] += block_motion.contact_force[1, block * LANES + lane + k]
        kick_and_drift(u, next_u, tracks.v, lightness, full_step, half, block * LANES + lane, scratch)


@njit(forceinline=True, **INNER)
def _advance_block_with_loads(  # type: ignore[no-untyped-def]
    blocks, tracks, block_motion, drive, u, previous_u, next_u, dt, step, is_first_sweep, is_last_sweep, block, scratch
):
    """End `step` for `block`, unless a sequence starts, and go on to the next one, unless it ends."""
    if is_first_sweep:
        _copy_accelerations_to_scratch(tracks.a, scratch, block)
    else:
        for lane in range(0, LANES, across(scratch)):
            sum_lanes(blocks, tracks, u, previous_u, step, block, lane, scratch)
            for k in range(across(scratch)):
                scratch[FX + lane + k], scratch[FY + lane + k] = scratch[k], scratch[ROW + k]
        if block_motion.adds_contact_force[block]:
            _add_contact_forces(block_motion.contact_force, scratch, block)
        if block_motion.has_loads[block]:
            _add_loads_and_book_work(
                block_motion.body_force, block_motion.previous_body_force, tracks.v, tracks.work, scratch, dt, block
            )
        _forces_to_accelerations(block_motion.inverse_rho, scratch, block)
        _copy_accelerations_from_scratch(tracks.a, scratch, block)
        _accelerate_held_components(tracks, block_motion, drive, dt, step * dt, block)
        _copy_accelerations_to_scratch(tracks.a, scratch, block)
        _half_kick_block(tracks.v, scratch, dt, block)
    if not is_last_sweep:
        _half_kick_block(tracks.v, scratch, dt, block)
        _drift_block(tracks.v, u, next_u, dt, block)
        _prescribe_held_components(tracks, block_motion, drive, next_u, dt, (step + 1) * dt, block)


@njit(**INNER)
def _copy_displacements_to_first_buffer(u_buffers, last_buffer):  # type: ignore[no-untyped-def]
    for axis in range(2):
        for i in range(u_buffers.shape[2]):
            u_buffers[0, axis, i] = u_buffers[last_buffer, axis, i]


@njit(**INNER)
def _accelerate_held_components(tracks, block_motion, drive, dt, time, block):  # type: ignore[no-untyped-def]
    v, a, speed, force = tracks.v.T, tracks.a.T, drive.held_speed, drive.held_force
    for k in range(block_motion.first_held_entry_of_block[block], block_motion.first_held_entry_of_block[block + 1]):
        e = block_motion.held_entries_by_block[k]
        accelerate_held_component_and_book_work(
            v, a, block_motion.rho, tracks.work, drive.holds, drive.profiles, speed, force, e, dt, time
        )


@njit(**INNER)
def _prescribe_held_components(tracks, block_motion, drive, u, dt, time, block):  # type: ignore[no-untyped-def]
    v, a = tracks.v.T, tracks.a.T
    for k in range(block_motion.first_held_entry_of_block[block], block_motion.first_held_entry_of_block[block + 1]):
        prescribe_held_u_and_v(
            u.T, v, a, drive.holds, drive.profiles, drive.held_speed, block_motion.held_entries_by_block[k], dt, time
        )


@njit(**INNER)
def _add_loads_and_book_work(force, previous_force, v, work, scratch, dt, block):  # type: ignore[no-untyped-def]
    """Add the loads to the forces of `block`, and book their work."""
    for lane in range(LANES):
        i = block * LANES + lane
        scratch[FX + lane] += force[0, i]
        scratch[FY + lane] += force[1, i]
        work[i] += (previous_force[0, i] + force[0, i]) / 2 * (dt * v[0, i])
        work[i] += (previous_force[1, i] + force[1, i]) / 2 * (dt * v[1, i])


@njit(**INNER)
def _add_contact_forces(contact_force, scratch, block):  # type: ignore[no-untyped-def]
    """Add the forces of contact to those of `block`."""
    for lane in range(LANES):
        scratch[FX + lane] += contact_force[0, block * LANES + lane]
        scratch[FY + lane] += contact_force[1, block * LANES + lane]


@njit(**INNER)
def _forces_to_accelerations(inverse_rho, scratch, block):  # type: ignore[no-untyped-def]
    """Turn force densities into accelerations, stored in FX and FY."""
    for lane in range(LANES):
        scratch[FX + lane] *= inverse_rho[block * LANES + lane]
        scratch[FY + lane] *= inverse_rho[block * LANES + lane]


@njit(**INNER)
def _copy_accelerations_from_scratch(a, scratch, block):  # type: ignore[no-untyped-def]
    for lane in range(LANES):
        a[0, block * LANES + lane] = scratch[FX + lane]
        a[1, block * LANES + lane] = scratch[FY + lane]


@njit(**INNER)
def _copy_accelerations_to_scratch(a, scratch, block):  # type: ignore[no-untyped-def]
    for lane in range(LANES):
        scratch[FX + lane] = a[0, block * LANES + lane]
        scratch[FY + lane] = a[1, block * LANES + lane]


@njit(**INNER)
def _half_kick_block(v, scratch, dt, block):  # type: ignore[no-untyped-def]
    half = scratch.dtype.type(dt / 2)
    for lane in range(LANES):
        v[0, block * LANES + lane] += half * scratch[FX + lane]
        v[1, block * LANES + lane] += half * scratch[FY + lane]


@njit(**INNER)
def _drift_block(v, u, next_u, dt, block):  # type: ignore[no-untyped-def]
    full_step = v.dtype.type(dt)
    for lane in range(LANES):
        next_u[0, block * LANES + lane] = u[0, block * LANES + lane] + full_step * v[0, block * LANES + lane]
        next_u[1, block * LANES + lane] = u[1, block * LANES + lane] + full_step * v[1, block * LANES + lane]
