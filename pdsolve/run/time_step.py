"""The time step of a run."""

from __future__ import annotations

import warnings

import numpy as np

from pdsolve.model import Model, ModelError, ModelWarning

STILL = 2.0  # damping times a step: more would turn velocities round within it


def step_of(model: Model, bound: float) -> float:
    """The time step of a run, s; warns of one above the surely stable `bound`. Raises ModelError."""
    step, damped = float(model.settings.run.time_step or bound), model.settings.run.damping
    if not np.isfinite(step):
        raise ModelError(f"{model.name}: $.run.time_step: found none, expected one for a model without bonds")
    if damped * step > STILL:
        raise ModelError(
            f"{model.name}: $.run.damping: found {damped:g} 1/s, which stops all motion within a step of {step:.3g} s,"
            f" expected at most {STILL / step:.3g}"
        )
    if step > bound:
        warnings.warn(
            f"{model.name}: the time step {step:.4g} s is above the bound that is surely stable, {bound:.4g} s",
            ModelWarning,
            stacklevel=3,
        )
    return step
