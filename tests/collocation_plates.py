"""Plates of fine and coarse nodes of one horizon, to ask questions of."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid

from pdmesh.model.document import Collocation, Material, Run, Settings, Velocity
from pdsolve.adaptivity.collocation.engine import CollocationEngine
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

H = 1e-3  # m
STEEL = Material(E=191e9, rho=8000.0, G0=42408.0, plane="strain", micromodulus="constant")


def cracked(columns: int, rows: int, ratio: float, crack: float, **settings: Any) -> Model:
    """A plate of steel with nodes on its edges and a crack from the left one, between two rows in the middle."""
    share = [np.r_[0.5, np.ones(count - 2), 0.5] for count in (rows, columns)]
    level = rows // 2 + 0.5
    cracks = H * np.array([[0.0, level, crack, level]]) if crack else np.zeros((0, 4))
    grid = dataclasses.replace(square_grid(columns, rows), cracks=cracks, areas=H**2 * np.outer(*share).ravel())
    return plate(grid, ratio, **{"material": STEEL, **settings})


def torn(adapt: str, ratio: float = 4.0, steps: int = 120, **how: Any) -> Model:
    """The same, pulled apart at both ends, until the crack has run far."""
    pull = tuple(Velocity(box=(-1.0, y - 1e-4, 1.0, y + 1e-4), y=v) for y, v in ((0.0, -12.0), (0.059, 12.0)))
    seam = Collocation(damped=True, **how)
    run = Run(steps=steps, every=30, ledger=15, time_step=2e-7, adapt=adapt, collocation=seam)
    return cracked(61, 60, ratio, 24.0, conditions=pull, run=run)


def prepared(model: Model) -> tuple[PreparedRun, CollocationEngine]:
    """A model ready to march, and what marches."""
    problem = prepare(model, Options(threads=1))
    assert isinstance(problem.system.moving_zone_operator, CollocationOperator)
    return problem, problem.system.moving_zone_operator.engine


def places(engine: CollocationEngine) -> NDArray[np.float64]:
    """Where all places (2, places) are, in spacings."""
    numbering, p = engine.lattice.numbering, np.arange(engine.lattice.numbering.place_count)
    return np.stack(
        [p % numbering.row_stride - numbering.left_margin, p // numbering.row_stride - numbering.row_margin]
    ).astype(float)


def accelerations(engine: CollocationEngine) -> NDArray[np.float64]:
    """Those (2, places) of active nodes at the displacements they have, loads left out."""
    engine.sum_forces_and_break_bonds(0, 0.0)
    return np.asarray(engine.zone.f / engine.lattice.rho)


def with_material(model: Model, **changes: Any) -> Model:
    """The same of another material."""
    assert model.settings.material is not None
    material = msgspec.structs.replace(model.settings.material, **changes)
    settings: Settings = msgspec.structs.replace(model.settings, material=material)
    return dataclasses.replace(model, settings=settings)


def with_run(model: Model, **changes: Any) -> Model:
    """The same with other settings of the run."""
    run = msgspec.structs.replace(model.settings.run, **changes)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
