"""Initial states of runs in time: displaced nodes, equilibrium with the conditions of time 0, and the end of a path.

The motion that follows an equilibrium path whose largest dead loads a body no longer bears begins where the path ends,
just past its largest loads, at rest and with the bonds as they are there. The loads stay as large as they were at most;
what is held stays where it is. Its steps count on from those of the path, so that bonds that broke along it keep their
steps, and its ledger goes on from that of the path.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from pdmesh.model.document import Condition
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.bonds.assembly import Scheme
from pdsolve.conditions import constrained_components, factors, initial_displacement
from pdsolve.model import Model, model_of, on_device
from pdsolve.options import Options
from pdsolve.rest.equilibrium import force_densities
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.results import Results
from pdsolve.run.assembly import prepare_quasi_static_run
from pdsolve.run.prepare import prepare
from pdsolve.run.subdomain import restore_state
from pdsolve.run.system import PreparedRun


def start_in_static_equilibrium(prepared: PreparedRun) -> PreparedRun:
    """A prepared run at rest under what acts at time 0; no bond breaks on the way.

    Components with a prescribed velocity or acceleration are held still meanwhile. Energies are relative to the
    unloaded plate. Raises ModelError, NotConvergedError.
    """
    system, state = prepared
    model = system.model
    rest = prepare_quasi_static_model_of_start(model, system.options, system.scheme)
    stepper, operator, drive = cast("LoadSteps", rest.system.stepper), rest.system.operator, rest.system.drive
    stepper.solve_equilibrium_at_time_zero(rest.state)
    state.value[:] = rest.state.value
    system.drive.held_force[:] = drive.held_force
    acceleration = (force_densities(operator, rest.state) + drive.force) / model.rho[:, None]
    state.second[:] = np.where(stepper.held, state.second, acceleration)
    strain = float(np.sum(system.area * operator.energies(rest.state)[0]))
    return PreparedRun(dataclasses.replace(system, initial_energy=system.initial_energy + strain), state)


def prepare_quasi_static_model_of_start(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """The model to be brought to rest, in double precision. Raises ModelError."""
    run = model.settings.run
    rest = msgspec.structs.replace(run, solver="static", start="unloaded", damping=0.0, until=None, quiet=None)
    rest = msgspec.structs.replace(rest, time_step=None, steps=1, device="cpu")  # what acts at time 0, and no later
    settings = msgspec.structs.replace(model.settings, run=rest)
    double = options._replace(precision="float64")
    return prepare_quasi_static_run(
        dataclasses.replace(model, settings=settings), double, scheme, bonds_may_break=False
    )


def apply_initial_displacements(prepared: PreparedRun) -> PreparedRun:
    """A prepared run with initial displacements: with the forces and the energies of time 0, before any step.

    What is prescribed at time 0 holds then. Bonds that are stretched too far break in step 0, on lattices and in
    zones in step 1.
    """
    system, state = prepared
    model, operator, zone = system.model, system.operator, system.moving_zone_operator
    if zone is not None:  # conditions are those of all nodes of the grid
        zone = cast("HybridOperator | HybridBodyOperator", zone)
        every = initial_displacement(system.requested_model, system.drive, state.value.shape[1])
        state.value[:] = every[zone.grid_rows]
        zone.set_node_motion(state)
        zone.engine.compute_initial_forces()
        zone.copy_to_state(state)
        strain = float(np.sum(system.area * zone.energies(state)[0]))
        return PreparedRun(dataclasses.replace(system, initial_energy=system.initial_energy + strain), state)
    state.value[:] = initial_displacement(model, system.drive, state.value.shape[1])
    on_processor = state
    if model.settings.run.device != "cpu":
        host_system, on_processor = prepare(on_device(model, "cpu"), system.options)
        operator = host_system.operator
        on_processor.value[:] = state.value
    pull = force_densities(operator, on_processor)
    state.second[:] += np.where(constrained_components(system.drive), 0.0, pull / model.rho[:, None])
    holds = system.drive.holds
    system.drive.held_force[:] += pull[holds.node, holds.axis]
    strain = float(np.sum(system.area * (operator.energies(on_processor)[0] + on_processor.dissipated)))
    return PreparedRun(dataclasses.replace(system, initial_energy=system.initial_energy + strain), state)


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
