"""The cost of a crack in a lattice: one half is moved away from the other, and bonds fail one after the other.

Springs dissipate the same energy on any path. Where a bond's energy depends on other bonds of its families, this path
leaves the halves undeformed; a test pulls a strip apart for comparison (tests/verification/test_families.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Horizon, Material, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.state import zero_state

GROWTH = 1.005  # of the opening, from look to look
FIRST = 1e-7  # spacings
MOST = 3000  # looks


def patch(material: Material, ratio: float) -> Model:
    """A lattice of spacing 1 around a row of bonds' ends that no edge reaches."""
    side = int(np.ceil(ratio + 0.5))
    x, y = (
        coordinate.ravel()
        for coordinate in np.meshgrid(np.arange(-3 * side, 3 * side + 1), np.arange(-3 * side, 3 * side) + 0.5)
    )
    position, count = np.column_stack([x, y]).astype(float), len(x)
    nowhere = np.full(count, -1)
    grid = Grid(np.arange(count), position, np.ones(count), nowhere >= 0, nowhere, np.zeros((0, 4)))
    return Model(grid, Settings(material=material, horizon=Horizon(ratio)))


def patch_in_space(material: Material, ratio: float) -> Model:
    """A cubic lattice of spacing 1 around a plane of bonds' ends, periodic along the plane."""
    side = int(ratio + 0.5)
    wide, high = np.arange(-side, side + 1.0), np.arange(-2 * side, 2 * side) + 0.5
    position = np.stack(np.meshgrid(wide, wide, high, indexing="ij"), axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    grid = Grid(np.arange(len(position)), position, np.ones(len(position)), nowhere >= 0, nowhere, np.zeros((0, 9)))
    return Model(grid, Settings(material=material, horizon=Horizon(ratio)))


def bonds_in_space(model: Model, xi: NDArray[np.float64], weight: NDArray[np.float64], limit: float) -> Bonds:
    """All bonds of such a patch, those of a family being `xi` (k, 3) with weights (k,)."""
    position = model.grid.position
    side, high = position[:, 0].max(), position[:, 2].max()
    period, layers = int(2 * side + 1), int(2 * high + 1)
    place = position[:, None, :] + xi
    source, way = np.nonzero(np.abs(place[..., 2]) <= high)
    x, y = ((place[source, way, axis] + side) % period for axis in (0, 1))
    target = ((x * period + y) * layers + place[source, way, 2] + high).astype(np.int64)
    order = np.lexsort((target, source))
    source, way, target = source[order], way[order], target[order]
    nothing, limits = np.zeros(len(source)), np.full(len(source), limit)
    start = np.searchsorted(source, np.arange(len(position) + 1))
    return Bonds(start, target.astype(np.int32), xi[way], nothing, limits, limits, weight[way])


def cost(law: Law, model: Model, bonds: Bonds) -> float:
    """What a patch's bonds spend, for each length, or each area, of the crack between its halves."""
    operator = BondList(law, model, bonds, symmetric=True)
    position = model.grid.position
    count, width = len(position), sum(unknown.width for unknown in operator.unknowns)
    state = zero_state(count, width)
    across = position.shape[1] - 1  # the axis that the halves part along
    upper, middle = position[:, across] > 0, (position[:, :across] == 0).all(axis=1)
    source, target = operator.bonds()
    crossing, opening = int((middle[source] & (upper[source] != upper[target])).sum()), FIRST
    for look in range(1, MOST):
        state.value[upper, across] = opening
        operator.accumulate_force(state, np.zeros_like(state.value), look, 0.0)
        broken = operator.broken()
        if int((middle[broken.source] & (upper[broken.source] != upper[broken.target])).sum()) == crossing:
            break
        opening *= GROWTH
    return float(state.dissipated[middle].sum())
