"""Equilibria of bodies that touch: any method, with normals and weights of contact taken anew until they stay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.protocol import Operator
from pdsolve.state import State
from pdsolve.steppers.equilibrium import EquilibriumConditions, Method, Settled, Tell, UnsettledError, forces, left_over
from pdsolve.steppers.path_following import Path
from pdsolve.steppers.rigid_body_modes import Pairs

Solved = tuple[Path, int, float]  # a place on a path, iterations and residual

LOOKS = 10  # at one equilibrium
STAYS = 1e-3  # residual of an equilibrium for normals and weights of that place: these are good then
SMALLEST = 1 / 64  # of a load step
FAR = 0.5  # spacings: a node that moves farther in one equilibrium may miss what it meets


class Touching:
    """A method for an operator with a part that is contact; see `Method`."""

    def __init__(self, method: Method, operator: Operator, contact: RestingContact) -> None:
        self._method, self._operator, self.contact = method, operator, contact
        self.said, self.smallest = method.said, min(method.smallest, SMALLEST)

    def settle(self, state: State, conditions: EquilibriumConditions, tell: Tell) -> Settled:
        """Move the values of the state to equilibrium, in place. Raises UnsettledError."""
        start, contact, done = state.value.copy(), self.contact, 0
        contact.begin(state)
        for _ in range(LOOKS):
            equilibrium = self._method.settle(state, conditions, tell)
            done += equilibrium.iterations
            if contact.moved(state.value) > FAR:
                state.value[:] = start
                raise UnsettledError(f"bodies in contact move by more than {FAR:g} spacings")
            before = contact.seen
            contact.see(state.value.copy())
            if left_over(state, conditions, forces(self._operator, state), 0.0) < STAYS:
                contact.see(before)
                return Settled(done, equilibrium.residual)
        state.value[:] = start
        raise UnsettledError(
            f"no place in which bodies stay that touch, after {LOOKS} looks at their faces; add supports or"
            " friction for what can slide"
        )

    def forget(self) -> None:
        """Discard history, so that what follows depends on the state alone."""
        self._method.forget()

    def ways_down(self, state: State, constrained: NDArray[np.bool_]) -> int:
        """Independent displacements along which energy falls; see `Method`."""
        return self._method.ways_down(state, constrained)

    def hold_softly(self, nodes: NDArray[np.bool_]) -> None:
        """Restrain these nodes (n,) by weak springs during the solution; see `Method`."""
        self._method.hold_softly(nodes)


def and_touching(bonds: Pairs, contact: RestingContact) -> Pairs:
    """Bonds, and pairs of nodes that touch."""
    (source, target), (i, j) = bonds, contact.holding()
    return np.concatenate([source, i, j]), np.concatenate([target, j, i])


def resting(
    contact: RestingContact | None, solve: Callable[[], Solved], measure_residual: Callable[[Path], float]
) -> Solved:
    """The place on a path that `solve` finds, its iterations and residual, with normals and weights that stay there.

    `measure_residual` is the residual of a place. Raises UnsettledError.
    """
    new, count, residual = solve()
    for _ in range(LOOKS if contact is not None else 0):
        assert contact is not None
        if contact.moved(new.value) > FAR:
            raise UnsettledError(f"bodies in contact move by more than {FAR:g} spacings")
        before = contact.seen
        contact.see(new.value)
        if measure_residual(new) < STAYS:
            contact.see(before)
            return new, count, residual
        new, more, residual = solve()
        count += more
    if contact is not None:
        raise UnsettledError(f"no place in which bodies stay that touch, after {LOOKS} looks at their faces")
    return new, count, residual
