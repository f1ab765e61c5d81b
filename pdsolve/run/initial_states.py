"""Initial states of runs in time: displaced nodes, and equilibrium with the conditions of time 0."""

from __future__ import annotations

import dataclasses
from typing import cast

import msgspec
import numpy as np

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.bonds.assembly import Scheme
from pdsolve.conditions import constrained_components, initial_displacement
from pdsolve.model import Model, on_device
from pdsolve.options import Options
from pdsolve.rest.equilibrium import force_densities
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.run.at_rest import prepare_quasi_static_run
from pdsolve.run.prepare import prepare
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

    What is prescribed at time 0 holds then. Bonds that are stretched too far break in step 0.
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
