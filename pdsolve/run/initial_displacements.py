"""Starts of runs in time whose nodes are displaced at time 0."""

from __future__ import annotations

import dataclasses

import numpy as np

from pdsolve.conditions import constrained_components, initial_displacement
from pdsolve.model import on_device
from pdsolve.rest.equilibrium import force_densities
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun


def apply_initial_displacements(prepared: PreparedRun) -> PreparedRun:
    """A prepared run with initial displacements: with the forces and the energies of time 0, before any step.

    What is prescribed at time 0 holds then. Bonds that are stretched too far break in step 0.
    """
    system, state = prepared
    model, operator = system.model, system.operator
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
