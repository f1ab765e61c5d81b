"""Forward Euler: surely stable up to 1 / max of what leaves a node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.medium import Medium
from pdsolve.diffusion.conditions import BoundaryConditions
from pdsolve.diffusion.corrected import Corrected
from pdsolve.diffusion.dissolution import State, potential
from pdsolve.diffusion.listed import BondList
from pdsolve.diffusion.operator import Operator


class Euler:
    """Steps of `time_step` (s) for what an operator and conditions do."""

    name = "forward Euler"

    def __init__(self, operator: Operator, done: BoundaryConditions, medium: Medium, time_step: float) -> None:
        self._operator, self._done, self._medium, self._dt = operator, done, medium, time_step
        self._held = np.flatnonzero(~done.free)
        self._supplied = bool(done.supplied) or bool(done.exchange.any())
        self._kinetic = medium.dissolution == "kinetic"
        self._rate, self._supply = (np.zeros(len(operator.volume)) for _ in range(2))

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        done, volume, rate, supply = self._done, self._operator.volume, self._rate, self._supply
        for step in range(first, last):
            even = potential(self._medium, state.content)
            self._rates(state, even)
            state.books[0] += self._dt * float((volume[self._held] * rate[self._held]).sum())
            if self._supplied:
                done.supply((step - 1) * self._dt, supply)
                supply -= done.exchange * even
                state.books[1] += self._dt * float((volume * supply).sum())
                rate += supply
            rate *= self._dt
            np.add(state.content, rate, out=state.content)
            done.hold(state.content, step * self._dt)
            if self._kinetic:
                state.solid[state.content <= (self._medium.C_sat or 0.0)] = 0

    def _rates(self, state: State, even: NDArray[np.float64]) -> None:
        medium = self._medium
        if self._kinetic and isinstance(self._operator, BondList | Corrected):
            C_sat = (medium.C_sat or 0.0) if medium.capped else np.inf
            self._operator.dissolve(even, state.solid, C_sat, medium.k_diss, self._rate)
        else:
            self._operator.rates(even, self._rate)


def bound(operator: Operator, done: BoundaryConditions, medium: Medium) -> float:
    """The longest step that is surely stable, s; infinite without links."""
    faster = max(1.0, medium.k_diss) if medium.dissolution == "kinetic" else 1.0
    most = float((faster * operator.total + done.exchange)[done.free].max(initial=0.0))
    return 1 / most if most > 0 else float("inf")
