"""Loads of a static solution: its load steps, and conditions that it does not support."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np

from pdmesh.model.document import Condition, Displacement, Load
from pdmesh.model.selection import components
from pdsolve.conditions import factors
from pdsolve.model import Model, ModelError

STEPS = 10  # load steps where something varies


def in_load_steps(model: Model, precision: str) -> Model:
    """The model in load steps: steps and frames are load steps from time 0 to the end of its profiles.

    Without a varying profile there is one load step, at 1 s. Raises ModelError for an unsupported model.
    """
    run = model.settings.run
    if precision != "float64":
        raise ModelError(f"precision: found {precision}, expected float64, as the solver is static")
    end = max((time for c in _no_fail(model) for time, _ in c.profile), default=0.0)
    varies = end > 0 and any(len(c.profile) > 1 for c in _no_fail(model))
    steps = run.static.load_steps or (STEPS if varies else 1)
    if not varies and steps > 1:
        raise ModelError(
            f"{model.name}: $.run.static.load_steps: found {steps} and nothing that varies with time, expected 1, or a"
            " condition with a profile"
        )
    step = (end if varies else 1.0) / steps
    changed = msgspec.structs.replace(run, time_step=step, steps=steps, every=1, ledger=1)
    found = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=changed))
    _refuse_loads(found)
    return found


def _no_fail(model: Model) -> list[Condition]:
    return [condition for condition in model.settings.conditions if isinstance(condition, Condition)]


def _refuse_loads(model: Model) -> None:
    """Raise ModelError for conditions without an effect, and for contradictory holds."""
    run = model.settings.run
    times = [step * (run.time_step or 0.0) for step in range(1, run.steps + 1)]
    loads = False
    holds: dict[tuple[int, str], tuple[int, list[float]]] = {}
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Load):
            push = condition.traction if condition.body_force is None else condition.body_force
            loads |= bool(np.any(push)) and any(factors(condition, times))
        if not isinstance(condition, Displacement):
            continue
        for axis, value in zip("xyz", components(condition), strict=True):
            if value is None:
                continue
            way = [value * factor for factor in factors(condition, times)]
            loads |= any(way)
            for row in model.selected(condition).tolist():
                other, before = holds.setdefault((row, axis), (number, way))
                if before != way:
                    raise ModelError(
                        f"{model.name}: $.conditions[{number}].{axis}: found node {model.grid.ids[row]} held otherwise"
                        f" by $.conditions[{other}], expected one displacement of it, as the solver is static"
                    )
    if not loads:
        raise ModelError(
            f"{model.name}: $.conditions: found none that loads the plate at any load step, expected a load or a"
            " displacement that is not 0"
        )
