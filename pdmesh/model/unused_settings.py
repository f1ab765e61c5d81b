"""Settings that a run does not use, reported where a model is built and where it is solved: the only list of them.

A setting that asks for something impossible is refused elsewhere; those here only have no effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import msgspec

from pdmesh.model.document import Medium, Settings
from pdmesh.model.material import DECLARED, USUAL_LAW, Expansion, Material, switch_of
from pdmesh.model.materials import KINDS


class Used(NamedTuple):
    """Settings, and the switch values under one of which they are used."""

    names: tuple[str, ...]  # dotted; of a struct for all that is in it
    switches: tuple[tuple[str, str | None], ...]  # dotted name and value
    expected: str = ""  # in words, where they say more than the switches
    instead: str | None = None  # what the first switch is where nothing is used; of other words nothing is known

    def why_not(self, settings: Settings) -> str:
        """Why a run does not use them; "" if it does."""
        first, _ = self.switches[0]
        actual = value_of(settings, first)
        unknown = actual is None or self.instead not in (None, actual)
        used = unknown or any(_is_on(settings, name, value) for name, value in self.switches)
        return "" if used else f"not used with {first} {actual}"

    def use(self) -> str:
        """What to use to have an effect of them."""
        return self.expected or " or ".join(f"{name} {value}" for name, value in self.switches)


def _of_materials() -> Iterator[Used]:
    """Settings of materials that are used with others alone."""
    for kind in KINDS.values():
        for struct in kind.structs:
            if (switch := switch_of(struct)) is not None:
                names = tuple(f"material.{name}" for name in struct.__struct_fields__)
                instead = USUAL_LAW if switch[0] == "law" else None  # other laws may use the same parameters
                yield Used(names, ((f"material.{switch[0]}", switch[1]),), instead=instead)
        said = tuple(f"material.{name}" for name in kind.parameters if not DECLARED[name].refused)
        if said:
            yield Used(said, (("material.model", kind.name),))


GIVEN = "given"  # as the value of a switch: any
OF_TIME = (("run.solver", "explicit"), ("run.solver", "implicit"), ("physics", "thermoelastic"))
TABLE = (
    Used(("contact",), (("physics", "mechanics"), ("physics", "thermoelastic"))),
    Used(("run.theta",), (("run.solver", "implicit"), ("physics", "thermoelastic"))),
    Used(("run.split",), (("run.adapt", "split"),)),
    Used(("run.collocation",), (("run.adapt", "collocation"),)),
    Used(("run.hybrid",), (("run.adapt", "hybrid"), ("run.adapt", "auto"))),
    Used(("run.collocation",), (("physics", "mechanics"),)),
    Used(tuple(f"material.{name}" for name in Expansion.__struct_fields__), (("physics", "thermoelastic"),)),
    Used(("run.particles",), (("run.cracks", "particles"),)),
    Used(("run.particles.branch",), (("run.particles.criterion", "stress"),)),
    Used(("run.particles.branch",), (("run.particles.direction", "hoop"),)),
    Used(
        ("run.static",),
        (("run.solver", "static"), ("run.start", "static")),
        "run.solver static (--static), or run.start static",
    ),
    Used(("run.fatigue",), (("run.solver", "static"),), "run.solver static (--static)"),
    Used(
        ("run.static.load_steps", "run.static.control", "run.static.opening", "run.after"),
        (("run.solver", "static"),),
        "run.solver static (--static)",
    ),
    Used(("run.steps",), (("run.duration", None),), "one of the two"),
    Used(("run.duration",), (*OF_TIME, ("run.after", "motion")), "run.static.load_steps, or run.after motion"),
    Used(
        ("run.steps", "run.every"),
        (*OF_TIME, ("run.fatigue", GIVEN)),
        "run.static.load_steps: a load step is a step and a frame",
    ),
    Used(
        ("run.time_step", "run.ledger"),
        OF_TIME,
        "run.static.load_steps: a load step is a step and a frame",
    ),
    *_of_materials(),
    Used(("medium.k_diss", "medium.capped"), (("medium.dissolution", "kinetic"),)),
)


def in_vain(settings: Settings, names: Iterable[str]) -> str | None:
    """Message about the first of these dotted names that was given but is not used; None if all are used."""
    rows = [(row, why) for row in TABLE if (why := row.why_not(settings))]
    for name in names:
        for row, why in rows:
            if any(name == unheard or name.startswith(f"{unheard}.") for unheard in row.names):
                return f"{name} is {why}; leave it out, or use {row.use()}"
    return None


def remarks(settings: Settings) -> list[str]:
    """Remarks on given settings without effect, one line for each reason; settings at their default are left out."""
    lines, usual = list(_said(settings, "$")), USUAL.material
    unheard: dict[tuple[str | None, ...], list[str]] = {}  # parameters of materials of these words
    for number, region in enumerate(settings.regions):
        words = tuple(value if isinstance(value, str) else None for value in msgspec.structs.astuple(region.material))
        region_settings = msgspec.structs.replace(settings, material=region.material, run=USUAL.run, medium=None)
        if words not in unheard:
            rows = (row for row in TABLE if row.why_not(region_settings))
            leaves = (leaf for row in rows for name in row.names for leaf in _leaves(name))
            unheard[words] = [leaf.removeprefix("material.") for leaf in leaves if leaf.startswith("material.")]
        if any(getattr(region.material, name) != getattr(usual, name) for name in unheard[words]):
            lines += _said(region_settings, f"$.regions[{number}]")
    return lines


def _said(settings: Settings, place: str) -> Iterator[str]:
    """Messages about given settings that are not used, each named once."""
    mentioned: set[str] = set()
    for row in TABLE:
        why = row.why_not(settings)
        if not why:
            continue
        names = [leaf for name in row.names for leaf in _leaves(name) if leaf not in mentioned]
        said = [name for name in names if value_of(settings, name) != value_of(USUAL, name)]
        mentioned.update(said)
        if said:
            named = ", ".join(f"{place}.{name}" for name in said)
            values = ", ".join(word(value_of(settings, name)) for name in said)
            yield f"{named} ({values}) {why}; use {row.use()}"


# As everything is that is left out
USUAL = Settings(material=Material(E=1.0, rho=1.0, G0=1.0), medium=Medium(D=1.0))


def _is_on(settings: Settings, name: str, value: str | None) -> bool:
    setting_value = value_of(settings, name)
    return setting_value is not None if value is GIVEN else bool(setting_value == value)


def value_of(settings: Settings, name: str) -> Any:
    """The setting of this dotted name; None if its struct is absent."""
    value: Any = settings
    for part in name.split("."):
        value = None if value is None else getattr(value, part)
    return value


def _leaves(name: str) -> Iterator[str]:
    """The settings that a name stands for: itself, or all in its struct."""
    value = value_of(USUAL, name)
    if isinstance(value, msgspec.Struct):
        for part in value.__struct_fields__:
            yield from _leaves(f"{name}.{part}")
    else:
        yield name


def word(value: Any) -> str:
    """A value as messages show it."""
    if isinstance(value, msgspec.Struct):
        return "some"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
