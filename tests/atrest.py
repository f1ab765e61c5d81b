"""Nodes at rest between nodes that are held, by conjugate gradients on small displacements, without a matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg

from pdsolve.operators.protocol import Operator
from pdsolve.state import State

SMALL = 1e-7  # of displacements: what is left of what is not linear


def settled(
    operator: Operator,
    cell: NDArray[np.float64],
    held: NDArray[np.bool_],
    at: NDArray[np.float64],
    load: NDArray[np.float64] | float = 0.0,
    rtol: float = 1e-7,
) -> NDArray[np.float64]:
    """Values (n, w) at rest where the components `held` (n, w) are those of `at` (n, w), under a `load` (n, w); all of
    them as if they were small. `cell` (n,) are the nodes' cells."""
    nodes, width = held.shape
    weight = cell[:, None]

    def pulls(value: NDArray[np.float64]) -> NDArray[np.float64]:
        size = float(np.abs(value).max())
        if size == 0:
            return np.zeros_like(value)
        state = State(value * (SMALL / size), *np.zeros((2, nodes, width)), *np.zeros((3, nodes)))
        out = np.zeros((nodes, width))
        operator.add(state, out, 0, 0.0)
        return weight * out * (size / SMALL)

    free = ~held

    def resisted(x: NDArray[np.float64]) -> NDArray[np.float64]:
        value = np.zeros((nodes, width))
        value[free] = x
        return -pulls(value)[free]

    start = np.where(held, at, 0.0)
    count = int(free.sum())
    right = (pulls(start) + weight * load)[free]
    scale = np.repeat(1 / (operator.stiffness_bound() * cell), width).reshape(nodes, width)[free]
    light = LinearOperator((count, count), lambda r: scale * r.ravel())
    x, failed = cg(LinearOperator((count, count), resisted), right, rtol=rtol, maxiter=3000, M=light)
    assert not failed
    start[free] = x
    return start
