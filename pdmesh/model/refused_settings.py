"""Settings that no solver accepts, reported wherever a model is built, described or solved: the only list of them.

It covers settings alone. What depends on nodes, shapes or a solver's options is refused where it is found.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from pdmesh.model.document import (
    USUAL_LAW,
    Absorb,
    Acceleration,
    GridError,
    InitialVelocity,
    Material,
    Settings,
    Velocity,
)
from pdmesh.model.material_constants import BONDS_NU

FAILURES = {
    "bond": ("stretch",),
    "ordinary": ("stretch", "energy", "none"),
    "correspondence": ("stretch", "energy", "stress", "none"),
    "micropolar": ("stretch", "none"),
}
ITS_OWN = {  # name: the models that know it
    "influence": ("ordinary", "correspondence"),
    "strength": ("correspondence",),
    "solid": ("correspondence",),
    "form": ("correspondence",),
    "control": ("correspondence",),
    "order": ("correspondence",),
    "constant_term": ("correspondence",),
    "yield_stress": ("correspondence",),
    "hardening": ("correspondence",),
    "law": ("bond",),
    "kr": ("bond",),
}
SAME = 1e-12
FEWEST = 12.0  # spacings in the horizon with which collocation need not be asked to damp its seam
# Measured in the plate of docs/collocation.md
LOSSY = "with fewer the seam is damped, which took 64 % of the work from a struck plate with 4"
USUAL = Material(E=1.0, rho=1.0, G0=1.0)


class Impossible(NamedTuple):
    """A setting that is refused: its place, what was found, what was expected."""

    place: str  # dotted, from $ on
    found: str
    expected: str

    def __str__(self) -> str:
        return f"{self.place}: found {self.found}, expected {self.expected}"


def _swelling(settings: Settings, every: list[tuple[str, Material]]) -> Iterator[Impossible]:
    """What a motion that a content swells does not take, of settings and of every material with its place."""
    why = "as the physics is thermoelastic"
    for place, material in every:
        for name in ("alpha", "T0"):
            if getattr(material, name) is None:
                yield Impossible(f"{place}.{name}", "none", f"a number, {why}")
    if settings.medium is not None and settings.medium.C_solid is not None:
        yield Impossible("$.medium.C_solid", f"{settings.medium.C_solid:g}", f"none, {why}")
    run = settings.run
    usual = {"solver": "explicit", "adapt": "none", "cracks": "bonds", "start": "unloaded"}
    for name, expected in usual.items():
        if getattr(run, name) != expected:
            yield Impossible(f"$.run.{name}", getattr(run, name), f"{expected}, {why}")


def impossible(settings: Settings, dimension: int) -> Iterator[Impossible]:
    """Settings that cannot be combined, in a plate (2) or a body in space (3), except those of diffusion."""
    if settings.physics == "diffusion" or settings.material is None:
        return
    every = [("$.material", settings.material)]
    every += [(f"$.regions[{number}].material", region.material) for number, region in enumerate(settings.regions)]
    if dimension == 3:
        every = [(place, msgspec.structs.replace(material, plane="space")) for place, material in every]
        yield from _in_space(settings, every)
    for place, material in every:
        yield from of_material(material, place)
    if settings.physics == "thermoelastic":
        yield from _swelling(settings, every)
    run = settings.run
    if run.solver == "static":
        yield from _at_rest(settings, every)
    elif run.start == "static":
        yield from _from_rest(every)
    if run.adapt != "none":
        yield from _adaptive(settings, every)
    if run.cracks == "particles":
        yield from _of_particles(settings, every)


def refuse(settings: Settings, dimension: int, name: str) -> None:
    """Raise GridError for impossible settings of the file called `name`."""
    for wrong in impossible(settings, dimension):
        raise GridError(f"{name}: {wrong}")


Places = list[tuple[str, Material]]


def of_material(material: Material, place: str) -> Iterator[Impossible]:
    """Impossible values of a material, and values that its model does not use."""
    for name, expected in (*_unheard(material), *_impossible(material)):
        value = getattr(material, name)
        found = "none" if value is None else f"{value:g}" if isinstance(value, float) else f"'{value}'"
        yield Impossible(f"{place}.{name}", found, expected)


def softens(material: Material) -> bool:
    """Whether a material's bonds soften, that is, its law is not brittle."""
    brittle = material.law == USUAL_LAW or (material.law == "bilinear" and material.kr == 1)
    return material.model == "bond" and not brittle


def _in_space(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that only plates can have."""
    run = settings.run
    if run.adapt != "none":
        yield Impossible("$.run.adapt", f"'{run.adapt}'", "none in a body in space")
    if run.cracks != "bonds":
        yield Impossible("$.run.cracks", run.cracks, "bonds in a body in space")
    if settings.area_rule == "eq19":
        yield Impossible("$.area_rule", "'eq19'", "cells or square in a body in space")
    for place, material in every:
        if material.model == "micropolar":
            yield Impossible(f"{place}.model", "'micropolar'", "another in a body in space")


def _at_rest(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that load steps do not support."""
    run, why = settings.run, "as the solver is static"
    for name, found, usual in (("damping", f"{run.damping:g}", "0"), ("until", str(run.until), "None")):
        if found != usual:
            yield Impossible(f"$.run.{name}", found, f"none, {why}")
    if run.start == "static":
        yield Impossible("$.run.start", "static", f"none, {why}")
    if run.static.floating and run.static.method == "relaxation":
        yield Impossible(
            "$.run.static.floating",
            "true",
            "false, as the method is relaxation: it has no way to tell a slow motion from one that nothing holds",
        )
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, Velocity | Acceleration | InitialVelocity | Absorb):
            kind = str(condition.__struct_config__.tag)
            yield Impossible(f"$.conditions[{number}]", kind, f"load or displacement, {why}")
    for place, material in every:
        yield from _not_followed(material, place, breaks=run.cracks == "bonds")


def _not_followed(material: Material, place: str, breaks: bool) -> Iterator[Impossible]:
    """Settings of a material that load steps do not support; `breaks` tells whether bonds break by themselves."""
    if material.model == "micropolar":
        yield _rotates(place)
    if breaks and material.model != "bond" and material.failure != "none":
        yield Impossible(f"{place}.failure", f"'{material.failure}'", f"'none' at rest with '{material.model}'")
    if breaks and softens(material):
        yield Impossible(f"{place}.law", f"'{material.law}'", f"'{USUAL_LAW}', as the solver is static")


def _rotates(place: str) -> Impossible:
    return Impossible(f"{place}.model", "'micropolar'", "one without rotations at rest with 'micropolar'")


def _from_rest(every: Places) -> Iterator[Impossible]:
    """Settings that exclude a start at rest, as the run in time has no history of it."""
    for place, material in every:
        if material.model == "micropolar":
            yield _rotates(place)
        if material.solid == "j2":
            yield Impossible(f"{place}.solid", "'j2'", f"one that does not flow at rest with '{material.model}'")
        if material.form == "rate":
            yield Impossible(f"{place}.form", "'rate'", f"'total' at rest with '{material.model}'")


def _adaptive(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that splitting cells and moving fine zones do not support."""
    run = settings.run
    why = f", as run.adapt is {run.adapt}"
    for place, found, expected in (
        ("$.area_rule", settings.area_rule or "cells", "cells"),
        ("$.run.solver", run.solver, "explicit"),
        ("$.run.start", run.start, "unloaded"),
        ("$.run.damping", f"{run.damping:g}", "0" if run.adapt != "split" else f"{run.damping:g}"),
    ):
        if found != expected:
            yield Impossible(place, found, expected + why)
    if run.adapt == "collocation" and settings.regions:
        yield Impossible("$.regions", f"{len(every)} materials", f"one{why}")
    ratio = settings.horizon.ratio
    if run.adapt == "collocation" and ratio < FEWEST and not run.collocation.damped:
        yield Impossible(
            "$.run.collocation.damped",
            f"false with {ratio:g} spacings in the horizon",
            f"true, or at least {FEWEST:g} spacings: {LOSSY}",
        )
    yield from _alike(run.adapt, every)
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, Acceleration | Absorb):
            kind = str(condition.__struct_config__.tag)
            yield Impossible(f"$.conditions[{number}]", kind, f"a load, a displacement or a velocity{why}")
    if run.adapt == "split" and not run.split.merge < run.split.threshold:
        less = f"less than the threshold, {run.split.threshold:g}{why}"
        yield Impossible("$.run.split.merge", f"{run.split.merge:g}", less)


def _alike(adapt: str, every: Places) -> Iterator[Impossible]:
    """Materials that adaptive grids do not support."""
    first, why = every[0][1], f", as run.adapt is {adapt}"
    for place, material in every:
        alike = [("model", "bond")]
        if adapt != "split":
            alike += [("sight", "visibility"), ("micromodulus", first.micromodulus)]
        if adapt != "hybrid":
            alike += [("law", USUAL_LAW)]
        elif material.law not in (USUAL_LAW, "bilinear"):
            yield Impossible(f"{place}.law", material.law, f"{USUAL_LAW} or bilinear{why}")
        for name, expected in alike:
            if getattr(material, name) != expected:
                also = ", as elsewhere" if name == "micromodulus" else ""
                yield Impossible(f"{place}.{name}", getattr(material, name), expected + also + why)


def _of_particles(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that cracks of particles do not support, and contradictory rules."""
    rules, words = settings.run.particles, "with cracks that are particles"
    if settings.run.adapt != "none":
        yield Impossible("$.run.adapt", settings.run.adapt, f"none {words}")
    for place, material in every:
        if material.solid not in ("linear", "svk"):
            yield Impossible(f"{place}.solid", material.solid, f"linear or svk {words}")
    for name, criterion in (("strength", "stress"), ("toughness", "intensity")):
        value = getattr(rules, name)
        if value is not None and rules.criterion != criterion:
            yield Impossible(f"$.run.particles.{name}", f"{value:g}", f"none as the criterion is {rules.criterion}")
    if rules.criterion == "stress" and rules.strength is None:
        most = "the largest principal stress, Pa, as the criterion is stress"
        yield Impossible("$.run.particles.strength", "none", most)
    if rules.criterion == "intensity" and rules.direction != "hoop":
        yield Impossible("$.run.particles.direction", rules.direction, "hoop as the criterion is intensity")


def _unheard(material: Material) -> Iterator[tuple[str, str]]:
    """Settings of a material that its model ignores: name, and what is expected instead."""
    model = material.model
    for name, models in ITS_OWN.items():
        if model not in models and getattr(material, name) != getattr(USUAL, name):
            yield name, f"none with model '{model}'"
    if material.sight == "visibility" and material.gamma != USUAL.gamma:
        yield "gamma", "none with sight 'visibility'"
    if material.failure not in FAILURES[model]:
        yield "failure", f"one of {', '.join(FAILURES[model])} with model '{model}'"


def _impossible(material: Material) -> Iterator[tuple[str, str]]:
    """Settings of a material that its model cannot have: name, and what is expected instead."""
    model, most = material.model, BONDS_NU[material.plane]
    beyond = material.order > 1 or material.constant_term
    remembers = material.form == "rate" or material.solid == "j2"
    if model == "bond":
        return
    if material.nu is None or material.nu >= 0.5:
        yield "nu", f"Poisson's ratio below 0.5 with model '{model}'"
    elif model == "micropolar" and material.nu > most + SAME:
        yield "nu", f"{most:.4g} at most with model 'micropolar' in plane {material.plane}: its beams are soft beyond"
    if material.failure == "stress" and material.strength is None:
        yield "strength", "the largest principal stress, Pa, as failure is by stress"
    if material.solid == "j2" and material.yield_stress is None:
        yield "yield_stress", "more than 0 Pa with solid 'j2'"
    if material.hardening < 0:
        yield "hardening", "0 Pa or more: what softens flows in one row of nodes, however thin"
    if material.form == "rate" and material.solid not in ("linear", "j2"):
        yield "form", f"'total' with solid '{material.solid}'"
    if material.control == "breitzman-dayal" and remembers:
        yield "control", "silling, wan or none where a node has a history"
    if beyond and material.control not in ("silling", "none"):
        yield "control", "silling or none with order above 1, or with the constant term"
