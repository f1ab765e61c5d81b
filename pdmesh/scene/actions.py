"""Conditions and regions of scenes, for plates and bodies, as structs of the grid file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np

from pdmesh.model.document import Acceleration, AnyCondition, InitialVelocity, MediumRegion, Velocity
from pdmesh.model.plain_numbers import plain
from pdmesh.model.suggestions import explained
from pdmesh.scene.conditions import checked_profile
from pdmesh.scene.shapes import SceneError

T = TypeVar("T")
Components = Sequence[float | None]


def action(kind: type[AnyCondition], name: str, values: dict[str, Any]) -> AnyCondition:
    """The condition of a kind with these values. Raises SceneError."""
    place = f"{kind.__struct_config__.tag} '{name}'"
    if "profile" in values:
        values = values | {"profile": checked_profile(values["profile"], f"{place}: profile")}
    return converted({"kind": kind.__struct_config__.tag, "name": name} | values, kind, place)


def motion(
    name: str,
    axes: str,
    velocity: Components | None,
    acceleration: Components | None,
    initial_velocity: Components | None,
    **held: Any,
) -> tuple[type[AnyCondition], dict[str, Any]]:
    """Kind and values of the one motion along `axes` that is given; `held` are profile and breakable.

    They do not apply to an initial velocity. Raises SceneError.
    """
    given: list[tuple[type[AnyCondition], Components | None]] = [
        (Velocity, velocity),
        (Acceleration, acceleration),
        (InitialVelocity, initial_velocity),
    ]
    chosen = [(kind, value) for kind, value in given if value is not None]
    if len(chosen) != 1:
        raise SceneError(
            f"move '{name}': found {len(chosen)} of velocity, acceleration and initial_velocity, expected one"
        )
    ((kind, components),) = chosen
    along = dict(zip(axes, components, strict=True))
    if kind is not InitialVelocity:
        return kind, along | held
    if any(held.values()):
        raise SceneError(f"move '{name}': found a profile or breakable, expected none of an initial velocity")
    return kind, {axis: value or 0.0 for axis, value in along.items()}


def vector(given: Sequence[float], count: int, place: str) -> tuple[float, ...]:
    """So many finite numbers. Raises SceneError, beginning with `place`."""
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise SceneError(f"{place}: found {given!r:.80}, expected {count} finite numbers")
    return tuple(found.tolist())


def medium(name: str, D: float) -> MediumRegion:
    """A medium region of diffusivity `D`, m^2/s. Raises SceneError."""
    return converted({"name": name, "D": D}, MediumRegion, f"medium '{name}'")


def converted(given: dict[str, Any], kind: type[T], place: str) -> T:
    """A struct of the grid file with these fields. Raises SceneError, beginning with `place`."""
    given = plain(given)
    try:
        return msgspec.convert(given, kind)
    except msgspec.ValidationError as error:
        raise SceneError(f"{place}: {explained(error, kind, lambda: given)}") from None
