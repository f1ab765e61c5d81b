"""What tests ask of a prepared system, whatever its operator."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Bonds, in_precision
from pdsolve.model import ModelWarning
from pdsolve.notes import checkpoint
from pdsolve.state import Broken
from pdsolve.system import Prepared, system_of


def bonds_of(problem: Prepared) -> Bonds:
    """All its bonds at the start in one list, in the run's precision."""
    system = problem.system
    return in_precision(system.scheme.fill(system.model).whole().bonds, system.options.precision)


def forces(problem: Prepared, step: int = 1, dt: float = 1e-8) -> NDArray[np.float64]:
    """Force densities (n, w), N/m^3, of the state as it is; what is over its limit breaks in this `step` of `dt`, s."""
    out = np.zeros(problem.state.value.shape)
    problem.system.operator.add(problem.state, out, step, dt)
    return out


def broken(problem: Prepared, after: int = 0) -> Broken:
    """The bonds broken after a step, in the order of steps, sources and targets, whatever the operator's own."""
    found = problem.system.operator.broken(after)
    order = np.lexsort((found.target, found.source, found.step))
    return Broken(*(column[order] for column in found))


def worst(problem: Prepared) -> NDArray[np.floating]:
    """The largest stretches that softened bonds remember, in the order of sources and targets."""
    kept = problem.system.operator.keep()
    return kept["worst"][np.lexsort((kept["worst_target"], kept["worst_source"]))] if "worst" in kept else np.zeros(0)


def kept(problem: Prepared) -> dict[str, NDArray[Any]]:
    """A copy of what a checkpoint has."""
    return {name: values.copy() for name, values in checkpoint(*problem).items()}


def at_step(problem: Prepared, dt: float) -> Prepared:
    """The same from its start with steps of `dt`, s, be it stable or not."""
    system = problem.system
    run = msgspec.structs.replace(system.model.settings.run, time_step=dt)
    settings = msgspec.structs.replace(system.model.settings, run=run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return system_of(dataclasses.replace(system.model, settings=settings), system.options, system.scheme)
