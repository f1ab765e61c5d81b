"""A plate, or a body, one half of which leaves the other half at a speed: what the cut costs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pdmesh.model.document import Horizon, Material, Run, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
COLUMNS, ROWS, SPACING = 20, 10, 1e-3  # the last in m
TIME = 2e-5  # s, in which slow halves come free


class Cut(NamedTuple):
    """What a cut cost, over G0 times its area."""

    taken: float  # from the motion
    booked: float
    momentum: float  # its drift, N s/m
    bonds: int  # broken


def plate(material: Material, time_step: float | None) -> Model:
    """A plate whose nodes are symmetric about its middle."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS]
    grid = Grid(
        ids=np.arange(1, x.size + 1),
        position=SPACING * np.column_stack([x.ravel(), y.ravel()]),
        delta=np.full(x.size, SPACING),
        border=np.zeros(x.size, dtype=bool),
        hole_id=np.full(x.size, -1),
        cracks=np.empty((0, 4)),
    )
    return Model(grid, Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=time_step)))


def torn(speed: float, share: float, material: Material = GLASS, options: Options | None = None) -> Cut:
    """Tear the plate at a speed, m/s, in steps that are a share of the program's own."""
    options = options or Options(threads=1)
    own = prepare(plate(material, None), options).system.time_step
    return cut(plate(material, share * own), speed, options, ROWS * SPACING)


def cut(model: Model, speed: float, options: Options, area: float) -> Cut:
    """Tear a model in the middle of x; `area` of the cut, m of a plate, m^2 of a body."""
    problem = prepare(model, options)
    system, state, x = problem.system, problem.state, model.grid.position[:, 0]
    mass = model.rho * system.area
    state.rate[x < (x.min() + x.max()) / 2, 0] = -speed

    def energy() -> float:
        return float(0.5 * mass @ (state.rate.astype(float) ** 2).sum(axis=1))

    start, momentum = energy(), mass @ state.rate
    problem.march(1, round(TIME / system.time_step) + 1)
    strain, softened = system.operator.energies(state)
    cost = model.materials[0].G0 * area
    taken, booked = start - energy() - system.area @ strain, system.area @ (state.dissipated + softened)
    drift = np.abs(mass @ state.rate - momentum).max()
    return Cut(float(taken / cost), float(booked / cost), float(drift), len(system.operator.broken().step) // 2)
