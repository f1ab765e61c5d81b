"""Dissolution of a solid.

Enthalpy method, as in phase change: the conserved quantity is the content H of a node, its potential is min(H, C_sat),
and all bonds are equal. The solid share of a node is (H - C_sat) / (C_solid - C_sat). This is the limit in which
diffusion determines the rate.

Kinetic method, after S. Jafarzadeh, Z. Chen, F. Bobaru and others (Z. Chen, F. Bobaru, J. Mech. Phys. Solids 78 (2015)
352-381): a node is solid until its concentration has fallen to C_sat. A bond between solid and liquid has its own
dissolvability, k_diss times the micro-diffusivity; a bond between two solid nodes has none. With `capped`, nothing
dissolves into liquid at C_sat; otherwise the liquid at the front exceeds saturation.
"""

from __future__ import annotations

import numpy as np

from pdmesh.model.medium import Medium
from pdsolve.diffusion.families import extended, lattice_diffusivity, moment
from pdsolve.diffusion.walls import Array
from pdsolve.model import Model


def potential(medium: Medium, content: Array) -> Array:
    """Potential (n,), mol/m^3, whose differences drive the bonds."""
    if medium.C_sat is None or medium.dissolution == "kinetic":
        return content
    return np.minimum(content, medium.C_sat)


def solid_share(medium: Medium, content: Array) -> Array:
    """Solid share of each node (n,), from 0 to 1, from its `content`, by the enthalpy method."""
    if medium.C_sat is None or medium.C_solid is None:
        return np.zeros(len(content))
    return np.clip((content - medium.C_sat) / (medium.C_solid - medium.C_sat), 0.0, 1.0)


def crossing(model: Model) -> float:
    """Value of `contrast` for a unit of surface of a solid, m/s: the mean over all directions, for a full family.

    The mean projection of a bond of length |xi| across a surface is 2/pi of it in the plane and 1/2 in space.
    """
    assert model.settings.medium is not None
    dimension, power, ratio = len(extended(model)), model.settings.medium.power, model.settings.horizon.ratio
    across = {1: 1.0, 2: 2 / np.pi, 3: 0.5}[dimension] * moment(1, ratio, dimension, power)
    even = lattice_diffusivity(ratio, dimension, power)
    return across * model.settings.medium.D / even / float(model.grid.delta.min())
