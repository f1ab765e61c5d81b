"""The named numbers and words a drawing carries, asked for one by one, so that a name nobody asks for is found out."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec
import numpy as np

from pdmesh.conditions import Profile, parse_profile
from pdmesh.grid import Material, Run
from pdmesh.shapes import SceneError

T = TypeVar("T")

PREFIX = "Peridynamics/"
FOLDERS = ("Zones", "Loads", "Fixes", "Moves", "Material", "Materials", "Refine", "Run", "Horizon ratio", "Area rule")


@dataclass(frozen=True)
class Parameter:
    """One parameter as a drawing defines it."""

    name: str
    value: float | str
    unit: str = ""
    meaning: str = ""


class Parameters:
    """Values asked for by their name below ``Peridynamics/``; remembers what was asked for."""

    def __init__(self, values: Mapping[str, float | str]) -> None:
        self._values = values
        self.used: set[str] = set()

    def below(self, folder: str) -> set[str]:
        """The names directly below a folder."""
        prefix = f"{PREFIX}{folder}/"
        return {name.removeprefix(prefix).split("/")[0] for name in self._values if name.startswith(prefix)}

    def _get(self, name: str, kind: type, expected: str) -> Any:
        full = PREFIX + name
        self.used.add(full)
        value = self._values.get(full)
        if value is not None and not isinstance(value, kind):
            raise SceneError(f"parameter '{full}': found {value!r}, expected {expected}")
        return value

    def maybe(self, name: str) -> float | None:
        """A finite number, or None where there is none."""
        value: float | None = self._get(name, float, "a number")
        if value is not None and not np.isfinite(value):
            raise SceneError(f"parameter '{PREFIX}{name}': found {value}, expected a finite number")
        return value

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number. Raises SceneError where there is neither one nor a default."""
        value = self.maybe(name)
        value = default if value is None else value
        if value is None:
            raise SceneError(f"parameter '{PREFIX}{name}': found none, expected a number")
        return value

    def pair(self, name: str) -> tuple[float | None, float | None]:
        """The components ``NAME x`` and ``NAME y``; None where there is none."""
        return self.maybe(f"{name} x"), self.maybe(f"{name} y")

    def whole(self, name: str, default: int) -> int:
        """A whole number."""
        value = self.number(name, float(default))
        if value != round(value):
            raise SceneError(f"parameter '{PREFIX}{name}': found {value:g}, expected a whole number")
        return round(value)

    def flag(self, name: str, default: bool) -> bool:
        """A number that is 0 or 1."""
        value = self.number(name, float(default))
        if value not in (0.0, 1.0):
            raise SceneError(f"parameter '{PREFIX}{name}': found {value:g}, expected 0 or 1")
        return value == 1.0

    def text(self, name: str, default: str = "", of: Sequence[str] = ()) -> str:
        """A word, one of those given."""
        value = self._get(name, str, "a word")
        value = default if value is None else str(value)
        if of and value not in of:
            raise SceneError(f"parameter '{PREFIX}{name}': found '{value}', expected one of {', '.join(of)}")
        return value

    def profile(self, name: str) -> Profile:
        """A profile in time."""
        return parse_profile(self.text(name), f"parameter '{PREFIX}{name}'")

    def refuse_unused(self) -> None:
        """Raises SceneError for a name that means nothing in the folders that have a meaning."""
        for name in sorted(set(self._values) - self.used):
            if name.startswith(PREFIX) and name.removeprefix(PREFIX).split("/")[0] in FOLDERS:
                raise SceneError(
                    f"parameter '{name}': found a name that means nothing here, expected{_close(name, self.used)}"
                )


def unknown(name: str, known: Iterable[str]) -> str:
    """What to say of a parameter that is not in a drawing."""
    return f"parameter '{name}' is not in the drawing, expected{_close(name, known)}"


def _close(name: str, known: Iterable[str]) -> str:
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    return f" one such as '{(close or names)[0]}'" if names else " none"


def material(parameters: Parameters, folder: str, base: Material | None) -> Material | None:
    """The material below a folder; what it leaves out is that of `base`. None where nothing says any."""
    keep = parameters.maybe(f"{folder}/Keep G0")
    given = {
        "E": parameters.maybe(f"{folder}/E"),
        "rho": parameters.maybe(f"{folder}/rho"),
        "G0": parameters.maybe(f"{folder}/G0"),
        "nu": parameters.maybe(f"{folder}/nu"),
        "law": parameters.text(f"{folder}/Force law") or None,
        "kr": parameters.maybe(f"{folder}/kr"),
        "keep_G0": None if keep is None else parameters.flag(f"{folder}/Keep G0", True),
        "micromodulus": parameters.text(f"{folder}/Micromodulus") or None,
        "plane": parameters.text(f"{folder}/Plane") or None,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if base is not None:
        given = msgspec.to_builtins(base) | given
    if not given:
        return None
    for name in ("E", "rho", "G0"):
        if name not in given:
            raise SceneError(f"parameter '{PREFIX}{folder}/{name}': found none, expected a number")
    return _converted(given, Material, folder)


def run(parameters: Parameters) -> Run:
    """How long to solve, from the duration and the time step."""
    step, duration = parameters.maybe("Run/Time step"), parameters.maybe("Run/Duration")
    every = parameters.whole("Run/Frame every", 50)
    if step is None and duration is None:
        return _converted({"every": every}, Run, "Run")
    if step is None or duration is None or not step > 0 or not duration >= 0:
        raise SceneError(
            f"{PREFIX}Run: found Time step {step} s and Duration {duration} s, expected both, positive, or none"
        )
    if duration / step > 1e9:
        raise SceneError(f"{PREFIX}Run: found {duration / step:.1g} steps, expected at most 1e9")
    return _converted({"time_step": step, "steps": round(duration / step), "every": every}, Run, "Run")


def _converted(fields: dict[str, Any], kind: type[T], place: str) -> T:
    try:
        return msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise SceneError(f"{PREFIX}{place}: {error}") from None
