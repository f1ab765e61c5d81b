"""The named numbers and words of a drawing: the known names, the unit of lengths, and access by type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec
import msgspec.inspect as inspection
import numpy as np

from pdmesh.model.document import ADAPTS, Contact, Run, Static
from pdmesh.model.material import DECLARED, Material
from pdmesh.model.medium import Medium
from pdmesh.quantities import UNITS, Unit, number_in
from pdmesh.scene.actions import converted
from pdmesh.scene.conditions import Profile, parse_profile
from pdmesh.scene.heat import Heat
from pdmesh.scene.shapes import SceneError
from pdmesh.spelling import meant

T = TypeVar("T")

PREFIX = "Peridynamics/"
OWN = "Plate"  # the folder of the numbers that a drawing has for itself
MOST = 1e9  # of any count
ANY = "NAME"  # in the names below, the name of a group
ZONE = ("Spacing", "Grown")
SHARED = ("Rows", "Profile", "Breakable", "Box", "Edge", "Face")  # of every condition
PRESSURE = ("Pressure", "Following")
LOAD = ("Node", *(f"{kind} {axis}" for kind in ("Traction", "Body force", "Force") for axis in "xyz"), *PRESSURE)
K_FIELD = ("K1", "K2", "Tip", "Tip angle", "Tip speed")  # of a plate
FIX = ("Node", "Components", *(f"Displacement {axis}" for axis in "xyz"), *K_FIELD)
SPRING = tuple(f"{kind} {axis}" for kind in ("Stiffness", "Body stiffness") for axis in "xyz")
MOTIONS = ("Velocity", "Acceleration", "Initial velocity", "Initial displacement")
MOVE = tuple(f"{kind} {axis}" for kind in MOTIONS for axis in "xyz")
MATERIAL = {  # parameters of a material: in the model, and in drawings
    name: declared.drawing_name or name[0].upper() + name[1:].replace("_", " ") for name, declared in DECLARED.items()
}
CONTACT = {name: name.title() for name in ("friction", "stiffness", "distance", "restitution")}  # here, and in drawings
MEDIUM = {  # but those of heat
    "D": "D",
    "broken": "Broken",
    "power": "Power",
    "C_solid": "C solid",
    "C_sat": "C sat",
    "dissolution": "Dissolution",
    "k_diss": "k diss",
    "capped": "Capped",
    "surface_correction": "Surface correction",
}
RUN = {
    "time_step": "Time step",
    "every": "Frame every",
    "solver": "Solver",
    "start": "Start",
    "damping": "Damping",
    "theta": "Theta",
}
STATIC = {"load_steps": "Load steps", "control": "Control"}
RIGID = ("Rigid", "Mass", "Spin", "Held", "Profile", "Radius")
FOLDERS = {
    f"Zones/{ANY}": ZONE,
    f"Loads/{ANY}": LOAD + SHARED,
    f"Fixes/{ANY}": FIX + SHARED,
    f"Moves/{ANY}": MOVE + SHARED,
    f"Springs/{ANY}": (*SPRING, "Rows", *SHARED[2:]),
    f"Pins/{ANY}": ("Rows", "Breakable", "Edge"),
    f"Absorbs/{ANY}": ("Width", "Box", "Edge"),
    f"Load cells/{ANY}": ("Of",),
    "Material": tuple(MATERIAL.values()),
    f"Materials/{ANY}": tuple(MATERIAL.values()),
    f"Bodies/{ANY}": ("Spacing", *(f"Velocity {axis}" for axis in "xyz"), *RIGID, *MATERIAL.values()),
    "Contact": tuple(CONTACT.values()),
    **{f"Refine/{target}": ("Distance", "Spacing") for target in ("crack", "notch", "hole")},
    f"Holds/{ANY}": ("Concentration", "Temperature", *SHARED[:2], *SHARED[3:]),
    f"Supplies/{ANY}": ("Flux", "Rate", "Heat flux", "Heat rate", *SHARED[:2], *SHARED[3:]),
    f"Exchanges/{ANY}": ("Coefficient", "h", "Outside", *SHARED[:2], "Edge", "Face"),
    f"Begins/{ANY}": ("Concentration", "Temperature", "Box"),
    f"Media/{ANY}": ("D",),
    "Medium": (*MEDIUM.values(), "k", "c", "Deformation"),
    "Run": (*RUN.values(), *STATIC.values(), "Duration", "Opening", "Adapt", "Collocation damped", "Cracks"),
}
NAMES = (
    *(f"{folder}/{name}" for folder, names in FOLDERS.items() for name in names),
    "Horizon ratio",
    "Area rule",
    "Units",
)
OF_SETTINGS = {  # parameters by the names that settings of the solver have
    "horizon.ratio": "Horizon ratio",
    "area_rule": "Area rule",
    **{f"material.{name}": f"Material/{drawn}" for name, drawn in MATERIAL.items()},
    **{f"contact.{name}": f"Contact/{drawn}" for name, drawn in CONTACT.items()},
    **{f"medium.{drawn.lower() if len(drawn) > 1 else drawn}": f"Medium/{drawn}" for drawn in ("D", "Power", "Broken")},
    **{f"run.{name.lower().replace(' ', '_')}": f"Run/{name}" for name in FOLDERS["Run"]},
    "run.every": "Run/Frame every",
    "run.collocation.damped": "Run/Collocation damped",
    **{f"run.static.{name.lower().replace(' ', '_')}": f"Run/{name}" for name in ("Load steps", "Control", "Opening")},
}


QUANTITIES = {  # SI units of parameters by their last words, without an axis
    **dict.fromkeys(("Spacing", "Distance", "Width", "Radius", "Opening", "Displacement", "Initial displacement"), "m"),
    **dict.fromkeys(("Time step", "Duration"), "s"),
    **dict.fromkeys(("Velocity", "Initial velocity"), "m/s"),
    **dict.fromkeys(("Traction", "Pressure"), "Pa"),
    **{drawn: DECLARED[name].unit for name, drawn in MATERIAL.items()},
}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a drawing: name, value, unit and meaning."""

    name: str
    value: float | str
    unit: str = ""
    meaning: str = ""


def needed(
    values: Mapping[str, float | str], spacing: str, unit: str, groups: Mapping[str, tuple[str, str]] | None = None
) -> list[Parameter]:
    """The parameters that a file without any needs, those without a value as "", and those that are set.

    `spacing` is the name of that of its zone, "" if its nodes are given; `groups` are more, with unit and meaning.
    """
    every = {
        **({spacing: (unit, "between nodes")} if spacing else {}),
        "Material/E": ("Pa", "Young's modulus"),
        "Material/rho": ("kg/m^3", "density"),
        "Material/G0": ("J/m^2", "critical energy release rate"),
        **(groups or {}),
        "Units": ("", "of all lengths"),
    }
    names = {PREFIX + name: about for name, about in every.items()}
    values = {f"{PREFIX}Units": unit, **values}
    return [Parameter(name, values.get(name, ""), *names.get(name, ())) for name in dict.fromkeys([*names, *values])]


def full_name(name: str) -> str:
    """A parameter's name with ``Peridynamics/`` before it; that of a setting of the solver is its parameter's."""
    return name if name.startswith(PREFIX) else PREFIX + OF_SETTINGS.get(name, name)


def given(assignments: Iterable[tuple[str, str]]) -> dict[str, float | str]:
    """The assigned parameters of a file that has none itself, as numbers where possible, else as words.

    A length with a unit is converted to the assigned one. Raises SceneError for an unknown name.
    """
    named = [(full_name(name), text) for name, text in assignments]
    values: dict[str, float | str] = dict(named)
    lengths = values.get(f"{PREFIX}Units") or "m"
    for name, text in named:
        unit = unit_of_parameter(name)
        with suppress(ValueError):
            values[name] = number_in(text, str(lengths) if unit == "m" else unit)
    refuse_unknown(values, from_drawing=False)
    return values


def unit_of_parameter(name: str) -> str:
    """The SI unit of the parameter with this full name; "" of a word, a pure number, or a drawing's own number."""
    folder, _, last = name.removeprefix(PREFIX).rpartition("/")
    own = folder.split("/")[0] in (OWN, "Contact")  # whose distance is one in spacings
    return "" if own else QUANTITIES.get(last[:-2] if last[-2:] in (" x", " y", " z") else last, "")


def refuse_unknown(names: Iterable[str], from_drawing: bool) -> None:
    """Raise SceneError for an unknown full name; `from_drawing`, any below ``Peridynamics/Plate/`` is allowed."""
    for name in sorted(names):
        words = name.removeprefix(PREFIX).split("/")
        if (from_drawing and words[0] == OWN and len(words) > 1) or any(_is(words, template) for template in NAMES):
            continue
        group = words[1] if len(words) > 2 else ANY
        likely = [template.replace(ANY, group) for template in NAMES] + ["/".join([OWN, *words[1:]])] * from_drawing
        also = f" (a drawing's own numbers go below '{PREFIX}{OWN}/')" if from_drawing else ""
        raise SceneError(unknown(name.removeprefix(PREFIX), likely, "is unknown", PREFIX, also))


def refuse_space(names: Iterable[str]) -> None:
    """Raise SceneError for a component or a face, which plates do not have."""
    for name in names:
        if name.endswith((" z", "/Face")) and not name.startswith(f"{PREFIX}{OWN}/"):
            raise SceneError(
                f"parameter '{name}' is for bodies; leave it out in a plate (volumes make a body in space)"
            )


def _is(words: Sequence[str], template: str) -> bool:
    pattern = template.split("/")
    return len(words) == len(pattern) and all(
        word == wanted or (wanted == ANY and word != "") for word, wanted in zip(words, pattern, strict=True)
    )


def unit_of(values: Mapping[str, float | str]) -> Unit:
    """The unit of lengths in a drawing with these parameters. Raises SceneError."""
    return UNITS[Parameters(values, UNITS["m"]).text("Units", of=("", *UNITS)) or "m"]


class Parameters:
    """Parameter values by their name below ``Peridynamics/``; lengths are converted from `unit`."""

    def __init__(self, values: Mapping[str, float | str], unit: Unit) -> None:
        self._values, self.unit = values, unit

    def below(self, folder: str) -> set[str]:
        """The names directly below a folder."""
        prefix = f"{PREFIX}{folder}/"
        return {name.removeprefix(prefix).split("/")[0] for name in self._values if name.startswith(prefix)}

    def _get(self, name: str, kind: type, expected: str) -> Any:
        value = self._values.get(PREFIX + name)
        if value is not None and not isinstance(value, kind):
            raise SceneError(f"parameter '{PREFIX}{name}' is {value!r}; use {expected}")
        if isinstance(value, str) and not value.isprintable():
            raise SceneError(f"parameter '{PREFIX}{name}' is {value!r:.80}; use a word that can be printed")
        return value

    def maybe(self, name: str) -> float | None:
        """A finite number, or None if it is not given."""
        value: float | None = self._get(name, float, "a number")
        if value is not None and not np.isfinite(value):
            raise SceneError(f"parameter '{PREFIX}{name}' is {value}; use a finite number")
        return value

    def of_place(self, name: str, is_length: bool = False) -> float | str | None:
        """A finite number, or an expression or the name of a file of values, which are in SI units; None if it is not
        given. A number may be a length in the drawing's unit."""
        if isinstance(self._values.get(PREFIX + name), str):
            return self.text(name) or None
        return self.maybe_length(name) if is_length else self.maybe(name)

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number. Raises SceneError if it is not given and there is no default."""
        value = self.maybe(name)
        value = default if value is None else value
        if value is None:
            raise SceneError(f"parameter '{PREFIX}{name}' is missing; give a number")
        return value

    def maybe_length(self, name: str) -> float | None:
        """A length in metres, or None if it is not given."""
        value = self.maybe(name)
        return None if value is None else float(self.unit.to_si(value))

    def length(self, name: str) -> float:
        """A length in metres. Raises SceneError if it is not given."""
        return float(self.unit.to_si(self.number(name)))

    def whole(self, name: str, default: int) -> int:
        """A whole number."""
        value = self.number(name, float(default))
        if value != round(value) or abs(value) > MOST:
            raise SceneError(f"parameter '{PREFIX}{name}' is {value:g}; use a whole number of {MOST:.0e} at most")
        return round(value)

    def flag(self, name: str, default: bool) -> bool:
        """A number that is 0 or 1."""
        value = self.number(name, float(default))
        if value not in (0.0, 1.0):
            raise SceneError(f"parameter '{PREFIX}{name}' is {value:g}; use 0 or 1")
        return value == 1.0

    def text(self, name: str, default: str = "", of: Sequence[str] = ()) -> str:
        """A word; if `of` is given, one of those."""
        value = self._get(name, str, "a word")
        value = default if value is None else str(value)
        if of and value not in of:
            raise SceneError(f"parameter '{PREFIX}{name}' is '{value}'; use one of {', '.join(filter(None, of))}")
        return value

    def of_type(self, name: str, kind: inspection.Type) -> float | bool | str | None:
        """A number, a flag or a word, as a struct's field of this type has it; None if it is not given."""
        for member_type in kind.types if isinstance(kind, inspection.UnionType) else (kind,):
            match member_type:
                case inspection.FloatType():
                    return self.maybe(name)
                case inspection.BoolType():
                    return None if self.maybe(name) is None else self.flag(name, True)
                case inspection.IntType():
                    return None if self.maybe(name) is None else self.whole(name, 1)
        return self.text(name) or None

    def profile(self, name: str) -> Profile:
        """A profile in time."""
        return parse_profile(self.text(name), f"parameter '{PREFIX}{name}'")


def unknown(
    name: str, names: Iterable[str], problem: str = "is not in the drawing", prefix: str = "", also: str = ""
) -> str:
    """Message about an unknown parameter: the one of `names` that it means or is similar to, or where to see them."""
    names = list(names)
    near = meant(name, names)
    use = f"did you mean '{prefix}{near}'?" if near else "pdmesh params lists those of a drawing"
    return f"parameter '{prefix}{name}' {problem}; {use}{also}"


def given_fields(
    parameters: Parameters, folder: str, kind: type[msgspec.Struct], names: Mapping[str, str]
) -> dict[str, Any]:
    """The fields of a struct that parameters of a folder give; `names` has the parameter of each field."""
    about = inspection.type_info(kind)
    assert isinstance(about, inspection.StructType)
    values = {
        field.name: parameters.of_type(f"{folder}/{names[field.name]}", field.type)
        for field in about.fields
        if field.name in names
    }
    return {name: value for name, value in values.items() if value is not None}


def material(parameters: Parameters, folder: str, base: Material | None) -> Material | None:
    """The material below a folder, completed from `base`; None if no parameter is given."""
    settings = given_fields(parameters, folder, Material, MATERIAL)
    if base is not None:
        either = {"G0", "critical_stretch"}
        base_values = msgspec.to_builtins(base)
        settings = {
            name: value for name, value in base_values.items() if not (name in either and either & settings.keys())
        } | settings
    if not settings:
        return None
    for name in ("E", "rho", "G0"):
        if name not in settings and not (name == "G0" and "critical_stretch" in settings):
            raise SceneError(f"parameter '{PREFIX}{folder}/{name}' is missing; give a number")
    return converted(settings, Material, f"{PREFIX}{folder}")


def content(parameters: Parameters, folder: str) -> float | str:
    """The Concentration, mol/m^3, or the Temperature, K, of a condition. Raises SceneError for neither and for both."""
    return either(parameters, folder, "Concentration", "Temperature")[0]


def either(parameters: Parameters, folder: str, *names: str) -> tuple[float | str, str]:
    """The one of these parameters that is given, and its name. Raises SceneError for none and for several."""
    values = [(value, name) for name in names if (value := parameters.of_place(f"{folder}/{name}")) is not None]
    if len(values) != 1:
        present_names = ", ".join(name for _, name in values) or "none"
        expected_names = " and ".join([", ".join(names[:-1]), names[-1]])
        raise SceneError(
            f"parameter '{PREFIX}{folder}/{names[0]}': {present_names} given; give one of {expected_names}"
        )
    return values[0]


def medium(parameters: Parameters) -> Medium | Heat | None:
    """The medium of diffusion, or of heat if its conductivity is given; None if no parameter is given."""
    if parameters.maybe("Medium/k") is not None or parameters.maybe("Medium/c") is not None:
        others = sorted(parameters.below("Medium") - {"k", "c", "Broken", "Deformation"})
        if others:
            raise SceneError(f"parameter '{PREFIX}Medium/{others[0]}' cannot be combined with k and c; leave it out")
        k, c = (parameters.number(f"Medium/{name}") for name in "kc")
        return Heat(k, c, parameters.number("Medium/Broken", 1.0), parameters.flag("Medium/Deformation", False))
    settings = given_fields(parameters, "Medium", Medium, MEDIUM)
    if not settings and not parameters.below("Medium"):
        return None
    if "D" not in settings:
        raise SceneError(f"parameter '{PREFIX}Medium/D' is missing; give a number")
    return converted(settings, Medium, f"{PREFIX}Medium")


def run(parameters: Parameters) -> Run:
    """Solver settings, with the number of steps from the duration and the time step."""
    step, duration = parameters.maybe("Run/Time step"), parameters.maybe("Run/Duration")
    settings = given_fields(parameters, "Run", Run, RUN)
    settings["adapt"] = parameters.text("Run/Adapt", "none", ADAPTS)
    if cracks := parameters.text("Run/Cracks", of=("", "bonds", "particles")):
        settings["cracks"] = cracks
    if parameters.maybe("Run/Collocation damped") is not None:
        settings["collocation"] = {"damped": parameters.flag("Run/Collocation damped", False)}
    static = given_fields(parameters, "Run", Static, STATIC)
    opening = parameters.maybe_length("Run/Opening")
    if static or opening is not None:
        settings["static"] = static if opening is None else static | {"opening": opening}
    if step is not None:
        if duration is None or not step > 0 or not duration >= 0:
            text = "none" if duration is None else f"{duration:g} s"
            raise SceneError(
                f"{PREFIX}Run: Time step is {step:g} s and Duration {text}; give both, positive, or Duration alone"
            )
        if duration / step > 1e9:
            raise SceneError(f"{PREFIX}Run: the run takes {duration / step:.1g} steps; use at most 1e9")
        settings["steps"] = round(duration / step)
    elif duration is not None:
        settings["duration"] = duration  # in steps that the solver knows
    return converted(settings, Run, f"{PREFIX}Run")


def contact(parameters: Parameters) -> Contact | None:
    """How bodies touch; None if no parameter is given."""
    settings = given_fields(parameters, "Contact", Contact, CONTACT)
    return converted(settings, Contact, f"{PREFIX}Contact") if settings else None


def of_scene(parameters: Parameters, source: str, text: str, values: Mapping[str, float | str]) -> dict[str, Any]:
    """What a plate and a body have in common, as arguments of a scene."""
    return {
        "material": material(parameters, "Material", None),
        "touching": contact(parameters),
        "medium": medium(parameters),
        "horizon": parameters.number("Horizon ratio", 3.0),
        "run": run(parameters),
        "source": source,
        "drawing": text,
        "parameters": tuple(values.items()),
    }
