"""The thesis's bonds: each node sums over its own horizon, with its own constants, whatever the neighbour sees.

Stiffness of the bond i -> j: lambda_i c_i(xi) beta_ij A_j, with Hu's beta on the family |xi| <= horizon_i
(W. Hu, Y. D. Ha, F. Bobaru, Comput. Methods Appl. Mech. Eng. 217-220 (2012) 247-261; thesis, eq. 14), areas by
eq. 19 and the softening coefficient lambda_i = potential / actual bonds (thesis, "Effetti di bordo"). Where
horizons differ, forces come without their reaction: momentum drifts, and the loaded rows lose part of their load.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.areas import thesis_areas
from pdsolve.bonds import ROUND_OFF, Assembly, Pairs, assembled, cut_by_cracks, inside_plate, pairs_within
from pdsolve.laws.brittle import critical_stretch
from pdsolve.laws.micromodulus import micromodulus
from pdsolve.model import Model


def fill(model: Model) -> Assembly:
    """One-sided bonds of the model."""
    grid, material, horizon = model.grid, model.material, model.horizons
    area = thesis_areas(grid.position, grid.delta, horizon)
    pairs = pairs_within(grid.position, horizon)
    pairs = inside_plate(grid, pairs)
    reach = horizon[pairs.source]
    stiffness = micromodulus(material, pairs.length, reach) * area[pairs.target]
    stiffness *= hu_beta(pairs.length, reach, grid.delta[pairs.target])
    stiffness *= softening(model, pairs)[pairs.source]
    return assembled(model, pairs, stiffness, critical_stretch(material, reach), area)


def hu_beta(
    length: NDArray[np.float64], horizon: NDArray[np.float64], delta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of a neighbour's cell, of size `delta`, within the horizon: 1 up to horizon - delta/2, then linear."""
    return np.clip((horizon + delta / 2 - length) / delta, 0.0, 1.0)


def softening(model: Model, pairs: Pairs) -> NDArray[np.float64]:
    """lambda (n,): the bonds a node of a full lattice has over those it has, pre-crack and edges counted out."""
    actual = np.bincount(pairs.source[~cut_by_cracks(model.grid, pairs)], minlength=len(model.grid))
    return full_family(model.settings.horizon.ratio) / np.maximum(actual, 1)


def full_family(ratio: float) -> int:
    """Neighbours of a node in a full square lattice, with horizon / spacing = `ratio`: 28 for 3, 48 for 4."""
    steps = np.arange(-int(ratio) - 1, int(ratio) + 2)
    return int((np.hypot(*np.meshgrid(steps, steps)) <= ratio * (1 + ROUND_OFF)).sum()) - 1
