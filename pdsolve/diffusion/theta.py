"""An implicit step: theta of the flux at the end of the step, the rest at its beginning.

With dissolution by enthalpy, the potential min(H, C_sat) has a kink; Newton's method iterates until it has found the
nodes below it. The amounts booked are those that flowed along the links, so that masses balance to round-off regardless
of the tolerance of the equations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.diffusion.conditions import BoundaryConditions
from pdsolve.diffusion.dissolution import potential
from pdsolve.diffusion.operator import Fick
from pdsolve.errors import UnstableError
from pdsolve.state import State

FACTORED = 1_000_000  # links; of more, or where the equations change, conjugate gradients find the potentials
TOLERANCE = 1e-12  # of the right-hand side
ITERATIONS, MOST = 60, 10_000  # of Newton's method, of conjugate gradients

Solve = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Theta:
    """Steps of `time_step` (s), with weight theta on their ends and 1 - theta on their beginnings."""

    def __init__(self, operator: Fick, done: BoundaryConditions, time_step: float, theta: float) -> None:
        self._operator, self._done, self._medium = operator.exchange, done, operator.medium
        self._dt, self._theta = time_step, theta
        self.name = "backward Euler" if theta == 1 else f"implicit steps (theta {theta:g})"
        self._factors: Solve | None = None
        self._rate, self._supply = (np.zeros(len(operator.volume)) for _ in range(2))

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place. Raises UnstableError if the equations do not converge."""
        done, dt, theta, C = self._done, self._dt, self._theta, state.value[:, 0]
        for step in range(first, last):
            rate, before = self._gone(C), C.copy()
            self._book(state, rate, (1 - theta), C, (step - 1) * dt)
            fixed = C + dt * (1 - theta) * (rate + self._supply - done.exchange * self._potential(C))
            done.supply(step * dt, self._supply)
            fixed += dt * theta * self._supply
            end = before.copy()
            done.hold(end, step * dt)
            found = self._newton(fixed, end, step)
            rate = self._gone(found)
            C[done.free] = (fixed + dt * theta * (rate - done.exchange * found))[done.free]
            done.hold(C, step * dt)
            state.rate[:, 0] = (C - before) / dt
            self._book(state, rate, theta, found, step * dt)

    def _potential(self, content: NDArray[np.float64]) -> NDArray[np.float64]:
        return potential(self._medium, content)

    def _gone(self, content: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fluxes along links (n,) at these contents or potentials."""
        return self._comes(self._potential(content)).copy()

    def _comes(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fluxes along links (n,) at these potentials (n,), valid until the next call."""
        self._rate[:] = 0
        self._operator.rates(value, self._rate)
        return self._rate

    def _book(
        self, state: State, rate: NDArray[np.float64], share: float, content: NDArray[np.float64], time: float
    ) -> None:
        """Book a share of the step's exchange, and leave the sources at `time` in its place."""
        done = self._done
        done.supply(time, self._supply)
        given = self._supply - done.exchange * self._potential(content)
        state.dissipated[:] += np.where(done.free, 0.0, self._dt * share * rate)
        state.work[:] += np.where(done.free, self._dt * share * given, 0.0)

    def _newton(self, fixed: NDArray[np.float64], guess: NDArray[np.float64], step: int) -> NDArray[np.float64]:
        """Contents (n,) at the end of a step that solve H - theta dt (flux at the potential of H) = `fixed`."""
        free, weight = self._done.free, self._dt * self._theta
        content, most = guess, self._medium.C_sat if self._medium.dissolution == "enthalpy" else None
        for _ in range(ITERATIONS):
            liquid = free if most is None else free & (content < most)
            value = self._potential(content)
            left = fixed - content + weight * (self._even(value))
            left[~free] = 0
            change = left.copy()
            change[liquid] = self._solve(liquid, left)[liquid]
            if most is not None:
                along = np.where(liquid, change, 0.0)
                solid = free & ~liquid
                change[solid] = (left + weight * (self._even(along)))[solid]
            content = np.asarray(content + change)
            if most is None or np.array_equal(liquid, free & (content < most)):
                return content
        raise UnstableError(
            f"step {step}: found no end of Newton's method in {ITERATIONS} iterations, expected one; take a smaller"
            " time step"
        )

    def _even(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Flux into each node (n,) along links and from outside at these potentials (n,)."""
        return np.asarray(self._comes(value) - self._done.exchange * value)

    def _solve(self, liquid: NDArray[np.bool_], right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Change (n,) of the liquid nodes for the right-hand side `right` (n,), 0 elsewhere."""
        if (
            self._medium.C_sat is None and self._operator.count.sum() <= FACTORED
        ):  # the same nodes are free in all steps
            self._factors = self._factors or self._factored(liquid)
            return np.where(liquid, self._factors(right), 0.0)
        volume, weight = self._operator.volume, self._dt * self._theta

        def product(change: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(volume * np.where(liquid, change - weight * self._even(change), 0.0))

        diagonal = volume * (1 + weight * (self._operator.total + self._done.exchange))
        return gradients(product, np.where(liquid, volume * right, 0.0), diagonal)

    def _factored(self, liquid: NDArray[np.bool_]) -> Solve:
        """A solver for the liquid nodes (n,), reused for several steps."""
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import splu

        volume, keep = self._operator.volume, diags_array(liquid.astype(float))
        even = diags_array(volume) @ (self._operator.tangent() - diags_array(self._done.exchange))
        matrix = (diags_array(volume) - self._dt * self._theta * (keep @ even @ keep)).tocsc()
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        found = splu(matrix, **symmetric)
        return lambda right: np.asarray(found.solve(np.where(liquid, volume * right, 0.0)))


def gradients(product: Solve, right: NDArray[np.float64], diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution of `product` x = `right` (n,) by conjugate gradients, for a symmetric positive definite `product`.

    `diagonal` (n,) is its diagonal. Sums are numpy's, not those of a threaded library, so that results are reproducible
    to the bit. Raises UnstableError.
    """
    found, left = np.zeros_like(right), right.copy()
    ahead = left / diagonal
    along, gain = ahead.copy(), float((left * ahead).sum())
    aim = TOLERANCE * float((right * right).sum()) ** 0.5
    for _ in range(MOST):
        if float((left * left).sum()) ** 0.5 <= aim:
            return found
        image = product(along)
        way = gain / float((along * image).sum())
        found += way * along
        left -= way * image
        ahead = left / diagonal
        gain, before = float((left * ahead).sum()), gain
        along = ahead + gain / before * along
    raise UnstableError(f"found no end of conjugate gradients in {MOST} iterations, expected one; take smaller steps")
