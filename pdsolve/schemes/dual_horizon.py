"""Symmetric bonds: each node of a pair brings half the bond of its own horizon, and both feel both halves.

H. Ren, X. Zhuang, Y. Cai, T. Rabczuk, Int. J. Numer. Methods Eng. 108 (2016) 1451-1476. The pair's modulus is
(c_i [xi <= horizon_i] + c_j [xi <= horizon_j]) / 2, so linear and angular momentum are conserved. The two halves
break together, when their energy is what the two would have spent on breaking alone. Areas are exact cells; no
correction for partial cells or for surfaces is made.
"""

from __future__ import annotations

import numpy as np

from pdsolve.bonds import ROUND_OFF, Assembly, assembled, both_ways, inside_plate, pairs_within
from pdsolve.laws.brittle import critical_stretch
from pdsolve.laws.micromodulus import micromodulus
from pdsolve.model import Model


def fill(model: Model) -> Assembly:
    """Dual-horizon bonds of the model."""
    grid, material, horizon = model.grid, model.material, model.horizons
    area = grid.delta**2 if grid.areas is None else grid.areas
    pairs = both_ways(pairs_within(grid.position, horizon), len(grid))
    pairs = inside_plate(grid, pairs)
    modulus = np.zeros(len(pairs.length))
    energy = np.zeros(len(pairs.length))
    widest = np.zeros(len(pairs.length))
    for end in (pairs.source, pairs.target):
        reach = horizon[end]
        seen = pairs.length <= reach * (1 + ROUND_OFF)
        half = np.where(seen, micromodulus(material, pairs.length, reach) / 2, 0.0)
        limit = critical_stretch(material, reach)
        modulus += half
        energy += half * limit**2
        widest = np.maximum(widest, np.where(seen, limit, 0.0))
    with np.errstate(invalid="ignore"):
        limit = np.where(modulus > 0, np.sqrt(energy / modulus), widest)
    return assembled(model, pairs, modulus * area[pairs.target], limit, area)
