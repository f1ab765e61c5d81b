"""Conditions that a way of solving a model does not support."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pdmesh.model.document import InitialDisplacement, InitialVelocity, Settings
from pdmesh.model.refusals import Impossible


def spinning(settings: Settings, why: str) -> Iterator[Impossible]:
    """Nodes that turn about a centre that is not known where they are not all of the model's."""
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, InitialVelocity) and np.any(condition.spin):
            yield Impossible(f"$.conditions[{number}].spin", str(condition.spin), f"0{why}")


def of_kinds(settings: Settings, kinds: tuple[type, ...], expected: str) -> Iterator[Impossible]:
    """Conditions of these kinds, which are not supported, and what is."""
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, kinds):
            yield Impossible(f"$.conditions[{number}]", str(condition.__struct_config__.tag), expected)


def displaced(settings: Settings) -> Iterator[Impossible]:
    """Initial displacements of runs that begin otherwise."""
    run = settings.run
    for name, value, usual in (
        ("physics", settings.physics, "mechanics"),
        ("run.start", run.start, "unloaded"),
        ("run.adapt", run.adapt, "none"),
    ):
        if value != usual:
            yield from of_kinds(settings, (InitialDisplacement,), f"none, as {name} is {value}")
