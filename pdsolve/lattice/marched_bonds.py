"""What a march in one sweep a step asks of bonds on lattices: in the blocks of plates, and in the tiles of bodies.

A group is a block or a tile. Its lanes have places side by side in the arrays of motion.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.lanes import across, beside, keep
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.blocks import BlockMotion
from pdsolve.lattice.bond import zeros
from pdsolve.lattice.layout import LANES, in_tiles
from pdsolve.lattice.sums import UNAGED, UNDONE, sum_lanes
from pdsolve.lattice.tiles import (
    EMPTY,
    Breaks,
    SiteMotion,
    collect_rows,
    copy_breaks,
    has_room,
    join_breaks,
    place_rows,
    pull_again,
    room_for,
    select_breaks,
)
from pdsolve.state import State

if TYPE_CHECKING:
    from pdsolve.lattice.operator import BlockLattice, TileLattice

READY, NO_ROOM, NO_MEMORY = range(3)  # what a group waits for
BETWEEN_LOOKS = 16  # sweeps of tiles in which nobody else can ask which bonds are broken
ROOM = 16  # tiles of a thread all of whose bonds may break before it stops for more room
PARTS = 16  # of a thread's share of blocks: groups from everywhere


class Sweep(NamedTuple):
    """One sweep: it ends a step and begins the next one; m places along d axes."""

    number: int  # in a sequence of steps
    step: int  # that it ends
    dt: float  # s
    u: NDArray[np.floating]  # (d, m) displacements, m
    previous_u: NDArray[np.floating]  # (d, m) one step ago; not where u are kept of two steps alone
    next_u: NDArray[np.floating]  # (d, m) where those of the next step go
    v: NDArray[np.floating]  # (d, m) velocities of the middle of the step, m/s
    next_v: NDArray[np.floating]  # (d, m) where those of the next one go: v itself, or free until then
    is_first: bool  # it ends no step
    is_last: bool  # it begins no step


class MarchedBonds(Protocol):
    """The bonds of n nodes in groups of lanes, and the arrays of their motion, those of a few steps in turn."""

    threads: int
    axes: tuple[int, ...]  # as many entries as there are axes
    lanes: int  # of a group
    margin: int  # places before the first group
    group_count: int
    u: tuple[NDArray[np.floating], ...]  # (d, m) displacements, m
    v: tuple[NDArray[np.floating], ...]  # (d, m) velocities, m/s
    divides_by_rho: bool  # the accelerations are forces over rho, not times its inverse
    places_are_rows: bool  # of nodes
    sweeps_at_once: int  # at most
    breaking: AbstractContextManager[Any]  # held during sweeps

    def nodes(self) -> NDArray[np.int32]:
        """Row of the node in each lane of all groups, or -1."""

    def share_groups(self, own_block_range: tuple[int, int] | None) -> NDArray[np.int64]:
        """The groups to sweep, in the order in which they are shared out to threads; on ranks those of own nodes."""

    def place_motion(self, state: State) -> None:
        """Enter the motion of the state in the first arrays."""

    def collect_motion(self, state: State, sweep: int) -> State:
        """The state with the motion that a sweep begins with."""

    def finish(self, state: State, sweep: int, step: int) -> None:
        """Enter the motion behind the last sweep, which ended `step`, in the state."""

    def of_thread(self, thread: int) -> tuple[Any, Any]:
        """The bonds, and where their breaks are written."""

    def begin_sweeps(self) -> None:
        """Give threads what they go on with."""

    def make_room(self, waiting_reason: NDArray[np.uint8]) -> None:
        """Give groups (g,) what they wait for."""

    def end_sweeps(self) -> None:
        """Take over what has broken."""


def copy_state(state: State, copy: State) -> State:
    """The `copy`, with the values of the state; arrays that both share stay as they are."""
    for values, copied in zip(state, copy, strict=True):
        if values.ctypes.data != copied.ctypes.data:
            copied[:] = values
    return copy


def rows_in(places: NDArray[np.floating], nodes: int) -> NDArray[np.floating]:
    """Room for the vectors (n, d) of nodes in the memory of an array (d, m) of places, m >= n."""
    return places.reshape(-1)[: nodes * len(places)].reshape(nodes, len(places))


class MarchedBlocks:
    """Bonds in blocks; see `MarchedBonds`. The state is the motion's own, and breaks are written where bonds are."""

    lanes, margin, sweeps_at_once = LANES, 0, 1 << 62
    divides_by_rho, places_are_rows = False, True
    breaking: AbstractContextManager[Any] = nullcontext()

    def __init__(self, operator: BlockLattice) -> None:
        self._operator, self.threads = operator, len(operator.blocks.scratch)
        self.group_count = len(operator.blocks.softened)
        self.axes: tuple[int, ...] = operator.blocks.axes
        self.u: tuple[NDArray[np.floating], ...] = tuple(operator.tracks.u)
        self.v: tuple[NDArray[np.floating], ...] = (operator.tracks.v,)

    def nodes(self) -> NDArray[np.int32]:
        """Row of the node in each lane: its place, or -1 behind the last one."""
        places = np.arange(LANES * self.group_count, dtype=np.int32)
        return np.where(places < len(self._operator.stiffness_bound()), places, np.int32(-1))

    def share_groups(self, own_block_range: tuple[int, int] | None) -> NDArray[np.int64]:
        """The blocks to sweep, shared out to threads.

        Equal parts, one a thread, are to be equal work: blocks at an interface between spacings cost more than others,
        so that each part takes groups of blocks from everywhere.
        """
        first, end = own_block_range or (0, self.group_count)
        count = end - first
        thread = np.arange(count) // max(1, count // (PARTS * self.threads)) % self.threads
        return first + np.argsort(thread, kind="stable").astype(np.int64)

    def place_motion(self, state: State) -> None:
        """Nothing: the state is there."""

    def collect_motion(self, state: State, sweep: int) -> State:
        """The state with the motion that a sweep begins with."""
        return state._replace(value=self.u[sweep % len(self.u)][:, : len(state.value)].T)

    def finish(self, state: State, sweep: int, step: int) -> None:
        """Enter the motion behind the last sweep, which moves no node, in the state."""
        if (sweep - 1) % len(self.u) != 0:
            self.u[0][:] = self.u[(sweep - 1) % len(self.u)]

    def of_thread(self, thread: int) -> tuple[Any, Any]:
        """The bonds, and their history."""
        blocks = self._operator.blocks
        return blocks._replace(scratch=blocks.scratch[thread : thread + 1]), self._operator.tracks

    def begin_sweeps(self) -> None:
        """Nothing."""

    def make_room(self, waiting_reason: NDArray[np.uint8]) -> None:
        """Nothing: no block waits."""

    def end_sweeps(self) -> None:
        """Nothing: the operator looks at its bonds."""


class MarchedTiles:
    """Bonds in tiles; see `MarchedBonds`."""

    lanes = ROW
    divides_by_rho, places_are_rows = True, False
    sweeps_at_once = BETWEEN_LOOKS

    def __init__(self, operator: TileLattice) -> None:
        self._operator, self.threads, self.axes = operator, operator.threads, operator.tiles.axes
        self.margin, self.group_count = operator.sites.margin, operator.sites.tiles
        self.breaking: AbstractContextManager[Any] = operator.breaking
        self.u: tuple[NDArray[np.floating], ...] = tuple(operator.u)
        self.v: tuple[NDArray[np.floating], ...] = tuple(operator.v)
        self._breaks = [self._room_for(0) for _ in range(operator.threads)]
        self._shared = [0] * operator.threads  # bonds at the beginning of these that the operator knows already
        self._new: list[Breaks] = []

    def nodes(self) -> NDArray[np.int32]:
        """Row of the node at each site, or -1."""
        return self._operator.sites.node

    def share_groups(self, own_block_range: tuple[int, int] | None) -> NDArray[np.int64]:
        """The tiles to sweep, in order: each thread has some side by side."""
        first, end = self._operator.summed_tiles
        self._swept = first + np.flatnonzero(self._operator.tiles.kind[first:end] != EMPTY)
        return self._swept

    def place_motion(self, state: State) -> None:
        """Enter the motion of the state in the first arrays."""
        for values, places in ((state.value, self.u[0]), (state.rate, self.v[0])):
            place_rows(self._operator.sites.site, values, places, 0, len(values))

    def collect_motion(self, state: State, sweep: int) -> State:
        """The state with the motion that a sweep begins with."""
        return self._collect(state, sweep, sweep)

    def finish(self, state: State, sweep: int, step: int) -> None:
        """Enter the motion behind the last sweep, which moves no node, in the state."""
        copy_state(self._collect(state, sweep - 1, sweep), state)
        self._operator.drop_pending_before(step)

    def _collect(self, state: State, u_number: int, v_number: int) -> State:
        """The state with the motion at these numbers, in the arrays that are free meanwhile."""
        rows = []
        for arrays, number in ((self.u, u_number), (self.v, v_number)):
            values = rows_in(arrays[(number + 1) % 2], len(state.value))
            collect_rows(self._operator.sites.site, arrays[number % 2], values, 0, len(values))
            rows.append(values)
        return state._replace(value=rows[0], rate=rows[1])

    def of_thread(self, thread: int) -> tuple[Any, Any]:
        """The bonds, and room for those that break."""
        return self._operator.tiles, self._breaks[thread]

    def begin_sweeps(self) -> None:
        """Give each thread the bonds of its tiles that broke in the last step, before those that it will break."""
        pending, count, threads = self._operator.pending, len(self._swept), self.threads
        turn = np.searchsorted(self._swept, pending.places[:, 0] // ROW)
        for thread in range(threads):
            own = (turn >= count * thread // threads) & (turn < count * (thread + 1) // threads)
            used = self._shared[thread] = int(np.count_nonzero(own))
            if used + len(self._room_for(0).bonds) > len(self._breaks[thread].bonds):
                self._breaks[thread] = self._room_for(used)
            breaks = self._breaks[thread]
            for column, values in zip(breaks[1:], pending[1:], strict=True):
                column[:used] = values[own]
            breaks.used[0] = used

    def make_room(self, waiting_reason: NDArray[np.uint8]) -> None:
        """Give tiles (g,) room for breaks, and memory for bonds that soften."""
        self._collect_and_clear_breaks()
        self._operator.extend(np.flatnonzero(waiting_reason == NO_MEMORY))

    def end_sweeps(self) -> None:
        """Take out what has broken, the same on any number of threads: in the order of steps, and of tiles."""
        self._collect_and_clear_breaks()
        new, self._new = join_breaks(self._new), []
        if new.used[0]:
            self._operator.take_out(select_breaks(new, np.lexsort((new.places[:, 0] // ROW, new.bonds[:, 0]))))

    def _room_for(self, used: int) -> Breaks:
        """Room for so many bonds that are known, and for those that break."""
        room: Breaks = room_for(used + ROOM * ROW * len(self._operator.sites.ways))
        return room

    def _collect_and_clear_breaks(self) -> None:
        """Collect the bonds of each thread that broke since the last call, whose room is free again."""
        for breaks, shared in zip(self._breaks, self._shared, strict=True):
            self._new.append(copy_breaks(breaks, shared))
            breaks.used[0] = shared


def _load_from_sites(bonds, history, state, group, a):  # type: ignore[no-untyped-def]
    for lane in range(ROW):
        i = bonds.node[group * ROW + lane]
        for axis in range(len(a)):
            a[axis, lane] = state.second[i, axis] if i >= 0 else 0


@in_tiles(_load_from_sites, INNER)
def load_accelerations(bonds, history, state, group, a):  # type: ignore[no-untyped-def]
    """Copy the accelerations of a group's nodes from the state to a (d, lanes)."""
    for lane in range(0, LANES, across(a)):
        keep(beside(history.a, bonds.axes, group * LANES + lane), a, lane)


def _store_at_sites(bonds, history, state, group, a):  # type: ignore[no-untyped-def]
    for lane in range(ROW):
        i = bonds.node[group * ROW + lane]
        if i >= 0:
            for axis in range(len(a)):
                state.second[i, axis] = a[axis, lane]


@in_tiles(_store_at_sites, INNER)
def store_accelerations(bonds, history, state, group, a):  # type: ignore[no-untyped-def]
    """Copy a (d, lanes) to the accelerations of a group's nodes in the state."""
    for lane in range(0, LANES, across(a)):
        keep(beside(a, bonds.axes, lane), history.a, group * LANES + lane)


def _sum_tile(bonds, history, state, sweep, has_failure_forces, group, f):  # type: ignore[no-untyped-def]
    if not has_room(bonds, history):
        return NO_ROOM
    failure_forces = sweep.next_v  # of bonds that soften or break: their place is free until the tile is advanced
    motion = SiteMotion(sweep.u, sweep.v, True, sweep.dt, sweep.step, failure_forces, state.dissipated)
    place = bonds.margin + group * ROW
    if not has_failure_forces[group]:
        for lane in range(0, ROW, across(sweep.u)):
            keep(zeros(sweep.u, bonds.axes), failure_forces, place + lane)
    for lane in range(0, ROW, across(sweep.u)):
        status, sums = sum_lanes(bonds, history, motion, group, lane)
        keep(sums, f, lane)
        if status != UNAGED:
            has_failure_forces[group] = True
        if status == UNDONE:
            return NO_MEMORY
    if has_failure_forces[group]:
        has_failure_forces[group] = False
        for axis in range(len(f)):
            for lane in range(ROW):
                f[axis, lane] += failure_forces[axis, place + lane]
    return READY


@in_tiles(_sum_tile)
def sum_group(bonds, history, state, sweep, has_failure_forces, group, f):  # type: ignore[no-untyped-def]
    """Fill the force densities f (d, lanes) on a group, N/m^3; bonds over their limit break.

    Returns READY, or what the group waits for: nothing has changed then but what is done again.
    """
    return READY  # never asked for


@in_tiles(lambda bonds: False)
def never_waits(bonds):  # type: ignore[no-untyped-def]
    """Whether no group waits, so that some lanes may move before others are summed."""
    return True


@in_tiles(lambda bonds, history, sweep, group, lane: zeros(sweep.u, bonds.axes))  # never asked for
def sum_of_lanes(bonds, history, sweep, group, lane):  # type: ignore[no-untyped-def]
    """The force densities on lanes of a group that never waits, from `lane` on, N/m^3; bonds over their limit break."""
    motion = BlockMotion(sweep.u, sweep.previous_u, sweep.step, bonds.scratch[0])
    return sum_lanes(bonds, history, motion, group, lane)[1]


def _add_second_forces_to_tiles(bonds, history, state, sweep, has_failure_forces):  # type: ignore[no-untyped-def]
    motion = SiteMotion(sweep.u, sweep.v, True, sweep.dt, sweep.step, sweep.next_v, state.dissipated)
    end = first = history.used[0]
    while first > 0 and history.bonds[first - 1, 0] == sweep.step - 1:
        first -= 1
    for n in range(first, end):
        tile = history.places[n, 0] // ROW
        if not has_failure_forces[tile]:
            has_failure_forces[tile] = True
            place = bonds.margin + tile * ROW
            sweep.next_v[:, place : place + ROW] = 0
        pull_again(bonds, motion, history, n)


@in_tiles(_add_second_forces_to_tiles, INNER)
def add_second_release_forces(bonds, history, state, sweep, has_failure_forces):  # type: ignore[no-untyped-def]
    """Begin the sums of the thread's groups with the second forces of bonds that broke one step ago."""
    # in blocks, lanes look at their bonds
