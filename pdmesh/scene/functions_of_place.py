"""Python functions of place in conditions of scenes, which become tables of the values at the condition's nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.values_of_place import AXES, LARGEST, LEAST, Table, Value, is_file, replaced, wrong_value
from pdmesh.scene.shapes import SceneError

ValueOfPlace = Value | Callable[..., Any]  # of a component: f(x, y) or f(x, y, z), m, gives a number
VectorOfPlace = Sequence[ValueOfPlace] | Callable[..., Any]  # along each axis: the function gives all components
C = TypeVar("C", bound=msgspec.Struct)


class Function(NamedTuple):
    """A function that gives one value of a condition."""

    name: str  # of the field
    number: int | None  # within it, of a vector
    value: Callable[..., Any]
    component: int | None  # of what it returns; None: all


@dataclass(frozen=True)
class OverTime:
    """A function of place and time: f(x, y, t), or in space f(x, y, z, t), m and s, sampled at `times`."""

    function: Callable[..., Any]
    times: tuple[float, ...]  # s, which cover the run

    def __call__(self, *at: float) -> Any:
        """The value at a place and a time."""
        return self.function(*at)


def over_time(function: Callable[..., Any], times: Sequence[float]) -> OverTime:
    """A value of a condition that is a function of place and time.

    Parameters
    ----------
    function
        f(x, y, t), in space f(x, y, z, t), m and s: one value, or all components.
    times
        When it is sampled, s, increasing, from 0 to the end of the run. Values are linear between them.
    """
    return OverTime(function, tuple(float(time) for time in times))


class Component(NamedTuple):
    """One component of what a function returns."""

    value: Callable[..., Any]
    number: int


def components_of(vector: Any, count: int) -> tuple[Any, ...]:
    """The components of a vector, which may be one function of all of them."""
    return tuple(Component(vector, at) for at in range(count)) if callable(vector) else tuple(vector)


def without_functions(values: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Function, ...]]:
    """Fields of a condition with 0 in place of functions, and these."""
    plain: dict[str, Any] = {}
    functions: list[Function] = []
    for name, value in values.items():
        several = isinstance(value, tuple) and not isinstance(value, Component)
        parts = list(value) if several else [value]
        for at, part in enumerate(parts):
            if isinstance(part, Component) or callable(part):
                function, which = part if isinstance(part, Component) else (part, None)
                functions.append(Function(name, at if several else None, function, which))
                parts[at] = 0.0
        plain[name] = tuple(parts) if several else parts[0]
    return plain, tuple(functions)


def sampled(condition: C, functions: Sequence[Function], position: NDArray[np.float64], place: str) -> C:
    """The condition with tables of its functions at the places (k, d) of its nodes, m. Raises SceneError."""
    places = tuple(map(tuple, position.tolist()))
    for function in functions:
        times = function.value.times if isinstance(function.value, OverTime) else ()
        moments: list[tuple[float, ...]] = [(time,) for time in times] or [()]
        values = [_value(function, (*at, *time), place) for time in moments for at in places]
        table = Table(places, tuple(values), None, times)
        wrong = wrong_value(table, position.shape[1]) if times else None
        if wrong is not None:
            raise SceneError(f"{place}: {function.name}: {wrong}")
        condition = replaced(condition, function.name, function.number, table)
    return condition


def _value(function: Function, at: tuple[float, ...], place: str) -> float:
    """The value of a function at a place, and a time if it is one of time. Raises SceneError."""
    where = ", ".join(f"{number:g}" for number in at)
    try:
        output = function.value(*at)
        value = float(output if function.component is None else output[function.component])
    except Exception as error:  # a user's program may raise anything
        raise SceneError(
            f"{place}: {function.name}: the function raises {type(error).__name__} at ({where}) m ({error});"
            f" return a number for each place ({', '.join(AXES[: len(at)])})"
        ) from None
    if not abs(value) <= LARGEST:
        raise SceneError(f"{place}: {function.name} is {value:g} at ({where}) m; use finite numbers")
    return value if abs(value) >= LEAST else 0.0


def divided(value: ValueOfPlace, by: float) -> ValueOfPlace:
    """The value over a number; one of place stays one. Raises SceneError for the name of a file."""
    if isinstance(value, Table):
        return msgspec.structs.replace(value, values=tuple(number / by for number in value.values))
    if isinstance(value, str):
        if is_file(value):
            raise SceneError(f"a heat supply cannot be the file '{value:.80}'; use a function or an expression")
        return f"({value}) / {by!r}"
    if callable(value):
        return lambda *at: value(*at) / by
    return value / by
