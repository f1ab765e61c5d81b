"""Cracks of particles along their path of equilibria, with their length as the control.

In each step the tips with the largest share of what lets them grow grow by a particle each, and one factor of loads and
prescribed displacements is found with which the largest share is 1 again, whether it rises or falls (snap-back). The
shares are of intensities with the size of sqrt(J E'), over the toughness, or by the rule "stress" of the stress ahead,
over the strength. They are proportional to the factor in a linear body; the secant method finds the factor of others.
The first step is elastic.

Between two equilibria displacements are linear, and the forces of the bonds that a new arm cuts fall to zero: a crack
takes the energy that these bonds held, and the work that their mean forces do on its faces (G. R. Irwin, J. Appl. Mech.
24 (1957) 361-364). Loads do the work of their mean, too. Both are exact in a linear body, and neither follows from the
balance, so that work = strain + spent checks the bookkeeping.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, put_loads
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import Equilibrium, NotConvergedError, force_densities
from pdsolve.rest.growing_cracks import CrackedBodySnapshot, CrackGrowth, EvaluatedTip, stress_intensities_of_tips
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.rest.path import REACHED, PathStepper
from pdsolve.state import Broken, State

Array = NDArray[np.float64]

SMALL = 1e-3  # of the loads: the first look at an elastic body
ALIKE = 1e-3  # of the largest share: tips this near to it grow together
CLOSED = 1e-6  # share of a tip that loads press shut: they are doubled until one opens
NEAR = 1e-6  # of the share that lets a tip grow, by which the largest may be missed
TRIES = 12  # factors that are tried in a step
STEP_BACK = 0.99  # of a factor: the second one tried where loads do not grow in proportion


class NoGrowingTipError(NotConvergedError):
    """No crack can go on: the path ends there."""


class CrackLengthSteps(PathStepper):
    """Takes steps of a particle of the tips that are next, with load steps whose bonds do not break."""

    def __init__(
        self, model: Model, operator: Operator, drive: Drive, area: Array, load_steps: LoadSteps, growth: CrackGrowth
    ) -> None:
        super().__init__(model, operator, drive, area)
        self._motion, self._cracks = load_steps, growth
        self.inner = load_steps
        self.description = f"crack length as the control, {load_steps.method.description}"

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """The path so far, and what load steps keep, which take none by themselves, for a checkpoint."""
        return super().checkpoint_arrays() | self._motion.checkpoint_arrays()

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._motion.restore(checkpoint, state, 0, broken)

    def _finished_path_share(self) -> float:
        """How much of the path is done: of its steps, or of the loads."""
        return max(
            len(self.step_results) / self._model.settings.run.steps,
            *(path_step.load_factor for path_step in self.step_results),
            0.0,
        )

    def _take_path_step(self, state: State, step: int) -> None:
        self._motion.method.discard_reused_tangent()
        path_point = (
            self._grow_tips_and_rescale_loads(state, step)
            if self.step_results
            else self._load_until_first_tip_grows(state, step)
        )
        if path_point is None:
            return
        equilibrium, factor, cost = path_point
        dissipated_energy = cost + (self.step_results[-1].dissipated_energy if self.step_results else 0.0)
        after = self._area[:, None] * self._motion.loads_and_reactions(state, self._drive.force.astype(float))
        self._record_step(step, equilibrium.iterations, equilibrium.residual, factor, after, dissipated_energy)

    def _load_until_first_tip_grows(self, state: State, step: int) -> tuple[Equilibrium, float, float]:
        """Loads up to the first tip that grows; books their work."""
        load = np.zeros(self._drive.force.shape)

        def solve_equilibrium_at_load_factor(factor: float) -> Equilibrium:
            equilibrium = self._motion.solve_equilibrium_at_time_and_add_work(state, load.copy(), step, factor)
            load[:] = self._drive.force
            return equilibrium

        first = 0.0
        if self._start.any():
            solve_equilibrium_at_load_factor(0.0)
            first = self._largest_intensity_to_toughness_ratio(state)
            if first >= 1:
                raise NotConvergedError(f"a tip has {first:.3g} of what lets it grow under what does not change")
        previous_point, factor = (0.0, first), SMALL
        iterations = solve_equilibrium_at_load_factor(factor).iterations
        while factor < 1 and (share := self._largest_intensity_to_toughness_ratio(state)) < CLOSED:
            previous_point, factor = (factor, share), min(2 * factor, 1.0)
            iterations += solve_equilibrium_at_load_factor(factor).iterations
        equilibrium, factor = self._find_load_factor_of_tip_growth(
            state, previous_point, factor, solve_equilibrium_at_load_factor
        )
        return equilibrium._replace(iterations=iterations + equilibrium.iterations), factor, 0.0

    def _grow_tips_and_rescale_loads(self, state: State, step: int) -> tuple[Equilibrium, float, float] | None:
        """Let the tips that are next grow, and find the factor that goes with it; books what they take, J/m.

        None: no crack can go on, and all is as before.
        """
        growth, operator, motion, last = self._cracks, self._operator, self._motion, self.step_results[-1]
        checkpoint, value, area = CrackedBodySnapshot.capture(state, operator, growth), state.value.copy(), self._area
        outside = motion.loads_and_reactions(state, self._drive.force.astype(float))
        inside = force_densities(operator, state)
        dissipated_energy = float(area @ state.dissipated)
        held_force = self._drive.held_force.copy()
        start = last.load_factor if not self._start.any() else STEP_BACK * last.load_factor
        try:
            evaluated_tips = growth.evaluate_tips(state)
            shares = self._intensity_to_toughness_ratios(evaluated_tips)
            # Tips that go straight on to what is ahead of them; or else those with the largest share
            tips = [tip for tip in evaluated_tips if tip[1].straight] or [
                tip for tip, share in zip(evaluated_tips, shares, strict=True) if share > (1 - ALIKE) * shares.max()
            ]
            if not growth.grow_tips_and_cut_bonds(tips, state, step):
                raise NoGrowingTipError("no crack goes on")
            cut = inside - force_densities(operator, state)  # forces of the bonds that are gone
            motion.raise_if_a_body_lacks_supports()
            previous_point = (0.0, 0.0)
            if self._start.any():
                motion.solve_equilibrium_at_time(state, step, start)
                previous_point = start, self._largest_intensity_to_toughness_ratio_or_raise(state)
            equilibrium, factor = self._find_load_factor_of_tip_growth(
                state, previous_point, last.load_factor, lambda at: motion.solve_equilibrium_at_time(state, step, at)
            )
        except NoGrowingTipError as error:
            checkpoint.restore(state, operator, growth)
            put_loads(self._drive, last.load_factor)
            self._drive.held_force[:], self._drive.before[:] = held_force, self._drive.force
            self.finished, self.end_reason = True, str(error)
            return None
        way, outside_now = state.value - value, motion.loads_and_reactions(state, self._drive.force.astype(float))
        state.work[:] += ((outside + outside_now) / 2 * way).sum(axis=1)
        state.dissipated[:] -= (cut * way).sum(axis=1) / 2
        return equilibrium, factor, float(area @ state.dissipated) - dissipated_energy

    def _find_load_factor_of_tip_growth(
        self,
        state: State,
        previous_load_factor_and_ratio: tuple[float, float],
        load_factor: float,
        solve_equilibrium_at_load_factor: Callable[[float], Equilibrium],
    ) -> tuple[Equilibrium, float]:
        """Bring the body to rest where the largest share is 1, or at the end of the loads; from a factor and the share
        there, and the next factor to try. Returns how it settled, and the factor."""
        iterations = 0
        for _ in range(TRIES):
            equilibrium = solve_equilibrium_at_load_factor(load_factor)
            iterations += equilibrium.iterations
            share = self._largest_intensity_to_toughness_ratio_or_raise(state)
            if abs(share - 1) < NEAR or (load_factor == 1 and share < 1):
                if load_factor == 1:
                    self.finished, self.end_reason = True, REACHED
                return Equilibrium(iterations, equilibrium.residual), load_factor
            slope = (share - previous_load_factor_and_ratio[1]) / (load_factor - previous_load_factor_and_ratio[0])
            if not slope > 0:
                raise NotConvergedError(f"a tip has {share:.3g} of what lets it grow, and no more under larger loads")
            previous_load_factor_and_ratio = (load_factor, share)
            load_factor = min(load_factor + (1 - share) / slope, 1.0)
        raise NotConvergedError(f"no loads let a tip grow after {TRIES} tries")

    def _intensity_to_toughness_ratios(self, evaluated_tips: list[EvaluatedTip]) -> Array:
        """Shares (k,) of what lets tips grow; 0 of those that stay, or go straight on to what is ahead of them."""
        toughness = np.array([self._cracks.toughness(tip) for tip, _ in evaluated_tips])
        moves = np.array([bool(verdict.angles) and not verdict.straight for _, verdict in evaluated_tips])
        return np.asarray(np.where(moves, stress_intensities_of_tips(self._cracks, evaluated_tips) / toughness, 0.0))

    def _largest_intensity_to_toughness_ratio(self, state: State) -> float:
        """The largest share; 0 where no tip may go on."""
        return float(self._intensity_to_toughness_ratios(self._cracks.evaluate_tips(state)).max(initial=0.0))

    def _largest_intensity_to_toughness_ratio_or_raise(self, state: State) -> float:
        """The largest share. Raises NoGrowingTipError where no tip may go on."""
        share = self._largest_intensity_to_toughness_ratio(state)
        if not share > 0:
            raise NoGrowingTipError("no tip is opened by the loads, with room for intensities around it")
        return share
