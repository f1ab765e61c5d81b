"""What a crack costs in a lattice: one half is moved away from the other, bonds fail one after the other.

Springs spend the same on any way. Where what a bond holds depends on the others of its families, this is the way that
leaves the halves as they are; a test pulls a strip apart for comparison (tests/verification/test_ordinary.py).
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from pdmesh.model.cloud import Grid
from pdmesh.model.document import Horizon, Material, Settings
from pdsolve.bonds import Bonds
from pdsolve.model import Model
from pdsolve.operators.listed import Listed
from pdsolve.state import State

GROWTH = 1.005  # of the opening, from look to look
FIRST = 1e-7  # spacings
MOST = 3000  # looks


def patch(material: Material, ratio: float) -> Model:
    """A lattice of spacing 1 around a row of bonds' ends that no edge reaches."""
    side = int(np.ceil(ratio + 0.5))
    x, y = (
        each.ravel() for each in np.meshgrid(np.arange(-3 * side, 3 * side + 1), np.arange(-3 * side, 3 * side) + 0.5)
    )
    position, count = np.column_stack([x, y]).astype(float), len(x)
    nowhere = np.full(count, -1)
    grid = Grid(np.arange(count), position, np.ones(count), nowhere >= 0, nowhere, np.zeros((0, 4)))
    return Model(grid, Settings(material=material, horizon=Horizon(ratio)))


def cost(law: ModuleType, model: Model, bonds: Bonds) -> float:
    """What a patch's bonds spend, for each length of the crack between its halves."""
    operator = Listed(law, model, bonds, symmetric=True)
    position = model.grid.position
    count, width = len(position), sum(unknown.width for unknown in operator.unknowns)
    state = State(*np.zeros((3, count, width)), *np.zeros((2, count)))
    upper, middle = position[:, 1] > 0, position[:, 0] == 0
    source, target = operator.bonds()
    crossing, opening = int((middle[source] & (upper[source] != upper[target])).sum()), FIRST
    for look in range(1, MOST):
        state.value[upper, 1] = opening
        operator.add(state, np.zeros_like(state.value), look, 0.0)
        broken = operator.broken()
        if int((middle[broken.source] & (upper[broken.source] != upper[broken.target])).sum()) == crossing:
            break
        opening *= GROWTH
    return float(state.dissipated[middle].sum())
