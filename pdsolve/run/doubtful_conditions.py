"""Conditions, and the restitution of contact, that act otherwise than their author probably means."""

from __future__ import annotations

import warnings

import numpy as np

from pdmesh.model.document import InitialVelocity, Timed
from pdmesh.model.rigid_bodies import components_set
from pdmesh.model.selection import components
from pdmesh.model.suggestions import called
from pdsolve.checks import warn
from pdsolve.model import Model, ModelNote

LITTLE = 0.1  # of the peak of a profile: a run in which less acts may be one of other units


def warn_of_doubtful_conditions(model: Model, time_step: float) -> None:
    """Warn of conditions that hardly act in a run in steps of `time_step`, s, of zeros that set nothing, and of a
    restitution that bodies do not show."""
    _warn_of_profiles_far_below_peak(model, time_step)
    _warn_of_ignored_zero_velocities(model)
    contact, bodies = model.settings.contact, model.grid.bodies
    if contact is None or contact.restitution == 1 or bodies is None or len(bodies.rigid) == len(bodies.names):
        return
    warnings.warn(
        f"{model.name}: $.contact.restitution is {contact.restitution:g} with bodies that deform, which usually"
        " rebound with more: it holds for pairs of nodes in contact, and the elastic energy inside the bodies returns"
        " in full; rigid bodies rebound with it",
        ModelNote,
        stacklevel=2,
    )


def _warn_of_profiles_far_below_peak(model: Model, time_step: float) -> None:
    """Warn of conditions whose profile stays far below its peak in a run in steps of `time_step`, s."""
    run = model.settings.run
    if run.solver == "static" and model.settings.physics == "mechanics":
        return  # whose load steps go to the end of the profiles
    end = run.steps * time_step
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Timed) or len(condition.profile) < 2:
            continue
        time, factor = np.array(condition.profile, dtype=float).T
        acts = np.abs([*factor[time <= end], np.interp(end, time, factor)]).max()
        peak, at = float(np.abs(factor).max()), float(time[np.abs(factor).argmax()])
        if acts < LITTLE * peak:
            named = f"{condition.__struct_config__.tag} '{called(condition.name, number)}'"
            warn(
                model,
                f"$.conditions[{number}].profile: {acts / peak:.2g} of the peak of {named} acts within the run's"
                f" {end:.3g} s: the peak comes at {at:.3g} s; use a longer run.duration or a shorter profile"
                " (quasi-static: run.solver static)",
            )


def _warn_of_ignored_zero_velocities(model: Model) -> None:
    """Warn of a component of an initial velocity that is 0 where an earlier one is not, as it leaves that."""
    earlier: list[tuple[int, InitialVelocity]] = []
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, InitialVelocity):
            continue
        for axis, value, sets in zip("xyz", components(condition), components_set(condition), strict=True):
            for earlier_number, before in earlier if value == 0.0 and not sets else ():
                common = np.intersect1d(model.selected(condition), model.selected(before))
                if getattr(before, axis) not in (None, 0.0) and len(common):
                    warn(
                        model,
                        f"$.conditions[{number}].{axis} is 0 beside another component, which leaves what"
                        f" $.conditions[{earlier_number}] gives {len(common)} of its nodes; one condition with all"
                        " components sets a node's velocity to 0 along an axis",
                    )
        earlier.append((number, condition))
