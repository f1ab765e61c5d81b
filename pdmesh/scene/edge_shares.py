"""How a traction on an edge is shared by the rows of nodes within a horizon of it.

In uniform stretching across an edge, a node at a depth d lacks the pull of the bonds that would end beyond the edge. A
traction that pulls it as much instead leaves the stretching uniform up to the edge; on the first row alone it would
stretch what is near the edge more.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import has_partial_cells, hu_beta
from pdmesh.model.material import Material
from pdmesh.model.material_constants import micromodulus

NU = 1 / 3  # contraction across
ROUND_OFF = 1e-6  # of a spacing

Pulls: TypeAlias = tuple[float, ...]  # of the columns of a family, 1, 2, ... spacings from its node


def pulls_of(material: Material, ratio: float) -> Pulls:
    """Pulls of the columns of a family on a lattice, in a plate, whose horizon has so many spacings; none where no bond
    pulls across an edge."""
    reach = int(np.ceil(ratio)) + 1
    x, y = (
        coordinate.ravel()
        for coordinate in np.meshgrid(np.arange(1, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    )
    length, horizon = np.hypot(x, y), np.full(len(x), float(ratio))
    if has_partial_cells(material):
        counted = hu_beta(length, horizon, np.ones(len(x)))
    else:
        counted = np.where(length <= horizon * (1 + ROUND_OFF), 1.0, 0.0)
    along = x / length
    pull = counted * micromodulus(material, length, horizon) * along * (along**2 - NU * (1 - along**2))
    columns = np.bincount(x, pull)[1:]
    return tuple((columns / columns.sum()).tolist()) if (columns > 0).any() else ()


def shares(pulls: Pulls, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (k,) of nodes at these depths (k,) below an edge, in spacings, of what a node on it has."""
    if not pulls:
        return np.ones(len(depth))
    column = np.arange(1, len(pulls) + 1)[:, None]
    beyond = (column > depth + ROUND_OFF) + 0.5 * (np.abs(column - depth) <= ROUND_OFF)
    edge_share = np.array(pulls) @ beyond
    return np.where(edge_share > 1 - ROUND_OFF, 1.0, np.where(edge_share > ROUND_OFF, edge_share, 0.0))
