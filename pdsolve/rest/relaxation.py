"""Adaptive dynamic relaxation: a damped motion with fictitious mass and damping.

P. Underwood, in Computational Methods for Transient Analysis (1983) 245-265; B. Kilic, E. Madenci, Theor. Appl. Fract.
Mech. 53 (2010) 194-204. The step is 1 s and the mass as small as stability allows, so that all modes have similar
frequencies. The damping is twice the frequency of the mode still in motion, estimated by Rayleigh's quotient. It works
with any operator.

    lambda  (n, w) mass density          r  residual forces                     c  damping, 1/s
    k_i = -(r_i - r_i before) / (lambda_i v_i)          c = 2 sqrt(sum k w^2 / sum w^2), w the displacement so far
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import (
    Equilibrium,
    EquilibriumConditions,
    EquilibriumMethod,
    NotConvergedError,
    ProgressReport,
    force_densities,
    reference_stiffness_above_round_off,
    relative_residual,
)
from pdsolve.state import State

MOST = 100_000  # iterations
CAP = 1.9  # of the damping, as 2 would stop every motion
HEAVIER = 1.5  # times the mass where a motion grows
GROWN = 1e3  # times the residual there was: a motion that grows
LOOK = 50  # iterations between two looks at the clock


def smallest_stable_mass(operator: Operator) -> NDArray[np.float64]:
    """The smallest mass (n,), N/m^4 s^2, at which a step of 1 s is surely stable, from the operator's bound."""
    return operator.stiffness_bound() / 2


class DynamicRelaxation(EquilibriumMethod):
    """Dynamic relaxation with any operator; see `EquilibriumMethod`."""

    description = "adaptive dynamic relaxation"
    least_load_step_share = 1.0  # smaller parts take as many iterations

    def __init__(
        self,
        operator: Operator,
        tolerance: float,
        max_iterations: int | None = None,
        mass: NDArray[np.float64] | None = None,
    ) -> None:
        """`mass` (n, w) or (n, 1), N/m^4 s^2; None: from the operator's bound, plus a tenth, as bonds rotate."""
        self._operator, self._tolerance, self._most = operator, tolerance, max_iterations or MOST
        self._mass = 1.1 * smallest_stable_mass(operator)[:, None] if mass is None else mass
        self._least = reference_stiffness_above_round_off(2 * float(self._mass.max(initial=0.0)), tolerance)

    def solve_equilibrium(
        self, state: State, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> Equilibrium:
        """Move the values of the state to equilibrium by dynamic relaxation, in place. Raises NotConvergedError."""
        start, mass = state.value.copy(), np.broadcast_to(self._mass, state.value.shape).copy()
        mass[mass == 0] = 1.0  # of a node without a bond
        free, iteration = ~conditions.constrained, 0
        while True:
            state.value[:] = np.where(free, start, conditions.prescribed_displacement)
            v, before = np.zeros(state.value.shape), np.zeros(state.value.shape)
            begin, least, first = state.value.copy(), np.inf, True
            while iteration <= self._most:
                out = force_densities(self._operator, state)
                residual = relative_residual(state, conditions, out, self._least)
                if residual < self._tolerance:
                    return Equilibrium(iteration, residual)
                if not residual < GROWN * max(least, self._tolerance):  # the motion grows
                    break
                least = min(least, residual)
                if iteration % LOOK == 0:
                    report_progress(iteration, residual)
                _take_relaxation_step(state.value, v, out, conditions.body_force, free, mass, before, begin, first, CAP)
                first, iteration = False, iteration + 1
            iteration = min(iteration, self._most)
            if iteration >= self._most or not mass.max() < 100 * self._mass.max():
                raise NotConvergedError(
                    f"no equilibrium after {iteration} iterations of {self.description} (tolerance"
                    f" {self._tolerance:g} of the external forces); allow more iterations (run.static.iterations), or a"
                    " larger tolerance"
                )
            mass = mass * HEAVIER


@cached_njit(error_model="numpy")
def _take_relaxation_step(  # type: ignore[no-untyped-def]
    u, v, force_density, body_force, is_free, mass, previous_residual, start_u, is_first_step, largest_damping
):
    """One relaxation step of 1 s; `previous_residual` (n, w), over masses, is overwritten by the new one."""
    above = below = 0.0
    for i in range(len(u)):
        for a in range(u.shape[1]):
            now = (force_density[i, a] + body_force[i, a]) / mass[i, a] if is_free[i, a] else 0.0
            force_density[i, a] = now
            displacement = u[i, a] - start_u[i, a]
            if not is_first_step and v[i, a] != 0:
                above -= (now - previous_residual[i, a]) / v[i, a] * displacement * displacement
            below += displacement * displacement
            previous_residual[i, a] = now
    c = 0.0
    if below > 0 and above > 0:
        c = min(2 * np.sqrt(above / below), largest_damping)
    for i in range(len(u)):
        for a in range(u.shape[1]):
            if is_free[i, a]:
                v[i, a] = (
                    force_density[i, a] / 2
                    if is_first_step
                    else ((2 - c) * v[i, a] + 2 * force_density[i, a]) / (2 + c)
                )
                u[i, a] += v[i, a]
