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
from pdsolve.conditions import constrained_components, factors
from pdsolve.model import Model, model_of
from pdsolve.options import Options
from pdsolve.rest.equilibrium import force_densities
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.subdomain import restore_state
from pdsolve.run.system import PreparedRun

FRAMES = 50  # of the motion
ENTRIES = 500  # of its ledger


def results_file_of_motion_after_equilibrium_path(path_results_file: Path) -> Path:
    """The file of the motion after the path in the file `path_results_file`."""
    return path_results_file.with_name(f"{path_results_file.stem}_motion{path_results_file.suffix}")


def needs_motion_after_path(path_results: Results) -> bool:
    """Whether a motion is to follow the run in these results. Raises ResultsError."""
    if path_results.meta().get("status") != "finished" or path_results.summary().get("lost") is None:
        return False
    return model_of(path_results.model(), path_results.name).settings.run.after == "motion"


def prepare_motion_after_equilibrium_path(path_results: Results, threads: int | None) -> tuple[PreparedRun, int]:
    """The motion after a path that it follows, and the last step of the path. Raises ModelError, ResultsError."""
    step, checkpoint = path_results.checkpoint()
    options = Options(path_results.meta()["mode"], "float64", threads, "listed")
    system, state = prepare(
        _explicit_model_with_constant_loads(
            model_of(path_results.model(), path_results.name), path_results.summary()["lost"]
        ),
        options,
    )
    ahead = system.model.settings.run.steps
    model = _model_with_run_settings(
        system.model, steps=step + ahead, every=max(1, ahead // FRAMES), ledger=max(1, ahead // ENTRIES)
    )
    system = dataclasses.replace(system, model=model)
    restore_state(system, state, step, checkpoint, path_results.breaks())
    acceleration = (force_densities(system.operator, state) + system.drive.force) / system.model.rho[:, None]
    state.second[:] = np.where(constrained_components(system.drive), 0.0, acceleration)  # with which motion begins
    return PreparedRun(system, state), step


def _explicit_model_with_constant_loads(model: Model, load_factor: float) -> Model:
    """The model in motion, whose loads and holds stay as they are at a factor of those prescribed."""
    conditions = []
    for condition in model.settings.conditions:
        if isinstance(condition, Condition):  # springs and pins have no profile
            profile = ((0.0, factors(condition, [load_factor])[0]),)
            condition = msgspec.structs.replace(condition, profile=profile)
        conditions.append(condition)
    settings = msgspec.structs.replace(model.settings, conditions=tuple(conditions))
    still = dataclasses.replace(model, settings=settings)
    return _model_with_run_settings(still, solver="explicit", after="path", time_step=None)


def _model_with_run_settings(model: Model, **settings: Any) -> Model:
    """The model with some settings of its run changed."""
    run = msgspec.structs.replace(model.settings.run, **settings)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
