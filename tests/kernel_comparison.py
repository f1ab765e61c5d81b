"""Plates that both kernels solve, and how near their results are."""

from __future__ import annotations

import dataclasses

import numpy as np
from plates import plate, square_grid, two_scale_grid

from pdmesh.model.document import Absorb, Acceleration, Displacement, InitialVelocity, Load, Run, Velocity
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun


def cracked() -> Grid:
    """21 x 12 nodes with a crack to the middle."""
    return dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[0.0, 0.0, 8e-3, 0.0]]))


def holed() -> Grid:
    """25 x 20 nodes less those in a round hole."""
    full = square_grid(25, 20)
    keep = np.hypot(*(full.position - [12e-3, 9.5e-3]).T) >= 3.2e-3
    columns = {name: getattr(full, name)[keep] for name in ("ids", "position", "delta", "border", "hole_id")}
    angle = np.linspace(0, 2 * np.pi, 33)[:-1]
    ring = np.array([12e-3, 9.5e-3]) + 3.2e-3 * np.column_stack([np.cos(angle), np.sin(angle)])
    outline = np.array([[0.0, 0.0], [24e-3, 0.0], [24e-3, 19e-3], [0.0, 19e-3]])
    return dataclasses.replace(full, **columns, outline=(outline,), holes=(ring,))


GRIDS = {"one scale": square_grid(21, 12), "two scales": two_scale_grid(), "cracked": cracked(), "holed": holed()}

EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)
# What acts on `torn` plates
DRIVEN = {
    "loads that change": {},
    "damping": {"run": Run(time_step=40e-9, damping=3e5)},
    "motions": {
        "conditions": (
            Displacement(box=(-1.0, 4.4e-3, 1.0, 1.0), y=1e-5, profile=((0.0, 0.0), (2e-6, 1.0))),
            Velocity(box=(-1.0, -1.0, 1.0, -4.4e-3), x=0.0, y=-5.0, profile=((0.0, 0.2), (1e-6, 1.0), (3e-6, 0.5))),
            Acceleration(box=(-1.0, -2e-3, 1e-3, 2e-3), x=-1e8),
            InitialVelocity(box=EVERYWHERE, x=1.0, y=-0.5),
        )
    },
    "a layer that absorbs": {
        "conditions": (
            InitialVelocity(box=EVERYWHERE, y=30.0),
            Absorb(box=(-1.0, -1.0, 6e-3, 1.0)),
            Velocity(box=(15e-3, -1.0, 1.0, 1.0), y=0.0),
        )
    },
}


def torn(grid: Grid, **settings: object) -> Model:
    """The upper and lower edge of a plate pulled apart, one faster and faster."""
    low, high = grid.position.min(axis=0).tolist(), grid.position.max(axis=0).tolist()
    delta = float(grid.delta.max())
    return plate(
        grid,
        **{
            "conditions": (
                Load(box=(low[0], high[1] - delta, high[0], high[1]), body_force=(0.0, 4e10)),
                Load(
                    box=(low[0], low[1], high[0], low[1] + delta),
                    body_force=(0.0, -4e10),
                    profile=((0.0, 0.5), (2e-6, 1.5)),
                ),
            ),
            "run": Run(time_step=40e-9, steps=120, every=40),
            **settings,
        },
    )


def both(model: Model, mode: str, precision: str = "float64") -> tuple[PreparedRun, PreparedRun]:
    """The problem for the fast kernel and for the listed one."""
    fast, listed = (prepare(model, Options(mode, precision, kernel=kernel)) for kernel in (None, "listed"))
    assert (fast.system.operator.name, listed.system.operator.name) == ("blocks", "listed")
    return fast, listed


def nearly(found: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    """Whether the arrays agree, as a share of the largest."""
    return bool(np.abs(found - expected).max() <= tolerance * max(np.abs(expected).max(), 1e-300))
