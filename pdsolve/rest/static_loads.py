"""Loads of a static solution: its load steps, and conditions that it does not support."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np

from pdmesh.model.document import ARC, CRACK, Condition, Displacement, Load
from pdmesh.model.materials.kind import softens
from pdmesh.model.selection import components, data_too_short, given_of
from pdmesh.model.values_at_places import values_at_times
from pdmesh.model.values_of_place import Table, end_of_data, is_of_place
from pdsolve.conditions import conditions_of, factors
from pdsolve.model import Model, ModelError, counted
from pdsolve.operators.softening_shear import bonds_soften
from pdsolve.rest.path import CRACK_STEPS

STEPS = 10  # load steps where something varies
PATH_STEPS = 10  # times those of a crack through the smallest extent: the path is given up


def model_with_load_steps(model: Model) -> Model:
    """The model in load steps: steps and frames are load steps from time 0 to the end of its profiles.

    Without a varying profile there is one load step, at 1 s. Raises ModelError for an unsupported model.
    """
    run = model.settings.run
    if uses_softening_path_control(model) or uses_crack_length_control(model) or uses_arc_length_control(model):
        return _model_with_path_steps(model)
    if run.static.control is not None or run.after == "motion":
        named = (
            "run.after is 'motion'; use path"
            if run.after == "motion"
            else f"run.static.control is '{run.static.control}'; use none"
        )
        raise ModelError(f"{model.name}: $.{named}, as no bond softens before it breaks")
    if run.fatigue is not None:
        changed = msgspec.structs.replace(run, time_step=1.0, ledger=1)
        stepped_model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=changed))
        _refuse_unsolvable_conditions(stepped_model, [1.0])
        return stepped_model
    profiles = [condition.profile for _, condition in conditions_of(model.settings, Condition)]
    data_ends = [end_of_data(condition) for _, condition in conditions_of(model.settings, Condition)]
    ends = [time for time in data_ends if time is not None]
    end = max((*ends, *(time for profile in profiles for time, _ in profile)), default=0.0)
    varies = end > 0 and (bool(ends) or any(len(profile) > 1 for profile in profiles))
    wrong = data_too_short(model.settings.conditions, end)
    if wrong is not None:
        raise ModelError(f"{model.name}: {wrong}")
    steps = run.static.load_steps or (STEPS if varies else 1)
    if not varies and steps > 1:
        raise ModelError(
            f"{model.name}: $.run.static.load_steps is {steps}, and nothing varies with time; give a load or a"
            " displacement a profile, such as 'ramp 1' (Profile in a drawing), or use 1 step"
        )
    step = (end if varies else 1.0) / steps
    changed = msgspec.structs.replace(run, time_step=step, steps=steps, every=1, ledger=1)
    stepped_model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=changed))
    _refuse_unsolvable_conditions(stepped_model, [number * step for number in range(1, steps + 1)])
    return stepped_model


def uses_softening_path_control(model: Model) -> bool:
    """Whether bonds soften and break by themselves: then the equilibrium path is followed."""
    softening = any(softens(material) for material in model.materials)  # or break, of a law of one's own
    return model.settings.run.cracks == "bonds" and softening and bonds_soften(model)


def uses_crack_length_control(model: Model) -> bool:
    """Whether cracks of particles are followed, their length being the control."""
    return model.settings.run.cracks == "particles" and model.settings.run.static.control == CRACK


def uses_arc_length_control(model: Model) -> bool:
    """Whether an elastic body is followed by the arc length of its path."""
    return model.settings.run.cracks == "bonds" and model.settings.run.static.control == ARC


def _model_with_path_steps(model: Model) -> Model:
    """The model in steps of 1 s along its path; its profiles go from 0 to 1 s. Raises ModelError."""
    run = model.settings.run
    profiles = [condition.profile for _, condition in conditions_of(model.settings, Condition)]
    varies = any(len(profile) > 1 for profile in profiles)
    end = max((time for profile in profiles for time, _ in profile), default=0.0)
    conditions = []
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Condition) or (varies and len(condition.profile) < 2):
            conditions.append(condition)
            continue
        points = condition.profile if varies else ((0.0, 0.0), (1.0, 1.0))
        if len(points) != 2 or points[0][0] != 0 or points[1][0] != (end if varies else 1.0):
            raise ModelError(
                f"{model.name}: $.conditions[{number}].profile has {len(points)} points; use a straight line from 0"
                " to the end, as loads follow from what bonds or cracks dissipate"
            )
        conditions.append(msgspec.structs.replace(condition, profile=((0.0, points[0][1]), (1.0, points[1][1]))))
    if uses_crack_length_control(model):
        # a crack of particles goes through the largest extent of the plate
        spacing, extent = run.particles.spacing * model.grid.delta.min(), np.ptp(model.grid.position, axis=0).max()
        steps = run.static.load_steps or int(np.ceil(extent / spacing))
    else:
        steps = PATH_STEPS * (run.static.load_steps or CRACK_STEPS)
    changed = msgspec.structs.replace(run, time_step=1.0, steps=steps, every=1, ledger=1)
    settings = msgspec.structs.replace(model.settings, run=changed, conditions=tuple(conditions))
    stepped_model = dataclasses.replace(model, settings=settings)
    _refuse_unsolvable_conditions(stepped_model, [1.0])
    return stepped_model


def quasi_static_swelling_model(model: Model) -> Model:
    """The model at rest after each time step of a content that swells it. Raises ModelError for an unsupported one."""
    run = model.settings.run
    assert run.time_step is not None
    moves = msgspec.structs.replace(model.settings, run=msgspec.structs.replace(run, solver="explicit"))
    timed = counted(dataclasses.replace(model, settings=moves), run.time_step).settings
    every_step = msgspec.structs.replace(timed.run, solver="static", ledger=run.ledger or 1)  # a step may take minutes
    rests = msgspec.structs.replace(timed, run=every_step)
    stepped_model = dataclasses.replace(model, settings=rests)
    steps = stepped_model.settings.run.steps
    _refuse_unsolvable_conditions(
        stepped_model, [number * run.time_step for number in range(1, steps + 1)], load_is_needed=False
    )
    return stepped_model


def _refuse_unsolvable_conditions(model: Model, times: list[float], load_is_needed: bool = True) -> None:
    """Raise ModelError for contradictory holds at these times, s, and without an effect, if one is `load_is_needed`."""
    loads = False
    holds: dict[tuple[int, str], tuple[int, list[float]]] = {}
    for _, load in conditions_of(model.settings, Load):
        acts = any(is_of_place(value) or value for vector in given_of(load).values() for value in vector)
        loads |= acts and any(factors(load, times))
    for number, condition in conditions_of(model.settings, Displacement):
        for axis, value in zip("xyz", components(condition), strict=True):
            if value is None:
                continue
            rows = model.selected(condition)
            if isinstance(value, Table) and value.times:
                ways = values_at_times(value, model.grid.part(rows).position, np.array(times))
            else:
                ways = np.outer(np.broadcast_to(model.values(value, rows), len(rows)), factors(condition, times))
            loads |= bool(ways.any())
            for row, way in zip(rows.tolist(), ways.tolist(), strict=True):
                earlier_number, before = holds.setdefault((row, axis), (number, way))
                if before != way:
                    raise ModelError(
                        f"{model.name}: $.conditions[{number}].{axis}: node {model.grid.ids[row]} is held otherwise"
                        f" by $.conditions[{earlier_number}]; use one displacement of it, as the solver is static"
                    )
    if load_is_needed and not loads:
        raise ModelError(
            f"{model.name}: $.conditions: none loads the plate at any load step; add a load or a displacement that"
            " is not 0"
        )
