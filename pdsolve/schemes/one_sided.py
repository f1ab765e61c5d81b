"""The thesis's bonds: each node sums over its own horizon, with its own constants, whatever the neighbour sees.

Stiffness of the bond i -> j: lambda_i c_i(xi) beta_ij A_j, with Hu's beta on the family |xi| <= horizon_i (thesis,
eq. 14), areas by eq. 19 and the softening coefficient lambda_i = potential / actual bonds (thesis, "Effetti di
bordo"). Where horizons differ, forces come without their reaction: momentum drifts, and the loaded rows lose part
of their load. Where materials meet, a bond has the constants of its own node's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Assembly, Pairs, areas, assembled, chosen, cut_by_cracks, inside_plate, pairs_within
from pdsolve.lattice import full_family, hu_beta
from pdsolve.laws.bilinear import critical_stretch, limits
from pdsolve.laws.micromodulus import micromodulus
from pdsolve.model import Model


def fill(model: Model) -> Assembly:
    """One-sided bonds of the model."""
    grid, horizon = model.grid, model.horizons
    area = areas(model, "eq19")
    pairs = pairs_within(grid.position, horizon)
    pairs = chosen(pairs, inside_plate(grid, pairs))
    reach = horizon[pairs.source]
    stiffness, peak, limit = (np.zeros(len(pairs.length)) for _ in range(3))
    for number, material in enumerate(model.materials):
        own = model.material_of[pairs.source] == number
        stiffness[own] = micromodulus(material, pairs.length[own], reach[own])
        peak[own], limit[own] = limits(material, critical_stretch(material, reach[own]))
    stiffness *= area[pairs.target] * hu_beta(pairs.length, reach, grid.delta[pairs.target])
    stiffness *= softening(model, pairs)[pairs.source]
    return assembled(model, pairs, stiffness, peak, limit, area)


def softening(model: Model, pairs: Pairs) -> NDArray[np.float64]:
    """lambda (n,): the bonds a node of a full lattice has over those it has, pre-crack and edges counted out."""
    actual = np.bincount(pairs.source[~cut_by_cracks(model.grid, pairs)], minlength=len(model.grid))
    return full_family(model.settings.horizon.ratio) / np.maximum(actual, 1)
