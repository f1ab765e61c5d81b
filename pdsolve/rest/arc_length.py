"""Elastic bodies along their equilibrium path by its arc length: through snap-through and snap-back.

Displacements and the factor of loads and prescribed displacements are unknown together. A step goes from the last
equilibrium along the tangent of the path, and returns to the path in the plane normal to that (E. Riks, Int. J. Solids
Struct. 15 (1979) 529-551):

    K a = R,  K b = p,  d lambda = (ds - t (u - u_n) - t a) / (t b),  du = a + d lambda b

with K the consistent tangent, N/m^2, R the residual forces, N/m, p their derivative by the factor lambda at fixed u, b
the derivative of the displacements, t its unit vector at u_n and ds the step, m; norms are over components. Nothing
breaks: the path ends where the first bond reaches its limit. Units are a plate's; in space forces are in N.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.static_breakage import Breaking
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, put_loads
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.rest.continuation import CRACK_STEPS, work_of_last_path_step
from pdsolve.rest.controls import PathPoint, PathSolution
from pdsolve.rest.equilibrium import NotConvergedError, area_weighted_tangent, force_densities, norm
from pdsolve.rest.factors import factorize
from pdsolve.rest.path import REACHED, PathStepper
from pdsolve.state import Broken, State
from pdsolve.stepper import LoadStepProgress

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

MOST = 12  # iterations; a step that needs more is halved
FEW = 4  # iterations: a step that needs no more grows by
GROWTH = 1.5
LONGEST, LEAST = 4.0, 1e-4  # of the first step: longer ones are not taken, and shorter ones not tried
COARSEST = 1e-6  # tolerance of residuals: path steps are not solved better
PAST = 0.02  # of the limit of a bond, by which the path goes past it at most
BENT = 0.5  # of a step, by which the path leaves its tangent at most


class ArcLengthSteps(PathStepper):
    """Takes steps of arc length with any operator whose bonds do not break."""

    end_load_share = 0.0
    description = "arc length as the control, Newton's method with factors"

    def __init__(
        self,
        model: Model,
        operator: Operator,
        drive: Drive,
        area: Array,
        bond_breaking: Breaking | None,
        on_equilibrium: Callable[[State], None] = lambda state: None,
        has_plastic_flow: bool = False,
    ) -> None:
        """`bond_breaking` knows the limits of bonds, if there are any, `on_equilibrium` is called at each equilibrium.

        The tangent of a solid that flows is elastic at an equilibrium that it has reached. Its path goes on in the
        direction of its last step.
        """
        super().__init__(model, drive, area)
        self._operator = operator
        self._breaking = bond_breaking
        self._remember = on_equilibrium
        self._flows = has_plastic_flow
        self._free = np.flatnonzero(~self._held.ravel())
        static, shape = model.settings.run.static, self._held.shape
        self._tolerance = max(static.tolerance, COARSEST)
        self._steps = static.load_steps or CRACK_STEPS
        self._largest = 0.0  # N/m, norm of the forces from outside so far: the measure of residuals
        self._most = self._more = 0.0  # m, the first step and the next one
        self._last = PathPoint(np.zeros(shape), 0.0, 0.0)  # with arc lengths, as the one before
        self._before = PathPoint(np.zeros(shape), 0.0, 0.0)
        self._pushed = np.zeros(shape), np.zeros(shape)  # loads and reactions there, N/m

    def checkpoint_arrays(self) -> dict[str, Array]:
        """The path so far, for a checkpoint."""
        numbers = [*self._last[1:], *self._before[1:], self._more, self._most, self._largest]
        values = {"path_value": self._last.displacement, "path_before": self._before.displacement}
        return (
            super().checkpoint_arrays()
            | values
            | {"path_pushed": np.array(self._pushed), "path_numbers": np.array(numbers)}
        )

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._pushed = tuple(entry(checkpoint, "path_pushed", (2, *self._held.shape), float).copy())
        value, before = (entry(checkpoint, f"path_{name}", self._held.shape, float) for name in ("value", "before"))
        factor, length, earlier, less, *rest = entry(checkpoint, "path_numbers", (7,), float).tolist()
        self._last, self._before = PathPoint(value.copy(), factor, length), PathPoint(before.copy(), earlier, less)
        self._more, self._most, self._largest = rest

    def _finished_path_share(self) -> float:
        """How much of the path is done: of the loads."""
        return min(max((path_step.load_factor for path_step in self.step_results), default=0.0), 1.0)

    def _take_path_step(self, state: State, step: int) -> None:
        try:
            new, iterations, residual = self._advance_to_next_equilibrium(state, step)
        except NotConvergedError as error:
            raise NotConvergedError(f"{self._model.name}: path step {step}: {error}") from None
        put_loads(self._drive, new.load_factor)
        inside = self._area[:, None] * force_densities(self._operator, state)
        after = np.where(self._held, -inside, self._start + new.load_factor * self._growth)  # loads and reactions, N/m
        work = work_of_last_path_step((self._before, self._last, new), (*self._pushed, after)).sum(axis=1)
        self._pushed, self._before, self._last = (self._pushed[1], after), self._last, new
        state.work[:] += work / self._area
        state.rate[:] = state.second[:] = 0
        if new.load_factor == 1:
            self.finished, self.end_reason = True, REACHED
        self._remember(state)
        drive, node, axis = self._drive, self._drive.holds.node, self._drive.holds.axis
        drive.held_force[:] = (drive.force - after / self._area[:, None])[node, axis]
        drive.before[:] = drive.force
        spent = float(self._area @ (state.dissipated + self._operator.energies(state)[1]))
        self._record_step(step, iterations, residual, new.load_factor, after, spent)
        if self._largest_bond_overload(state) > 0:
            self.finished, self.end_reason = True, "a bond has reached its limit"

    def _advance_to_next_equilibrium(self, state: State, step: int) -> PathSolution:
        """The next equilibrium, as far along the path as it converges; the state is there then."""
        last, largest, begins = self._last, self._largest, len(self.step_results) <= bool(self._start.any())
        if not self.step_results and self._start.any():
            return self._find_equilibrium_at_load_factor(state, last.displacement, 0.0, step)
        if self._flows and not begins:
            way, turned = last.displacement - self._before.displacement, last.load_factor - self._before.load_factor
            size = norm(way)
        else:
            # The derivative of the displacements by the factor
            way = self._displacement_derivative_by_load_factor(*self._compute_and_factorize_tangent(state))
            size = norm(way)
            turned = -1.0 if not begins and (way * (last.displacement - self._before.displacement)).sum() < 0 else 1.0
            way *= turned
        self._most = self._most or size / self._steps
        self._more = self._more or self._most
        while True:
            share = self._more / size
            guess = PathPoint(
                last.displacement + share * way,
                last.load_factor + share * turned,
                last.energy_or_arc_length + self._more,
            )
            try:
                new, count, residual = self._solve_from_guess(state, guess, 1 / size * way, step)
                if not norm(new.displacement - guess.displacement) < BENT * self._more:
                    raise NotConvergedError("the path bends within the shortest step")
                if new.load_factor >= 1:  # the loads end between the last equilibrium and this one
                    ahead = (1 - last.load_factor) / (new.load_factor - last.load_factor)
                    near = last.displacement + ahead * (new.displacement - last.displacement)
                    new, more, residual = self._find_equilibrium_at_load_factor(state, near, 1.0, step)
                    count += more
                    if not norm(new.displacement - near) < BENT * self._more:
                        raise NotConvergedError("the path bends within the shortest step")
                if self._largest_bond_overload(state) > 1 + PAST:
                    raise NotConvergedError("a bond passes its limit within the shortest step")
                break
            except NotConvergedError:
                state.value[:], self._largest, self._more = last.displacement, largest, self._more / 2
                if self._more < LEAST * self._most:
                    raise
        self._more = min((GROWTH if count <= FEW else 1.0) * self._more, LONGEST * self._most)
        return new, count, residual

    def _largest_bond_overload(self, state: State) -> float:
        """How far over its limit a bond is: its load by that at which it breaks; 0 if none is."""
        return 0.0 if self._breaking is None else self._breaking.worst(state.value)

    def _find_equilibrium_at_load_factor(
        self, state: State, start_displacement: Array, load_factor: float, step: int
    ) -> PathSolution:
        """The equilibrium at a factor, from displacements (n, w) near it."""
        last = self._last.displacement
        value = np.where(self._held, self._start + load_factor * self._growth, start_displacement)
        new, count, residual = self._solve_from_guess(state, PathPoint(value, load_factor, 0.0), None, step)
        return (
            new._replace(energy_or_arc_length=self._last.energy_or_arc_length + norm(new.displacement - last)),
            count,
            residual,
        )

    def _solve_from_guess(self, state: State, guess: PathPoint, plane_normal: Array | None, step: int) -> PathSolution:
        """The equilibrium in the plane through a guess with a unit normal (n, w), or at its factor.

        The state is there then. Raises NotConvergedError.
        """
        value, factor, constrained = guess.displacement.copy(), guess.load_factor, self._held
        for iteration in range(MOST + 1):
            state.value[:] = value
            inside = self._area[:, None] * force_densities(self._operator, state)
            loads = self._start + factor * self._growth
            rest, outside = (inside + loads)[~constrained], max(norm(loads[~constrained]), norm(inside[constrained]))
            scale = max(self._largest, outside)
            residual = norm(rest) / scale if scale > 0 else float(norm(rest) > 0)
            if self.on_progress is not None:
                self.on_progress(LoadStepProgress(step, iteration, residual, 0))
            if residual < self._tolerance:
                self._largest = scale
                return PathPoint(value, factor, guess.energy_or_arc_length), iteration, residual
            if not np.isfinite(residual) or iteration == MOST:
                break
            matrix, solve = self._compute_and_factorize_tangent(state)
            move, turn = np.zeros(constrained.shape), 0.0
            move.ravel()[self._free] = solve(rest)
            if plane_normal is not None:
                b = self._displacement_derivative_by_load_factor(matrix, solve)
                turn = -float((plane_normal * (move + value - guess.displacement)).sum()) / float(
                    (plane_normal * b).sum()
                )
                move += turn * b
            value, factor = value + move, factor + turn
        raise NotConvergedError(
            f"no equilibrium on the path after {iteration} iterations (residual {residual:.2g}; tolerance"
            f" {self._tolerance:g} of the external forces)"
        )

    def _displacement_derivative_by_load_factor(
        self, tangent: csr_array, solve_free: Callable[[Array], Array]
    ) -> Array:
        way = np.where(self._held, self._growth, 0.0)
        pushed = np.where(self._held, 0.0, self._growth).ravel() - tangent @ way.ravel()
        way.ravel()[self._free] = solve_free(pushed[self._free])
        return way

    def _compute_and_factorize_tangent(self, state: State) -> tuple[csr_array, Callable[[Array], Array]]:
        """The tangent (n w, n w) of a state, N/m^2, and what solves with its free part."""
        free, matrix = ~self._held.ravel(), area_weighted_tangent(self._operator, self._area, state)
        try:
            return matrix, factorize(matrix[free][:, free], self._operator.symmetric)
        except RuntimeError:
            raise NotConvergedError("the tangent is singular") from None
