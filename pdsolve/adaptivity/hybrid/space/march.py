"""Steps of a body with a fine zone, some in one call of a fused kernel.

A sweep of `pdsolve.lattice.march` over fine tiles, and then one over the springs of coarse cells. Before the first
one, nodes on the border take the place that coarse nodes give them, and pieces of clipped bonds pull. Between both,
forces on nodes on the border pass to the coarse nodes that carry them. Threads share tiles; one of them does what is
between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.pieces import GroupedBondPieceSprings, add_bond_piece_forces
from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import apply_loads
from pdsolve.lattice.march import Group, advance_group_with_loads_and_holds, advance_lanes_without_loads
from pdsolve.lattice.marched_bonds import READY, Sweep, add_second_release_forces, sum_group
from pdsolve.numerics.thread_team import meet


class BorderNodes(NamedTuple):
    """Fine nodes on the border, b of them, which move with up to four coarse nodes."""

    place: NDArray[np.int64]  # (b,) on the fine lattice
    coarse_places: NDArray[np.int64]  # (b, 4)
    weights: NDArray[np.float64]  # (b, 4)
    volume: NDArray[np.float64]  # (b,) m^3
    off: NDArray[np.float64] | None  # (b, 3) how far they are off where coarse nodes move them, m; None: none swells


class GroundSprings(NamedTuple):
    """Springs from components of nodes to the ground."""

    place: NDArray[np.int64]  # (e,) on the fine lattice, or -1 less that on the coarse one
    axis: NDArray[np.int64]  # (e,)
    stiffness: NDArray[np.float64]  # (e,) N/m


class Seam(NamedTuple):
    """What fine and coarse nodes, at m and q places in tiles, do to each other."""

    border: BorderNodes
    pieces: GroupedBondPieceSprings
    ground: GroundSprings
    # (3, m) forces on fine nodes beside those of tiles, N; on the border force densities of tiles, N/m^3
    fine_forces: NDArray[np.float64]
    coarse_forces: NDArray[np.float64]  # (3, q) likewise on coarse nodes, N
    fine_inverse_volume: NDArray[np.float64]  # (m,) 1/m^3, 0 without a fine node of the body
    coarse_inverse_volume: NDArray[np.float64]  # (q,)
    has_fine_forces: NDArray[np.bool_]  # tiles with such forces
    has_coarse_forces: NDArray[np.bool_]
    is_on_border: NDArray[np.bool_]  # (16 tiles,) sites of the border
    strain_limit: float  # e of pieces at which the zone is too late
    largest_strain: NDArray[np.float64]  # (1,) the largest e of pieces so far; see `add_bond_piece_forces`


@cached_njit(nogil=True, error_model="numpy")
def sweep_zone(  # type: ignore[no-untyped-def]  # noqa: C901 - groups are not made in functions
    fine, breaks, coarse, spring_breaks, fine_arrays, coarse_arrays, drives, seam, state, dt, sweeps, thread, gate
):
    """Do sweeps of a sequence of steps, until `fine_arrays.next_sweep`; arguments are as in `sweep_groups_of_thread`.

    The first one begins a step, the last one ends one. All threads call this together. They stop where tiles wait, and
    go on from there with `sweeps.only_waiting_groups`; and where a piece of a clipped bond is over its limit, with
    `coarse_arrays.stalled_sweep` as the sweep's number.
    """
    fine_drive, coarse_drive = drives
    only_waiting, threads = sweeps.only_waiting_groups, gate.threads
    u, v, coarse_u, coarse_v = fine_arrays.u, fine_arrays.v, coarse_arrays.u, coarse_arrays.v
    tiles, spring_tiles = fine_arrays.groups, coarse_arrays.groups
    f, a, previous_v = fine_arrays.buffers[thread, 0], fine_arrays.buffers[thread, 1], fine_arrays.buffers[thread, 2]
    for number in range(sweeps.first_sweep, fine_arrays.next_sweep[0]):
        now, after, step = number % 2, (number + 1) % 2, sweeps.first_step + number - 1
        is_last = number == sweeps.end_step - sweeps.first_step
        of_step = number == 0, is_last
        sweep = Sweep(number, step, dt, u[now], u[after], u[after], v[now], v[after], *of_step)
        coarse_sweep = Sweep(
            number, step, dt, coarse_u[now], coarse_u[after], coarse_u[after], coarse_v[now], coarse_v[after], *of_step
        )
        if number > 0 and not only_waiting:
            if thread == 0:
                if fine_drive.varies:
                    apply_loads(fine_drive, sweep.step * dt)
                _begin_seam_forces(seam, coarse_arrays, sweep.u, coarse_sweep.u, sweep)
            meet(gate)
            if coarse_arrays.stalled_sweep[0] == number:
                return
            add_second_release_forces(fine, breaks, state, sweep, fine_arrays.has_failure_forces)
        for t in tiles[len(tiles) * thread // threads : len(tiles) * (thread + 1) // threads]:
            if not only_waiting or fine_arrays.waiting_reason[t] != READY:
                places = fine_arrays.margin + t * ROW, fine_arrays.rho_place[t]
                group = Group(t, ROW, *places, f, a, previous_v, fine_arrays.work[thread])
                _sweep_fine_tile(fine, breaks, fine_arrays, fine_drive, seam, state, sweep, group)
        only_waiting = False
        meet(gate)
        if fine_arrays.stalled_sweep[0] == number:
            return
        if number > 0:
            if thread == 0:
                _pass_border_forces_on(seam)
            meet(gate)
        for t in spring_tiles[len(spring_tiles) * thread // threads : len(spring_tiles) * (thread + 1) // threads]:
            places = coarse_arrays.margin + t * ROW, coarse_arrays.rho_place[t]
            group = Group(t, ROW, *places, f, a, previous_v, fine_arrays.work[thread])
            _sweep_springs(coarse, spring_breaks, coarse_arrays, coarse_drive, seam, state, coarse_sweep, group)
        meet(gate)


@njit(**INNER)
def _begin_seam_forces(seam, coarse_arrays, u, coarse_u, sweep):  # type: ignore[no-untyped-def]
    """Place nodes on the border, and begin the forces with those of pieces; note where one is over its limit."""
    interpolate_border_displacements(seam.border, coarse_u, u)
    for forces, has_forces, margin in (
        (seam.fine_forces, seam.has_fine_forces, (seam.fine_forces.shape[1] - len(seam.is_on_border)) // 2),
        (seam.coarse_forces, seam.has_coarse_forces, coarse_arrays.margin),
    ):
        for t in range(len(has_forces)):
            if has_forces[t]:
                forces[:, margin + t * ROW : margin + (t + 1) * ROW] = 0
    largest = add_bond_piece_forces(u, coarse_u, seam.pieces, seam.fine_forces, seam.coarse_forces)
    add_ground_spring_forces(u, coarse_u, seam.ground, seam.fine_forces, seam.coarse_forces)
    seam.largest_strain[0] = max(seam.largest_strain[0], largest)
    if sweep.step > 0 and largest > seam.strain_limit:
        coarse_arrays.stalled_sweep[0] = sweep.number


@cached_njit(nogil=True, error_model="numpy")
def add_ground_spring_forces(u, coarse_u, springs, forces, coarse_forces):  # type: ignore[no-untyped-def]
    """Add the forces of springs to the ground, N, to those on fine (3, m) and coarse places (3, q)."""
    for n in range(len(springs.place)):
        place, axis = springs.place[n], springs.axis[n]
        if place >= 0:
            forces[axis, place] -= springs.stiffness[n] * u[axis, place]
        else:
            coarse_forces[axis, -1 - place] -= springs.stiffness[n] * coarse_u[axis, -1 - place]


@cached_njit(nogil=True, error_model="numpy")
def interpolate_border_displacements(border, coarse_u, u):  # type: ignore[no-untyped-def]
    """Set the displacements u (3, m) of nodes on the border to what those of coarse nodes (3, q) make of them."""
    for n in range(len(border.place)):
        for axis in range(len(u)):
            displacement = 0.0
            for m in range(border.weights.shape[1]):
                displacement += border.weights[n, m] * coarse_u[axis, border.coarse_places[n, m]]
            u[axis, border.place[n]] = displacement
    _move_off(border.place, border.off, u)


@overloaded(INNER)
def _move_off(place, off, u):  # type: ignore[no-untyped-def]
    """Move nodes on the border off where coarse nodes have them, if nodes swell."""
    if is_none(off):
        return lambda place, off, u: None

    def move(place, off, u):  # type: ignore[no-untyped-def]
        for n in range(len(place)):
            for axis in range(len(u)):
                u[axis, place[n]] += off[n, axis]

    return move


@njit(**INNER)
def _pass_border_forces_on(seam):  # type: ignore[no-untyped-def]
    """Pass the forces on nodes on the border to the coarse nodes that carry them."""
    border = seam.border
    for n in range(len(border.place)):
        for m in range(border.weights.shape[1]):
            share = border.weights[n, m] * border.volume[n]
            for axis in range(len(seam.coarse_forces)):
                force = seam.fine_forces[axis, border.place[n]]
                seam.coarse_forces[axis, border.coarse_places[n, m]] += share * force


@njit(**INNER)
def _sweep_fine_tile(bonds, breaks, arrays, drive, seam, state, sweep, group):  # type: ignore[no-untyped-def]
    """End a step for a fine tile and begin the next one, or one of both, unless the tile waits."""
    t, f = group.number, group.f
    if not sweep.is_first:
        arrays.waiting_reason[t] = sum_group(bonds, breaks, state, sweep, arrays.has_failure_forces, t, f)
        if arrays.waiting_reason[t] != READY:
            arrays.stalled_sweep[0] = sweep.number
            return
        if seam.has_fine_forces[t]:
            for lane in range(ROW):
                at, is_on_border = group.place + lane, seam.is_on_border[t * ROW + lane]
                for axis in range(len(f)):
                    if is_on_border:
                        seam.fine_forces[axis, at] = f[axis, lane]
                    else:
                        f[axis, lane] += seam.fine_forces[axis, at] * seam.fine_inverse_volume[at]
    _advance_tile(bonds, breaks, arrays, drive, state, sweep, group)


@njit(**INNER)
def _sweep_springs(springs, breaks, arrays, drive, seam, state, sweep, group):  # type: ignore[no-untyped-def]
    """End a step for a tile of coarse nodes, whose sums are forces, N, and begin the next one, or one of both."""
    t, f = group.number, group.f
    if not sweep.is_first:
        sum_group(springs, breaks, state, sweep, arrays.has_failure_forces, t, f)
        for lane in range(ROW):
            at = group.place + lane
            for axis in range(len(f)):
                if seam.has_coarse_forces[t]:
                    f[axis, lane] += seam.coarse_forces[axis, at]
                f[axis, lane] *= seam.coarse_inverse_volume[at]
    _advance_tile(springs, breaks, arrays, drive, state, sweep, group)


@njit(**INNER)
def _advance_tile(bonds, breaks, arrays, drive, state, sweep, group):  # type: ignore[no-untyped-def]
    """Move a tile whose force densities are summed."""
    if not arrays.has_only_bond_forces[group.number] or sweep.is_first or sweep.is_last:
        advance_group_with_loads_and_holds(bonds, breaks, arrays, drive, state, sweep, group)
        return
    for lane in range(0, ROW, across(sweep.u)):
        advance_lanes_without_loads(arrays, sweep, group, beside(group.f, arrays.axes, lane), lane)
