"""What it means to be at rest, and what a method that brings a plate there is asked and answers.

At rest the densities of what neighbours do, f, and of loads, b, leave nothing on a component that is free: r = f + b
is 0 there. What is left is measured over what comes from outside: |r| / |b|, or over the forces on what is held where
there is no load; norms are over components. Where hardly anything comes from outside, round-off is the measure.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Operator
from pdsolve.state import State

ROUND = 3e-16  # of a force: what its sum over neighbours is known to
Tell = Callable[[int, float], None]  # iterations so far in this go, and what is left


class UnsettledError(ArithmeticError):
    """A plate that does not come to rest; the message says how far it came and what to look at."""


class Asked(NamedTuple):
    """Loads and holds to be at rest under; n nodes."""

    load: NDArray[np.float64]  # (n, w) body force, N/m^3
    held: NDArray[np.bool_]  # (n, w) components that are held
    at: NDArray[np.float64]  # (n, w) where, m


class Settled(NamedTuple):
    """How a plate came to rest."""

    iterations: int
    residual: float  # what is left of the forces over those from outside


class Method(Protocol):
    """A way to come to rest."""

    said: str  # which it is, for the record

    def settle(self, state: State, asked: Asked, tell: Tell) -> Settled:
        """Move the values of the state to rest, in place. Raises UnsettledError."""

    def forget(self) -> None:
        """Start anew: what follows depends on the state alone."""

    def hold_softly(self, nodes: NDArray[np.bool_]) -> None:
        """Let these (n,) move as they are no further than forces ask; no force on them stays."""


def forces(operator: Operator, state: State) -> NDArray[np.float64]:
    """Densities (n, w) of what neighbours do at a state whose bonds do not break, N/m^3."""
    out: NDArray[Any] = np.zeros(state.value.shape)
    operator.add(state, out, 0, 0.0)
    return out


def left_over(state: State, asked: Asked, out: NDArray[np.float64], least: float) -> float:
    """What is left of the forces over those from outside, `out` (n, w) being those of neighbours.

    Those from outside count as `least`, 1/m times the norm of displacements, where they are less.
    """
    load = norm(asked.load[~asked.held])
    outside = load if load > 0 else norm(out[asked.held])
    left, scale = norm((out + asked.load)[~asked.held]), max(outside, least * norm(state.value))
    return left / scale if scale > 0 else float(left > 0)


def round_off(stiffest: float, tolerance: float) -> float:
    """The least force from outside over displacements, N/m^4, of which `tolerance` can be left and no less: forces of a
    plate this stiff (N/m^4) are not known any better."""
    return ROUND * stiffest / tolerance


def norm(values: NDArray[np.float64]) -> float:
    """The root of the sum of squares, summed in one order on one thread: BLAS takes longer to share it out."""
    return float(np.sqrt((values * values).sum()))
