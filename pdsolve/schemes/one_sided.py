"""The thesis's bonds: each node sums over its own horizon, with its own constants, whatever the neighbour sees.

Stiffness of the bond i -> j: lambda_i c_i(xi) beta_ij A_j, with Hu's beta on the family |xi| <= horizon_i (thesis,
eq. 14), areas by eq. 19 and the softening coefficient lambda_i = potential / actual bonds (thesis, "Effetti di
bordo"). Where horizons differ, forces come without their reaction: momentum drifts, and the loaded rows lose part
of their load. Where materials meet, a bond has the constants of its own node's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.continuum import critical_stretch, micromodulus
from pdmesh.model.full_lattice import full_family, hu_beta
from pdmesh.model.neighbours import Neighbours, chosen
from pdmesh.model.visibility import sight_of
from pdsolve.bonds import Filling, Paired, Part, areas, part_of
from pdsolve.conditions import unbreakable
from pdsolve.laws.critical import limits
from pdsolve.model import Model


def fill(model: Model) -> Filling:
    """One-sided bonds of the model. Raises GridError for an outline that encloses nothing."""
    grid, horizon, area, held = model.grid, model.horizons, areas(model, "eq19"), unbreakable(model)
    neighbours, sight = Neighbours(grid.position, grid.delta, horizon), sight_of(grid, model.name)
    full = full_family(model.settings.horizon.ratio)

    def part(rows: NDArray[np.int64]) -> Part:
        pairs = neighbours.pairs(rows)
        pairs = chosen(pairs, sight.inside(pairs))
        intact = ~sight.cut(pairs)
        reach = horizon[pairs.source]
        stiffness, peak, limit = (np.zeros(len(pairs.length)) for _ in range(3))
        for number, material in enumerate(model.materials):
            own = model.material_of[pairs.source] == number
            stiffness[own] = micromodulus(material, pairs.length[own], reach[own])
            peak[own], limit[own] = limits(material, critical_stretch(material, reach[own]))
        weight = area[pairs.target] * hu_beta(pairs.length, reach, grid.delta[pairs.target])
        stiffness *= weight
        actual = np.bincount(pairs.source[intact] - rows[0], minlength=len(rows))
        stiffness *= softening(full, actual)[pairs.source - rows[0]]
        return part_of(grid.position, held, rows, Paired(pairs, intact, stiffness, peak, limit, weight))

    return Filling(area, part)


def softening(full: int, actual: NDArray[np.int64]) -> NDArray[np.float64]:
    """lambda (n,): the bonds a node of a `full` family has over its `actual` ones (n,), cut ones and edges counted
    out."""
    return full / np.maximum(actual, 1)
