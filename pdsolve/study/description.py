"""Description of a study: the drawing, varied and common parameters, and the number of repetitions."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import sys
import tomllib
import zlib
from collections.abc import Container, Mapping
from dataclasses import dataclass
from datetime import date, time
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from pdmesh.files import FilePath
from pdmesh.model.suggestions import explained
from pdsolve.study.measure_columns import MEASURES, OWN, column_of

Mode = Literal["conservative", "thesis"]
Kernel = Literal["blocks", "listed"]
Precision = Literal["float64", "float32"]

OPTIONS = ("mode", "kernel", "precision")
MOST = 100_000  # runs


class StudyError(ValueError):
    """An invalid study; the message names the file, what was found and what was expected."""


class Set(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Values for one run, or for all: parameters of the drawing, settings of the model, and solver options."""

    drawing: dict[str, Any] = {}
    model: dict[str, Any] = {}
    mode: Mode | None = None
    kernel: Kernel | None = None
    precision: Precision | None = None


class Vary(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Lists of values; a study runs all their combinations."""

    drawing: dict[str, Any] = {}
    model: dict[str, Any] = {}
    mode: tuple[Mode, ...] | None = None
    kernel: tuple[Kernel, ...] | None = None
    precision: tuple[Precision, ...] | None = None


class Repeat(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Number of repetitions of each run: the first as drawn, the others disturbed by uniform random draws.

    `noise` alone is normally distributed.
    """

    times: Annotated[int, msgspec.Meta(ge=1, le=10_000)] = 1
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**31)] = 0
    notch: Annotated[float, msgspec.Meta(ge=0, le=10)] = 0.0  # spacings that pre-cracks are moved across themselves
    step: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.0  # share that the time step is shortened by, at most
    noise: Annotated[float, msgspec.Meta(ge=0, le=0.1)] = 0.0  # spacings: standard deviation of the nodes' places


ONCE = Repeat()


QUANTITIES = ("peak_force", "displacement_at_peak", "intensity", "cycles", "sql")


class RunMeasure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A further column of the table: one of QUANTITIES of a run."""

    peak_force: str | None = None  # the largest force of this condition or load cell, along the axis of its largest
    displacement_at_peak: str | None = None  # the mean displacement of its nodes along this axis, at that force
    intensity: Literal["J", "K1", "K2", "T"] | None = None  # of the first tip, in the last frame in which it has one
    cycles: Literal["total", "first_break"] | None = None  # of a run with fatigue
    sql: str | None = None  # a query of the database of a run, whose first value it is
    unit: str = ""  # of what `sql` selects
    thickness: Annotated[float, msgspec.Meta(gt=0, le=1e3)] | None = None  # m, of a plate, whose force is in N then

    @property
    def quantity(self) -> tuple[str, str]:
        """The field that is given, and its value."""
        return next((name, value) for name in QUANTITIES if (value := getattr(self, name)) is not None)


Pair = tuple[float, float]


class Distribution(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The distribution of a parameter that is drawn anew for each repetition; one field is given."""

    uniform: Pair | None = None  # least and largest value
    normal: Pair | None = None  # mean and standard deviation
    lognormal: Pair | None = None  # median, and standard deviation of the logarithm
    weibull: Pair | None = None  # scale, exceeded with a probability of 1/e, and modulus

    def draw(self, random: np.random.Generator) -> float:
        """A value."""
        if self.uniform is not None:
            return float(random.uniform(*self.uniform))
        if self.normal is not None:
            return float(random.normal(*self.normal))
        if self.lognormal is not None:
            return float(self.lognormal[0] * np.exp(self.lognormal[1] * random.standard_normal()))
        assert self.weibull is not None
        return float(self.weibull[0] * random.weibull(self.weibull[1]))


class Random(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Distributions of parameters of the drawing and of settings of the model, which may be tables in tables."""

    drawing: dict[str, Distribution] = {}
    model: dict[str, Any] = {}

    def named(self) -> list[tuple[str, str, Distribution]]:
        """Kind, name and distribution of each parameter. Raises msgspec.ValidationError."""
        flat = _flatten_to_dotted_names(self.model, ends=Distribution.__struct_fields__)
        named = [("model", name, msgspec.convert(value, Distribution)) for name, value in flat.items()]
        return [*(("drawing", *item) for item in self.drawing.items()), *named]


class FitParameter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The first guess of a parameter, and the bounds that it stays between."""

    first: float | None = None
    bounds: Pair | None = None


class FitSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The parameters that are fitted, and the curve of each run that is compared with the measured one."""

    condition: str  # the force of this condition or load cell
    gap: str | None = None  # against the opening of this gap; None: against its own displacement
    thickness: Annotated[float, msgspec.Meta(gt=0, le=1e3)] | None = None  # m, of the specimen of a 2D model
    step: Annotated[float, msgspec.Meta(ge=1e-5, le=0.2)] = 0.02  # of the derivative, as a share of the parameter
    evaluations: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 30  # sets of parameters that are tried, at most
    drawing: dict[str, FitParameter] = {}
    model: dict[str, Any] = {}

    def named(self) -> list[tuple[str, str, FitParameter]]:
        """Kind, name and settings of each parameter. Raises ValueError."""
        flat = _flatten_to_dotted_names(self.model, ends=FitParameter.__struct_fields__)
        for name, value in flat.items():
            if not isinstance(value, dict):
                raise ValueError(f"$.fit.model: {name} is {value!r:.40}; write {{first = 1.0, bounds = [0.5, 2.0]}}")
        named = [("model", name, msgspec.convert(value, FitParameter)) for name, value in flat.items()]
        return [*(("drawing", *item) for item in self.drawing.items()), *named]


class Description(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The contents of the file study.toml."""

    drawing: str
    set: Set = Set()
    vary: Vary = Vary()
    runs: tuple[Set, ...] = ()
    repeat: Repeat = Repeat()
    random: Random = Random()
    measures: dict[str, RunMeasure] = {}
    fit: FitSettings | None = None


@dataclass(frozen=True)
class Case:
    """The parameters of one run of a study."""

    drawing: Mapping[str, Any]
    model: Mapping[str, Any]
    options: Mapping[str, str]
    repetition: int = 0  # 0: undisturbed
    repeat: Repeat = ONCE

    @property
    def key(self) -> str:
        """Text that identifies the case among all others."""
        parts: dict[str, Any] = {"drawing": self.drawing, "model": self.model, "options": self.options}
        if self.repetition:
            disturbed = msgspec.to_builtins(self.repeat)
            del disturbed["times"]
            parts |= {"repetition": self.repetition, "repeat": disturbed}
        return json.dumps(_with_equal_numbers(parts), sort_keys=True)

    @property
    def names(self) -> list[tuple[str, str, str]]:
        """Kind, name and table column of each parameter."""
        kinds = (("drawing", self.drawing), ("model", self.model), ("options", self.options))
        return [(kind, name, column_of(kind, name)) for kind, parameters in kinds for name in parameters]

    @property
    def values(self) -> dict[str, Any]:
        """Parameters of this run by table column."""
        return {column: getattr(self, kind)[name] for kind, name, column in self.names}

    def assignments(self, kind: str) -> list[tuple[str, str]]:
        """Parameters of the "drawing", or settings of the "model", in the form of ``--set``."""
        parameters: Mapping[str, Any] = getattr(self, kind)
        return [(name, format_value(value, toml=kind == "model")) for name, value in parameters.items()]


@dataclass(frozen=True)
class Study:
    """A study as read from its file."""

    path: Path
    text: str
    description: Description

    @property
    def drawing(self) -> Path:
        """The drawing's file; its name is relative to the study's folder."""
        return self.path.parent / self.description.drawing

    @property
    def digest(self) -> str:
        """SHA-256 of the drawing as it is now. Raises OSError."""
        return hashlib.sha256(self.drawing.read_bytes()).hexdigest()

    @property
    def varied(self) -> list[str]:
        """Names of the parameters that differ between runs, but for random ones, in the order of the file."""
        if self.description.fit is not None:
            return [column_of(kind, name) for kind, name, _ in self.description.fit.named()]
        cases, random = self.cases(), self.random
        names = dict.fromkeys(name for case in cases for name in case.values if name not in random)
        return [
            name
            for name in names
            if len({json.dumps(_with_equal_numbers(case.values.get(name))) for case in cases}) > 1
        ]

    @property
    def random(self) -> list[str]:
        """Table columns of the random parameters."""
        return [column_of(kind, name) for kind, name, _ in self.description.random.named()]

    def case_of_fit(self, values: Mapping[str, float] = {}) -> Case:
        """The run of a fit with these values of its parameters, by their names; by default those of the first guess."""
        parts: dict[str, dict[str, Any]] = {"drawing": {}, "model": {}, "options": {}}
        _override_parts(parts, self.description.set)
        for kind, name, parameter in self.description.fit.named() if self.description.fit else ():
            parts[kind][name] = values.get(name, parameter.first)
        return Case(parts["drawing"], parts["model"], parts["options"])

    def cases(self) -> list[Case]:
        """All runs: each of `runs` combined with all combinations of `vary`, and repeated; of a fit, the first guess.

        Raises StudyError.
        """
        about, cases = self.description, {}
        if about.fit is not None:
            return [self.case_of_fit()]
        vary = about.vary
        ranges = [("drawing", *item) for item in vary.drawing.items()]  # kind, name and values of each parameter
        ranges += [("model", *item) for item in _flatten_to_dotted_names(vary.model).items()]
        ranges += [("options", name, getattr(vary, name)) for name in OPTIONS if getattr(vary, name) is not None]
        for _, name, values in ranges:
            if not isinstance(values, list | tuple) or not values:
                raise StudyError(f"{self.path}: $.vary: {name} is {values!r:.60}; use a list of values")
        count = math.prod(len(values) for _, _, values in ranges) * max(len(about.runs), 1) * about.repeat.times
        if count > MOST:
            raise StudyError(f"{self.path} has {count} runs; use at most {MOST}")
        distributions = about.random.named()
        for listed in about.runs or (Set(),):
            for chosen in itertools.product(*(values for _, _, values in ranges)):
                parts: dict[str, dict[str, Any]] = {"drawing": {}, "model": {}, "options": {}}
                _override_parts(parts, about.set)
                _override_parts(parts, listed)
                for (kind, name, _), value in zip(ranges, chosen, strict=True):
                    parts[kind][name] = value
                for repetition in range(about.repeat.times):
                    drawn = {kind: dict(values) for kind, values in parts.items()}
                    for kind, name, distribution in distributions:
                        entropy = [about.repeat.seed, repetition, zlib.crc32(name.encode())]  # of each parameter
                        drawn[kind][name] = distribution.draw(np.random.default_rng(entropy))
                    case = Case(**drawn, repetition=repetition, repeat=about.repeat)
                    cases[case.key] = case
        return list(cases.values())


def read_study(path: FilePath) -> Study:
    """The study in the TOML file at `path`. Raises StudyError."""
    from pdmesh.files import read_bytes

    path = Path(path)
    try:
        text = read_bytes(path).decode("utf-8")
        content = tomllib.loads(text)
        about = msgspec.convert(content, Description)
        _check_random(path, about, about.random.named())
        _check_fit(path, about)
        _raise_for_no_parameter_value(msgspec.to_builtins(about, builtin_types=(date, time)), "$")
    except OSError as error:
        raise StudyError(f"{path}: cannot be read: {error.strerror}") from None
    except (msgspec.ValidationError, tomllib.TOMLDecodeError) as error:
        raise StudyError(f"{path}: {explained(error, Description, lambda: content)}") from None
    except (ValueError, RecursionError) as error:  # TOML's and UTF-8's
        raise StudyError(f"{path}: {error}") from None
    again = about.repeat
    is_random = bool(about.random.drawing or about.random.model)
    if again.times > 1 and not (again.notch or again.step or again.noise or is_random):
        raise StudyError(
            f"{path}: $.repeat has {again.times} times without notch, step, noise or [random], which give bit-identical"
            " runs; add one of them"
        )
    _check_measures(path, about.measures)
    study = Study(path, text, about)
    # a measure may not have the name of another column; case does not count
    parameters = {column for case in study.cases() for column in case.values}
    taken = {name.lower() for name in (*OWN, *MEASURES, *parameters)}
    for name in study.description.measures:
        if name.lower() in taken:
            raise StudyError(f"{path}: $.measures.{name} is another column of the table; use another name")
        taken.add(name.lower())
    if not study.drawing.is_file():
        raise StudyError(f"{path}: $.drawing: there is no file {study.drawing}; name a drawing")
    study.cases()
    return study


def _check_random(path: Path, about: Description, named: list[tuple[str, str, Distribution]]) -> None:
    """Raise StudyError for a distribution that is not one, or of a parameter that is varied or set as well."""
    for kind, name, distribution in named:
        place = f"{path}: $.random.{kind}: {name}"
        given = [form for form in Distribution.__struct_fields__ if getattr(distribution, form) is not None]
        if len(given) != 1:
            forms = ", ".join(Distribution.__struct_fields__)
            raise StudyError(f"{place} has {len(given)} distributions; give one of {forms}")
        first, second = getattr(distribution, given[0])
        if not (math.isfinite(first) and math.isfinite(second)):
            raise StudyError(f"{place} has {first:g} and {second:g}; use finite numbers")
        if given[0] == "uniform" and not first < second:
            raise StudyError(f"{place} is uniform from {first:g} to {second:g}; give the smaller number first")
        if given[0] != "uniform" and not second > 0:
            raise StudyError(f"{place} has {second:g} as its second number; use one above 0")
        others: list[tuple[str, Set | Vary]] = [("vary", about.vary), ("set", about.set)]
        others += [("runs", run) for run in about.runs]
        for where, other in others:
            if name in (other.drawing if kind == "drawing" else _flatten_to_dotted_names(other.model)):
                raise StudyError(f"{place} is in $.{where} as well; leave it out of one of them")


def _check_fit(path: Path, about: Description) -> None:
    """Raise StudyError for a fit without parameters or of one without bounds, and for what a fit cannot have."""
    if about.fit is None:
        return
    named, place = about.fit.named(), f"{path}: $.fit"
    if not named:
        raise StudyError(f"{place} has no parameter; give [fit.model] or [fit.drawing] with first and bounds")
    for name in ("vary", "runs", "repeat", "random"):
        if getattr(about, name) != getattr(Description("", fit=about.fit), name):
            raise StudyError(f"{place} varies its parameters itself; leave out $.{name}, or $.fit")
    for kind, name, parameter in named:
        where = f"{place}.{kind}: {name}"
        if name in (about.set.drawing if kind == "drawing" else _flatten_to_dotted_names(about.set.model)):
            raise StudyError(f"{where} is in $.set as well; leave it out of one of them")
        if parameter.bounds is None or parameter.first is None:
            missing = "bounds" if parameter.bounds is None else "first guess"
            raise StudyError(f"{where} has no {missing}; write {{first = 1.0, bounds = [0.5, 2.0]}} with your values")
        low, high = parameter.bounds
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise StudyError(f"{where} has bounds {low:g} and {high:g}; give two finite numbers, the smaller one first")
        if not low <= parameter.first <= high:
            raise StudyError(f"{where} begins at {parameter.first:g}; use a first guess between {low:g} and {high:g}")


def _check_measures(path: Path, measures: Mapping[str, RunMeasure]) -> None:
    """Raise StudyError for a measure that is not exactly one quantity."""
    for name, measure in measures.items():
        given = [quantity for quantity in QUANTITIES if getattr(measure, quantity) is not None]
        if len(given) != 1:
            raise StudyError(
                f"{path}: $.measures.{name} gives {len(given)} quantities; give one of {', '.join(QUANTITIES)}"
            )
        if measure.unit and measure.sql is None:
            raise StudyError(f"{path}: $.measures.{name}.unit is known from {given[0]}; leave it out")
        if measure.thickness is not None and measure.peak_force is None:
            raise StudyError(f"{path}: $.measures.{name}.thickness is of peak_force alone; leave it out")


def _raise_for_no_parameter_value(value: Any, place: str) -> None:
    """Raise ValueError for TOML values that are no parameters: dates and times, and numbers that no double holds."""
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        raise ValueError(f"{place} is an integer of {value.bit_length()} bits; use one below 1.8e308")
    if isinstance(value, date | time):
        raise ValueError(f"{place} is {value}; use a number, a word, a list or a table")
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for name, part in parts:
        _raise_for_no_parameter_value(part, f"{place}[{name}]" if isinstance(name, int) else f"{place}.{name}")


def format_value(value: Any, toml: bool = False) -> str:
    """A value in the form of ``--set``."""
    if isinstance(value, bool):
        return ("true" if value else "false") if toml else str(int(value))
    if isinstance(value, str):
        return json.dumps(value) if toml else value
    return json.dumps(value) if isinstance(value, list) else repr(value)


def _override_parts(parts: dict[str, dict[str, Any]], above: Set) -> None:
    """Override `parts` by the values of `above`, in place."""
    parts["drawing"].update(above.drawing)
    parts["model"].update(_flatten_to_dotted_names(above.model))
    parts["options"].update({name: getattr(above, name) for name in OPTIONS if getattr(above, name) is not None})


def _flatten_to_dotted_names(nested: Mapping[str, Any], before: str = "", ends: Container[str] = ()) -> dict[str, Any]:
    """Nested tables as dotted names. Tables with the keys `ends` are values."""
    flat: dict[str, Any] = {}
    for name, value in nested.items():
        if isinstance(value, dict) and not (value and all(key in ends for key in value)):
            flat |= _flatten_to_dotted_names(value, f"{before}{name}.", ends)
        else:
            flat[f"{before}{name}"] = value
    return flat


def _with_equal_numbers(value: Any) -> Any:
    """A value in which 1 and 1.0 are equal."""
    if isinstance(value, Mapping):
        return {str(key): _with_equal_numbers(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_with_equal_numbers(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
