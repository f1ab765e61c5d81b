"""The mode that cracks of particles are solved in, and how often they are looked at."""

from __future__ import annotations

import numpy as np

from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdsolve.model import Model, ModelError


def refuse(model: Model, mode: str) -> None:
    """Raises ModelError for a mode that cracks that are particles cannot be solved in."""
    if model.settings.run.cracks != "bonds" and mode != "conservative":
        raise ModelError(f"{model.name}: mode: found {mode}, expected conservative with cracks that are particles")


def every_of(model: Model, step: float) -> int:
    """Steps of so many seconds between two looks at cracks: a crack that grows at each runs as fast as Rayleigh waves,
    which none outruns."""
    speeds = [rayleigh_speed(each.E, each.rho, each.plane, poisson(each)) for each in model.materials]
    shortest = model.settings.run.particles.spacing * float(model.grid.delta.min())
    return max(1, int(np.ceil(shortest / (max(speeds) * step))))
