"""Explicit steps by forward Euler."""

from __future__ import annotations

import numpy as np

from pdsolve.diffusion.conditions import BoundaryConditions
from pdsolve.diffusion.dissolution import potential
from pdsolve.diffusion.operator import Fick
from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.state import State


class Euler:
    """Steps of `time_step` (s) with an operator and conditions."""

    name = "forward Euler"

    def __init__(self, operator: Fick, done: BoundaryConditions, time_step: float) -> None:
        self._operator, self._done, self._dt = operator, done, time_step
        self._held = np.flatnonzero(~done.free)
        self._supplied = bool(done.supplied) or bool(done.exchange.any())
        self._supply = np.zeros(len(operator.volume))

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        done, dt, supply = self._done, self._dt, self._supply
        content, rate = state.value[:, 0], state.rate[:, 0]
        for step in range(first, last):
            rate[:] = 0
            self._operator.add(state, state.rate, step, dt)
            state.dissipated[self._held] += dt * rate[self._held]
            if self._supplied:
                done.supply((step - 1) * dt, supply)
                supply -= done.exchange * potential(self._operator.medium, content)
                state.work[:] += dt * supply
                rate += supply
            _advance(content, rate, dt)
            done.hold(content, step * dt)


@cached_njit()
def _advance(content, rate, dt):  # type: ignore[no-untyped-def]
    for i in range(len(content)):
        content[i] += rate[i] * dt


def bound(operator: Fick, done: BoundaryConditions) -> float:
    """The longest step without overshoot of any content, s; infinite without links."""
    most = float((operator.stiffness_bound() / 2 + done.exchange)[done.free].max(initial=0.0))
    return 1 / most if most > 0 else float("inf")
