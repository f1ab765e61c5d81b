"""Path following: a body of softening bonds at rest, along its equilibrium path, by the energy that its bonds spend.

All loads and prescribed displacements grow with one factor, lambda. Up to the first bond that softens, lambda is scaled
until that bond is at its peak. From there each step prescribes the energy that bonds spend, which never decreases, and
finds lambda as another unknown, so that snap-backs and snap-throughs are followed (C. V. Verhoosel, J. J. C. Remmers,
M. A. Gutierrez, Int. J. Numer. Meth. Engng 77 (2009) 1290-1321). A monitored opening may take the energy's place.

    u  displacements of free components       D  energy spent, or opening    R  residual forces, N/m
    K  consistent tangent, N/m^2              q  dD / du                     p  d(forces) / d(lambda) at fixed u
    K a = R,  K b = p,  d lambda = (dD - (D - D_n) - q a) / (q b),  du = a + d lambda b

Units are a plate's, by metre of thickness; in space forces are in N, energies in J, stiffnesses in N/m.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Condition
from pdmesh.model.graphs import tree_of
from pdmesh.model.suggestions import called
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, put_loads
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.ground_supports import grounded
from pdsolve.operators.protocol import Operator
from pdsolve.operators.softening_bonds import Response, SofteningBonds
from pdsolve.rest.contact_method import append_contact_pairs, solve_until_contact_converges
from pdsolve.rest.controls import DissipationControl, OpeningControl, PathControl, PathPoint, PathSolution
from pdsolve.rest.equilibrium import NotConvergedError, ProgressReport, norm
from pdsolve.rest.factors import ReusedFactors, Submatrix
from pdsolve.rest.modes import find_loose_bodies
from pdsolve.rest.path import REACHED, PathStepper
from pdsolve.state import Broken, State
from pdsolve.stepper import LoadStepProgress

if TYPE_CHECKING:
    from scipy.sparse import csr_array


Array = NDArray[np.float64]

MOST = 12  # iterations; a step that needs more is halved
FEW = 5  # iterations: a step that needs no more grows by
GROWTH = 1.4
FIRST = 0.05  # of the largest step of dissipation: the first one
LEAST = 1e-4  # of it: smaller ones are not tried
NEAR = 0.01  # of a step of the control, by which it may be missed
CONVERGING = 20  # iterations of one whose residual has been halved in each beyond MOST
UNDECIDED = 2  # times that a bond has begun or ceased to load within a step: it gets a mean slope, lest it goes on so
DECIDED = 3  # iterations without another turn, after which it gets its own slope again
STEADY = 3  # bonds that turned in an iteration of secants, at most: tangents converge from there
KEPT = 320  # components with columns from one step to the next, at most: equations of more take as long as new factors
# Of the right sides of an iteration, which its solutions may leave: with 1e-3 a cantilever takes another branch than
# with exact solutions; with 1e-8 the order of nodes changes forces by less than 1e-9
LEFT = 1e-8
FAR = 0.5  # of the largest displacement: an iteration goes no further


class ProportionalLoads(NamedTuple):
    """Loads and prescribed displacements (n, d) that grow with one factor."""

    constrained: NDArray[np.bool_]
    constant_part: Array  # N/m, and m where held, at lambda = 0
    proportional_part: Array  # of it, from lambda = 0 to 1

    def loads_and_displacements_at(self, load_factor: float) -> Array:
        """Forces, N/m, and places, m."""
        return self.constant_part + load_factor * self.proportional_part


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


class PathFollower:
    """Finds equilibria of softening bonds."""

    def __init__(self, bonds: SofteningBonds, drive: ProportionalLoads, tolerance: float, control: PathControl) -> None:
        self.bonds, self.drive, self._tolerance, self.control = bonds, drive, tolerance, control
        self._free = np.flatnonzero(~drive.constrained.ravel())
        self._free_part, self._factors = Submatrix(self._free), cast("ReusedFactors | None", None)
        self.reference: tuple[Array, Array] | None = None  # displacements and history whose tangent has factors
        self.largest = 0.0  # N/m, norm of the forces from outside so far: the measure of residuals

    def begin_step(self, displacement: Array) -> None:
        """Take the factors of the reference, or new ones at these displacements of the last equilibrium.

        Solutions of the step depend on both alone, not on the steps in between.
        """
        matrix = self._free_part.of(self.bonds.tangent(self.bonds.respond(displacement)))
        if self._factors is not None and self.reference is not None:
            changed = self._factors.changed_components(matrix)
            before = self._factors.components
            for components in (np.union1d(before, changed), changed):
                if self._factors.keep_components(components, KEPT):
                    return
        self._factorize(matrix)
        self.reference = displacement.copy(), self.bonds.kappa.copy()

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """The reference, for a checkpoint; empty without one."""
        none, components = (np.zeros((0, self.drive.constrained.shape[1])), np.zeros(0)), np.zeros(0, dtype=np.int64)
        displacement, history = self.reference or none
        if self._factors is not None and self.reference is not None:
            components = self._factors.components
        return {"reference_value": displacement, "reference_history": history, "reference_components": components}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Restore the reference of a checkpoint. Raises CheckpointError."""
        components = entry(checkpoint, "reference_components", (None,), np.int64, 0, len(self._free) - 1)
        if not len(entry(checkpoint, "reference_history", (None,), float)):
            return
        value = entry(checkpoint, "reference_value", self.drive.constrained.shape, float).copy()
        history = entry(checkpoint, "reference_history", self.bonds.kappa.shape, float).copy()
        now, self.bonds.kappa = self.bonds.kappa, history
        factors = self._factorize(self._free_part.of(self.bonds.tangent(self.bonds.respond(value))))
        self.bonds.kappa, self.reference = now, (value, history)
        factors.add_columns(components)

    def _factorize(self, matrix: csr_array) -> ReusedFactors:
        try:
            self._factors = ReusedFactors(matrix, self.bonds.symmetric)
        except RuntimeError:
            raise NotConvergedError("the tangent is singular") from None
        self.reference = None
        return self._factors

    def _solve(self, tangent: csr_array, right_sides: Array, guess: Array | None = None) -> Array:
        """The solutions (f, r) of free components. Raises NotConvergedError."""
        matrix = self._free_part.of(tangent)
        solution = None if self._factors is None else self._factors.solve(matrix, right_sides, LEFT, guess)
        return self._factorize(matrix).solve_approximately(right_sides) if solution is None else solution

    def solve_at_load_factor(
        self, start_displacement: Array, load_factor: float, report_progress: ProgressReport
    ) -> PathSolution:
        """Equilibrium at this lambda by Newton's method with a line search, its iterations and residual.

        Raises NotConvergedError.
        """
        drive, free = self.drive, self._free
        at = drive.loads_and_displacements_at(load_factor)
        value, response = start_displacement.copy(), self.bonds.respond(start_displacement)
        way = np.where(drive.constrained, at - start_displacement, 0.0)
        rest, matrix = self._free_residual_forces(response, at), self.bonds.tangent(response)
        step = self._solve(matrix, (rest - (matrix @ way.ravel())[free])[:, None])[:, 0]
        value[drive.constrained] = at[drive.constrained]
        value.ravel()[free] += step
        for iteration in range(1, 2 * MOST):
            response = self.bonds.respond(value)
            rest = self._free_residual_forces(response, at)
            residual = self._residual_over_external_forces(response, at, rest)
            report_progress(iteration, residual)
            if residual < self._tolerance:
                self.largest = max(self.largest, self._external_force_norm(response, at))
                return PathPoint(value, load_factor, response.spent), iteration, residual
            step = self._solve(self.bonds.tangent(response), rest[:, None])[:, 0]
            size, before = 1.0, norm(rest)
            while size > 1e-3:
                tried = value.copy()
                tried.ravel()[free] += size * step
                if norm(self._free_residual_forces(self.bonds.respond(tried), at)) < before:
                    break
                size /= 2
            value = tried
        raise NotConvergedError(f"no equilibrium at {load_factor:.4g} of the loads after {2 * MOST} iterations")

    def solve_at_control_increment(
        self,
        last_point: PathPoint,
        guess: PathPoint | None,
        control_increment: float,
        report_progress: ProgressReport,
        secant_iterations: int = 0,
        max_reversals_for_tangents: int = STEADY,
    ) -> PathSolution:
        """The equilibrium where the control has grown by `control_increment`, its iterations and its residual.

        `guess` is a place to begin with; None: along the last direction of the secants. The first `secant_iterations`
        take secants for tangents, which leads from further away; they end sooner if no more than
        `max_reversals_for_tangents` bonds turn in one. Raises NotConvergedError.
        """
        free = self._free
        if guess is None:
            guess = self._extrapolate_along_secant_direction(last_point, control_increment)
        value, factor = guess.displacement.copy(), guess.load_factor
        begin = self.control.control_value(last_point.displacement, last_point.energy_or_arc_length)
        reach = FAR * max(float(np.abs(last_point.displacement).max()), float(np.abs(value).max()))
        response, residual = self.bonds.respond(value), np.inf
        turns, b = LoadingReversals(response.releases > 0), np.zeros(len(free))
        for iteration in range(secant_iterations + CONVERGING + 1):
            at = self.drive.loads_and_displacements_at(factor)
            rest = self._free_residual_forces(response, at)
            before, residual = residual, self._residual_over_external_forces(response, at, rest)
            missed = control_increment - (self.control.control_value(value, response.spent) - begin)
            report_progress(iteration, residual)
            if residual < self._tolerance and abs(missed) < NEAR * control_increment:
                self.largest = max(self.largest, self._external_force_norm(response, at))
                return PathPoint(value, factor, response.spent), iteration, residual
            last_one = secant_iterations + (MOST if residual > before / 2 else CONVERGING)
            if not np.isfinite(residual) or iteration >= last_one:
                break
            reversals = turns.update_and_count_reversed_bonds(response.releases > 0, iteration >= secant_iterations)
            if reversals <= max_reversals_for_tangents and iteration:
                secant_iterations = min(secant_iterations, iteration)
            mean = response._replace(
                slope=np.where(turns.often_reversing_bonds(), (response.slope + response.secant) / 2, response.slope)
            )
            matrix = self.bonds.tangent(mean, iteration < secant_iterations)
            pushed = self._free_force_derivative_by_load_factor(matrix)
            a, b = self._solve(matrix, np.column_stack([rest, pushed]), np.column_stack([0 * b, b])).T
            q = self.control.gradient_by_displacement(value, response)
            held_q = float((q * np.where(self.drive.constrained, self.drive.proportional_part, 0.0)).sum())
            free_q = q.ravel()[free]
            along = float(free_q @ b) + held_q
            if along == 0 or not np.isfinite(along):
                break
            turn = (missed - float(free_q @ a)) / along
            move = np.where(self.drive.constrained, turn * self.drive.proportional_part, 0.0)
            move.ravel()[free] = a + turn * b
            size = min(1.0, reach / max(float(np.abs(move).max()), 1e-300))
            value, factor = value + size * move, factor + size * turn
            response = self.bonds.respond(value)
        raise NotConvergedError(
            f"no equilibrium where {self.control.description} {control_increment:.3g} {self.control.unit} more after"
            f" {iteration} iterations (residual {residual:.2g}; tolerance {self._tolerance:g} of the external forces)"
        )

    def relative_residual(self, point: PathPoint) -> float:
        """What is left of the forces at a place, over the largest from outside so far."""
        response = self.bonds.respond(point.displacement)
        outside = self.drive.loads_and_displacements_at(point.load_factor)
        return self._residual_over_external_forces(response, outside, self._free_residual_forces(response, outside))

    def displacement_derivative_by_load_factor(self, response: Response) -> Array:
        """Derivative (n, d) of displacements by lambda, of bonds that are straight."""
        matrix = self.bonds.tangent(response, secant=True)
        way = np.where(self.drive.constrained, self.drive.proportional_part, 0.0)
        way.ravel()[self._free] = self._solve(matrix, self._free_force_derivative_by_load_factor(matrix)[:, None])[:, 0]
        return way

    def _extrapolate_along_secant_direction(self, last_point: PathPoint, control_increment: float) -> PathPoint:
        """Where the control is by `control_increment` larger, along the straight direction of growing loads."""
        way = self.displacement_derivative_by_load_factor(self.bonds.respond(last_point.displacement))
        begin = self.control.control_value(last_point.displacement, last_point.energy_or_arc_length)
        turn = max(last_point.load_factor, 1e-6) * 1e-3

        def control_growth_at(factor_increment: float) -> float:
            value = last_point.displacement + factor_increment * way
            return self.control.control_value(value, self.bonds.respond(value).spent) - begin

        while control_growth_at(turn) < control_increment and turn < 1e3:
            turn *= 2
        low, high = 0.0, turn
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if control_growth_at(middle) < control_increment else (low, middle)
        return PathPoint(
            last_point.displacement + high * way, last_point.load_factor + high, last_point.energy_or_arc_length
        )

    def _free_force_derivative_by_load_factor(self, tangent: csr_array) -> Array:
        """Forces (f,) that lambda adds on free components at fixed displacements of these, N/m."""
        way = np.where(self.drive.constrained, self.drive.proportional_part, 0.0).ravel()
        return np.asarray((self.drive.proportional_part.ravel() - tangent @ way)[self._free])

    def _free_residual_forces(self, response: Response, loads: Array) -> Array:
        return np.asarray((self.bonds.forces(response) + loads).ravel()[self._free])

    def _external_force_norm(self, response: Response, loads: Array) -> float:
        constrained = self.drive.constrained
        return max(norm(loads[~constrained]), norm(self.bonds.forces(response)[constrained]))

    def _residual_over_external_forces(self, response: Response, loads: Array, residual_forces: Array) -> float:
        scale = max(self.largest, self._external_force_norm(response, loads))
        return norm(residual_forces) / scale if scale > 0 else float(norm(residual_forces) > 0)


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
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Condition) or condition.breakable:
            continue
        if np.isin(ends, model.selected(condition)).any():
            return (
                f"$.conditions[{number}]: bonds of '{called(condition.name, number)}', which do not break, are"
                f" stretched to {peaks[worst]:.2f} times the peak of others at the end of a crack; use breakable ="
                " true"
            )
    return None
