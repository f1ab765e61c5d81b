"""Equilibria of bodies that touch: any method, with normals and weights of contact taken anew until they stay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import (
    Equilibrium,
    EquilibriumConditions,
    EquilibriumMethod,
    NotConvergedError,
    ProgressReport,
    force_densities,
    relative_residual,
)
from pdsolve.rest.modes import Pairs
from pdsolve.state import State

Array = NDArray[np.float64]

LOOKS = 10  # at one equilibrium
STAYS = 1e-3  # residual of an equilibrium for normals and weights of that place: these are good then
SMALLEST = 1 / 64  # of a load step
FAR = 0.5  # spacings: a node that moves farther in one equilibrium may miss what it meets


class EquilibriumMethodWithContact:
    """A method for an operator with a part that is contact; see `EquilibriumMethod`."""

    reference_is_near = True

    def __init__(self, method: EquilibriumMethod, operator: Operator, contact: RestingContact) -> None:
        self._method, self._operator, self.contact = method, operator, contact
        self.description = method.description
        self.least_load_step_share = min(method.least_load_step_share, SMALLEST)

    def solve_equilibrium(
        self, state: State, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> Equilibrium:
        """Move the values of the state to equilibrium, in place. Raises NotConvergedError."""
        start, done, equilibrium = state.value.copy(), 0, Equilibrium(0, 0.0)
        self.contact.begin(state)

        def solve() -> Array:
            nonlocal equilibrium, done
            equilibrium = self._method.solve_equilibrium(state, conditions, report_progress)
            done += equilibrium.iterations
            return state.value.copy()

        def measure_residual() -> float:
            return relative_residual(state, conditions, force_densities(self._operator, state), 0.0)

        try:
            solve_until_contact_stays(self.contact, solve, measure_residual)
        except NotConvergedError:
            state.value[:] = start
            raise
        return Equilibrium(done, equilibrium.residual)

    def discard_reused_tangent(self) -> None:
        """Discard history, so that what follows depends on the state alone."""
        self._method.discard_reused_tangent()

    def discard_reference(self) -> None:
        """See `EquilibriumMethod`."""
        self._method.discard_reference()

    def count_unstable_modes(self, state: State, constrained: NDArray[np.bool_]) -> int:
        """Independent displacements along which energy falls; see `EquilibriumMethod`."""
        return self._method.count_unstable_modes(state, constrained)

    def restrain_by_weak_springs(self, nodes: NDArray[np.bool_]) -> None:
        """Restrain these nodes (n,) by weak springs during the solution; see `EquilibriumMethod`."""
        self._method.restrain_by_weak_springs(nodes)


def append_contact_pairs(bonds: Pairs, contact: RestingContact) -> Pairs:
    """Bonds, and pairs of nodes that touch."""
    (source, target), (i, j) = bonds, contact.holding()
    return np.concatenate([source, i, j]), np.concatenate([target, j, i])


def solve_until_contact_stays(
    contact: RestingContact, solve: Callable[[], Array], measure_residual: Callable[[], float]
) -> None:
    """Solve for displacements (n, w) until normals and weights of contact stay where these lead.

    `measure_residual` is the residual there, with normals and weights of that place. Raises NotConvergedError.
    """
    for _ in range(LOOKS):
        displacement = solve()
        if contact.moved(displacement) > FAR:
            raise NotConvergedError(f"bodies in contact move by more than {FAR:g} spacings")
        before = contact.seen
        contact.see(displacement)
        if measure_residual() < STAYS:
            contact.see(before)
            return
    raise NotConvergedError(
        f"no place in which bodies stay that touch, after {LOOKS} looks at their faces; add supports or friction for"
        " what can slide"
    )
