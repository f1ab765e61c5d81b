"""The mode required for cracks of particles, and the interval between checks of their growth."""

from __future__ import annotations

import numpy as np

from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdsolve.model import Model, ModelError


def refuse(model: Model, mode: str) -> None:
    """Raise ModelError for a mode that does not support cracks of particles."""
    if model.settings.run.cracks != "bonds" and mode != "conservative":
        raise ModelError(f"{model.name}: mode: found {mode}, expected conservative with cracks that are particles")


def every_of(model: Model, step: float) -> int:
    """Steps of `step` s between checks: a crack that grows at every check runs at the Rayleigh speed, the upper
    limit."""
    speeds = [rayleigh_speed(each.E, each.rho, each.plane, poisson(each)) for each in model.materials]
    shortest = model.settings.run.particles.spacing * float(model.grid.delta.min())
    return max(1, int(np.ceil(shortest / (max(speeds) * step))))
