"""Prepared starts: a run in time that begins at rest under what acts at time 0, instead of unloaded."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np

from pdsolve.model import ModelError
from pdsolve.steppers.load_steps import LoadSteps
from pdsolve.system import Prepared, at_rest


def started(prepared: Prepared) -> Prepared:
    """The same at the start that its model asks for; no bond breaks on the way there, whatever its stretch.

    Components whose speed or acceleration is held are held still meanwhile. Energies count from the unloaded plate.
    Raises ModelError, UnsettledError.
    """
    system, state = prepared
    model = system.model
    run = model.settings.run
    if run.start != "static":
        return prepared
    if run.solver == "static":
        raise ModelError(f"{model.name}: $.run.start: found static, expected none, as the solver is static")
    rest = msgspec.structs.replace(run, solver="static", start="unloaded", damping=0.0, until=None, quiet=None)
    settings = msgspec.structs.replace(model.settings, run=rest)
    still = at_rest(dataclasses.replace(model, settings=settings), system.options, system.scheme, breaks=False)
    stepper = still.system.stepper
    assert isinstance(stepper, LoadSteps)
    stepper.bring(still.state)
    held, drive = stepper.held, still.system.drive
    state.value[:] = still.state.value
    system.drive.held_force[:] = drive.held_force
    out = np.zeros(still.state.value.shape)
    still.system.operator.add(still.state, out, 0, 0.0)
    rho = model.rho[:, None]
    state.second[:] = np.where(held, state.second, (out + drive.force) / rho)
    strain = float(np.sum(system.area * still.system.operator.energies(still.state)[0]))
    return Prepared(dataclasses.replace(system, initial_energy=system.initial_energy + strain), state)
