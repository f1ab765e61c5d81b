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

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry
from pdsolve.operators.softening_bonds import Response, SofteningBonds
from pdsolve.steppers.equilibrium import NotConvergedError, ProgressReport, norm
from pdsolve.steppers.factors import ReusedFactors, Submatrix
from pdsolve.steppers.path_control import PathControl

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
LEFT = 1e-3  # of the right sides of an iteration, which its solutions may leave
FAR = 0.5  # of the largest displacement: an iteration goes no further


class PathPoint(NamedTuple):
    """A place on the path."""

    displacement: Array  # (n, d) m
    load_factor: float  # lambda
    energy_or_arc_length: float  # J/m that bonds have dissipated, or m along the path


PathSolution = tuple[PathPoint, int, float]  # a place on the path, iterations and residual


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
            if self._factors.keep_components(np.union1d(before, changed)) or self._factors.keep_components(changed):
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
