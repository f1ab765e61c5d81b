"""Settings laid over those of a file: the keys of a TOML file, and ``NAME=VALUE`` assignments with dotted names."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from pdmesh.model.document import Run, Settings, tables_beside
from pdmesh.model.suggestions import explained, may_be_none

NESTED = "values are nested too deep to be read; use those of the grid file"
POINTED = re.compile(r"[+-]?(\d+\.|\.\d+)([eE][+-]?\d+)?")  # .5 and 1., which are no numbers of TOML


class ModelError(ValueError):
    """A model that cannot be solved; the message names the place, what was found and what was expected."""


def overlaid(
    below: Settings,
    path: Path,
    settings: Path | None = None,
    assignments: Sequence[tuple[str, str]] = (),
    dimension: int = 2,
) -> Settings:
    """Settings of the file at `path`, overridden by a TOML file and then by assignments.

    Tables of a model in the plane (2) or in space (3) are read beside the file that names them. Raises ModelError,
    GridError.
    """
    layers = msgspec.to_builtins(below, builtin_types=())
    if settings is not None:
        above = _read_toml(settings)
        _refuse_plane_in_space(above, path, dimension)
        layers = _laid_over(_without_other_end(layers, above), above)
    for name, text in assignments:
        value = _toml_value(name, text)
        layers = _without_other_end(layers, _nested(name, value))
        if name == "run.fields" and isinstance(value, str):
            # All, the listed ones, or after a plus the listed ones besides those there are
            run, fields = layers["run"], value.removeprefix("+").split(",")
            if value == "all":
                fields = list(Run().fields)
            elif value.startswith("+") and isinstance(run, dict):
                earlier = run.get("fields", Run().fields)
                fields = [*earlier, *fields] if isinstance(earlier, list | tuple) else fields
            value = list(dict.fromkeys(fields))
        above = _nested(name, value)
        _refuse_plane_in_space(above, path, dimension)
        layers = _laid_over(layers, above)
    try:
        merged = msgspec.convert(layers, Settings)
    except msgspec.ValidationError as error:
        names = " + ".join(map(str, filter(None, [path, settings])))
        for name, text in assignments:
            if f"$.{name}" in str(error) or f"`{name.rpartition('.')[2]}`" in str(error):
                names = f"{names} with {name}={text}"
        raise ModelError(f"{names}: {explained(error, Settings, lambda: layers)}") from None
    tables = tables_beside(merged.conditions, settings or path, dimension)
    return msgspec.structs.replace(merged, conditions=tables)


def _refuse_plane_in_space(layer: dict[str, Any], path: Path, dimension: int) -> None:
    material = layer.get("material")
    plane = material.get("plane", "space") if dimension == 3 and isinstance(material, dict) else "space"
    if plane != "space":
        raise ModelError(f"{path}: material.plane is '{plane}'; use space, or none, in a body in space")


def _without_other_end(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Settings `below` without the duration if `above` gives steps, and the other way round; likewise G0 and the
    critical stretch."""
    for part, either in (("run", ("steps", "duration")), ("material", ("G0", "critical_stretch"))):
        new, old = above.get(part), below.get(part)
        names_above = [name for name in either if isinstance(new, dict) and new.get(name) is not None]
        if len(names_above) == 1 and isinstance(old, dict):
            below = below | {part: {name: value for name, value in old.items() if name not in either}}
    return below


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{path}: {explained(error, Settings, dict)}") from None
    except ValueError as error:  # a number may be too long
        raise ModelError(f"{path}: {error}") from None
    except RecursionError:
        raise ModelError(f"{path}: {NESTED}") from None


def _toml_value(name: str, text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        pass
    except RecursionError:
        raise ModelError(f"--set {name}: {NESTED}") from None
    if POINTED.fullmatch(text):
        return float(text)
    # a bare word: a number such as ``65GPa`` in the unit of its setting, ``none`` where a setting may be left out
    from pdmesh.quantities import NUMBER, number_in

    if text == "none" and may_be_none(name, Settings):
        return None
    if NUMBER.fullmatch(text) is None:
        return text
    from pdmesh.model.settings_table import unit_of  # reads source files

    unit = unit_of(name)
    try:
        return number_in(text, unit) if unit else text
    except ValueError as error:
        raise ModelError(f"{name} is '{text}'; use {error}") from None


def _nested(name: str, value: Any) -> dict[str, Any]:
    for key in reversed(name.split(".")):
        value = {key: value}
    nested: dict[str, Any] = value
    return nested


def _laid_over(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {key: _laid_over(below.get(key), value) for key, value in above.items()}
    return above
