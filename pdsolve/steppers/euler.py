"""Forward Euler: explicit, first order. Sources act from the beginning of a step, prescribed values at its end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, prescribe_values, put_loads
from pdsolve.operators.ghosts import Ghosts
from pdsolve.operators.protocol import Operator
from pdsolve.state import State
from pdsolve.stepper import Stepper


class ForwardEuler(Stepper):
    """Forward Euler with any operator of one unknown of first order and one component."""

    name = "forward Euler"

    def __init__(self, operator: Operator, drive: Drive, time_step: float, ghosts: Ghosts | None = None) -> None:
        """Steps of `time_step`, s; `ghosts` get their values from other ranks."""
        self._operator, self._drive, self._dt, self._ghosts = operator, drive, time_step, ghosts
        self._change = np.zeros(len(drive.force))

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last one."""
        drive, dt, constrained_nodes = self._drive, self._dt, self._drive.holds.node
        value, rate, source = state.value[:, 0], state.rate[:, 0], drive.force[:, 0]
        for step in range(first_step, end_step):
            if self._ghosts is not None:
                self._ghosts.receive_values(state.value.T)
            rate[:] = 0
            self._operator.accumulate_force(state, state.rate, step, dt)
            state.dissipated[constrained_nodes] += dt * rate[constrained_nodes]
            if drive.varies:
                put_loads(drive, (step - 1) * dt)
            if len(drive.loads.node):
                state.work[:] += dt * source
                rate += source
            value += np.multiply(rate, dt, out=self._change)
            prescribe_values(drive, value, step * dt)
        return end_step - 1


def stable_time_step(operator: Operator, free: NDArray[np.bool_]) -> float:
    """The longest step without overshoot at any of the `free` nodes (n,), s; infinite without neighbours."""
    most = float((operator.stiffness_bound() / 2)[free].max(initial=0.0))
    return 1 / most if most > 0 else float("inf")
