"""An implicit step: theta of the flux at the end of the step, the rest at its beginning.

With dissolution by enthalpy, the potential min(H, C_sat) has a kink; Newton's method iterates until it has found the
nodes below it. The amounts booked are those that flowed along the bonds, so that masses balance to round-off regardless
of the tolerance of the equations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, constrained_components, prescribe_values, put_loads
from pdsolve.errors import UnstableError
from pdsolve.operators.protocol import FluxOperator
from pdsolve.rest.factors import factorize
from pdsolve.state import State
from pdsolve.stepper import Stepper

TOLERANCE = 1e-12  # of the right-hand side
ITERATIONS, MOST = 60, 10_000  # of Newton's method, of conjugate gradients

Solve = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class ThetaSteps(Stepper):
    """Implicit steps with an operator whose rates are linear in a potential."""

    def __init__(self, operator: FluxOperator, drive: Drive, time_step: float, theta: float, factor_once: bool) -> None:
        """Steps of `time_step`, s, with weight `theta` on their ends and 1 - theta on their beginnings.

        `factor_once`: the equations are the same in all steps and few enough for an LU factorization; otherwise
        conjugate gradients solve them.
        """
        self._operator, self._drive, self._dt, self._theta = operator, drive, time_step, theta
        self.name = "backward Euler" if theta == 1 else f"implicit steps (theta {theta:g})"
        self._free, self._factored = ~constrained_components(drive)[:, 0], factor_once
        self._factors: Solve | None = None
        self._out = np.zeros(len(self._free))

    def discard_factors(self) -> None:
        """Factor the equations anew, as the operator has changed."""
        self._factors = None

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last one.

        Raises UnstableError if the equations do not converge.
        """
        drive, dt, theta, free = self._drive, self._dt, self._theta, self._free
        content, source = state.value[:, 0], drive.force[:, 0]
        for step in range(first_step, end_step):
            before = content.copy()
            put_loads(drive, (step - 1) * dt)
            rate = self._compute_rates_and_add_flows(state, before, 1 - theta, step)
            fixed = before + dt * (1 - theta) * (rate + source)
            put_loads(drive, step * dt)
            fixed += dt * theta * source
            prescribe_values(drive, content, step * dt)
            end_content = self._solve_end_content(state, fixed, step)
            rate = self._compute_rates_and_add_flows(state, end_content, theta, step)
            content[free] = (fixed + dt * theta * rate)[free]
            state.rate[:, 0] = (content - before) / dt
        return end_step - 1

    def _compute_rates_and_add_flows(
        self, state: State, content: NDArray[np.float64], step_share: float, step: int
    ) -> NDArray[np.float64]:
        """Rates (n,) at these contents (n,), of which a share of the step is booked, and so are the sources."""
        out, weight = np.zeros((len(content), 1)), step_share * self._dt
        self._operator.accumulate_force(state._replace(value=content[:, None]), out, step, weight)
        state.dissipated[:] += np.where(self._free, 0.0, weight * out[:, 0])
        state.work[:] += weight * self._drive.force[:, 0]
        return out[:, 0]

    def _compute_rates_at_potential(self, potential: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rates (n,) at these potentials (n,), valid until the next call."""
        self._out[:] = 0
        self._operator.rates(potential, self._out)
        return self._out

    def _solve_end_content(self, state: State, right_side: NDArray[np.float64], step: int) -> NDArray[np.float64]:
        """Contents (n,) at the end of a step that solve H - theta dt rates(H) = `right_side`, from those of a state
        on."""
        operator, free, weight, content = self._operator, self._free, self._dt * self._theta, state.value[:, 0]
        for _ in range(ITERATIONS):
            follows = free & operator.follows(content)
            residual = right_side - content + weight * self._compute_rates_at_potential(operator.potential(content))
            residual[~free] = 0
            change = np.where(follows, self._solve_linear_content_change(state, follows, residual), residual)
            if not np.array_equal(follows, free):
                along = weight * self._compute_rates_at_potential(np.where(follows, change, 0.0))
                change += np.where(free & ~follows, along, 0.0)
            content = np.asarray(content + change)
            if np.array_equal(follows, free & operator.follows(content)):
                return content
        raise UnstableError(
            f"step {step}: Newton's method did not end in {ITERATIONS} iterations; use a smaller time step"
        )

    def _solve_linear_content_change(
        self, state: State, changes_with_potential: NDArray[np.bool_], right_side: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Change (n,) of the nodes whose potential follows for the right-hand side `right_side` (n,), 0 elsewhere."""
        volume, weight = self._operator.volume, self._dt * self._theta
        right_side = np.where(changes_with_potential, volume * right_side, 0.0)
        if self._factored:
            if self._factors is None:  # for the free nodes, reused for all steps
                from scipy.sparse import diags_array

                all_volumes, keep = diags_array(volume), diags_array(self._free.astype(float))
                tangent = self._operator.tangent(state)
                self._factors = factorize(all_volumes + weight * (keep @ all_volumes @ tangent @ keep))
            return self._factors(right_side)

        def multiply_by_matrix(change: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.where(
                changes_with_potential, volume * (change - weight * self._compute_rates_at_potential(change)), 0.0
            )

        return solve_by_conjugate_gradients(
            multiply_by_matrix, right_side, volume * (1 + weight * self._operator.stiffness_bound() / 2)
        )


def solve_by_conjugate_gradients(
    multiply_by_matrix: Solve, right_side: NDArray[np.float64], diagonal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solution x (n,) of A x = `right_side` by conjugate gradients, for a symmetric positive definite A.

    `diagonal` (n,) is that of A. Sums are numpy's, not those of a threaded library, so that results are reproducible
    to the bit. Raises UnstableError.
    """
    solution, residual = np.zeros_like(right_side), right_side.copy()
    ahead = residual / diagonal
    along, gain = ahead.copy(), float((residual * ahead).sum())
    aim = TOLERANCE * float((right_side * right_side).sum()) ** 0.5
    for _ in range(MOST):
        if float((residual * residual).sum()) ** 0.5 <= aim:
            return solution
        image = multiply_by_matrix(along)
        way = gain / float((along * image).sum())
        solution += way * along
        residual -= way * image
        ahead = residual / diagonal
        gain, before = float((residual * ahead).sum()), gain
        along = ahead + gain / before * along
    raise UnstableError(f"conjugate gradients did not end in {MOST} iterations; use smaller steps")
