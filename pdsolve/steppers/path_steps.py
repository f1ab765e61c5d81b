"""Steps along the equilibrium path of a body whose bonds soften; see `pdsolve.steppers.path_following`.

The first step is elastic, up to the first bond at its peak. Each further step spends a prescribed energy, less where it
takes many iterations. The work of loads and holds follows from the trapezoidal rule, independently of the balance, so
that work = strain + spent checks the bookkeeping. Units are a plate's, by metre of thickness; in space N and J.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.graphs import tree_of
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, put_loads
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.ground_supports import grounded
from pdsolve.operators.protocol import Operator
from pdsolve.operators.softening_bonds import Response, SofteningBonds
from pdsolve.state import Broken, State
from pdsolve.stepper import LoadStepProgress
from pdsolve.steppers.contact_method import append_contact_pairs, solve_until_contact_converges
from pdsolve.steppers.cracks_at_no_fail_bonds import describe_crack_at_no_fail_bonds
from pdsolve.steppers.equilibrium import NotConvergedError
from pdsolve.steppers.path_control import DissipationControl, OpeningControl, PathControl
from pdsolve.steppers.path_following import (
    FEW,
    FIRST,
    GROWTH,
    LEAST,
    NEAR,
    STEADY,
    PathFollower,
    PathPoint,
    PathSolution,
    ProportionalLoads,
)
from pdsolve.steppers.path_stepper import REACHED, PathStepper
from pdsolve.steppers.rigid_body_modes import find_loose_bodies

Array = NDArray[np.float64]

CRACK_STEPS = 80  # of dissipation in which a crack would go through the body's smallest extent
COARSEST = 1e-6  # tolerance of residuals: path steps are not solved better
SECANTS = 20  # iterations with which a step that does not converge begins again
PATIENT = 300  # likewise, after the least step, where bonds alike all over a body turn in circles under tangents
NEVER = -1  # turning bonds among which those go over to tangents
COARSER = 8.0  # times: what the largest step is divided by, up to three times, where even these find no rest
PARTS = 20  # in which loads that do not grow are put on where bonds soften under them
SMALL = 1e-3  # of the loads: the first look at an elastic body
ALIKE = 3.0  # times: steps of dissipation that one parabola may go through


class SofteningPathSteps(PathStepper):
    """Takes path steps with the bonds of an operator, whose history it keeps up to date."""

    description = "path following with factors"

    def __init__(
        self,
        model: Model,
        operator: Operator,
        drive: Drive,
        area: Array,
        bonds: SofteningBonds,
        contact: RestingContact | None = None,
    ) -> None:
        """Profiles of the drive go from 0 to 1 s; `operator` has the bonds. Raises ModelError for a body without
        supports."""
        super().__init__(model, drive, area)
        self._operator, self._bonds, constrained = operator, bonds, self._held
        d = model.grid.dimension
        joined = operator.bonds(at_start=True)
        if contact is not None:
            joined = append_contact_pairs(joined, contact)
        self._contact = contact
        supported = constrained | grounded(model, drive.force.shape[1])
        loose_bodies = find_loose_bodies(model.grid.position, model.grid.ids, joined, supported[:, :d])
        if loose_bodies.description:
            raise ModelError(f"{model.name}: $.conditions: {loose_bodies.description}; add supports")
        static = model.settings.run.static
        control: PathControl = DissipationControl(bonds)
        for gap in model.settings.run.gaps:
            if gap.name == static.control:
                first, second = tree_of(model.grid.position).query(np.array(gap.ends))[1].tolist()
                control = OpeningControl(gap.name, model.grid.position, (first, second))
                break
        self._follower = PathFollower(
            bonds, ProportionalLoads(constrained, self._start, self._growth), max(static.tolerance, COARSEST), control
        )
        # The largest step along a path: m of the gap that controls it, or J/m that bonds spend
        steps = static.load_steps or CRACK_STEPS
        if static.opening is None:
            extent = float(np.ptp(model.grid.position, axis=0).min() + model.grid.delta.min())
            cost = min(material.G0 for material in model.materials)
            self._most = float(cost * extent ** (d - 1) / steps)
        else:
            self._most = static.opening / steps
        self._whole = self._most * steps  # of the control
        self._opening = np.inf if static.opening is None else static.opening  # m, of the gap that controls, in the end
        self._more = FIRST * self._most
        self._last = PathPoint(np.zeros(constrained.shape), 0.0, 0.0)
        self._before = PathPoint(np.zeros(constrained.shape), 0.0, 0.0)
        self._pushed = np.zeros(constrained.shape), np.zeros(constrained.shape)  # loads and reactions there, N/m
        self._told = False  # of bonds that must not break where a crack would pass

    def checkpoint_arrays(self) -> dict[str, Array]:
        """The path so far, for a checkpoint."""
        return (
            super().checkpoint_arrays()
            | {
                "path_value": self._last.displacement,
                "path_before": self._before.displacement,
                "path_pushed": np.array(self._pushed),
                "path_numbers": np.array([*self._last[1:], *self._before[1:], self._more, self._follower.largest]),
            }
            | self._follower.checkpoint_arrays()
        )

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`, with the history that its operator has. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._pushed = tuple(entry(checkpoint, "path_pushed", (2, *self._held.shape), float).copy())
        value, before = (entry(checkpoint, f"path_{name}", self._held.shape, float) for name in ("value", "before"))
        factor, spent, earlier, less, self._more, self._follower.largest = entry(
            checkpoint, "path_numbers", (6,), float
        ).tolist()
        self._last, self._before = PathPoint(value.copy(), factor, spent), PathPoint(before.copy(), earlier, less)
        self._bonds.restore(self._operator.checkpoint_arrays(), self._operator.broken())
        self._follower.restore(checkpoint)

    def _finished_path_share(self) -> float:
        """How much of the path is done: of the factor, or of the control until a crack is through, the larger."""
        factor = max((path_step.load_factor for path_step in self.step_results), default=0.0)
        return min(max(factor, self._control_value(self._last) / self._whole), 1.0)

    def _take_path_step(self, state: State, step: int) -> None:
        if self._contact is not None:
            self._contact.begin(state)
            self._follower.reference = None  # contact is not part of it
        try:
            self._follower.begin_step(self._last.displacement)
            new, iterations, residual = (
                self._solve_first_path_step(state) if not self.step_results else self._advance_to_next_equilibrium(step)
            )
        except NotConvergedError as error:
            raise NotConvergedError(f"{self._model.name}: path step {step}: {error}") from None
        response = self._bonds.respond(new.displacement)
        after = self._loads_and_reactions(new, response)
        work = work_of_last_path_step((self._before, self._last, new), (*self._pushed, after)).sum(axis=1)
        self._pushed = self._pushed[1], after
        self._bonds.kappa[:] = response.kappa
        self._before, self._last = self._last, new
        state.value[:] = new.displacement
        state.work[:] += work / self._area
        self._store_history_and_reactions(state, step, response)
        self._record_step(step, iterations, residual, new.load_factor, after, new.energy_or_arc_length)
        message = (
            None if self._told else describe_crack_at_no_fail_bonds(self._model, self._bonds, self._last.displacement)
        )
        if message is not None:  # a crack arrives at bonds that do not break
            self._told = True
            said = f"{self._model.name}: path step {step}: {message}"
            warnings.warn(said, ModelWarning, stacklevel=2)

    def _solve_first_path_step(self, state: State) -> PathSolution:
        """Elastic, or as far as what does not grow where bonds soften under this alone."""
        start, bonds, k = self._last, self._bonds, self._bonds.breaks
        if not self._follower.drive.constant_part.any():
            return self._load_until_first_bond_peaks(start)
        with suppress(NotConvergedError):
            path_point = self._find_equilibrium_at_load_factor(start, 0.0)
            if not (bonds.stretches(path_point[0].displacement)[k] >= bonds.peak[k]).any():
                return self._load_until_first_bond_peaks(path_point[0])
        full_drive, count = self._follower.drive, 0
        try:
            for part in range(1, PARTS + 1):
                share = part / PARTS
                self._follower.drive = full_drive._replace(
                    constant_part=share * full_drive.constant_part,
                    proportional_part=np.zeros_like(full_drive.proportional_part),
                )
                new, more, residual = self._find_equilibrium_at_load_factor(self._last, 0.0)
                count += more
                if part == PARTS:
                    break
                response = self._bonds.respond(new.displacement)
                after = self._loads_and_reactions(new, response)
                state.work[:] += ((self._pushed[1] + after) / 2 * (new.displacement - self._last.displacement)).sum(
                    axis=1
                ) / self._area
                self._pushed, self._bonds.kappa[:], self._last = (self._pushed[1], after), response.kappa, new
        except NotConvergedError as error:
            raise NotConvergedError(f"under {share:.0%} of what does not grow: {error}") from None
        finally:
            self._follower.drive = full_drive
        self._before = self._last
        return new, count, residual

    def _load_until_first_bond_peaks(self, start_point: PathPoint) -> PathSolution:
        """Up to the first bond at its peak, or to the end of the loads."""
        bonds, k = self._bonds, self._bonds.breaks
        peak, first = bonds.peak[k], bonds.stretches(start_point.displacement)[k]
        current_point, factor = start_point, SMALL
        for _ in range(3):
            near, count, residual = self._find_equilibrium_at_load_factor(current_point, factor)
            rate = (bonds.stretches(near.displacement)[k] - first) / (factor - start_point.load_factor)
            grows = rate > 0
            reach = ((peak - first)[grows] / rate[grows]).min(initial=1.0)
            if np.isfinite(self._opening):
                opened = self._control_value(near) - self._control_value(start_point)
                if not opened > 0:
                    said = f"{self._follower.control.description} {opened:.3g} m under growing loads"
                    raise NotConvergedError(f"{said}; use a gap that grows")
                left = self._opening - self._control_value(start_point)
                reach = min(reach, left / opened * (near.load_factor - start_point.load_factor))
            current_point, factor = near, min(float(start_point.load_factor + reach), 1.0)
        path_point = self._find_equilibrium_at_load_factor(current_point, factor)
        self.finished, self.end_reason = (True, REACHED) if factor == 1.0 else (False, "")
        self._end_at_final_opening(path_point[0])
        return path_point[0], count + path_point[1], max(residual, path_point[2])

    def _control_value(self, point: PathPoint) -> float:
        return self._follower.control.control_value(point.displacement, point.energy_or_arc_length)

    def _end_at_final_opening(self, point: PathPoint) -> None:
        """End the path where the gap that controls is as wide as it is to be."""
        if self._control_value(point) > self._opening - NEAR * self._most:
            self.finished, self.end_reason = True, "the opening is reached"

    def _find_equilibrium_at_load_factor(self, near_point: PathPoint, load_factor: float) -> PathSolution:
        return solve_until_contact_converges(
            self._contact,
            lambda: self._follower.solve_at_load_factor(
                near_point.displacement, load_factor, self._make_progress_callback(0)
            ),
            self._follower.relative_residual,
        )

    def _advance_to_next_equilibrium(self, step: int) -> PathSolution:
        """A step of dissipation, as large as it converges."""
        iterations, last, secants = 0, self._last, 0
        self._more = min(self._more, max(self._opening - self._control_value(last), LEAST * self._most))
        while True:
            guess, done = None, self._control_value(last) - self._control_value(self._before)
            if self._more < 2 * GROWTH * done and self._more >= LEAST * self._most:
                share = self._more / done
                ahead = last.displacement + share * (last.displacement - self._before.displacement)
                guess = PathPoint(ahead, last.load_factor + share * (last.load_factor - self._before.load_factor), 0.0)
            steady = NEVER if secants == PATIENT else STEADY
            follow = partial(
                self._follower.solve_at_control_increment,
                last,
                guess,
                self._more,
                self._make_progress_callback(step),
                secants,
                steady,
            )
            try:
                new, count, residual = solve_until_contact_converges(
                    self._contact, follow, self._follower.relative_residual
                )
                break
            except NotConvergedError as error:
                secants = self._choose_secant_iterations_for_retry(secants, error)
        if count <= FEW:
            self._more = min(self._more * GROWTH, self._most)
        if new.load_factor > 1:
            try:
                new, more, residual = self._find_equilibrium_at_load_factor(last, 1.0)
                count += more
                self.end_reason = REACHED
            except NotConvergedError:
                self.end_reason = "the path turns round beyond the loads"
            self.finished = True
        self._end_at_final_opening(new)
        return new, iterations + count, residual

    def _choose_secant_iterations_for_retry(self, secant_iterations: int, error: NotConvergedError) -> int:
        """Secants to begin the step again with, after it did not converge with so many; sets how much more is spent.

        Raises the error where nothing is left to try.
        """
        if secant_iterations < PATIENT and self._more >= LEAST * self._most:
            self._more, secant_iterations = (self._more, SECANTS) if not secant_iterations else (self._more / 2, 0)
        elif np.isfinite(self._opening):
            said = f"the gap '{self._model.settings.run.static.control}' does not grow along the path"
            raise NotConvergedError(f"{said}; use one that does, or no run.static.control") from None
        elif secant_iterations < PATIENT:
            self._more, secant_iterations = self._most, PATIENT
        elif self._more > self._most / COARSER**3:
            self._more /= COARSER
        else:
            raise error
        return secant_iterations

    def _loads_and_reactions(self, point: PathPoint, response: Response) -> Array:
        """Loads and reactions (n, d), N/m."""
        return np.where(
            self._held,
            -self._bonds.forces(response),
            self._follower.drive.loads_and_displacements_at(point.load_factor),
        )

    def _store_history_and_reactions(self, state: State, step: int, response: Response) -> None:
        """Store reactions and the history of bonds, and book the energy of those that are gone."""
        bonds, drive, factor = self._bonds, self._drive, self._last.load_factor
        put_loads(drive, factor)
        inner = bonds.forces(response) / self._area[:, None]
        drive.held_force[:] = (inner + drive.force)[drive.holds.node, drive.holds.axis]
        drive.before[:] = drive.force
        old = self._operator.broken()
        is_broken = np.isfinite(bonds.limit) & (bonds.kappa >= bonds.limit)
        k = np.flatnonzero(is_broken)
        source = np.concatenate([bonds.source[k], bonds.target[k]])
        target = np.concatenate([bonds.target[k], bonds.source[k]])
        was_broken = np.isin(source * len(self._area) + target, old.source * len(self._area) + old.target)
        half = np.tile(bonds.dissipated_energy(bonds.kappa)[k], 2) / 2
        new = ~was_broken
        state.dissipated[:] += np.bincount(source[new], half[new] / self._area[source[new]], len(self._area))
        broken = Broken(
            np.concatenate([old.step, np.full(int(new.sum()), step)]),
            np.concatenate([old.source, source[new]]),
            np.concatenate([old.target, target[new]]),
        )
        soft = np.flatnonzero((bonds.kappa > 0) & ~is_broken)
        worst = {
            "worst": np.tile(bonds.kappa[soft], 2),
            "worst_source": np.concatenate([bonds.source[soft], bonds.target[soft]]),
            "worst_target": np.concatenate([bonds.target[soft], bonds.source[soft]]),
        }
        self._operator.restore(worst, broken)

    def _make_progress_callback(self, step: int) -> Callable[[int, float], None]:
        def report_iteration(iterations: int, residual: float) -> None:
            if self.on_progress is not None:
                self.on_progress(LoadStepProgress(step, iterations, residual, len(self._operator.broken().step)))

        return report_iteration


def work_of_last_path_step(
    three_points: tuple[PathPoint, PathPoint, PathPoint], external_forces: tuple[Array, Array, Array]
) -> Array:
    """Work (n, d), J/m, of forces (n, d) from the second place to the third, all quadratic in the spent energy.

    By Simpson's rule, exact for these; by the trapezoidal rule next to a much longer or shorter step.
    """
    (first, last, new), (f0, f1, f2) = three_points, external_forces
    back = last.energy_or_arc_length - first.energy_or_arc_length
    ahead = new.energy_or_arc_length - last.energy_or_arc_length
    if not ALIKE * ahead > back > ahead / ALIKE:
        return np.asarray((f1 + f2) / 2 * (new.displacement - last.displacement))
    steep = ahead / back
    # The bend of a parabola through the three places
    bend = (new.displacement - last.displacement) - steep * (last.displacement - first.displacement)
    bow = (f2 - f1) - steep * (f1 - f0)
    # So that u = u1 + t (u2 - u1) - t (1 - t) bend, t from 0 to 1
    bend, bow = bend / (1 + 1 / steep), bow / (1 + 1 / steep)
    way = new.displacement - last.displacement
    middle = (f1 + f2) / 2 - bow / 4
    return np.asarray((f1 * (way - bend) + 4 * middle * way + f2 * (way + bend)) / 6)
