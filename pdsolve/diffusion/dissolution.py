"""How a solid dissolves.

By enthalpy, as in phase change: the content H of a node is what is conserved, its potential is min(H, C_sat), and all
links are alike. A node is solid by the share (H - C_sat) / (C_solid - C_sat). That is the limit in which diffusion
decides how fast a solid dissolves.

Kinetic, after S. Jafarzadeh, Z. Chen, F. Bobaru and others (Z. Chen, F. Bobaru, J. Mech. Phys. Solids 78 (2015)
352-381): a node is solid until its concentration has fallen to C_sat; between solid and liquid a link has a
dissolvability of its own, k_diss times the micro-diffusivity, between two solid nodes none. `capped`: nothing dissolves
into liquid that holds C_sat, without which the liquid at the front takes up more than it can hold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.medium import Medium, contradiction
from pdsolve.diffusion.links import dimension_of, lattice_diffusivity, moment
from pdsolve.model import Model, ModelError


def check(model: Model) -> None:
    """Raises ModelError for a solid that cannot be one."""
    medium = model.settings.medium
    assert medium is not None
    wrong = contradiction(medium)
    if wrong is not None:
        raise ModelError(f"{model.name}: $.medium.{wrong}")


def potential(medium: Medium, content: NDArray[np.float64]) -> NDArray[np.float64]:
    """What links make even (n,), mol/m^3."""
    if medium.C_sat is None or medium.dissolution == "kinetic":
        return content
    return np.minimum(content, medium.C_sat)


def solid_share(medium: Medium, content: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much of each node (n,) of this `content` is solid by enthalpy, from 0 to 1."""
    if medium.C_sat is None or medium.C_solid is None:
        return np.zeros(len(content))
    return np.clip((content - medium.C_sat) / (medium.C_solid - medium.C_sat), 0.0, 1.0)


def crossing(model: Model) -> float:
    """What `contrast` is for a unit of surface of a solid, m/s: the mean over all directions, of a full family.

    A link of length |xi| in a random direction reaches 2/pi (in the plane) or 1/2 (in space) of it across.
    """
    assert model.settings.medium is not None
    dimension, power, ratio = dimension_of(model), model.settings.medium.power, model.settings.horizon.ratio
    across = {1: 1.0, 2: 2 / np.pi, 3: 0.5}[dimension] * moment(1, ratio, dimension, power)
    even = lattice_diffusivity(ratio, dimension, power)
    return across * model.settings.medium.D / even / float(model.grid.delta.min())
