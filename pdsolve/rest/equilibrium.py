"""Equilibrium: its residual, and the interface of methods that find it.

At rest, the force densities of neighbours, f, and of loads, b, cancel on every free component: the residual r = f + b
is 0 there. It is measured relative to the external forces: |r| / |b|, or relative to the reactions of held components
if there is no load; norms are over components. If external forces almost vanish, round-off is the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Operator
from pdsolve.state import State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROUND = 3e-16  # of a force: what its sum over neighbours is known to
ProgressReport = Callable[[int, float], None]  # iterations so far in this go, and what is left


class NotConvergedError(ArithmeticError):
    """A plate that does not come to rest; the message says how far it came and what to check."""

    iterations = 0  # that were in vain


class SingularTangentError(NotConvergedError):
    """A tangent whose equations have no solution."""


class EquilibriumConditions(NamedTuple):
    """Loads and holds of an equilibrium; n nodes."""

    body_force: NDArray[np.float64]  # (n, w) N/m^3
    constrained: NDArray[np.bool_]  # (n, w) components that are held
    prescribed_displacement: NDArray[np.float64]  # (n, w) m
    swelling_force_norm: float = 0.0  # N/m^3, size of what swelling alone makes of forces; as much counts as external
    sufficient_residual: float = 0.0  # residual that is enough, where the method would go on to a smaller one


class Equilibrium(NamedTuple):
    """How a plate came to rest."""

    iterations: int
    residual: float  # what is left of the forces over those from outside
    neighbour_forces: NDArray[np.float64] | None = None  # (n, w) N/m^3 there, where the method has them


class EquilibriumMethod(Protocol):
    """A method to find equilibrium; by default it has no tangent, and no equations."""

    description: str  # which it is, for the record
    reference_is_near: bool = True  # whether factors of the undeformed body, if there are any, serve for all load steps
    least_load_step_share: float  # share of a load step that is worth a try, where larger ones do not come to rest

    def solve_equilibrium(
        self, state: State, conditions: EquilibriumConditions, report_progress: ProgressReport
    ) -> Equilibrium:
        """Move the values of the state to equilibrium, in place. Raises NotConvergedError."""

    def discard_reused_tangent(self) -> None:
        """Discard the tangent and its factors, where there are any: what follows depends on the state alone."""
        return

    def discard_reference(self) -> None:
        """Take new factors in each load step from now on, as the stiffness of the undeformed body changes."""
        return

    def count_unstable_modes(self, state: State, constrained: NDArray[np.bool_]) -> int:
        """Independent displacements of free components along which energy falls; 0 where that is not known."""
        return 0

    def restrain_by_weak_springs(self, nodes: NDArray[np.bool_]) -> None:
        """Restrain these nodes (n,) by weak springs in the equations, if there are any; no force of theirs remains."""
        return


def force_densities(operator: Operator, state: State) -> NDArray[np.float64]:
    """Force densities (n, w) of neighbours at a state whose bonds do not break, N/m^3."""
    out: NDArray[Any] = np.zeros(state.value.shape)
    operator.accumulate_force(state, out, 0, 0.0)
    return out


def area_weighted_tangent(operator: Operator, area: NDArray[np.float64], state: State) -> csr_array:
    """The tangent times the nodes' areas (n w, n w), N/m^2; if it is symmetric, without round-off that is not."""
    from scipy.sparse import diags_array  # SciPy takes long to import, and few runs ask

    matrix = (diags_array(np.repeat(area, state.value.shape[1])) @ operator.tangent(state)).tocsr()
    return ((matrix + matrix.T) / 2).tocsr() if operator.symmetric else matrix


def relative_residual(
    state: State,
    conditions: EquilibriumConditions,
    neighbour_forces: NDArray[np.float64],
    reference_stiffness: float,
    previous_displacement_norm: float = 0.0,
) -> float:
    """Residual over external forces; `neighbour_forces` (n, w) are the forces of neighbours.

    External forces count at least as `reference_stiffness`, N/m^4, times the norm of displacements, m: that of now, or
    `previous_displacement_norm`.
    """
    load = norm(conditions.body_force[~conditions.constrained])
    outside = max(load if load > 0 else norm(neighbour_forces[conditions.constrained]), conditions.swelling_force_norm)
    imbalance = norm((neighbour_forces + conditions.body_force)[~conditions.constrained])
    scale = max(outside, reference_stiffness * max(norm(state.value), previous_displacement_norm))
    return imbalance / scale if scale > 0 else float(imbalance > 0)


def reference_stiffness_above_round_off(largest_stiffness: float, tolerance: float) -> float:
    """The smallest reference, N/m^4, for which a residual of `tolerance` exceeds round-off.

    Forces of a plate of stiffness `largest_stiffness` (N/m^4) are not known better.
    """
    return ROUND * largest_stiffness / tolerance


def norm(values: NDArray[np.float64]) -> float:
    """Euclidean norm, summed in a fixed order on one thread: sharing it out makes BLAS slower."""
    return float(np.sqrt((values * values).sum()))
