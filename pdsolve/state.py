"""What changes while a system marches, and what its numbers are called."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Unknown(NamedTuple):
    """A field that is solved for."""

    name: str  # u: displacement
    width: int  # components
    order: int  # of the highest derivative in time


class State(NamedTuple):
    """The state of n nodes with w components of all unknowns, in the order of the operator's `unknowns`.

    Bonds remember for themselves (`Operator.keep`); nothing else changes.
    """

    value: NDArray[Any]  # (n, w) displacement, m
    rate: NDArray[Any]  # (n, w) velocity, m/s; within a step the mean since the last one
    second: NDArray[Any]  # (n, w) acceleration, m/s^2
    dissipated: NDArray[np.float64]  # (n,) spent by the node's broken bonds so far, J/m^3
    work: NDArray[np.float64]  # (n,) done on the node by loads and holds so far, J/m^3
    damped: NDArray[np.float64]  # (n,) taken from the node's motion by damping so far, J/m^3


class Broken(NamedTuple):
    """Bonds that have broken, k of them; that of both its nodes is there twice."""

    step: NDArray[np.int64]  # (k,)
    source: NDArray[np.int64]  # (k,) row of the node whose bond it was
    target: NDArray[np.int64]  # (k,)
