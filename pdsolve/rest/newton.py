"""Newton's method with the consistent tangent, and a line search.

Each iteration takes the tangent anew and halves the step while the residual does not fall, so that convergence near
equilibrium is quadratic. An equilibrium that took few iterations is nearly linear: the next one begins with the old
tangent, its steps mixed to minimize the residual (D. G. Anderson, J. ACM 12 (1965) 547-560), until that stalls.
`discard_reused_tangent` discards the old tangent, so that a resumed run continues bit by bit.

Up to `FACTORED` free components, the tangent is factorized (SuperLU through SciPy). Above, where the factors would not
fit into memory, equations are solved by conjugate gradients, or by BiCGStab for one-sided bonds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import (
    Equilibrium,
    EquilibriumConditions,
    NotConvergedError,
    ProgressReport,
    area_weighted_tangent,
    force_densities,
    norm,
    reference_stiffness_above_round_off,
    relative_residual,
)
from pdsolve.rest.factors import FactorsWithoutBonds, count_negative_eigenvalues, factorize
from pdsolve.state import State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

MOST = 15  # iterations with new tangents; an equilibrium that needs more is too far away
MOST_FLOWING = 25  # likewise, where nodes flow, which begin to one after the other
OVERSHOT = 0.5  # of the slope of the energy at the start of a step: with more beyond its least, it is too long
RUNAWAY = 100  # times the displacements of the first iteration: a body that flows without end
FACTORED = 60_000  # free components
FACTORED_IN = {2: FACTORED, 3: 3_000}  # by dimension: in space each has ten times as many neighbours
NEARLY_LINEAR = 4  # iterations: an equilibrium that took no more leaves its tangent to the next one
SLOW = 10  # iterations with the factors of the undeformed body: an equilibrium that takes more is far from it
HALVINGS = 10  # of a step, at most
PATIENCE = 6  # iterations in which an old tangent must bring the residual down by FALL
FALL = 0.1
GROWN = 1e3  # times the least residual so far: a tangent that leads away
MIXED = 12  # steps that are mixed
ALIKE = 1e-13  # relative: mixtures of steps that differ less count as none
INNER = 1e-4  # of the residual is left by one solution of the equations without factors
INNER_MOST = 20_000  # iterations of such a solution
SOFTEST = 1e-4  # of that stiffness, near equilibrium
SOFT = 1e-6  # of the stiffest component: what a body that nothing supports is held with while equations are solved


class Newton:
    """Solves with an operator's tangent; see `EquilibriumMethod`."""

    least_load_step_share = 1 / 64

    def __init__(
        self,
        operator: Operator,
        area: Array,
        tolerance: float,
        max_iterations: int | None = None,
        free_component_count: int = 0,
        max_factorized_components: int = FACTORED,
        forces_are_pairwise: bool = False,
        has_plastic_flow: bool = False,
    ) -> None:
        """`area` (n,) m^2 makes equations symmetric if bonds are; `forces_are_pairwise`: whether forces are those of
        bonds one by one; `has_plastic_flow`: whether nodes flow, so that the energy of a step is convex and a step is
        also good that does not lead far beyond its least."""
        self._operator, self._area, self._tolerance = operator, area, tolerance
        self._most, self._flows = max_iterations or (MOST_FLOWING if has_plastic_flow else MOST), has_plastic_flow
        self._least = reference_stiffness_above_round_off(float(operator.stiffness_bound().max(initial=0.0)), tolerance)
        self._before = 0.0  # m, norm of the displacements that the last equilibrium began with
        self._factored = free_component_count <= max_factorized_components
        way = "factors" if self._factored else "conjugate gradients" if operator.symmetric else "BiCGStab"
        self.description = f"Newton's method with {way}"
        self._floating: NDArray[np.bool_] | None = None  # (n,) nodes that are held softly
        self._forces_are_pairwise = forces_are_pairwise and self._factored
        self._no_bonds_broken = operator.broken()
        self._reference: FactorsWithoutBonds | None = None  # of the body as it was made
        self.reference_is_near = True  # whether its tangent serves for all load steps
        self._factors_in_use: FactorsWithoutBonds | None = None
        self._inverse: Callable[[Array], Array] | None = None
        self._matrix: csr_array | None = None

    def discard_reused_tangent(self) -> None:
        """Discard the factors of the tangent, so that what follows depends on the state alone."""
        self._inverse = self._matrix = self._factors_in_use = None

    def discard_reference(self) -> None:
        """Take new factors in each load step from now on, as those of the undeformed body lead too slowly to rest."""
        self.reference_is_near, self._reference = False, None
        self.discard_reused_tangent()

    def _take_factors_of_reference(self, state: State, free: NDArray[np.bool_]) -> None:
        """Take the factors of the body as it was made, without the bonds that have broken since, if they serve."""
        broken, operator = self._operator.broken(), self._operator
        if self._reference is None:
            checkpoint = operator.checkpoint_arrays()
            operator.restore(checkpoint, self._no_bonds_broken)
            undeformed = state._replace(value=np.zeros(state.value.shape))
            try:
                self._reference = FactorsWithoutBonds(self._tangent(undeformed), free, self._no_bonds_broken)
            except RuntimeError:
                self.reference_is_near = False
            finally:
                operator.restore(checkpoint, broken)
        if self._reference is None or not self._reference.restart_without_bonds(broken):
            self.discard_reference()
        else:
            self._factors_in_use, self._matrix, self._inverse = (
                self._reference,
                self._reference.tangent,
                self._reference.solve,
            )

    def restrain_by_weak_springs(self, nodes: NDArray[np.bool_]) -> None:
        """Restrain these nodes (n,) by weak springs in the equations only, which takes a few more iterations."""
        if self._floating is None or (self._floating != nodes).any():
            self._floating = nodes
            self.discard_reused_tangent()

    def count_unstable_modes(self, state: State, constrained: NDArray[np.bool_]) -> int:
        """Independent displacements along which energy falls from this equilibrium; 0 where that is not known.

        It is known of symmetric tangents that are factorized, of bodies that are supported.
        """
        if not (self._factored and self._operator.symmetric) or self._floating is not None:
            return 0
        self.discard_reused_tangent()  # whose factors would be there beside these
        matrix, free = self._tangent(state), ~constrained.ravel()
        return count_negative_eigenvalues(matrix[free][:, free])

    def solve_equilibrium(
        self, state: State, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> Equilibrium:
        """Move the values of the state to equilibrium by Newton's method, in place; raises NotConvergedError.

        The values are those of the start then.
        """
        start, free, done = state.value.copy(), ~conditions.constrained, 0
        self._before = norm(start)
        if self._inverse is None and self._forces_are_pairwise and self.reference_is_near and self._floating is None:
            self._take_factors_of_reference(state, free)
        if (state.value != np.where(free, state.value, conditions.prescribed_displacement)).any():
            free = ~conditions.constrained
            if self._matrix is None:
                self._set_up_tangent_solver(state, free)
            assert self._matrix is not None
            assert self._inverse is not None
            way = np.where(free, 0.0, conditions.prescribed_displacement - state.value).ravel()
            along = -(self._matrix @ way)[free.ravel()]
            move = way.copy()
            move[free.ravel()] = self._inverse(along)
            state.value[:] = np.where(free, state.value + move.reshape(free.shape), conditions.prescribed_displacement)
        if self._factors_in_use is not None and not self._factors_in_use.remove_bonds(self._operator.broken()):
            self.discard_reused_tangent()
        if self._inverse is not None:
            equilibrium, done = self._iterate_with_old_tangent(state, conditions, report_progress)
            if self._factors_in_use is self._reference is not None and (equilibrium is None or done > SLOW):
                self.discard_reference()
            if equilibrium is not None:
                return equilibrium
        equilibrium, done = self._iterate_with_new_tangents(state, conditions, done, report_progress)
        if equilibrium is not None:
            return equilibrium
        state.value[:] = start
        self.discard_reused_tangent()
        loose = "" if self._floating is None else "support the bodies that nothing but contact or --float holds, or "
        raise NotConvergedError(
            f"no equilibrium after {done} iterations of {self.description} (tolerance {self._tolerance:g} of the"
            f" external forces); {loose}take smaller load steps (run.static.load_steps)"
        )

    def _iterate_with_new_tangents(
        self, state: State, conditions: EquilibriumConditions, iterations_before: int, report_progress: ProgressReport
    ) -> tuple[Equilibrium | None, int]:
        """Iterate with a new tangent each time; returns None without rest, and the iterations after those
        `iterations_before`."""
        free, usual = ~conditions.constrained, 0.0  # m, norm of displacements after an iteration
        weight = np.repeat(self._area, free.shape[1])[free.ravel()] if self._operator.symmetric else 1.0

        def weighted_residual(neighbour_forces: Array) -> Array:
            return np.asarray(weight * (neighbour_forces + conditions.body_force)[free])

        out = force_densities(self._operator, state)
        residual = relative_residual(state, conditions, out, self._least, self._before)
        for done in range(iterations_before, iterations_before + self._most + 1):
            if residual < max(self._tolerance, conditions.sufficient_residual):
                if done - iterations_before > NEARLY_LINEAR:
                    self.discard_reused_tangent()
                return Equilibrium(done, residual, out), done
            report_progress(done, residual)
            if done == iterations_before + self._most or not np.isfinite(residual):
                break
            self._set_up_tangent_solver(state, free, residual)
            assert self._inverse is not None
            pushed = weighted_residual(out)
            value, step, size = state.value[free], self._inverse(pushed), 1.0
            for _ in range(HALVINGS):
                state.value[free] = value + size * step
                out = force_densities(self._operator, state)
                new_residual = relative_residual(state, conditions, out, self._least, self._before)
                if new_residual < residual or (
                    self._flows and weighted_residual(out) @ step > -OVERSHOT * (pushed @ step)
                ):
                    break
                size /= 2
            else:
                break
            residual = new_residual
            usual = usual or max(norm(state.value), self._before)
            if self._flows and norm(state.value) > RUNAWAY * usual:
                break
        return None, done

    def _iterate_with_old_tangent(
        self, state: State, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> tuple[Equilibrium | None, int]:
        """Iterate with the old tangent until equilibrium or a stall; returns the iterations, too."""
        assert self._inverse is not None
        free, weight = ~conditions.constrained, np.repeat(self._area, conditions.constrained.shape[1])
        inner, least, best_values = free.ravel(), np.inf, state.value.copy()
        mixed = _AndersonMixing()
        last: tuple[Array, Array] | None = None
        milestone, reached, done = np.inf, 0, 0
        while True:
            out = force_densities(self._operator, state)
            residual = relative_residual(state, conditions, out, self._least, self._before)
            rest = (out + conditions.body_force)[free]
            if residual < max(self._tolerance, conditions.sufficient_residual):
                return Equilibrium(done, residual, out), done
            report_progress(done, residual)
            if residual < FALL * milestone:
                milestone, reached = residual, done
            if not residual < GROWN * least or done - reached >= PATIENCE:
                break
            if residual < least:
                least, best_values = residual, state.value.copy()
            value = state.value[free]
            proposed = self._inverse((weight[inner] if self._operator.symmetric else 1.0) * rest)
            if last is not None:
                mixed.add_step(value - last[0], proposed - last[1])
            last = value, proposed
            state.value[free] = value + mixed.mix_step(proposed)
            done += 1
        state.value[:] = best_values
        return None, done

    def _set_up_tangent_solver(self, state: State, free: NDArray[np.bool_], residual: float = 1.0) -> None:
        """Set up the equations of this state. A body that nothing supports is held the less, the smaller the residual
        is: it turns by its load's own stiffness then, and converges as one that is supported."""
        from scipy.sparse import diags_array  # SciPy takes long to import, and few runs ask
        from scipy.sparse.linalg import bicgstab, cg

        symmetric = self._operator.symmetric
        matrix = self._matrix = self._tangent(state)
        if self._floating is not None and self._floating.any():
            soft = (
                SOFT
                * min(max(residual, SOFTEST), 1.0)
                * float(matrix.diagonal().max())
                * np.repeat(self._floating, free.shape[1])
            )
            matrix = (matrix + diags_array(soft)).tocsr()
        inner = matrix[free.ravel()][:, free.ravel()]
        if not self._factored:
            diagonal = inner.diagonal()
            light = diags_array(1 / np.where(diagonal > 0, diagonal, 1.0))
            method = cg if symmetric else bicgstab
            self._inverse = lambda right_side: np.asarray(
                method(inner, right_side, rtol=INNER, maxiter=INNER_MOST, M=light)[0]
            )
            return
        try:
            if self._forces_are_pairwise:
                self._factors_in_use = FactorsWithoutBonds(matrix, free, self._operator.broken())
                self._inverse = self._factors_in_use.solve
            else:
                self._inverse = factorize(inner, symmetric)
        except RuntimeError:
            raise NotConvergedError(
                "a body is free to move in its own plane without a force; add supports, or use run.static.floating"
                " (--float)"
            ) from None

    def _tangent(self, state: State) -> csr_array:
        """The tangent; if it is symmetric, times the nodes' areas, N/m^2, without round-off that is not."""
        if not self._operator.symmetric:
            return self._operator.tangent(state).tocsr()
        matrix = area_weighted_tangent(self._operator, self._area, state)
        return ((matrix + matrix.T) / 2).tocsr()


class _AndersonMixing:
    """Steps that are mixed to minimize the next proposal (D. G. Anderson), `MIXED` at most."""

    def __init__(self) -> None:
        self._moves: list[Array] = []  # changes (k,) of values, and of values with what the tangent proposes, and
        self._changes: list[Array] = []  # of the latter alone
        self._products = np.zeros((0, 0))  # of these changes with each other

    def add_step(self, iterate_change: Array, proposed_step_change: Array) -> None:
        """Take another step, from the last value to this one."""
        size = float(np.sqrt(proposed_step_change @ proposed_step_change)) or 1.0  # so that all are as large
        self._moves = [*self._moves[1 - MIXED :], (iterate_change + proposed_step_change) / size]
        self._changes = [*self._changes[1 - MIXED :], proposed_step_change / size]
        last = np.array([self._changes[-1] @ earlier_change for earlier_change in self._changes])
        before = self._products[-(len(last) - 1) :, -(len(last) - 1) :] if len(last) > 1 else self._products[:0, :0]
        self._products = np.block([[before, last[:-1, None]], [last]])

    def mix_step(self, proposed_step: Array) -> Array:
        """The step to take (k,): the proposed one, mixed with earlier ones."""
        if not self._changes:
            return proposed_step
        right = np.array([proposed_step @ earlier_change for earlier_change in self._changes])
        share = np.linalg.lstsq(self._products, right, rcond=ALIKE)[0]
        mixed_step = proposed_step.copy()
        for part, move in zip(share.tolist(), self._moves, strict=True):
            mixed_step -= part * move
        return mixed_step
