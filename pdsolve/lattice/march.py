"""Velocity Verlet for bonds on lattices, in one sweep a step; the scheme is that of `verlet`.

The forces of some lanes stay near until their nodes have moved, as their neighbours read only the motion of this step:
those of two or three steps are kept in turn. A sequence of s steps has s + 1 sweeps: the first one begins a step, the
last one ends one, and each other one ends a step and begins the next. Kick and drift are rounded separately and never
contracted, so that results do not depend on where a sequence of steps is divided.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same
from pdsolve.conditions import (
    Drive,
    accelerate_held_component_and_book_work,
    apply_loads,
    constrained_components,
    prescribe_held_u_and_v,
)
from pdsolve.lattice.bond import IN_PLACE, advanced, divided, kick_and_drift, multiplied
from pdsolve.lattice.layout import ONE
from pdsolve.lattice.marched_bonds import (
    READY,
    MarchedBonds,
    Sweep,
    add_second_release_forces,
    load_accelerations,
    never_waits,
    store_accelerations,
    sum_group,
    sum_of_lanes,
)
from pdsolve.numerics.memory import aligned, aligned_zeros
from pdsolve.numerics.thread_team import gate_of, meet, side_by_side
from pdsolve.operators.contact.kernel import push_anew
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.operators.ghosts import Ghosts
from pdsolve.state import State
from pdsolve.stepper import Stepper


class MarchArrays(NamedTuple):
    """The motion of m places in g groups of lanes, along d axes, and what acts on n nodes besides bonds."""

    axes: tuple[int, ...]  # as many entries as there are axes
    margin: int  # places before the first group
    node: NDArray[np.int32]  # (g lanes,) row of the node in a lane, or -1
    u: tuple[NDArray[np.floating], ...]  # (d, m) displacements of some steps in turn, m
    v: tuple[NDArray[np.floating], ...]  # (d, m) velocities of some steps in turn, m/s
    rho: NDArray[np.floating]  # (q lanes,) kg/m^3, of groups that differ
    inverse_rho: NDArray[np.floating] | None  # (q lanes,) by which forces are multiplied; None: rho divides them
    rho_place: NDArray[np.int32]  # (g,) of a group's first lane in both
    damping: NDArray[np.floating] | None  # (d, m) of components, 0 where they are prescribed, 1/s; None: all 0
    groups: NDArray[np.int64]  # (swept groups,) in the order in which they are shared out to threads
    has_only_bond_forces: NDArray[np.bool_]  # (g,) whether no load, hold or damping acts on the group
    has_loads: NDArray[np.bool_]  # (g,) whether a load acts on it
    held_entries: NDArray[np.int64]  # (holds,) prescribed components in the order of their groups
    first_held_entry: NDArray[np.int64]  # (g + 1,) those of a group
    place_of_row: NDArray[np.int32] | None  # (n,) of nodes that may touch; None: none may, or places are their rows
    contact_force: NDArray[np.float64]  # (n, d) force densities of contact now, N/m^3; (0, d) without contact
    adds_contact_force: NDArray[np.bool_]  # (g,) whether contact may act on the group
    has_failure_forces: NDArray[np.bool_]  # (g,) whether the next velocities are forces of failing bonds yet
    buffers: NDArray[np.floating]  # (threads, 3, d, lanes) of a group: forces or accelerations, velocities one step ago
    work: NDArray[np.float64]  # (threads, lanes) see `State`
    waiting_reason: NDArray[np.uint8]  # (g,) READY, or what a group waits for
    next_sweep: NDArray[np.int64]  # (1,) the sweep to go on with
    stalled_sweep: NDArray[np.int64]  # (1,) the sweep in which groups wait, or -1


class SweepRange(NamedTuple):
    """Sweeps of a sequence of steps."""

    first_step: int
    end_step: int  # after the last one
    first_sweep: int
    only_waiting_groups: bool
    pushes_pairs: bool = False  # whether the forces of pairs in touch change from sweep to sweep


class Group(NamedTuple):
    """A group while it is swept, along d axes."""

    number: int
    lanes: int
    place: int  # of its first lane
    rho_place: int  # of its first lane in the densities
    f: NDArray[np.floating]  # (d, lanes) force densities, N/m^3
    a: NDArray[np.floating]  # (d, lanes) accelerations, m/s^2
    previous_v: NDArray[np.floating]  # (d, lanes) velocities one step ago, m/s
    work: NDArray[np.float64]  # (lanes,) see `State`


class LatticeMarch(Stepper):
    """Takes steps of bonds in groups of lanes, changing the placed state."""

    integrator = "fused march"

    def __init__(
        self,
        bonds: MarchedBonds,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64] | None = None,
        contact: PenaltyContact | None = None,
        ghosts: Ghosts | None = None,
    ) -> None:
        """`rho` (n,) is the density, kg/m^3, `dt` the step, s, `damping` (n,) the damping of free components, 1/s.

        With `ghosts`, only the groups of own nodes move.
        """
        node = bonds.nodes()
        lane_of_node = np.zeros(len(rho), dtype=np.int32)  # of those of all groups
        lane_of_node[node[node >= 0]] = np.flatnonzero(node >= 0)
        self.bonds, self._dt, self._contact, self._ghosts = bonds, dt, contact, ghosts
        holds = drive.holds._replace(node=lane_of_node[drive.holds.node].astype(np.int64) % bonds.lanes)
        self.drive_of_lanes = drive._replace(holds=holds)
        self._group_of_node = lane_of_node // bonds.lanes if contact is not None else np.zeros(0, dtype=np.int32)
        self._rows = np.zeros(0, dtype=np.int64)  # on which contact acted
        if ghosts is not None:
            ghosts.set_places(bonds.margin + lane_of_node.astype(np.int64))
        self.arrays = self._make_arrays(lane_of_node, drive, rho, damping)

    def _make_arrays(
        self,
        lane_of_node: NDArray[np.int32],
        drive: Drive,
        rho: NDArray[np.floating],
        damping: NDArray[np.float64] | None,
    ) -> MarchArrays:
        """The arrays of kernels."""
        bonds, group = self.bonds, lane_of_node // self.bonds.lanes
        count, axes = bonds.group_count, len(bonds.axes)
        held_group, has_loads, acts = group[drive.holds.node], *np.zeros((2, count), dtype=np.bool_)
        has_loads[group[drive.loads.node]] = acts[held_group] = True
        rates = None
        if damping is not None and damping.any():
            acts[group[damping > 0]] = True
            rates = np.where(constrained_components(drive), 0.0, damping[:, None]).astype(rho.dtype)

            at_places = aligned_zeros((axes, bonds.u[0].shape[1]), rho.dtype)
            own = bonds.nodes()
            at_places[:, bonds.margin + np.flatnonzero(own >= 0)] = rates[own[own >= 0]].T
            rates = at_places
        group_rho, rho_number = self._distinct_densities(rho)

        return MarchArrays(
            axes=bonds.axes,
            margin=bonds.margin,
            node=bonds.nodes(),
            u=bonds.u,
            v=bonds.v,
            rho=group_rho,
            inverse_rho=None if bonds.divides_by_rho else aligned(1 / group_rho),
            rho_place=rho_number * np.int32(bonds.lanes),
            damping=rates,
            groups=bonds.share_groups(None if self._ghosts is None else self._ghosts.own_block_range),
            has_only_bond_forces=~(has_loads | acts),
            has_loads=has_loads,
            held_entries=np.argsort(held_group, kind="stable"),
            first_held_entry=np.searchsorted(np.sort(held_group), np.arange(count + 1)),
            place_of_row=None
            if self._contact is None or bonds.places_are_rows
            else lane_of_node + np.int32(bonds.margin),
            contact_force=np.zeros((0 if self._contact is None else len(rho), axes)),
            adds_contact_force=np.zeros(count, dtype=np.bool_),
            has_failure_forces=np.zeros(count, dtype=np.bool_),
            buffers=aligned_zeros((bonds.threads, 3, axes, bonds.lanes), rho.dtype),
            work=np.zeros((bonds.threads, bonds.lanes)),
            waiting_reason=np.zeros(count, dtype=np.uint8),
            next_sweep=np.zeros(1, dtype=np.int64),
            stalled_sweep=np.zeros(1, dtype=np.int64),
        )

    def _distinct_densities(self, rho: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
        """The densities of groups that differ, lane by lane, and which of these each group has.

        A lane without a node has the density of another one, or 1, so that few groups differ.
        """
        if len(rho) and rho.min() == rho.max():
            return aligned(np.full(self.bonds.lanes, rho[0])), np.zeros(self.bonds.group_count, dtype=np.int32)
        rho_of_lanes = np.append(rho, rho.dtype.type(0))[self.bonds.nodes()].reshape(-1, self.bonds.lanes)
        largest = rho_of_lanes.max(axis=1, keepdims=True)
        rho_of_lanes = np.where(rho_of_lanes > 0, rho_of_lanes, np.where(largest > 0, largest, 1))
        distinct, number = np.unique(rho_of_lanes, axis=0, return_inverse=True)
        return aligned(distinct.ravel()), number.ravel().astype(np.int32)

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last one."""
        bonds, sweep, end_sweep = self.bonds, 0, end_step - first_step + 1
        if end_step <= first_step:
            self._sweep_in_threads(state, SweepRange(first_step, end_step, 0, False), 0)  # compiles
            return end_step - 1
        bonds.place_motion(state)
        while sweep < end_sweep:
            count, pushes_pairs = bonds.sweeps_at_once if self._ghosts is None else 1, False
            if self._contact is not None:
                lasts = 1
                if sweep > 0:
                    step = first_step + sweep - 1
                    arrays, now = self.arrays, self.bonds.collect_motion(state, sweep)
                    free = self._contact.free_steps(now, step, self._dt)
                    arrays.contact_force[self._rows], arrays.adds_contact_force[:] = 0.0, False
                    self._rows = self._contact.rows if free == 0 else self._rows[:0]
                    arrays.adds_contact_force[self._group_of_node[self._rows]] = True
                    if free > 0:
                        lasts, pushes_pairs = free, False
                    else:
                        self._contact.push(now, arrays.contact_force, step, self._dt)
                        lasts, pushes_pairs = self._contact.push_steps(step), True
                count = min(count, lasts)
            sweeps = SweepRange(first_step, end_step, sweep, False, pushes_pairs)
            with bonds.breaking:
                sweep = self._sweep_in_threads(state, sweeps, min(sweep + count, end_sweep))
            if self._ghosts is not None and sweep < end_sweep:
                self._ghosts.receive_values(bonds.u[sweep % len(bonds.u)], at_places=True)
                if len(bonds.v) > 1:  # with which bonds know where nodes were a step ago
                    self._ghosts.receive_values(bonds.v[sweep % len(bonds.v)], at_places=True)
        bonds.finish(state, end_sweep, end_step - 1)
        return end_step - 1

    def _sweep_in_threads(self, state: State, sweeps: SweepRange, end_sweep: int) -> int:
        """Do sweeps of these steps until `end_sweep`, fewer if pairs are to be found; returns the one to go on with."""
        arrays, bonds = self.arrays, self.bonds
        pushes = None if self._contact is None else self._contact.pushes()

        def sweep_groups(sweeps: SweepRange, thread: int, gate: Any) -> None:
            drive = self.drive_of_lanes
            sweep_groups_of_thread(
                *bonds.of_thread(thread), arrays, drive, state, pushes, self._dt, sweeps, thread, gate
            )

        arrays.next_sweep[0], arrays.stalled_sweep[0], gate = end_sweep, -1, gate_of(bonds.threads)
        bonds.begin_sweeps()
        side_by_side(lambda thread: sweep_groups(sweeps, thread, gate), bonds.threads)
        while arrays.stalled_sweep[0] >= 0:
            stalled = int(arrays.stalled_sweep[0])
            bonds.make_room(arrays.waiting_reason)
            arrays.next_sweep[0], arrays.stalled_sweep[0] = stalled + 1, -1
            sweep_groups(sweeps._replace(first_sweep=stalled, only_waiting_groups=True), 0, gate_of(1))
        bonds.end_sweeps()
        return int(arrays.next_sweep[0])


@cached_njit(nogil=True, error_model="numpy")
def sweep_groups_of_thread(bonds, history, arrays, drive, state, pushes, dt, sweeps, thread, gate):  # type: ignore[no-untyped-def]
    """Do sweeps of a sequence of steps, until `arrays.next_sweep`.

    All threads call this together, each with a share of the groups, and `meet` once a step, twice where a sweep pushes
    pairs anew. They stop after a sweep in which groups wait. Prescribed components of `drive` are numbered by the
    lanes of their groups, loads by nodes. The accelerations of `state` are those of the last step of a node on whose
    group not only bonds act, and of all nodes after the last sweep.
    """
    u, v = arrays.u, arrays.v  # whose references are counted here alone
    count, lanes = len(arrays.groups), arrays.work.shape[1]
    f, a, previous_v = arrays.buffers[thread, 0], arrays.buffers[thread, 1], arrays.buffers[thread, 2]
    for number in range(sweeps.first_sweep, arrays.next_sweep[0]):
        if number > sweeps.first_sweep and not _push_pairs_anew(pushes, arrays, sweeps, dt, number, thread, gate):
            return
        of_u = u[number % len(u)], u[(number + len(u) - 1) % len(u)], u[(number + 1) % len(u)]
        of_v = v[number % len(v)], v[(number + 1) % len(v)]
        step, is_last = sweeps.first_step + number - 1, number == sweeps.end_step - sweeps.first_step
        sweep = Sweep(number, step, dt, *of_u, *of_v, number == 0, is_last)
        if number > 0 and not sweeps.only_waiting_groups:
            if drive.varies:
                if thread == 0:
                    apply_loads(drive, sweep.step * sweep.dt)
                meet(gate)
            add_second_release_forces(bonds, history, state, sweep, arrays.has_failure_forces)
        for turn in range(count * thread // gate.threads, count * (thread + 1) // gate.threads):
            which = arrays.groups[turn]
            if not sweeps.only_waiting_groups or arrays.waiting_reason[which] != READY:
                place, rho_place = arrays.margin + which * lanes, arrays.rho_place[which]
                group = Group(which, lanes, place, rho_place, f, a, previous_v, arrays.work[thread])
                _sweep_group(bonds, history, arrays, drive, state, sweep, group)
        meet(gate)
        if arrays.stalled_sweep[0] == number:
            return


@njit(**INNER)
def _push_pairs_anew(pushes, arrays, sweeps, dt, number, thread, gate):  # type: ignore[no-untyped-def]
    """Set the forces of the pairs in touch for a sweep; returns False where pairs are to be found first."""
    if pushes is None or not sweeps.pushes_pairs:
        return True
    if thread == 0 and not _push_rows(pushes, arrays, arrays.place_of_row, dt, number):
        arrays.next_sweep[0] = number
    meet(gate)
    return arrays.next_sweep[0] != number


@overloaded(INNER)
def _push_rows(pushes, arrays, place_of_row, dt, number):  # type: ignore[no-untyped-def]
    """What `push_anew` does, with the motion that a sweep begins with."""
    if is_none(place_of_row):

        def push_at_places(pushes, arrays, place_of_row, dt, number):  # type: ignore[no-untyped-def]
            u, v = arrays.u[number % len(arrays.u)], arrays.v[number % len(arrays.v)]
            return push_anew(pushes, u.T, v.T, dt, arrays.contact_force)

        return push_at_places
    return _push_copied_rows


def _push_copied_rows(pushes, arrays, place_of_row, dt, number):  # type: ignore[no-untyped-def]
    u, v, faces, n = arrays.u, arrays.v, pushes.pairs.faces, len(place_of_row)
    d = len(u[0])
    # The next motion is not begun yet: there is room in its place
    u_of_rows = u[(number + 1) % len(u)].reshape(u[0].size)[: n * d].reshape(n, d)
    v_of_rows = v[(number + 1) % len(v)].reshape(v[0].size)[: n * d].reshape(n, d)
    for rows in (pushes.rows, faces.near):
        _copy_rows(rows, place_of_row, u[number % len(u)], u_of_rows)
    _copy_rows(faces.rows, place_of_row, v[number % len(v)], v_of_rows)
    return push_anew(pushes, u_of_rows, v_of_rows, dt, arrays.contact_force)


@njit(**INNER)
def _copy_rows(rows, place_of_row, values, values_of_rows):  # type: ignore[no-untyped-def]
    """Copy some rows of `values` (d, m) at places to where they are in `values_of_rows` (n, d)."""
    for i in rows:
        for axis in range(len(values)):
            values_of_rows[i, axis] = values[axis, place_of_row[i]]


@njit(**IN_PLACE)
def _sweep_group(bonds, history, arrays, drive, state, sweep, group):  # type: ignore[no-untyped-def]
    """End a step for a group and begin the next one, or one of both, unless the group waits for something."""
    is_free = arrays.has_only_bond_forces[group.number] and not sweep.is_first and not sweep.is_last
    is_touched = arrays.adds_contact_force[group.number]
    if not sweep.is_first:
        if never_waits(bonds):
            for lane in range(0, group.lanes, across(sweep.u)):
                f = sum_of_lanes(bonds, history, sweep, group.number, lane)
                if is_free and not is_touched:  # while their forces are in registers
                    advance_lanes_without_loads(arrays, sweep, group, f, lane)
                else:
                    keep(f, group.f, lane)
            if is_free and not is_touched:
                return
        else:
            waits_for = sum_group(bonds, history, state, sweep, arrays.has_failure_forces, group.number, group.f)
            arrays.waiting_reason[group.number] = waits_for
            if waits_for != READY:
                arrays.stalled_sweep[0] = sweep.number
                return
        if is_touched:
            _add_contact_forces(arrays, group)
    if is_free:
        for lane in range(0, group.lanes, across(sweep.u)):
            advance_lanes_without_loads(arrays, sweep, group, beside(group.f, arrays.axes, lane), lane)
    else:
        advance_group_with_loads_and_holds(bonds, history, arrays, drive, state, sweep, group)


@njit(**INNER)
def _add_contact_forces(arrays, group):  # type: ignore[no-untyped-def]
    """Add the forces of contact to the force densities on a group."""
    for lane in range(group.lanes):
        i = arrays.node[group.number * group.lanes + lane]
        if i >= 0:
            for axis in range(len(group.f)):
                group.f[axis, lane] += arrays.contact_force[i, axis]


@overloaded(IN_PLACE)
def over_density(force, rho, inverse_rho, at):  # type: ignore[no-untyped-def]
    """Accelerations of lanes from `at` on from force densities."""
    if is_none(inverse_rho):
        return lambda force, rho, inverse_rho, at: divided(force, beside(rho, ONE, at)[0])
    return lambda force, rho, inverse_rho, at: multiplied(force, beside(inverse_rho, ONE, at)[0])


@njit(**IN_PLACE)
def advance_lanes_without_loads(arrays, sweep, group, f, lane):  # type: ignore[no-untyped-def]
    """End a step for the lanes of a group from `lane` on, with their force densities, and begin the next one."""
    a, at = over_density(f, arrays.rho, arrays.inverse_rho, group.rho_place + lane), group.place + lane
    kick_and_drift(sweep.u, sweep.next_u, sweep.v, sweep.next_v, a, sweep.dt, arrays.axes, at)


@njit(**INNER)
def advance_group_with_loads_and_holds(bonds, history, arrays, drive, state, sweep, group):  # type: ignore[no-untyped-def]
    """End a step for a group with its force densities, and begin the next one, or one of both."""
    axes, a, dt, half = arrays.axes, group.a, same(sweep.u, sweep.dt), same(sweep.u, sweep.dt / 2)
    load_accelerations(bonds, history, state, group.number, a)
    if sweep.is_first:
        for lane in range(0, group.lanes, across(a)):
            keep(beside(sweep.v, axes, group.place + lane), sweep.next_v, group.place + lane)
    else:
        _accelerate_and_half_kick_group(arrays, drive, state, sweep, group)
    if not sweep.is_last:
        for lane in range(0, group.lanes, across(a)):
            at = group.place + lane
            v = advanced(beside(sweep.next_v, axes, at), beside(a, axes, lane), half)
            keep(v, sweep.next_v, at)
            keep(advanced(beside(sweep.u, axes, at), v, dt), sweep.next_u, at)
        time, end = (sweep.step + 1) * sweep.dt, group.place + group.lanes
        held_u, held_v = sweep.next_u[:, group.place : end].T, sweep.next_v[:, group.place : end].T
        for k in range(arrays.first_held_entry[group.number], arrays.first_held_entry[group.number + 1]):
            entry = arrays.held_entries[k]
            of_holds = drive.holds, drive.profiles, drive.held_speed
            prescribe_held_u_and_v(held_u, held_v, a.T, *of_holds, entry, sweep.dt, time)
    store_accelerations(bonds, history, state, group.number, a)


@njit(**INNER)
def _accelerate_and_half_kick_group(arrays, drive, state, sweep, group):  # type: ignore[no-untyped-def]
    """From the force densities on a group to accelerations, the second half of the kick, and damping."""
    axes, f, a = arrays.axes, group.f, group.a
    half, minus_half = same(sweep.u, sweep.dt / 2), same(sweep.u, -sweep.dt / 2)
    if arrays.has_loads[group.number]:
        for lane in range(group.lanes):
            i = arrays.node[group.number * group.lanes + lane]
            if i >= 0:
                for axis in range(len(group.f)):
                    group.f[axis, lane] += drive.force[i, axis]
                    mean = (drive.before[i, axis] + drive.force[i, axis]) / 2
                    state.work[i] += mean * (sweep.dt * sweep.v[axis, group.place + lane])
    for lane in range(0, group.lanes, across(f)):
        at = group.place + lane
        v = beside(sweep.v, axes, at)
        keep(advanced(v, beside(a, axes, lane), minus_half), group.previous_v, lane)
        keep(over_density(beside(f, axes, lane), arrays.rho, arrays.inverse_rho, group.rho_place + lane), a, lane)
        keep(v, sweep.next_v, at)
    # The accelerations of prescribed components, and the work of holding them
    end, time, work = group.place + group.lanes, sweep.step * sweep.dt, group.work
    held_v = sweep.next_v[:, group.place : end].T
    rho_of_lanes = arrays.rho[group.rho_place : group.rho_place + group.lanes]
    of_holds = drive.holds, drive.profiles, drive.held_speed, drive.held_force
    for k in range(arrays.first_held_entry[group.number], arrays.first_held_entry[group.number + 1]):
        entry = arrays.held_entries[k]
        held_lane = drive.holds.node[entry]
        i = arrays.node[group.number * group.lanes + held_lane]
        work[held_lane] = state.work[i]
        accelerate_held_component_and_book_work(held_v, group.a.T, rho_of_lanes, work, *of_holds, entry, sweep.dt, time)
        state.work[i] = work[held_lane]
    for lane in range(0, group.lanes, across(f)):
        at = group.place + lane
        keep(advanced(beside(sweep.next_v, axes, at), beside(a, axes, lane), half), sweep.next_v, at)
    damp_group(arrays, arrays.damping, state, sweep, group)


@overloaded(INNER)
def damp_group(arrays, damping, state, sweep, group):  # type: ignore[no-untyped-def]
    """Damp the end of a step of a group as its beginning, and book the energy taken; see `holds`."""
    if is_none(damping):
        return lambda arrays, damping, state, sweep, group: None
    return _damp


def _damp(arrays, damping, state, sweep, group):  # type: ignore[no-untyped-def]
    dt, energy = sweep.dt, group.f  # which have done their work
    for axis in range(len(energy)):
        row = slice(axis, axis + 1)
        for lane in range(0, group.lanes, across(energy)):
            at = group.place + lane
            (rho,) = beside(arrays.rho, ONE, group.rho_place + lane)
            (c,) = beside(damping[row], ONE, at)
            (v,) = beside(sweep.next_v[row], ONE, at)
            (undamped,), (before,) = beside(group.a[row], ONE, lane), beside(group.previous_v[row], ONE, lane)
            middle = v - dt / 2 * undamped
            v = v / (1.0 + c * dt / 2)
            keep((v,), sweep.next_v[row], at)
            keep((undamped - c * v,), group.a[row], lane)
            keep((rho * c * (before + v) / 2.0 * (dt * middle),), energy[row], lane)
    for lane in range(group.lanes):
        i = arrays.node[group.number * group.lanes + lane]
        if i >= 0:
            for axis in range(len(energy)):
                state.damped[i] += energy[axis, lane]
