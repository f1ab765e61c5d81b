"""Nodes at rest between nodes that are held, by conjugate gradients on small displacements, without a matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid
from scipy.sparse.linalg import LinearOperator, cg

from pdmesh.model.document import Material
from pdsolve.operators.protocol import Operator
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
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
        operator.accumulate_force(state, out, 0, 0.0)
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


def strip(material: Material, width: int = 20) -> tuple[float, float]:
    """E and nu of a free strip of 60 x `width` nodes, one column loaded at each end, in its middle ninth."""
    system, state = prepare(plate(square_grid(60, width, 1.0), 3, material=material), Options(threads=1))
    position, load = system.model.grid.position, np.zeros_like(state.value)
    load[position[:, 0] == 0, 0], load[position[:, 0] == 59, 0] = -1, 1
    pinned = np.zeros(load.shape, dtype=bool)
    pinned[(position[:, 0] == 29) & (position[:, 1] == width // 2), :2] = True
    pinned[(position[:, 0] == 33) & (position[:, 1] == width // 2), 1] = True
    u = settled(system.operator, system.area, pinned, np.zeros(load.shape), load, rtol=1e-9)
    middle = (np.abs(position - [29.5, (width - 1) / 2]) < [10, width / 6]).all(axis=1)
    x, y = position[middle].T
    design = np.column_stack([np.ones(len(x)), x, y])
    xx = np.linalg.lstsq(design, u[middle, 0], rcond=None)[0][1]
    yy = np.linalg.lstsq(design, u[middle, 1], rcond=None)[0][2]
    return float(1 / xx), float(-yy / xx)
