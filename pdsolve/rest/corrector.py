"""The corrector: displacements, and the factor of loads, at which a body is at rest, by Newton's method.

All loads and prescribed displacements grow with one factor, lambda. Either it stays, or it is unknown as well, and a
control g, a quantity of the displacements, has a prescribed value in its place:

    u  displacements of free components       g  energy spent, opening or arc length    R  residual forces, N/m
    K  tangent, N/m^2                         q  dg / du                                p  dR / d(lambda) at fixed u
    K a = R,  K b = p,  d lambda = (dg - (g - g_n) - q a) / (q b),  du = a + d lambda b

With a factor that stays a step is halved while the residual does not fall. Under a control an iteration goes no further
than half the largest displacement.

Units are a plate's, by metre of thickness; in space forces are in N, energies in J, stiffnesses in N/m.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Operator
from pdsolve.rest.controls import PathControl, PathPoint, PathSolution, ProportionalLoads
from pdsolve.rest.equilibrium import NotConvergedError, ProgressReport, area_weighted_tangent, force_densities, norm
from pdsolve.state import State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Solve = Callable[["csr_array", Array, Array | None], Array]  # matrix (n w, n w), right sides (f, r), guess: solutions

MOST = 12  # iterations of an equilibrium
CONVERGING = 20  # iterations of one whose residual has been halved in each beyond MOST
NEAR = 0.01  # of a step of the control, by which it may be missed
FAR = 0.5  # of the largest displacement: an iteration under a control goes no further
HALVINGS = 10  # of a step, at most
OVERSHOT = 0.5  # of the slope of the energy at the start of a step: with more beyond its least, it is too long
RUNAWAY = 100  # times the displacements of the first iteration: a body that flows without end


class RestingBody(Protocol):
    """What is brought to rest: n nodes of w components."""

    symmetric: bool  # the tangent

    def respond(self, value: Array, /) -> Any:
        """What it does at displacements (n, w), which the other functions ask for."""

    def forces(self, response: Any, /) -> Array:
        """Forces (n, w) on nodes, N/m, but for loads."""

    def tangent(self, response: Any, /) -> csr_array:
        """Minus the derivative (n w, n w) of the forces by the displacements, N/m^2."""


class OperatorResponse(NamedTuple):
    """What an operator's bonds do at some displacements."""

    force_density: Array  # (n, w) N/m^3
    dissipated_energy: float = 0.0  # bonds that do not break dissipate nothing


class OperatorBody:
    """The body of an operator whose bonds do not break; the values of a state are those of the last response."""

    def __init__(self, operator: Operator, area: Array, state: State) -> None:
        """`area` (n,), m^2."""
        self._operator, self._area, self.state, self.symmetric = operator, area, state, operator.symmetric
        self.force_density = np.zeros(state.value.shape)  # N/m^3, of the last response

    def respond(self, value: Array) -> OperatorResponse:
        """The response at displacements (n, w)."""
        self.state.value[:] = value
        self.force_density = force_densities(self._operator, self.state)
        return OperatorResponse(self.force_density)

    def forces(self, response: OperatorResponse) -> Array:
        """Forces (n, w), N/m."""
        return self._area[:, None] * response.force_density

    def tangent(self, response: OperatorResponse | None = None) -> csr_array:
        """The tangent where the state is, as after the last response."""
        return area_weighted_tangent(self._operator, self._area, self.state)


class Aim(NamedTuple):
    """What a control is to be at the next equilibrium."""

    control: PathControl
    last_point: PathPoint  # on the path
    increment: float  # of the control from there on

    def missing(self, value: Array, dissipated_energy: float) -> float:
        """What is left of the increment at displacements (n, w), where bonds have spent so much, J/m."""
        begin = self.control.control_value(self.last_point.displacement, self.last_point.energy_or_arc_length)
        return self.increment - (self.control.control_value(value, dissipated_energy) - begin)


class Tangents:
    """The matrices of the iterations to an equilibrium: the tangent of each."""

    halves_steps = True  # at a factor that stays, while the residual does not fall

    def __init__(self, body: RestingBody, most: int = MOST, converging: int = CONVERGING, least: int = 0) -> None:
        """From `least` to `most` iterations, or `converging` while each halves the residual."""
        self.body, self.least, self._most, self._converging = body, least, most, converging

    def goes_on(self, iteration: int, residual: float, residual_before: float) -> bool:
        """Whether there may be more iterations than so many, the last two with these residuals."""
        return iteration < (self._most if residual > residual_before / 2 else self._converging)

    def matrix(self, response: Any, iteration: int, residual: float) -> csr_array:
        """The matrix (n w, n w) of an iteration, N/m^2."""
        return self.body.tangent(response)


class _Iterate(NamedTuple):
    """Where an iteration is."""

    value: Array  # (n, w) m
    factor: float
    response: Any
    at: Array  # (n, w) loads, N/m, and places of what is held, m
    rest: Array  # (f,) N/m
    residual: float


class Corrector:
    """Finds equilibria of a body under proportional loads."""

    def __init__(
        self,
        body: RestingBody,
        loads: ProportionalLoads,
        tolerance: float,
        solve: Solve,
        measure: Callable[[Any], float] | None = None,
        has_plastic_flow: bool = False,
    ) -> None:
        """Residuals are over the largest force from outside so far, or as `measure` has them, of a response.
        `has_plastic_flow`: whether nodes flow, so that the energy of a step is convex and a step is also good that does
        not lead far beyond its least."""
        self.body, self.loads, self._tolerance, self._solve = body, loads, tolerance, solve
        self._measure, self._flows = measure, has_plastic_flow
        self._free = np.flatnonzero(~loads.constrained.ravel())
        self.largest = 0.0  # N/m, norm of the forces from outside so far

    def find_equilibrium(
        self, guess: PathPoint, aim: Aim | None, report_progress: ProgressReport, tangents: Tangents | None = None
    ) -> PathSolution:
        """The equilibrium where the control is what it aims at, or, without an aim, at the factor of the guess; its
        iterations and residual. Raises NotConvergedError."""
        tangents, constrained = tangents or Tangents(self.body), self.loads.constrained
        now, before, iteration = self._iterate(guess.displacement.copy(), guess.load_factor), np.inf, 0
        b, usual = np.zeros(len(self._free)), 0.0
        while True:
            report_progress(iteration, now.residual)
            missed = 0.0 if aim is None else aim.missing(now.value, now.response.dissipated_energy)
            way = np.where(constrained, now.at - now.value, 0.0)  # of what is held and not there yet
            starts = aim is None and bool(way.any())
            if not starts:
                is_near = aim is None or abs(missed) < NEAR * aim.increment
                if iteration >= tangents.least and now.residual < self._tolerance and is_near:
                    self.largest = max(self.largest, self._external_force(now.response, now.at))
                    return PathPoint(now.value, now.factor, now.response.dissipated_energy), iteration, now.residual
                if not np.isfinite(now.residual) or not tangents.goes_on(iteration, now.residual, before):
                    break
                before = now.residual
            matrix = tangents.matrix(now.response, iteration, now.residual)
            if aim is None:
                pushed = now.rest - (matrix @ way.ravel())[self._free] if starts else now.rest
                way.ravel()[self._free] = self._solve(matrix, pushed[:, None], None)[:, 0]
                halves = tangents.halves_steps and not starts and iteration >= tangents.least
                following = self._search_along(way, now, halves)
            else:
                right_sides = np.column_stack([now.rest, self.free_force_by_load_factor(matrix)])
                a, b = self._solve(matrix, right_sides, np.column_stack([0 * b, b])).T
                q, growth = aim.control.gradient_by_displacement(now.value, now.response), self.loads.prescribed_growth
                along = float(q.ravel()[self._free] @ b) + float((q * growth).sum())
                if along == 0 or not np.isfinite(along):
                    following = None
                else:
                    turn = (missed - float(q.ravel()[self._free] @ a)) / along
                    move = turn * growth
                    move.ravel()[self._free] = a + turn * b
                    reach = FAR * max(float(np.abs(place.displacement).max()) for place in (aim.last_point, guess))
                    size = min(1.0, reach / max(float(np.abs(move).max()), 1e-300))
                    following = self._iterate(now.value + size * move, now.factor + size * turn)
            if following is None:
                break
            now, iteration = following, iteration + 1
            usual = usual or max(norm(guess.displacement), norm(now.value))
            if self._flows and norm(now.value) > RUNAWAY * usual:
                break
        where = f"at {now.factor:.4g} of the loads"
        if aim is not None:
            where = f"where {aim.control.description} {aim.increment:.3g} {aim.control.unit} more"
        error = NotConvergedError(
            f"no equilibrium {where} after {iteration} iterations (residual {now.residual:.2g}; tolerance"
            f" {self._tolerance:g} of the external forces)"
        )
        error.iterations = iteration
        raise error

    def residual(self, point: PathPoint) -> float:
        """What is left of the forces at a place, relative to those from outside."""
        return self._iterate(point.displacement, point.load_factor).residual

    def displacement_by_load_factor(self, matrix: csr_array) -> Array:
        """Derivative (n, w) of displacements by lambda, with this tangent (n w, n w)."""
        way = self.loads.prescribed_growth.copy()
        way.ravel()[self._free] = self._solve(matrix, self.free_force_by_load_factor(matrix)[:, None], None)[:, 0]
        return way

    def free_force_by_load_factor(self, matrix: csr_array) -> Array:
        """Forces (f,) that lambda adds on free components at fixed displacements of these, N/m."""
        pushed = self.loads.proportional_part.ravel() - matrix @ self.loads.prescribed_growth.ravel()
        return np.asarray(pushed[self._free])

    def _iterate(self, value: Array, factor: float) -> _Iterate:
        response, at = self.body.respond(value), self.loads.loads_and_displacements_at(factor)
        rest = np.asarray((self.body.forces(response) + at).ravel()[self._free])
        if self._measure is not None:
            return _Iterate(value, factor, response, at, rest, self._measure(response))
        scale = max(self.largest, self._external_force(response, at))
        residual = norm(rest) / scale if scale > 0 else float(norm(rest) > 0)
        return _Iterate(value, factor, response, at, rest, residual)

    def _external_force(self, response: Any, at: Array) -> float:
        """Norm of loads or of reactions, the larger, N/m."""
        constrained = self.loads.constrained
        return max(norm(at[~constrained]), norm(self.body.forces(response)[constrained]))

    def _search_along(self, way: Array, now: _Iterate, halves: bool) -> _Iterate | None:
        """Go all of a way (n, w), or, if it `halves` it, so far that the residual falls; None: nowhere."""
        step, size = way.ravel()[self._free], 1.0
        for _ in range(HALVINGS):
            value = now.value + size * way
            following = self._iterate(np.where(self.loads.constrained, now.at, value), now.factor)
            if not halves or following.residual < now.residual:
                return following
            if self._flows and following.rest @ step > -OVERSHOT * (now.rest @ step):
                return following
            size /= 2
        return None
