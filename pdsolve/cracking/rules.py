"""What cracks that are particles may be asked for, and how often they are looked at."""

from __future__ import annotations

import numpy as np

from pdmesh.model.continuum import poisson, rayleigh_speed
from pdsolve.model import Model, ModelError


def refuse(model: Model, mode: str) -> None:
    """Raises ModelError for what cracks that are particles cannot be solved with, and for rules that contradict."""
    run = model.settings.run
    if run.cracks == "bonds":
        return
    rules, words = run.particles, "expected {} with cracks that are particles"
    solids = [material.solid for material in model.materials if material.solid not in ("linear", "svk")]
    for place, found, wrong, expected in (
        ("mode", mode, mode != "conservative", "conservative"),
        ("$.run.adapt", run.adapt, run.adapt != "none", "none"),
        ("$.material.solid", (*solids, "")[0], bool(solids), "linear or svk"),
    ):
        if wrong:
            raise ModelError(f"{model.name}: {place}: found {found}, {words.format(expected)}")
    for name, criterion in (("strength", "stress"), ("toughness", "intensity")):
        value = getattr(rules, name)
        if value is not None and rules.criterion != criterion:
            raise ModelError(
                f"{model.name}: $.run.particles.{name}: found {value:g}, expected none as the criterion is"
                f" {rules.criterion}"
            )
    if rules.criterion == "stress" and rules.strength is None:
        raise ModelError(
            f"{model.name}: $.run.particles.strength: found none, expected the largest principal stress, Pa, as the"
            " criterion is stress"
        )
    if rules.criterion == "intensity" and rules.direction != "hoop":
        raise ModelError(
            f"{model.name}: $.run.particles.direction: found {rules.direction}, expected hoop as the criterion is"
            " intensity"
        )


def every_of(model: Model, step: float) -> int:
    """Steps of so many seconds between two looks at cracks: a crack that grows at each runs as fast as Rayleigh waves,
    which none outruns."""
    speeds = [rayleigh_speed(each.E, each.rho, each.plane, poisson(each)) for each in model.materials]
    shortest = model.settings.run.particles.spacing * float(model.grid.delta.min())
    return max(1, int(np.ceil(shortest / (max(speeds) * step))))
