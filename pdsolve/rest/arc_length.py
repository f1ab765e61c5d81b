"""Elastic bodies along their equilibrium path by its arc length: through snap-through and snap-back.

A step goes from the last equilibrium along the tangent of the path, and returns to the path in the plane normal to that
(E. Riks, Int. J. Solids Struct. 15 (1979) 529-551; `pdsolve.rest.corrector`). Nothing breaks: the path ends where
the first bond reaches its limit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.static_breakage import Breaking
from pdsolve.conditions import Drive, put_loads
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.rest.controls import ArcLengthControl, PathPoint, PathSolution
from pdsolve.rest.corrector import Aim, Corrector, OperatorBody
from pdsolve.rest.equilibrium import NotConvergedError, force_densities, norm
from pdsolve.rest.factors import Factors, FreeComponents
from pdsolve.rest.path import CRACK_STEPS, REACHED, CorrectedPathSteps
from pdsolve.state import State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

FEW = 4  # iterations: a step that needs no more grows by
GROWTH = 1.5
LONGEST, LEAST = 4.0, 1e-4  # of the first step: longer ones are not taken, and shorter ones not tried
PAST = 0.02  # of the limit of a bond, by which the path goes past it at most
BENT = 0.5  # of a step, by which the path leaves its tangent at most


class ArcLengthSteps(CorrectedPathSteps):
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
        super().__init__(model, operator, drive, area)
        self._breaking = bond_breaking
        self._remember = on_equilibrium
        self._flows = has_plastic_flow
        self._free = FreeComponents(~self._held)
        self._steps = model.settings.run.static.load_steps or CRACK_STEPS

    def _finished_path_share(self) -> float:
        """How much of the path is done: of the loads."""
        return min(max((path_step.load_factor for path_step in self.step_results), default=0.0), 1.0)

    def _take_path_step(self, state: State, step: int) -> None:
        new, iterations, residual = self._advance_to_next_equilibrium(state, step)
        put_loads(self._drive, new.load_factor)
        inside = self._area[:, None] * force_densities(self._operator, state)
        after = np.where(self._held, -inside, self._start + new.load_factor * self._growth)  # loads and reactions, N/m
        self._go_to(new, after, state)
        state.rate[:] = state.second[:] = 0
        if new.load_factor == 1:
            self.finished, self.end_reason = True, REACHED
        self._remember(state)
        drive, node, axis = self._drive, self._drive.holds.node, self._drive.holds.axis
        drive.held_force[:] = (drive.force - after / self._area[:, None])[node, axis]
        drive.before[:] = drive.force
        dissipated_energy = float(self._area @ (state.dissipated + self._operator.energies(state)[1]))
        self._record_step(step, iterations, residual, new.load_factor, after, dissipated_energy)
        if self._largest_bond_overload(state) > 0:
            self.finished, self.end_reason = True, "a bond has reached its limit"

    def _advance_to_next_equilibrium(self, state: State, step: int) -> PathSolution:
        """The next equilibrium, as far along the path as it converges; the state is there then."""
        last, begins = self._last, len(self.step_results) <= bool(self._start.any())
        body = OperatorBody(self._operator, self._area, state)
        corrector = Corrector(body, self._loads, self._tolerance, self._solve, has_plastic_flow=self._flows)
        corrector.largest = self._largest
        report_progress = self._make_progress_callback(step)
        if not self.step_results and self._start.any():
            new, count, residual = corrector.find_equilibrium(last, None, report_progress)
            self._largest = corrector.largest
            return self._add_arc_length(new), count, residual
        if self._flows and not begins:
            way, turned = last.displacement - self._before.displacement, last.load_factor - self._before.load_factor
            size = norm(way)
        else:
            # The derivative of the displacements by the factor
            way = corrector.displacement_by_load_factor(body.tangent(body.respond(last.displacement)))
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
                aim = Aim(ArcLengthControl(1 / size * way), last, self._more)
                new, count, residual = corrector.find_equilibrium(guess, aim, report_progress)
                new = new._replace(energy_or_arc_length=guess.energy_or_arc_length)
                if not norm(new.displacement - guess.displacement) < BENT * self._more:
                    raise NotConvergedError("the path bends within the shortest step")
                if new.load_factor >= 1:  # the loads end between the last equilibrium and this one
                    ahead = (1 - last.load_factor) / (new.load_factor - last.load_factor)
                    near = PathPoint(last.displacement + ahead * (new.displacement - last.displacement), 1.0, 0.0)
                    new, more, residual = corrector.find_equilibrium(near, None, report_progress)
                    new, count = self._add_arc_length(new), count + more
                    if not norm(new.displacement - near.displacement) < BENT * self._more:
                        raise NotConvergedError("the path bends within the shortest step")
                if self._largest_bond_overload(state) > 1 + PAST:
                    raise NotConvergedError("a bond passes its limit within the shortest step")
                break
            except NotConvergedError:
                state.value[:], corrector.largest, self._more = last.displacement, self._largest, self._more / 2
                if self._more < LEAST * self._most:
                    raise
        self._largest = corrector.largest
        self._more = min((GROWTH if count <= FEW else 1.0) * self._more, LONGEST * self._most)
        return new, count, residual

    def _largest_bond_overload(self, state: State) -> float:
        """How far over its limit a bond is: its load by that at which it breaks; 0 if none is."""
        return 0.0 if self._breaking is None else self._breaking.worst(state.value)

    def _add_arc_length(self, point: PathPoint) -> PathPoint:
        """A point with the length of the path as far as there, along a straight line from the last one."""
        length = norm(point.displacement - self._last.displacement)
        return point._replace(energy_or_arc_length=self._last.energy_or_arc_length + length)

    def _solve(self, matrix: csr_array, right_sides: Array, guess: Array | None) -> Array:
        """Solutions (f, r) with new factors, as all components change from one iteration to the next."""
        return Factors(matrix, self._free, self._operator.symmetric).solve_approximately(right_sides)
