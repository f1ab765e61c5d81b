"""Strips whose cracks are particles."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from plates import plate, square_grid

from pdmesh.model.document import Load, ParticleRules, Run
from pdsolve.model import Model

BY_STRESS = ParticleRules(criterion="stress", strength=2.5e7)


def pulled(rules: ParticleRules = BY_STRESS, columns: int = 41, crack: float = 10.2e-3, **run: Any) -> Model:
    """A strip 1 mm apart with an edge crack, suddenly loaded at both edges, or slowly."""
    push = 4e9 if run.get("solver") == "static" else 1.3e10
    grid = square_grid(columns, 20, y0=-9.5e-3)
    corners = [[-5e-4, -1e-2], [columns * 1e-3 - 5e-4, -1e-2], [columns * 1e-3 - 5e-4, 1e-2], [-5e-4, 1e-2]]
    grid = dataclasses.replace(
        grid, cracks=np.array([[-5e-4, 0.0, crack, 0.0]]), outline=(np.array(corners),), areas=np.full(len(grid), 1e-6)
    )
    loads = (
        Load(box=(-1.0, 9.4e-3, 1.0, 9.6e-3), body_force=(0.0, push)),
        Load(box=(-1.0, -9.6e-3, 1.0, -9.4e-3), body_force=(0.0, -push)),
    )
    settings = Run(
        **{"steps": 240, "time_step": 1e-7, "every": 20, "ledger": 10, "cracks": "particles", "particles": rules, **run}
    )
    return plate(grid, 2.0 if settings.solver == "static" else 3.0, conditions=loads, run=settings)
