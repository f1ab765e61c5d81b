"""Conditions and regions of scenes, for plates and bodies, as structs of the grid file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np

from pdmesh.model.base_structs import plain
from pdmesh.model.document import (
    Acceleration,
    AnyCondition,
    InitialDisplacement,
    InitialVelocity,
    MediumRegion,
    Velocity,
)
from pdmesh.model.suggestions import explained
from pdmesh.model.values_of_place import is_file, is_of_place, named, varying, wrong_value
from pdmesh.scene.conditions import checked_profile
from pdmesh.scene.functions_of_place import Component, ValueOfPlace, components_of
from pdmesh.scene.shapes import SceneError

T = TypeVar("T")
Components = Sequence[ValueOfPlace | None] | Callable[..., Any]  # a function gives all components


def action(kind: type[AnyCondition], name: str, values: dict[str, Any], dimension: int = 3) -> AnyCondition:
    """The condition of a kind with these values, in a plate (2) or in space (3). Raises SceneError."""
    place = f"{kind.__struct_config__.tag} '{name}'"
    if "profile" in values:
        values = values | {"profile": checked_profile(values["profile"], f"{place}: profile")}
    condition = converted({"kind": kind.__struct_config__.tag, "name": name} | values, kind, place)
    for key, at, value in varying(condition):
        wrong = None if isinstance(value, str) and is_file(value) else wrong_value(value, dimension)
        if wrong is not None:
            raise SceneError(f"{place}: {named(key, at)}: {wrong}")
    return condition


MOTIONS: dict[str, type[AnyCondition]] = {
    "velocity": Velocity,
    "acceleration": Acceleration,
    "initial_velocity": InitialVelocity,
    "initial_displacement": InitialDisplacement,
}


def motion(
    name: str, axes: str, moves: Mapping[str, Components | None], **options: Any
) -> tuple[type[AnyCondition], dict[str, Any]]:
    """Kind and values of the one of some `MOTIONS` along `axes` that is given; `options` are profile and breakable.

    They do not apply to an initial velocity or displacement. Raises SceneError.
    """
    chosen = [(MOTIONS[word], vector) for word, vector in moves.items() if vector is not None]
    if len(chosen) != 1:
        raise SceneError(f"move '{name}' has {len(chosen)} of {', '.join(MOTIONS)}; use one")
    ((kind, vector),) = chosen
    components = components_of(vector, len(axes))
    if len(components) != len(axes) or all(component is None for component in components):
        expected = f"{len(axes)} components, None of one that is free"
        raise SceneError(f"move '{name}' has {len(components)} components; use {expected}")
    along = dict(zip(axes, components, strict=True))
    if kind in (InitialVelocity, InitialDisplacement):
        if any(options.values()):
            raise SceneError(
                f"move '{name}': an initial velocity or displacement has no profile or breakable; leave them out"
            )
        return kind, along
    return kind, along | options


def vector(value: Any, count: int, place: str) -> tuple[float, ...]:
    """So many finite numbers. Raises SceneError, beginning with `place`."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise SceneError(f"{place} is {value!r:.80}; use {count} finite numbers")
    return tuple(array.tolist())


def vector_of_place(value: Any, count: int, place: str) -> tuple[Any, ...]:
    """So many finite numbers, expressions, tables or functions of place. Raises SceneError, beginning with `place`."""
    try:
        components = components_of(value, count)
    except TypeError:
        components = ()
    numbers = [
        component
        for component in components
        if not (is_of_place(component) or callable(component) or isinstance(component, Component))
    ]
    if len(components) == count and len(numbers) < count:
        vector(numbers, len(numbers), place)
        return components
    return vector(components, count, place)


def medium(name: str, D: float) -> MediumRegion:
    """A medium region of diffusivity `D`, m^2/s. Raises SceneError."""
    return converted({"name": name, "D": D}, MediumRegion, f"medium '{name}'")


def converted(fields: dict[str, Any], kind: type[T], place: str) -> T:
    """A struct of the grid file with these fields. Raises SceneError, beginning with `place`."""
    fields = plain(fields)
    try:
        return msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise SceneError(f"{place}: {explained(error, kind, lambda: fields)}") from None
