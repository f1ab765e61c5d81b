"""The state of a system, and the names of its unknowns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Unknown(NamedTuple):
    """A field that is solved for."""

    name: str  # u: displacement; h: content
    width: int  # components
    order: int  # of the highest derivative in time: 2 of a displacement, 1 of a content


class State(NamedTuple):
    """The state of n nodes with w components of all unknowns, in the order of the operator's `unknowns`.

    Bonds have their own history (`Operator.checkpoint_arrays`); nothing else changes. Conserved quantities, energy or
    substance, are booked by node.
    """

    value: NDArray[Any]  # (n, w) displacement, m; content, mol/m^3
    rate: NDArray[Any]  # (n, w) velocity, m/s; within a step the mean since the last one; mol/(m^3 s)
    second: NDArray[Any]  # (n, w) acceleration, m/s^2; (n, 0) of an unknown of first order
    dissipated: NDArray[np.float64]  # (n,) spent by the node's broken bonds, J/m^3; gone out where it is held, mol/m^3
    work: NDArray[np.float64]  # (n,) done on the node by loads and holds, J/m^3; supplied to it, mol/m^3
    damped: NDArray[np.float64]  # (n,) taken from the node's motion by damping so far, J/m^3


def zero_state(nodes: int, width: int, kind: DTypeLike = np.float64) -> State:
    """The state of so many nodes with so many components of precision `kind`, all 0."""
    return State(*np.zeros((3, nodes, width), dtype=kind), *np.zeros((3, nodes)))


class Broken(NamedTuple):
    """Broken bonds, k of them; a bond in the families of both its nodes appears twice."""

    step: NDArray[np.int64]  # (k,)
    source: NDArray[np.int64]  # (k,) row of the node whose bond it was
    target: NDArray[np.int64]  # (k,)

    def after(self, step: int) -> Broken:
        """Bonds broken after a step."""
        is_later = self.step > step
        return Broken(*(column[is_later] for column in self))
