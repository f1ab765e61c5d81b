"""What is done to the plate: body forces on nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.grid import Load
from pdsolve.model import Model


def conditioned(model: Model) -> NDArray[np.bool_]:
    """Which nodes (n,) carry a condition; their bonds do not break."""
    marked = np.zeros(len(model.grid), dtype=bool)
    for load in model.settings.conditions:
        marked[model.selected(load)] = True
    return marked


def body_force(model: Model, areas: NDArray[np.float64], exact_total: bool) -> NDArray[np.float64]:
    """Body force (2, n), N/m^3, of all conditions together.

    A traction becomes traction / (rows delta) at each of its nodes, as in the thesis. With `exact_total`, and
    where the length of the loaded edge is known, its nodes share traction * length by their `areas` (n,), m^2.
    """
    force = np.zeros((2, len(model.grid)))
    for load in model.settings.conditions:
        if not isinstance(load, Load):
            continue
        rows = model.selected(load)
        if load.body_force is not None:
            force[:, rows] += np.array(load.body_force)[:, None]
        elif load.traction is not None:
            if exact_total and load.length is not None:
                spread = np.full(len(rows), load.length / areas[rows].sum())
            else:
                spread = 1 / (load.rows * model.grid.delta[rows])
            force[:, rows] += np.array(load.traction)[:, None] * spread
    return force
