"""Velocity Verlet on a device, to the same bits as on the processor: state and conditions stay there between records.

The host computes the factors of profiles of some steps at a time, and reads the state only in `download_state`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, Entries, put_loads
from pdsolve.operators.device.blocks import BlocksOnDevice
from pdsolve.operators.device.factors import AT_ONCE, Factors
from pdsolve.operators.device.families import FamiliesOnDevice
from pdsolve.operators.device.source import preamble, text_of
from pdsolve.operators.device.space import SpaceOnDevice
from pdsolve.operators.simd_lattice.kernel import LANES
from pdsolve.state import State

OnDevice = BlocksOnDevice | SpaceOnDevice | FamiliesOnDevice
STARTS, ENDS = 1, 2  # phases of the kernel


class _EntriesByNode(NamedTuple):
    """Entries of loads or holds, by the nodes on which anything acts."""

    entry_order: NDArray[np.int64]  # (e,) of the entries
    first_entry_of_node: NDArray[np.int32]  # (rows + 1,) entries of a node


class VerletOnDevice:
    """Takes steps on a device; the state on the host is that of the last `download_state`; it may be changed then."""

    def __init__(
        self,
        bonds_state_drive: tuple[OnDevice, State, Drive],
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64],
    ) -> None:
        """`bonds_state_drive` are bonds, the placed state, and conditions; `rho` (n,) is the density, kg/m^3, `dt` the
        step, s, and `damping` (n,) that of free components, 1/s.

        Raises ModelError for a device with too little memory, or whose compiler refuses the kernel.
        """
        self._operator, self._state, self._drive = bonds_state_drive
        operator = bonds_state_drive[0]
        self._dt = dt
        self.session, self._ahead, self._last = operator.session, False, 0
        count, kind = operator.dimension * operator.room, rho.dtype
        self.session.expect_countable(count)
        room, drive, size = operator.room, self._drive, kind.itemsize
        motion, nodal = 6 * [size * count], [2 * size * room, *3 * [8 * room], 4 * room]
        conditions = [*7 * [8 * len(drive.loads.node)], *7 * [8 * len(drive.holds.node)]]
        self.session.room_for(*motion, *nodal, *conditions)
        defines = [f"#define {name}" for name in (*operator.scheme, *(("DAMPED",) if damping.any() else ()))]
        first = preamble(kind.name, operator.dimension, operator.together)
        program = self.session.build("\n".join([first, *defines, operator.source(), text_of("verlet.cl")]))
        self._kernel = program.advance
        if isinstance(operator, FamiliesOnDevice):
            operator.take_passes(program)
        to_device, none = self.session.put, np.zeros(count, dtype=kind)
        self._u, self._v, self._a = (
            [to_device(none) for _ in range(3)],
            [to_device(none) for _ in range(2)],
            to_device(none),
        )
        weight = np.concatenate([operator.spread(1 / rho, 1.0), operator.spread(rho, 1.0)])
        self._weight, self._damping = to_device(weight), to_device(operator.spread(damping))
        self._work, self._damped = (to_device(np.zeros(operator.room)) for _ in range(2))
        self._upload_conditions()

    def _upload_conditions(self) -> None:
        """Put loads and holds on the device, by the nodes on which they act."""
        drive, operator, to_device = self._drive, self._operator, self.session.put
        nodes = np.union1d(drive.loads.node, drive.holds.node)
        acts = np.full(operator.room, -1, dtype=np.int32)
        acts[operator.rows(nodes)] = np.arange(len(nodes))
        self._nodes, self._acts = nodes, to_device(acts)
        self._now, self._ago = (to_device(drive.force[nodes]) for _ in range(2))
        loads, self._holds = _group_entries_by_node(drive.loads, nodes), _group_entries_by_node(drive.holds, nodes)
        self._load = [to_device(loads.first_entry_of_node), *_upload_entry_columns(drive.loads, loads, to_device)]
        self._hold = [
            to_device(self._holds.first_entry_of_node),
            *_upload_entry_columns(drive.holds, self._holds, to_device),
        ]
        self._hold.append(to_device(drive.holds.kind[self._holds.entry_order].astype(np.int32)))
        self._speed, self._force = (
            to_device(column[self._holds.entry_order]) for column in (drive.held_speed, drive.held_force)
        )
        self._factors = Factors(self.session, drive.profiles, self._dt, ((0, 0.0), (1, 0.0), (1, self._dt / 2)))

    def advance(self, state: State, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises DeviceLostError."""
        if end_step <= first_step:
            return
        if not self._ahead:  # the device has not the state of the host
            operator, write, drive = self._operator, self.session.write, self._drive
            operator.hand_over()
            self.session.finish()
            for buffer, values in self._buffers_with_host_arrays():
                write(buffer, operator.spread(values))
            for buffer in (self._now, self._ago):
                write(buffer, drive.force[self._nodes])
            write(self._force, drive.held_force[self._holds.entry_order])
        self._ahead, steps, self._last = True, end_step - first_step, end_step - 1
        for sweep in range(steps + 1):
            if sweep % AT_ONCE == 0:
                if sweep > 0:
                    self._operator.fetch(first_step + sweep - 2)  # there is room for so many breaks
                self._factors.write(first_step + sweep - 1, min(AT_ONCE, steps + 1 - sweep))
            phase = STARTS * (sweep == 0) + ENDS * (sweep == steps)
            self._launch_step(first_step + sweep - 1, phase, sweep % AT_ONCE)
        self._u = [self._u[2], *self._u[:2]]  # the last sweep wrote no displacements
        self.session.finish()

    def _launch_step(self, step: int, phase: int, profile_factor_row: int) -> None:
        operator, drive = self._operator, self._drive
        before, now, after = self._u
        if (
            isinstance(operator, FamiliesOnDevice)
            and not phase & STARTS
            and (operator.sum_families(now) or operator.pulls_again(step))
        ):
            for buffer, values in ((now, self._state.value), (self._v[0], self._state.rate)):
                self._download_buffer(buffer, values)
            operator.fail(now, self._state, step, self._dt)
        motion = before, now, after, *self._v, self._a, self._weight, self._damping, self._work, self._damped
        acting = self._acts, self._now, self._ago, *self._load, *self._hold, self._speed, self._force
        numbers = np.int32(self._factors.count), np.int32(drive.varies), np.float64(self._dt)
        last = (np.int32(number) for number in (operator.room, step, phase, profile_factor_row))
        arguments = [*operator.arguments, *motion, *acting, self._factors.buffer, *numbers, *last]
        self.session.launch(self._kernel, (operator.room // operator.together, LANES // operator.together), arguments)
        self._u, self._v = [now, after, before], self._v[::-1]

    def _download_buffer(self, buffer: Any, state_array: NDArray[Any]) -> None:
        """Enter a buffer in an array of the state."""
        wide = np.empty((*state_array.shape[1:], self._operator.room), dtype=state_array.dtype)
        self.session.read(buffer, wide)
        self._operator.collected(wide, state_array)

    def _buffers_with_host_arrays(self) -> list[tuple[Any, NDArray[Any]]]:
        """Buffers, and the arrays of the state that they are."""
        state = self._state
        motion = (self._u[1], state.value), (self._v[0], state.rate), (self._a, state.second)
        booked = (self._operator.dissipated, state.dissipated), (self._work, state.work), (self._damped, state.damped)
        return [*motion, *booked]

    def download_state(self) -> None:
        """Bring the state on the host, and the history of bonds, up to the device's. Raises DeviceLostError."""
        if not self._ahead:
            return
        operator, drive = self._operator, self._drive
        for buffer, values in self._buffers_with_host_arrays():
            self._download_buffer(buffer, values)
        forces = np.empty(len(drive.held_force))
        self.session.read(self._force, forces)
        drive.held_force[self._holds.entry_order] = forces
        if drive.varies:
            put_loads(drive, self._last * self._dt)
        operator.fetch(self._last)
        self._ahead = False


def _group_entries_by_node(entries: Entries, nodes: NDArray[np.int64]) -> _EntriesByNode:
    """Entries by these nodes (k,), in ascending order; those of a node in their own order."""
    order = np.argsort(entries.node, kind="stable")
    first = np.searchsorted(entries.node[order], np.append(nodes, np.iinfo(np.int64).max))
    return _EntriesByNode(order, first.astype(np.int32))


def _upload_entry_columns(entries: Entries, by_node: _EntriesByNode, to_device: Any) -> list[Any]:
    """Axes, values and profiles of entries on the device."""
    axis, value, profile = (column[by_node.entry_order] for column in (entries.axis, entries.value, entries.profile))
    return [to_device(axis.astype(np.int32)), to_device(value), to_device(profile.astype(np.int32))]
