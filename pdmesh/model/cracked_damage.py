"""The damage above which a node belongs to a crack: the only rule for it.

A crack between two rows of a lattice, or two layers in space, cuts a share of the bonds of the nodes beside it. The
share is 11 of 28 bonds with a horizon of 3 spacings in the plane and 47 of 122 in space, but 4 of 12 and 10 of 32 with
2 spacings. A node is cracked at `CRACKED`, or at `PART` of that share where this is less.
"""

from __future__ import annotations

from functools import lru_cache

from pdmesh.model.lattice_calibration import has_partial_cells, offsets
from pdmesh.model.material import Material

CRACKED = 0.35  # damage of a cracked node where a crack cuts enough bonds
PART = 0.92  # of the share of bonds that a crack along the lattice cuts


@lru_cache
def share_cut_by_crack(reach: float, dimension: int = 2) -> float:
    """Share of a node's bonds, up to `reach` spacings long, that a crack beside it along the lattice cuts."""
    across = offsets(reach, dimension)[:, 0]
    return float((across > 0).mean())


def cracked_damage(horizon_ratio: float, material: Material | None = None, dimension: int = 2) -> float:
    """Damage above which a node is cracked, for a horizon in spacings; 0.35 from a horizon of 3 spacings on."""
    margin = 0.5 if material is not None and has_partial_cells(material) else 0.0
    return min(CRACKED, PART * share_cut_by_crack(horizon_ratio + margin, dimension))
