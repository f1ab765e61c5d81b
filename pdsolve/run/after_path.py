"""The motion that follows an equilibrium path whose largest dead loads a body no longer bears.

It begins where the path ends, just past its largest loads, at rest and with the bonds as they are there. The loads stay
as large as they were at most; what is held stays where it is. Its steps count on from those of the path, so that bonds
that broke along it keep their steps, and its ledger goes on from that of the path.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pdmesh.model.document import Condition
from pdsolve.conditions import factors, held
from pdsolve.model import Model, model_of
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import restore
from pdsolve.run.system import Prepared, System
from pdsolve.state import State
from pdsolve.steppers.equilibrium import forces

FRAMES = 50  # of the motion
ENTRIES = 500  # of its ledger


def name_of(path: Path) -> Path:
    """The file of the motion after the path in the file `path`."""
    return path.with_name(f"{path.stem}_motion{path.suffix}")


def motion_follows(path: Results) -> bool:
    """Whether a motion is to follow the run in these results. Raises ResultsError."""
    if path.meta().get("status") != "finished" or path.summary().get("lost") is None:
        return False
    return model_of(path.model(), path.name).settings.run.after == "motion"


def motion_after(path: Results, threads: int | None) -> tuple[Prepared, int]:
    """The motion after a path that it follows, and the last step of the path. Raises ModelError, ResultsError."""
    step, checkpoint = path.checkpoint()
    options = Options(path.meta()["mode"], "float64", threads, "listed")
    system, state = prepare(_moving(model_of(path.model(), path.name), path.summary()["lost"]), options)
    ahead = system.model.settings.run.steps
    model = _changed(system.model, steps=step + ahead, every=max(1, ahead // FRAMES), ledger=max(1, ahead // ENTRIES))
    system = dataclasses.replace(system, model=model)
    restore(system, state, step, checkpoint, path.breaks())
    _let_go(system, state)
    return Prepared(system, state), step


def _moving(model: Model, factor: float) -> Model:
    """The model in motion, whose loads and holds stay as they are at a factor of those prescribed."""
    conditions = []
    for condition in model.settings.conditions:
        assert isinstance(condition, Condition)
        conditions.append(msgspec.structs.replace(condition, profile=((0.0, factors(condition, [factor])[0]),)))
    settings = msgspec.structs.replace(model.settings, conditions=tuple(conditions))
    still = dataclasses.replace(model, settings=settings)
    return _changed(still, solver="explicit", after="path", time_step=None)


def _changed(model: Model, **changes: Any) -> Model:
    """The model with some settings of its run changed."""
    run = msgspec.structs.replace(model.settings.run, **changes)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))


def _let_go(system: System, state: State) -> None:
    """Set the accelerations (n, w), m/s^2, with which a body begins to move."""
    acceleration = (forces(system.operator, state) + system.drive.force) / system.model.rho[:, None]
    state.second[:] = np.where(held(system.drive), 0.0, acceleration)
