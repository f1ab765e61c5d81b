"""Velocity Verlet, or forward Euler of a content, on a device, to the same bits as on the processor.

State and conditions stay there between records.
The host computes the factors of profiles of some steps at a time, and reads the state only in `synchronize`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, Entries, put_loads
from pdsolve.device.nodes import AT_ONCE, Factors, NodesOnDevice
from pdsolve.device.source import declare, preamble, text_of
from pdsolve.lattice.layout import LANES
from pdsolve.state import State
from pdsolve.stepper import Stepper

STARTS, ENDS = 1, 2  # phases of the kernel
MOTION_ARRAYS = "before", "u", "after", "rate", "rate_after", "a"


class StepsOnDevice(Stepper):
    """Takes steps on a device; the state on the host is that of the last `synchronize`; it may be changed then."""

    def __init__(
        self,
        bonds: NodesOnDevice,
        state: State,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64],
    ) -> None:
        """`state` is placed on the device; `rho` (n,) is the density, kg/m^3, or the volume of nodes with a content,
        `dt` the step, s, and `damping` (n,) that of free components, 1/s.

        Raises ModelError for a device with too little memory, or whose compiler refuses the kernel.
        """
        operator = self._operator = bonds
        self._state, self._drive = state, drive
        self.session, self._ahead, self._last, self._dt = operator.session, False, 0, dt
        self.device_name = self.session.about.name.strip()
        self.session.expect_countable(operator.dimension * operator.room)
        self._nodes = np.union1d(drive.loads.node, drive.holds.node)
        hold_order, holds = _sort_entries_by_node(drive.holds, self._nodes)
        self._motion_holds = hold_order[: len(drive.held_force)]  # none of a content
        rows_that_act = np.full(len(rho), -1, dtype=np.int32)
        rows_that_act[self._nodes] = np.arange(len(self._nodes))
        weights = np.concatenate([operator.spread(1 / rho, 1.0), operator.spread(rho, 1.0)])
        arrays = {
            **{name: np.zeros((operator.dimension, operator.room), rho.dtype) for name in MOTION_ARRAYS},
            "weight": weights,
            "damping": operator.spread(damping),
            **{name: np.zeros(operator.room) for name in ("work", "damped")},
            "acts": operator.spread(rows_that_act, -1),
            **{name: drive.force[self._nodes] for name in ("now", "ago_force")},
            **{f"load_{name}": column for name, column in _sort_entries_by_node(drive.loads, self._nodes)[1].items()},
            **{f"hold_{name}": column for name, column in holds.items()},
            **{name: getattr(drive, name)[self._motion_holds] for name in ("held_speed", "held_force")},
        }
        self._buffers = self.session.upload(arrays)
        defines = [f"#define {name}" for name in (*operator.scheme, *(("DAMPED",) if damping.any() else ()))]
        lines = [preamble(rho.dtype.name, operator.dimension, operator.together), *defines, operator.source()]
        program = self.session.build("\n".join([*lines, declare("MOTION", arrays), text_of("steps.cl")]))
        self._kernel = program.advance
        operator.take_kernels(program)
        is_first_order = "FIRST_ORDER" in operator.scheme
        self._load_moment, self._value_buffer = (-1, "a") if is_first_order else (0, "u")
        moments = ((-1, 0.0), (0, 0.0), (0, 0.0)) if is_first_order else ((0, 0.0), (1, 0.0), (1, dt / 2))
        self._factors = Factors(self.session, drive.profiles, dt, moments)

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1; returns the last one. Raises DeviceLostError."""
        if end_step <= first_step:
            return end_step - 1
        operator, write, buffers = self._operator, self.session.write, self._buffers
        if not self._ahead:  # the device has not the state of the host
            operator.hand_over()
            self.session.finish()
            for buffer, values in self._buffers_with_host_arrays():
                write(buffer, operator.spread(values))
            for name in ("now", "ago_force"):
                write(buffers[name], self._drive.force[self._nodes])
            write(buffers["held_force"], self._drive.held_force[self._motion_holds])
        self._ahead, steps, self._last = True, end_step - first_step, end_step - 1
        for sweep in range(steps + 1):
            if sweep % AT_ONCE == 0:
                if sweep > 0:
                    operator.fetch(first_step + sweep - 2)  # there is room for so many breaks
                self._factors.write(first_step + sweep - 1, min(AT_ONCE, steps + 1 - sweep))
            phase = STARTS * (sweep == 0) + ENDS * (sweep == steps)
            step = first_step + sweep - 1
            if not phase & STARTS and operator.needs_host(buffers["u"], step):
                for name, values in (("u", self._state.value), ("rate", self._state.rate)):
                    self._download_buffer(buffers[name], values)
                operator.break_bonds_on_host(buffers["u"], self._state, step, self._dt)
            numbers = np.int32(self._factors.count), np.int32(self._drive.varies), np.float64(self._dt)
            last = (np.int32(number) for number in (operator.room, step, phase, sweep % AT_ONCE))
            arguments = [*operator.buffers.values(), *buffers.values(), self._factors.buffer, *numbers, *last]
            self.session.launch(
                self._kernel, (operator.room // operator.together, LANES // operator.together), arguments
            )
            self._rotate_buffers("after", "u", "before")
            self._rotate_buffers("rate", "rate_after")
        # The last sweep wrote no displacements, or amounts that the next start writes anew
        self._rotate_buffers("before", "u", "after")
        self.session.finish()
        return end_step - 1

    def _rotate_buffers(self, *names: str) -> None:
        """Give each of these buffers the next one's name, and the last one that of the first."""
        buffers = [self._buffers[name] for name in names]
        self._buffers.update(zip((*names[1:], names[0]), buffers, strict=True))

    def _download_buffer(self, buffer: Any, state_array: NDArray[Any]) -> None:
        """Enter a buffer in an array of the state."""
        wide = np.empty((*state_array.shape[1:], self._operator.room), dtype=state_array.dtype)
        self.session.read(buffer, wide)
        state_array[:] = wide[..., self._operator.place].T

    def _buffers_with_host_arrays(self) -> list[tuple[Any, NDArray[Any]]]:
        """Buffers, and the arrays of the state that they are."""
        state, buffers = self._state, self._buffers | {"dissipated": self._operator.buffers["dissipated"]}
        names = {"a": state.second, self._value_buffer: state.value, "rate": state.rate}
        names |= {"dissipated": state.dissipated, "work": state.work, "damped": state.damped}
        return [(buffers[name], values) for name, values in names.items()]

    def synchronize(self) -> None:
        """Bring the state on the host, and the history of bonds, up to the device's. Raises DeviceLostError."""
        if not self._ahead:
            return
        drive = self._drive
        for buffer, values in self._buffers_with_host_arrays():
            self._download_buffer(buffer, values)
        forces = np.empty(len(drive.held_force))
        self.session.read(self._buffers["held_force"], forces)
        drive.held_force[self._motion_holds] = forces
        if drive.varies:
            put_loads(drive, (self._last + self._load_moment) * self._dt)
        self._operator.fetch(self._last)
        self._ahead = False


def _sort_entries_by_node(
    entries: Entries, nodes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]]]:
    """Order of entries by these nodes (k,), ascending, those of a node in their own order; and the columns so, with the
    first entry (k + 1,) of each node."""
    order = np.argsort(entries.node, kind="stable")
    first = np.searchsorted(entries.node[order], np.append(nodes, np.iinfo(np.int64).max)).astype(np.int32)
    columns = {name: getattr(entries, name)[order].astype(np.int32) for name in ("axis", "profile", "kind")}
    return order, {"first": first, "value": entries.value[order].astype(float), **columns}
