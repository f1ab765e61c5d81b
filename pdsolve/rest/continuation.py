"""Path following: a body of softening bonds at rest, along its equilibrium path, by the energy that its bonds spend.

All loads and prescribed displacements grow with one factor, lambda. Up to the first bond that softens, lambda is scaled
until that bond is at its peak. From there each step prescribes the energy that bonds spend, which never decreases, and
finds lambda as another unknown, so that snap-backs and snap-throughs are followed (C. V. Verhoosel, J. J. C. Remmers,
M. A. Gutierrez, Int. J. Numer. Meth. Engng 77 (2009) 1290-1321). A monitored opening may take the energy's place.

Units are a plate's, by metre of thickness; in space forces are in N, energies in J, stiffnesses in N/m.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Condition
from pdmesh.model.mechanical_conditions import breakable_setting
from pdmesh.model.neighbours import tree_of
from pdmesh.model.suggestions import called
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, conditions_of, put_loads
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.ground_supports import grounded
from pdsolve.operators.protocol import Operator
from pdsolve.operators.softening_bonds import Response, SofteningBonds
from pdsolve.rest.contact_method import append_contact_pairs, solve_until_contact_stays
from pdsolve.rest.controls import (
    DissipationControl,
    OpeningControl,
    PathControl,
    PathPoint,
    PathSolution,
)
from pdsolve.rest.corrector import MOST, NEAR, Aim, Corrector, Tangents
from pdsolve.rest.equilibrium import NotConvergedError
from pdsolve.rest.factors import Factors, FreeComponents
from pdsolve.rest.modes import find_loose_bodies
from pdsolve.rest.path import CRACK_STEPS, REACHED, CorrectedPathSteps
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array


Array = NDArray[np.float64]

FEW = 5  # iterations: a step that needs no more grows by
GROWTH = 1.4
FIRST = 0.05  # of the largest step of dissipation: the first one
LEAST = 1e-4  # of it: smaller ones are not tried
UNDECIDED = 2  # times that a bond has begun or ceased to load within a step: it gets a mean slope, lest it goes on so
DECIDED = 3  # iterations without another turn, after which it gets its own slope again
STEADY = 3  # bonds that turned in an iteration of secants, at most: tangents converge from there
KEPT = 320  # components with columns from one step to the next, at most: equations of more take as long as new factors
# Of the right sides of an iteration, which its solutions may leave: with 1e-3 a cantilever takes another branch than
# with exact solutions; with 1e-8 the order of nodes changes forces by less than 1e-9
LEFT = 1e-8


class LoadingReversals:
    """How often bonds (b,) have begun or ceased to load within a step."""

    def __init__(self, is_loading: NDArray[np.bool_]) -> None:
        self._loads = is_loading
        self._times = np.zeros(len(is_loading), dtype=int)
        self._since = np.zeros(len(is_loading), dtype=int)

    def update_and_count_reversed_bonds(self, is_loading: NDArray[np.bool_], counts_reversals: bool) -> int:
        """Take those that load in the next iteration, whose turns count or not; returns how many have turned."""
        turned = is_loading != self._loads
        self._times += turned & counts_reversals
        self._since = np.where(turned, 0, self._since + 1)
        self._loads = is_loading
        return int(turned.sum())

    def often_reversing_bonds(self) -> NDArray[np.bool_]:
        """Bonds that load, and turned often and lately."""
        return np.asarray((self._times >= UNDECIDED) & (self._since < DECIDED) & self._loads)


class SofteningTangents(Tangents):
    """Tangents of softening bonds, after secants, which lead from further away, in the first iterations."""

    body: SofteningBonds

    def __init__(
        self, body: SofteningBonds, displacement: Array, secant_iterations: int = 0, max_reversals: int = STEADY
    ) -> None:
        """From displacements (n, w) on. Secants end sooner if no more than `max_reversals` bonds turn in one."""
        super().__init__(body)
        self._secant_iterations, self._max_reversals = secant_iterations, max_reversals
        self._reversals = LoadingReversals(body.respond(displacement).releases > 0)

    def goes_on(self, iteration: int, residual: float, residual_before: float) -> bool:
        """Whether there may be more iterations than so many, counted after the secants."""
        return super().goes_on(iteration - self._secant_iterations, residual, residual_before)

    def matrix(self, response: Response, iteration: int, residual: float) -> csr_array:
        """The tangent, with a mean slope of bonds that turn often, or the secant matrix."""
        count = self._reversals.update_and_count_reversed_bonds(
            response.releases > 0, iteration >= self._secant_iterations
        )
        if count <= self._max_reversals and iteration:
            self._secant_iterations = min(self._secant_iterations, iteration)
        mean = (response.slope + response.secant) / 2
        slope = np.where(self._reversals.often_reversing_bonds(), mean, response.slope)
        return self.body.tangent(response._replace(slope=slope), iteration < self._secant_iterations)


class SofteningFactors:
    """Factors of the tangent of softening bonds at a reference, and solutions with them, for all steps of a path."""

    def __init__(self, bonds: SofteningBonds, constrained: NDArray[np.bool_], keeps_reference: bool) -> None:
        """`keeps_reference`: whether factors stay from one step to the next; those with contact do not."""
        self._bonds, self._free, self._keeps_reference = bonds, FreeComponents(~constrained), keeps_reference
        self._factors = cast("Factors | None", None)
        self._reference: tuple[Array, Array] | None = None  # displacements and history whose tangent has factors

    def begin_step(self, displacement: Array) -> None:
        """Take the factors of the reference, or new ones at these displacements of the last equilibrium.

        Solutions of the step depend on both alone, not on the steps in between.
        """
        tangent = self._bonds.tangent(self._bonds.respond(displacement))
        if self._factors is not None and self._reference is not None:
            changed = self._factors.changed_components(tangent)
            before = self._factors.components
            for components in (np.union1d(before, changed), changed):
                if self._factors.keep_components(components, KEPT):
                    return
        self._factorize(tangent)
        if self._keeps_reference:
            self._reference = displacement.copy(), self._bonds.kappa.copy()

    def solve(self, tangent: csr_array, right_sides: Array, guess: Array | None) -> Array:
        """The solutions (f, r) of free components. Raises NotConvergedError."""
        solution = None if self._factors is None else self._factors.solve(tangent, right_sides, LEFT, guess)
        return self._factorize(tangent).solve_approximately(right_sides) if solution is None else solution

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """The reference, for a checkpoint; empty without one."""
        none, components = (np.zeros((0, self._free.shape[1])), np.zeros(0)), np.zeros(0, dtype=np.int64)
        displacement, history = self._reference or none
        if self._factors is not None and self._reference is not None:
            components = self._factors.components
        return {"reference_value": displacement, "reference_history": history, "reference_components": components}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Restore the reference of a checkpoint. Raises CheckpointError."""
        components = entry(checkpoint, "reference_components", (None,), np.int64, 0, len(self._free.numbers) - 1)
        if not len(entry(checkpoint, "reference_history", (None,), float)):
            return
        value = entry(checkpoint, "reference_value", self._free.shape, float).copy()
        history = entry(checkpoint, "reference_history", self._bonds.kappa.shape, float).copy()
        now, self._bonds.kappa = self._bonds.kappa, history
        factors = self._factorize(self._bonds.tangent(self._bonds.respond(value)))
        self._bonds.kappa, self._reference = now, (value, history)
        factors.add_columns(components)

    def _factorize(self, tangent: csr_array) -> Factors:
        self._factors, self._reference = Factors(tangent, self._free, self._bonds.symmetric), None
        return self._factors


SECANTS = 20  # iterations with which a step that does not converge begins again
PATIENT = 300  # likewise, after the least step, where bonds alike all over a body turn in circles under tangents
NEVER = -1  # turning bonds among which those go over to tangents
COARSER = 8.0  # times: what the largest step is divided by, up to three times, where even these find no rest
PARTS = 20  # in which loads that do not grow are put on where bonds soften under them
SMALL = 1e-3  # of the loads: the first look at an elastic body


class SofteningPathSteps(CorrectedPathSteps):
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
        super().__init__(model, operator, drive, area)
        self._bonds, constrained = bonds, self._held
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
        self._control = control
        self._factors = SofteningFactors(bonds, constrained, contact is None)
        self._corrector = Corrector(bonds, self._loads, self._tolerance, self._factors.solve)
        # The largest step along a path: m of the gap that controls it, or J/m that bonds spend
        steps = static.load_steps or CRACK_STEPS
        if static.opening is None:
            extent = float(np.ptp(model.grid.position, axis=0).min() + model.grid.delta.min())
            cost = model.node_values("G0").min()
            self._most = float(cost * extent ** (d - 1) / steps)
        else:
            self._most = static.opening / steps
        self._whole = self._most * steps  # of the control
        self._opening = np.inf if static.opening is None else static.opening  # m, of the gap that controls, in the end
        self._more = FIRST * self._most
        self._told = False  # of bonds that must not break where a crack would pass

    def checkpoint_arrays(self) -> dict[str, Array]:
        """The path and the reference of its factors, for a checkpoint."""
        self._largest = self._corrector.largest
        return super().checkpoint_arrays() | self._factors.checkpoint_arrays()

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`, with the history that its operator has. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._corrector.largest = self._largest
        self._bonds.restore(self._operator.checkpoint_arrays(), self._operator.broken())
        self._factors.restore(checkpoint)

    def _finished_path_share(self) -> float:
        """How much of the path is done: of the factor, or of the control until a crack is through, the larger."""
        factor = max((path_step.load_factor for path_step in self.step_results), default=0.0)
        return min(max(factor, self._control_value(self._last) / self._whole), 1.0)

    def _take_path_step(self, state: State, step: int) -> None:
        if self._contact is not None:
            self._contact.begin(state)
        self._factors.begin_step(self._last.displacement)
        new, iterations, residual = (
            self._advance_to_next_equilibrium(step) if self.step_results else self._solve_first_path_step(state)
        )
        response = self._bonds.respond(new.displacement)
        after = self._loads_and_reactions(new, response)
        self._bonds.kappa[:] = response.kappa
        state.value[:] = new.displacement
        self._go_to(new, after, state)
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
        if not self._corrector.loads.constant_part.any():
            return self._load_until_first_bond_peaks(start)
        with suppress(NotConvergedError):
            path_point = self._find_equilibrium_at_load_factor(start, 0.0)
            if not (bonds.stretches(path_point[0].displacement)[k] >= bonds.peak[k]).any():
                return self._load_until_first_bond_peaks(path_point[0])
        all_loads, count = self._corrector.loads, 0
        try:
            for part in range(1, PARTS + 1):
                share = part / PARTS
                self._corrector.loads = all_loads._replace(
                    constant_part=share * all_loads.constant_part,
                    proportional_part=np.zeros_like(all_loads.proportional_part),
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
            self._corrector.loads = all_loads
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
                    said = f"{self._control.description} {opened:.3g} m under growing loads"
                    raise NotConvergedError(f"{said}; use a gap that grows")
                left = self._opening - self._control_value(start_point)
                reach = min(reach, left / opened * (near.load_factor - start_point.load_factor))
            current_point, factor = near, min(float(start_point.load_factor + reach), 1.0)
        path_point = self._find_equilibrium_at_load_factor(current_point, factor)
        self.finished, self.end_reason = (True, REACHED) if factor == 1.0 else (False, "")
        self._end_at_final_opening(path_point[0])
        return path_point[0], count + path_point[1], max(residual, path_point[2])

    def _control_value(self, point: PathPoint) -> float:
        return self._control.control_value(point.displacement, point.energy_or_arc_length)

    def _end_at_final_opening(self, point: PathPoint) -> None:
        """End the path where the gap that controls is as wide as it is to be."""
        if self._control_value(point) > self._opening - NEAR * self._most:
            self.finished, self.end_reason = True, "the opening is reached"

    def _find_equilibrium_at_load_factor(self, near_point: PathPoint, load_factor: float) -> PathSolution:
        return self._correct(
            near_point._replace(load_factor=load_factor),
            None,
            0,
            lambda: Tangents(self._bonds, 2 * MOST, 2 * MOST, least=1),
        )

    def _correct(
        self, guess: PathPoint, aim: Aim | None, step: int, make_tangents: Callable[[], Tangents]
    ) -> PathSolution:
        """The equilibrium near a guess, with normals and weights of contact that stay there."""
        report_progress, contact = self._make_progress_callback(step), self._contact
        if contact is None:
            return self._corrector.find_equilibrium(guess, aim, report_progress, make_tangents())
        solutions: list[PathSolution] = []

        def solve() -> Array:
            solutions.append(self._corrector.find_equilibrium(guess, aim, report_progress, make_tangents()))
            return solutions[-1][0].displacement

        solve_until_contact_stays(contact, solve, lambda: self._corrector.residual(solutions[-1][0]))
        point, _, residual = solutions[-1]
        return point, sum(count for _, count, _ in solutions), residual

    def _extrapolate_along_secant_direction(self) -> PathPoint:
        """Where the control is by the next step larger, along the straight direction of growing loads."""
        last, response = self._last, self._bonds.respond(self._last.displacement)
        way = self._corrector.displacement_by_load_factor(self._bonds.tangent(response, secant=True))
        begin, turn = self._control_value(last), max(last.load_factor, 1e-6) * 1e-3

        def control_growth_at(factor_increment: float) -> float:
            value = last.displacement + factor_increment * way
            return self._control.control_value(value, self._bonds.respond(value).dissipated_energy) - begin

        while control_growth_at(turn) < self._more and turn < 1e3:
            turn *= 2
        low, high = 0.0, turn
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if control_growth_at(middle) < self._more else (low, middle)
        return last._replace(displacement=last.displacement + high * way, load_factor=last.load_factor + high)

    def _advance_to_next_equilibrium(self, step: int) -> PathSolution:
        """A step of dissipation, as large as it converges."""
        last, secants = self._last, 0
        self._more = min(self._more, max(self._opening - self._control_value(last), LEAST * self._most))
        while True:
            done = self._control_value(last) - self._control_value(self._before)
            try:
                if self._more < 2 * GROWTH * done and self._more >= LEAST * self._most:
                    share = self._more / done
                    ahead = last.displacement + share * (last.displacement - self._before.displacement)
                    turn = share * (last.load_factor - self._before.load_factor)
                    guess = PathPoint(ahead, last.load_factor + turn, 0.0)
                else:
                    guess = self._extrapolate_along_secant_direction()
                make_tangents = partial(
                    SofteningTangents,
                    self._bonds,
                    guess.displacement,
                    secants,
                    NEVER if secants == PATIENT else STEADY,
                )
                new, count, residual = self._correct(guess, Aim(self._control, last, self._more), step, make_tangents)
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
        return new, count, residual

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
            self._corrector.loads.loads_and_displacements_at(point.load_factor),
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


CRACKED = 5.0  # peaks: a stretch of bonds that a crack has gone through


def describe_crack_at_no_fail_bonds(
    model: Model, bonds: SofteningBonds, displacement: NDArray[np.float64]
) -> str | None:
    """What there is to say of no-fail bonds beyond the peak of others at displacements (n, d), beside cracked bonds."""
    keeps = ~np.isfinite(bonds.limit)
    if not keeps.any() or keeps.all():
        return None
    peaks = bonds.stretches(displacement) / float(bonds.peak[~keeps].max())
    cracked = np.zeros(len(displacement), dtype=bool)
    for end in (bonds.source, bonds.target):
        cracked[end[~keeps & (peaks > CRACKED)]] = True
    at_crack = cracked[bonds.source] | cracked[bonds.target]
    peaks = np.where(keeps & at_crack, peaks, 0.0)
    worst = int(peaks.argmax())
    if peaks[worst] < 1:
        return None
    ends = bonds.source[worst], bonds.target[worst]
    for number, condition in conditions_of(model.settings, Condition):
        if not condition.breakable and np.isin(ends, model.selected(condition)).any():
            return (
                f"$.conditions[{number}]: bonds of '{called(condition.name, number)}', which do not break, are"
                f" stretched to {peaks[worst]:.2f} times the peak of others at the end of a crack; use"
                f" {breakable_setting(condition)}"
            )
    return None
