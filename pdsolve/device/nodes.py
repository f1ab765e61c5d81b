"""Nodes on a device: their places there, the buffers of their bonds by name, the factors of their conditions; steps.

Steps are velocity Verlet, or forward Euler of a content, to the same bits as on the processor. State and conditions
stay on the device between records. The host computes the factors of profiles of some steps at a time, and reads the
state only in `synchronize`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.conditions import Entries, Profiles, factor_at, put_loads
from pdsolve.device.runtime import Session
from pdsolve.device.source import declare, preamble, text_of
from pdsolve.lattice.layout import LANES
from pdsolve.operators.protocol import CheckpointArrays, Motion
from pdsolve.state import Broken, State
from pdsolve.stepper import Stepper

AT_ONCE = 256  # steps, for which the host computes factors together
STARTS, ENDS = 1, 2  # phases of the kernel
MOTION_ARRAYS = "before", "u", "after", "rate", "rate_after", "a"


class NodesOnDevice:
    """The order of n nodes on a device, which has places for `room` of them, and buffers of their bonds by name."""

    session: Session
    dimension: int
    room: int
    place: slice | NDArray[np.integer]  # of nodes among the places
    scheme: tuple[str, ...] = ()  # of steps, see steps.cl
    together = 1  # nodes that a work item sums
    needs_upload = True  # the history of bonds is another than the device's

    def upload(self, session: Session, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Copy the arrays of bonds to the device. Raises ModelError if it has too little memory."""
        self.session, self.buffers = session, session.upload(arrays)
        self.declarations = declare("FORCE", arrays)

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        super().restore(checkpoint, broken)  # type: ignore[misc]
        self.needs_upload = True

    def march(self, motion: Motion) -> Stepper:
        """Steps on the device."""
        return StepsOnDevice(self, motion)

    def source(self) -> str:
        """What the bonds are in OpenCL C. Raises ModelError for a law that no device computes to the same bits."""
        raise NotImplementedError("written for each law")

    def take_kernels(self, program: Any) -> None:
        """Keep the kernels of a program besides that of a step, if bonds have any."""

    def needs_host(self, u: Any, step: int) -> bool:
        """Whether the host has to look at bonds at these displacements of the device; not where the device breaks
        them."""
        return False

    def break_bonds_on_host(self, u: Any, state: State, step: int, dt: float) -> None:
        """Break the bonds that `needs_host` has told of; `state` is that of the device."""
        raise NotImplementedError("the device breaks these bonds")

    def hand_over(self) -> None:
        """Give the history of bonds, if they have one, to the device, unless it has it."""

    def fetch(self, step: int) -> None:
        """Bring the history of bonds, where it is the device's, up to that of a step."""

    def write(self, name: str, values: NDArray[Any], at: int = 0) -> None:
        """Copy values into the buffer of this name, from the byte `at` on."""
        self.session.write(self.buffers[name], values, at)

    def read(self, name: str, values: NDArray[Any], at: int = 0) -> NDArray[Any]:
        """Copy the buffer of this name, from the byte `at` on, into contiguous values; returns them."""
        self.session.read(self.buffers[name], values, at)
        return values

    def spread(self, values: NDArray[Any], idle: float = 0.0) -> NDArray[Any]:
        """Nodal values (n, ...) in the device's order (..., m)."""
        wide = np.full((*values.shape[1:], self.room), idle, dtype=values.dtype)
        wide[..., self.place] = values.T
        return wide


class Factors:
    """The factors of p profiles at r moments of each step, (AT_ONCE, r, p) in `buffer`."""

    def __init__(self, session: Session, profiles: Profiles, dt: float, moments: tuple[tuple[int, float], ...]) -> None:
        """Moments of a step from 0 on: after so many steps of `dt`, s, less so many s. Raises ModelError for a device
        with too little memory."""
        self.count = max(len(profiles.start) - 1, 1)
        self._session, self._profiles, self._dt = session, profiles, dt
        self._steps, self._less = (np.array(column) for column in zip(*moments, strict=True))
        self._shape = len(moments), self.count
        self.buffer = session.upload({"factors": np.zeros((AT_ONCE, *self._shape))})["factors"]

    def write(self, step: int, steps: int) -> None:
        """Give the device the factors of so many steps from this one on, at most AT_ONCE."""
        table = np.zeros((steps, *self._shape))
        fill(self._profiles, step + self._steps, self._less, self._dt, table)
        self._session.write(self.buffer, table)


@cached_njit(error_model="numpy")
def fill(profiles, begin, less, dt, table):  # type: ignore[no-untyped-def]
    """Put the factors (steps, r, p) of profiles into a table: at begin[r] steps, less so many s, of the first step."""
    for k, r, p in np.ndindex(len(table), len(begin), len(profiles.start) - 1):
        table[k, r, p] = factor_at(profiles, p, (begin[r] + k) * dt - less[r])


class StepsOnDevice(Stepper):
    """Takes steps on a device; the state on the host is that of the last `synchronize`; it may be changed then."""

    def __init__(self, bonds: NodesOnDevice, motion: Motion) -> None:
        """The state of `motion` is placed on the device; it has no ghosts and no contact.

        Raises ModelError for a device with too little memory, or whose compiler refuses the kernel.
        """
        state, drive, rho, dt, damping, *_ = motion
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
