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
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Operator
from pdsolve.rest.controls import PathPoint, ProportionalLoads
from pdsolve.rest.corrector import Corrector, OperatorBody, OperatorResponse, RestingBody, Solve, Tangents
from pdsolve.rest.equilibrium import (
    Equilibrium,
    EquilibriumConditions,
    NotConvergedError,
    ProgressReport,
    SingularTangentError,
    area_weighted_tangent,
    norm,
    reference_stiffness_above_round_off,
    relative_residual,
)
from pdsolve.rest.factors import Factors, FreeComponents, count_negative_eigenvalues
from pdsolve.state import State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

MOST = 15  # iterations with new tangents; an equilibrium that needs more is too far away
MOST_FLOWING = 25  # likewise, where nodes flow, which begin to one after the other
FACTORED = 60_000  # free components
FACTORED_IN = {2: FACTORED, 3: 3_000}  # by dimension: in space each has ten times as many neighbours
NEARLY_LINEAR = 4  # iterations: an equilibrium that took no more leaves its tangent to the next one
SLOW = 10  # iterations with the factors of the undeformed body: an equilibrium that takes more is far from it
PATIENCE = 6  # iterations in which an old tangent must bring the residual down by FALL
FALL = 0.1
GROWN = 1e3  # times the least residual so far: a tangent that leads away
MIXED = 8  # steps that are mixed
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
        self._reference: Factors | None = None  # of the body as it was made
        self.reference_is_near = True  # whether its tangent serves for all load steps
        self._factors_in_use: Factors | None = None
        self._inverse: Callable[[Array], Array] | None = None
        self._matrix: csr_array | None = None
        self._lasting: _LastingTangent | None = None  # of this matrix, with earlier steps

    def discard_reused_tangent(self) -> None:
        """Discard the factors of the tangent, so that what follows depends on the state alone."""
        self._inverse = self._matrix = self._factors_in_use = self._lasting = None

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
                tangent = area_weighted_tangent(operator, self._area, undeformed)
                self._reference = Factors(tangent, FreeComponents(free), broken_bonds=self._no_bonds_broken)
            except SingularTangentError:
                self.reference_is_near = False
            finally:
                operator.restore(checkpoint, broken)
        if self._reference is None or not self._reference.restart_without_bonds(broken):
            self.discard_reference()
        else:
            self._use_factors(self._reference)

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
        self._reference = None  # and so would those of the undeformed body, which the next load step makes anew
        matrix, free = area_weighted_tangent(self._operator, self._area, state), ~constrained.ravel()
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
        if (
            self._forces_are_pairwise
            and self._factors_in_use is not None
            and not self._factors_in_use.remove_bonds(self._operator.broken())
        ):
            self.discard_reused_tangent()
        body = OperatorBody(self._operator, self._area, state)
        if self._inverse is None and (state.value != conditions.prescribed_displacement)[~free].any():
            self._factorize(self._restrain(body.tangent()), free)  # which is good for more than the way of what is held
        equilibrium: Equilibrium | None = None
        try:
            if self._inverse is not None:
                equilibrium, done = self._iterate_with_lasting_tangent(body, conditions, report_progress)
            if equilibrium is None:
                equilibrium = self._iterate_with_new_tangents(body, conditions, report_progress, done)
            return equilibrium
        except SingularTangentError:
            state.value[:] = start
            self.discard_reused_tangent()
            raise
        except NotConvergedError as error:
            state.value[:] = start
            self.discard_reused_tangent()
            loose = (
                "support the bodies that nothing but contact or --float holds, or "
                if self._floating is not None
                else ""
            )
            raise NotConvergedError(
                f"no equilibrium after {done + error.iterations} iterations of {self.description} (tolerance"
                f" {self._tolerance:g} of the external forces); {loose}take smaller load steps (run.static.load_steps)"
            ) from None

    def _iterate_with_lasting_tangent(
        self, body: OperatorBody, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> tuple[Equilibrium | None, int]:
        """Iterate with the earlier tangent; returns None where that stalls, and how many iterations there were."""
        assert self._inverse is not None
        assert self._matrix is not None
        if self._lasting is None:
            self._lasting = _LastingTangent(body, self._matrix, self._inverse)
        lasting, equilibrium = self._lasting, cast("Equilibrium | None", None)
        lasting.begin(body)
        try:
            equilibrium = self._iterate(body, conditions, lasting, lasting.solve, report_progress, 0)
            count = equilibrium.iterations
        except NotConvergedError as error:
            body.state.value[:], count = lasting.best, error.iterations
        if self._factors_in_use is self._reference is not None and (equilibrium is None or count > SLOW):
            self.discard_reference()
        return equilibrium, count

    def _iterate_with_new_tangents(
        self, body: OperatorBody, conditions: EquilibriumConditions, report_progress: ProgressReport, count: int
    ) -> Equilibrium:
        """Iterate with a new tangent each time, after `count` iterations. Raises NotConvergedError."""

        def solve(matrix: csr_array, right_sides: Array, guess: Array | None) -> Array:
            return self._factorize(matrix, ~conditions.constrained)(right_sides[:, 0])[:, None]

        tangents = _RestrainedTangents(body, self._most, self._restrain)
        equilibrium = self._iterate(body, conditions, tangents, solve, report_progress, count)
        if equilibrium.iterations > count + NEARLY_LINEAR:
            self.discard_reused_tangent()
        return equilibrium

    def _iterate(
        self,
        body: OperatorBody,
        conditions: EquilibriumConditions,
        tangents: Tangents,
        solve: Solve,
        report_progress: ProgressReport,
        iterations_before: int,
    ) -> Equilibrium:
        """Iterate from where the body is to equilibrium. Raises NotConvergedError."""
        constrained, load = conditions.constrained, self._area[:, None] * conditions.body_force
        at = np.where(constrained, conditions.prescribed_displacement, load)
        loads = ProportionalLoads(constrained, at, np.zeros_like(at))

        def measure(response: OperatorResponse) -> float:
            return relative_residual(body.state, conditions, response.force_density, self._least, self._before)

        tolerance = max(self._tolerance, conditions.sufficient_residual)
        corrector = Corrector(body, loads, tolerance, solve, measure, self._flows)
        _, count, residual = corrector.find_equilibrium(
            PathPoint(body.state.value.copy(), 1.0, 0.0),
            None,
            lambda iteration, left: report_progress(iterations_before + iteration, left),
            tangents,
        )
        return Equilibrium(iterations_before + count, residual, body.force_density)

    def _factorize(self, matrix: csr_array, free: NDArray[np.bool_]) -> Callable[[Array], Array]:
        """Set up the equations of the free components (n, w) of this matrix, N/m^2; returns what solves them."""
        from scipy.sparse import diags_array  # SciPy takes long to import, and few runs ask
        from scipy.sparse.linalg import bicgstab, cg

        symmetric, self._matrix, self._lasting = self._operator.symmetric, matrix, None
        if not self._factored:
            inner = matrix[free.ravel()][:, free.ravel()]
            diagonal = inner.diagonal()
            light = diags_array(1 / np.where(diagonal > 0, diagonal, 1.0))
            method = cg if symmetric else bicgstab
            self._inverse = lambda right_side: np.asarray(
                method(inner, right_side, rtol=INNER, maxiter=INNER_MOST, M=light)[0]
            )
            return self._inverse
        pairwise = self._forces_are_pairwise  # of which few are one-sided
        try:
            broken = self._operator.broken() if pairwise else None
            return self._use_factors(Factors(matrix, FreeComponents(free), symmetric or pairwise, broken))
        except SingularTangentError:
            raise SingularTangentError(
                "a body is free to move in its own plane without a force; add supports, or use run.static.floating"
                " (--float)"
            ) from None

    def _use_factors(self, factors: Factors) -> Callable[[Array], Array]:
        """Solve with these factors from now on; returns what does."""

        def solve(right_side: Array) -> Array:
            return np.asarray(factors.solve_approximately(right_side[:, None])[:, 0])

        self._factors_in_use, self._matrix, self._inverse = factors, factors.tangent, solve
        return solve

    def _restrain(self, matrix: csr_array, residual: float = 1.0) -> csr_array:
        """The matrix with the weak springs of what nothing supports: the weaker, the smaller the residual is, so that
        it turns by its load's own stiffness then, and converges as what is supported."""
        if self._floating is None or not self._floating.any():
            return matrix
        from scipy.sparse import diags_array

        softness = SOFT * min(max(residual, SOFTEST), 1.0) * float(matrix.diagonal().max())
        width = matrix.shape[0] // len(self._floating)
        return (matrix + diags_array(softness * np.repeat(self._floating, width))).tocsr()


class _RestrainedTangents(Tangents):
    """Tangents with the weak springs of what nothing supports."""

    def __init__(self, body: RestingBody, most: int, restrain: Callable[[csr_array, float], csr_array]) -> None:
        super().__init__(body, most, most)
        self._restrain = restrain

    def matrix(self, response: OperatorResponse, iteration: int, residual: float) -> csr_array:
        """The tangent with these springs."""
        return self._restrain(self.body.tangent(response), residual)


class _LastingTangent(Tangents):
    """An earlier tangent, whose steps are mixed to minimize the next one (D. G. Anderson), until that stalls."""

    halves_steps = False

    def __init__(self, body: OperatorBody, matrix: csr_array, inverse: Callable[[Array], Array]) -> None:
        super().__init__(body)
        self._matrix, self._inverse = matrix, inverse
        self._moves: list[Array] = []  # changes (k,) of values, and of values with what the tangent proposes, and
        self._changes: list[Array] = []  # of the latter alone; `MIXED` at most
        self._products = np.zeros((0, 0))  # of these changes with each other

    def begin(self, body: OperatorBody) -> None:
        """Begin another equilibrium: changes of earlier ones say how the tangent differs, though bonds broke since."""
        self._body, self.best = body, body.state.value.copy()
        self._least, self._milestone, self._reached = np.inf, np.inf, 0
        self._last: tuple[Array, Array] | None = None  # step, and what the tangent had proposed

    def goes_on(self, iteration: int, residual: float, residual_before: float) -> bool:
        """Whether the residual has fallen lately."""
        if residual < FALL * self._milestone:
            self._milestone, self._reached = residual, iteration
        if not residual < GROWN * self._least or iteration - self._reached >= PATIENCE:
            return False
        if residual < self._least:
            self._least, self.best = residual, self._body.state.value.copy()
        return True

    def matrix(self, response: OperatorResponse, iteration: int, residual: float) -> csr_array:
        """The earlier tangent."""
        return self._matrix

    def solve(self, matrix: csr_array, right_sides: Array, guess: Array | None) -> Array:
        """The step (k, 1) to take: what the tangent proposes, mixed with earlier steps."""
        proposed = self._inverse(right_sides[:, 0])
        step = proposed.copy()
        if self._last is not None:
            taken, change = self._last[0], proposed - self._last[1]  # of what is proposed after the last step
            size = float(np.sqrt(change @ change)) or 1.0  # so that all are as large
            self._moves = [*self._moves[1 - MIXED :], (taken + change) / size]
            self._changes = [*self._changes[1 - MIXED :], change / size]
            last = np.array([self._changes[-1] @ earlier_change for earlier_change in self._changes])
            before = self._products[-(len(last) - 1) :, -(len(last) - 1) :] if len(last) > 1 else self._products[:0, :0]
            self._products = np.block([[before, last[:-1, None]], [last]])
        if self._changes:
            right = np.array([proposed @ earlier_change for earlier_change in self._changes])
            shares = np.linalg.lstsq(self._products, right, rcond=ALIKE)[0]
            for share, move in zip(shares.tolist(), self._moves, strict=True):
                step -= share * move
        self._last = step, proposed
        return step[:, None]
