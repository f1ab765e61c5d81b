"""Nodes on a device: their places there, the buffers of their bonds by name, and the factors of their conditions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.conditions import Profiles, factor_at
from pdsolve.device.runtime import Session
from pdsolve.device.source import declare
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken, State

AT_ONCE = 256  # steps, for which the host computes factors together


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
