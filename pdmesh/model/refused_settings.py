"""Settings that no solver accepts, reported wherever a model is built, described or solved: the only list of them.

It covers settings alone. What depends on nodes, shapes or a solver's options is refused where it is found.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from pdmesh.model.document import (
    Absorb,
    Acceleration,
    GridError,
    InitialDisplacement,
    InitialVelocity,
    Pin,
    RigidBody,
    Run,
    Settings,
    Spring,
    Velocity,
)
from pdmesh.model.material import USUAL_LAW, Expansion, Material, missing, switch_of
from pdmesh.model.materials import KINDS, Refusal, Refusals, refused_by
from pdmesh.model.materials.kind import softens
from pdmesh.model.medium import Medium, contradiction, of_motion
from pdmesh.model.monitors import ARC, CRACK
from pdmesh.model.output_fields import OF_CONTENT
from pdmesh.model.output_fields import USUAL as USUAL_FIELDS
from pdmesh.model.refusals import Impossible, Places
from pdmesh.model.refused_conditions import displaced, of_kinds, spinning
from pdmesh.model.refused_fatigue import of_fatigue

FEWEST = 12.0  # spacings in the horizon with which collocation need not be asked to damp its seam
# Measured in the plate of docs/verification/collocation.md
LOSSY = "with fewer the seam is damped, which takes more than 60 % of the work from a struck plate with 4"
USUAL = Material(E=1.0, rho=1.0, G0=1.0)
MOVING = (Velocity, Acceleration, InitialVelocity, InitialDisplacement, Absorb, RigidBody)


def _swelling(settings: Settings, every: list[tuple[str, Material]]) -> Iterator[Impossible]:
    """What a motion that a content swells does not take, of settings and of every material with its place."""
    why = "as the physics is thermoelastic"
    for place, material in every:
        for name, needed in missing(material, Expansion):
            yield Impossible(f"{place}.{name}", "none", f"{needed}, {why}")
    if settings.medium is not None and settings.medium.C_solid is not None:
        yield Impossible("$.medium.C_solid", f"{settings.medium.C_solid:g}", f"none, {why}")
    run = settings.run
    if run.solver == "implicit":
        yield Impossible("$.run.solver", run.solver, f"explicit or static, {why}")
    if run.solver == "static":
        yield from _swelling_at_rest(run, every, why)
    if run.adapt not in ("none", "hybrid"):
        yield Impossible("$.run.adapt", run.adapt, f"none or hybrid, {why}")
    if run.adapt == "hybrid" and settings.medium is not None and settings.medium.deformation:
        yield Impossible("$.medium.deformation", "true", f"false, as coarse nodes have no heat of deformation, {why}")
    for name, expected in {"cracks": "bonds", "start": "unloaded"}.items():
        if getattr(run, name) != expected:
            yield Impossible(f"$.run.{name}", getattr(run, name), f"{expected}, {why}")


def _swelling_at_rest(run: Run, every: Places, why: str) -> Iterator[Impossible]:
    """What rest after each step of a content does not take."""
    if run.static.load_steps is not None:
        expected = f"run.time_step and steps, {why}"
        yield Impossible("$.run.static.load_steps", f"{run.static.load_steps}", expected)
    if run.time_step is None:
        yield Impossible("$.run.time_step", "none", f"one, after which the body is brought to rest, {why}")
    for place, material in every:
        if softens(material):
            yield Impossible(f"{place}.law", material.law, f"{USUAL_LAW} in a quasi-static analysis, {why}")


def _diffusing(settings: Settings, medium: Medium) -> Iterator[Impossible]:
    """Settings that diffusion in this medium does not support."""
    wrong = contradiction(medium)
    if wrong is not None:
        yield Impossible(f"$.medium.{wrong[0]}", *wrong[1:])
    yield from (Impossible(f"$.medium.{name}", *words) for name, *words in of_motion(medium))
    run, usual = settings.run, Run()
    for name in ("until", "start", "damping", "probes", "cracks"):
        value, expected = getattr(run, name), getattr(usual, name)
        if value != expected:
            yield Impossible(f"$.run.{name}", f"{value!r}", f"{expected!r}, as the physics is diffusion")
    if settings.area_rule == "eq19":
        yield Impossible("$.area_rule", "eq19", "cells or square of diffusion")
    for name in run.fields if run.fields != USUAL_FIELDS else ():
        if name not in OF_CONTENT:
            yield Impossible("$.run.fields", f"'{name}'", f"one of {', '.join(OF_CONTENT)}")
    yield from _steps_of_content(run, medium.dissolution == "kinetic")


def _steps_of_content(run: Run, kinetic: bool) -> Iterator[Impossible]:
    """Solvers that diffusion does not support; `kinetic`: that of a kinetic dissolution."""
    if run.solver == "static":
        yield Impossible("$.run.solver", "static", "explicit or implicit of diffusion")
    if run.solver == "implicit" and kinetic:
        yield Impossible("$.run.solver", "implicit", "explicit of a kinetic dissolution")
    if run.solver == "implicit" and run.time_step is None:
        yield Impossible("$.run.time_step", "none", "one, as the solver is implicit")
    if run.adapt not in ("none", "collocation"):
        yield Impossible("$.run.adapt", run.adapt, "none or collocation of diffusion")
    if run.adapt == "collocation" and run.solver == "implicit":
        yield Impossible("$.run.solver", "implicit", "explicit with collocation")
    if run.adapt == "collocation" and kinetic:
        yield Impossible("$.run.adapt", "collocation", "none of a kinetic dissolution")


def impossible(settings: Settings, dimension: int) -> Iterator[Impossible]:
    """Settings that cannot be combined, in a plate (2) or a body in space (3)."""
    if settings.run.adapt == "auto":  # where hybrid is refused, that is none
        settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(settings.run, adapt="none"))
    if settings.physics == "diffusion" and settings.medium is not None:
        yield from _diffusing(settings, settings.medium)
        if settings.run.device != "cpu":
            yield from _on_device(settings, [])
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
    if settings.contact is not None:
        yield from _touching(settings, every)
    yield from displaced(settings)
    yield from _of_run(settings, every)


def on_ranks(settings: Settings) -> Iterator[Impossible]:
    """Settings that a run on many ranks does not support."""
    why = "on many ranks"
    yield from of_kinds(settings, (InitialDisplacement,), f"none {why}")
    if settings.physics == "thermoelastic":
        yield Impossible("$.physics", settings.physics, f"mechanics or diffusion {why}")
    usual = {"solver": "explicit", "start": "unloaded", "adapt": "none", "cracks": "bonds", "device": "cpu"}
    yield from _unusual(settings, usual, f" {why}")
    yield from spinning(settings, f" {why}")
    for material in (settings.material, *(region.material for region in settings.regions)):
        if material is not None and material.model not in ("bond", "ordinary"):
            yield Impossible("$.material.model", f"'{material.model}'", f"'bond' or 'ordinary' {why}")
        elif material is not None and material.model == "ordinary" and material.failure not in ("none", "stretch"):
            yield Impossible("$.material.failure", f"'{material.failure}'", f"'none' or 'stretch' {why}")


def _unusual(settings: Settings, usual: dict[str, str], why: str) -> Iterator[Impossible]:
    """Settings of a run that are not the usual ones, contact and rigid bodies."""
    for name, expected in usual.items():
        if getattr(settings.run, name) != expected:
            yield Impossible(f"$.run.{name}", getattr(settings.run, name), f"{expected}{why}")
    if settings.contact is not None:
        yield Impossible("$.contact", "some", f"none{why}")
    yield from of_kinds(settings, (RigidBody, Spring, Pin), f"none{why}")


def _of_run(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that the way in which a model is solved does not support."""
    run = settings.run
    if settings.physics == "mechanics" and run.solver == "implicit":
        yield Impossible("$.run.solver", "implicit", "explicit or static of mechanics")
    if run.solver == "static":
        yield from _at_rest(settings, every)
    elif run.start == "static":
        for place, material in every:
            yield from _quoted(material, place, KINDS[material.model].from_rest(material))
    if run.adapt != "none":
        yield from _adaptive(settings, every)
    if run.cracks == "particles":
        yield from _of_particles(settings, every)
    if run.device != "cpu":
        yield from _on_device(settings, every)


def refuse(settings: Settings, dimension: int, name: str) -> None:
    """Raise GridError for impossible settings of the file called `name`."""
    for wrong in impossible(settings, dimension):
        raise GridError(f"{name}: {wrong}")


def of_material(material: Material, place: str) -> Iterator[Impossible]:
    """What a material cannot be, or says to a kind that it means nothing to."""
    yield from _quoted(material, place, _unheard(material))
    yield from _quoted(material, place, KINDS[material.model].wrong(material))
    yield from _quoted(material, place, _missing(material))


def _quoted(material: Material, place: str, refusals: Refusals) -> Iterator[Impossible]:
    """Refusals of a material, its words in quotes."""
    for name, expected in refusals:
        value = getattr(material, name)
        value_text = "none" if value is None else f"{value:g}" if isinstance(value, float) else f"'{value}'"
        yield Impossible(f"{place}.{name}", value_text, expected)


def _plain(material: Material, place: str, refusals: Refusals) -> Iterator[Impossible]:
    """Refusals of a material, its words as they are."""
    for name, expected in refusals:
        yield Impossible(f"{place}.{name}", getattr(material, name), expected)


def _in_space(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that only plates can have."""
    run = settings.run
    if run.adapt not in ("none", "hybrid"):
        yield Impossible("$.run.adapt", f"'{run.adapt}'", "none or hybrid in a body in space")
    if run.adapt == "hybrid":
        why = ", as run.adapt is hybrid in a body in space"
        if settings.physics != "mechanics":
            yield Impossible("$.physics", settings.physics, f"mechanics{why}")
        if run.damping:
            yield Impossible("$.run.damping", f"{run.damping:g}", f"0{why}")
        yield from of_kinds(settings, (Absorb,), f"a load, a displacement or a velocity{why}")
        for place, material in every:
            if material.law != USUAL_LAW:
                yield Impossible(f"{place}.law", material.law, f"{USUAL_LAW}{why}")
    if run.cracks != "bonds":
        yield Impossible("$.run.cracks", run.cracks, "bonds in a body in space")
    if settings.area_rule == "eq19":
        yield Impossible("$.area_rule", "'eq19'", "cells or square in a body in space")
    for place, material in every:
        yield from _quoted(material, place, KINDS[material.model].in_space(material))


def _at_rest(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that load steps do not support."""
    run, why = settings.run, "as the solver is static"
    for name, value, usual in (("damping", f"{run.damping:g}", "0"), ("until", str(run.until), "None")):
        if value != usual:
            yield Impossible(f"$.run.{name}", value, f"none, {why}")
    if run.start == "static":
        yield Impossible("$.run.start", "static", f"none, {why}")
    if run.static.floating and run.static.method == "relaxation":
        yield Impossible(
            "$.run.static.floating",
            "true",
            "false, as the method is relaxation: it has no way to tell a slow motion from one that nothing holds",
        )
    yield from _in_steps(settings, every)
    yield from of_kinds(settings, MOVING, f"load or displacement, {why}")
    for place, material in every:
        yield from _quoted(material, place, KINDS[material.model].at_rest(material, run.cracks == "bonds"))


def _in_steps(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that a path, or jumps of cycles, do not support."""
    run = settings.run
    if run.cracks == "bonds" and any(softens(material) for _, material in every):
        yield from _along_path(settings)
    elif run.cracks == "particles" and run.static.control == CRACK:
        yield from _along_cracks(settings)
    elif run.cracks == "bonds" and run.static.control == ARC:
        yield from _along_arc(settings)
    elif run.static.control is not None:
        length = CRACK if run.cracks == "particles" else ARC
        expected = f"{length} or none, as no bond softens, whose paths alone follow an opening"
        yield Impossible("$.run.static.control", f"'{run.static.control}'", expected)
    if run.fatigue is not None:
        yield from of_fatigue(settings, run.fatigue, every)


def _along_path(settings: Settings) -> Iterator[Impossible]:
    """Settings with which bonds that soften are not followed."""
    if settings.run.static.control == ARC:
        yield Impossible("$.run.static.control", "'arc'", "a gap, or none, as bonds soften")
    yield from _by_newton(settings.run, "as bonds soften")
    if settings.run.after == "motion" and settings.contact is not None:
        yield Impossible("$.contact", "some", "none, as run.after is motion")


def _along_cracks(settings: Settings) -> Iterator[Impossible]:
    """Settings with which cracks of particles are not followed, whose length is the control."""
    run, words = settings.run, "as the length of cracks is the control"
    if run.fatigue is not None:
        yield Impossible("$.run.fatigue", "some", f"none, {words}")
    if run.after == "motion":
        yield Impossible("$.run.after", "motion", f"path or stop, {words}")
    if settings.physics != "mechanics":
        yield Impossible("$.physics", settings.physics, f"mechanics, {words}")


def _along_arc(settings: Settings) -> Iterator[Impossible]:
    """Settings with which elastic bodies are not followed by the arc length of their path."""
    run, words = settings.run, "as the arc length is the control"
    if run.fatigue is not None:
        yield Impossible("$.run.fatigue", "some", f"none, {words}")
    yield from _by_newton(run, words)
    if settings.contact is not None:
        yield Impossible("$.contact", "some", f"none, {words}")
    if settings.physics != "mechanics":
        yield Impossible("$.physics", settings.physics, f"mechanics, {words}")


def _by_newton(run: Run, words: str) -> Iterator[Impossible]:
    """Settings of a path that only Newton's method with held bodies follows; `words` say why."""
    if run.static.method != "newton":
        yield Impossible("$.run.static.method", run.static.method, f"newton, {words}")
    if run.static.floating:
        yield Impossible("$.run.static.floating", "true", f"false, {words}")
    if run.after == "motion" and run.duration is None:
        yield Impossible("$.run.duration", "none", "seconds, as run.after is motion")


def _adaptive(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that splitting cells and moving fine zones do not support."""
    run, damping, why = settings.run, f"{settings.run.damping:g}", f", as run.adapt is {settings.run.adapt}"
    for place, value, expected in (
        ("$.area_rule", settings.area_rule or "cells", "cells"),
        ("$.run.solver", run.solver, "explicit"),
        ("$.run.start", run.start, "unloaded"),
        ("$.run.damping", damping, "0" if run.adapt == "collocation" else damping),
        *((f"{place}.coarse", material.coarse, "own") for place, material in every),
    ):
        if value != expected:
            yield Impossible(place, value, expected + why)
    if run.adapt == "collocation" and settings.regions:
        yield Impossible("$.regions", f"{len(every)} materials", f"one{why}")
    ratio = settings.horizon.ratio
    if run.adapt == "collocation" and ratio < FEWEST and not run.collocation.damped:
        yield Impossible(
            "$.run.collocation.damped",
            f"false with {ratio:g} spacings in the horizon",
            f"true, or at least {FEWEST:g} spacings: {LOSSY}",
        )
    for place, material in every:
        yield from _plain(material, place, KINDS[material.model].adaptive(material, every[0][1], run.adapt))
    refused = (Acceleration, Spring, Pin) if run.adapt == "hybrid" else (Acceleration, Absorb, Spring, Pin)
    yield from of_kinds(settings, refused, f"a load, a displacement or a velocity{why}")
    yield from spinning(settings, why)
    if run.adapt == "split" and not run.split.merge < run.split.threshold:
        less = f"less than the threshold, {run.split.threshold:g}{why}"
        yield Impossible("$.run.split.merge", f"{run.split.merge:g}", less)


def _touching(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that bodies in contact do not support."""
    why = ", as bodies touch"
    if settings.physics == "thermoelastic":
        words = f"mechanics{why}: contact is that of mechanics alone, and no heat passes from body to body"
        yield Impossible("$.physics", "thermoelastic", words)
    run = settings.run
    if run.adapt != "none":
        words = f"none{why}: adaptive cells are those of one body alone, and coarse ones would miss contact"
        yield Impossible("$.run.adapt", run.adapt, words)
    for name, expected in {"start": "unloaded", "cracks": "bonds", "fatigue": None}.items():
        if getattr(run, name) != expected:
            value = getattr(run, name) if expected else "some"
            yield Impossible(f"$.run.{name}", value, f"{expected or 'none'}{why}")
    if run.solver == "implicit":
        yield Impossible("$.run.solver", "implicit", f"explicit or static{why}")
    for place, material in every:
        if material.model == "micropolar":
            yield Impossible(f"{place}.model", "'micropolar'", f"a model without rotations{why}")


def _on_device(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that no device has."""
    why = f"as run.device is {settings.run.device}"
    yield from _unusual(settings, {"solver": "explicit", "adapt": "none", "cracks": "bonds"}, f", {why}")
    if settings.physics == "thermoelastic":
        yield Impossible("$.physics", settings.physics, f"mechanics or diffusion, {why}")
    if settings.medium is not None and settings.medium.dissolution == "kinetic":
        yield Impossible("$.medium.dissolution", "kinetic", f"enthalpy, {why}")
    for place, material in every:
        if material.model not in ("bond", "ordinary"):
            yield Impossible(f"{place}.model", f"'{material.model}'", f"bond or ordinary, {why}")


def _of_particles(settings: Settings, every: Places) -> Iterator[Impossible]:
    """Settings that cracks of particles do not support, and contradictory rules."""
    rules, words = settings.run.particles, "with cracks that are particles"
    if settings.run.adapt != "none":
        yield Impossible("$.run.adapt", settings.run.adapt, f"none {words}")
    for place, material in every:
        yield from _plain(material, place, KINDS[material.model].with_particles(material))
    for name, criterion in (("strength", "stress"), ("toughness", "intensity")):
        value = getattr(rules, name)
        if value is not None and rules.criterion != criterion:
            yield Impossible(f"$.run.particles.{name}", f"{value:g}", f"none as the criterion is {rules.criterion}")
    if rules.criterion == "stress" and rules.strength is None:
        most = "the largest principal stress, Pa, as the criterion is stress"
        yield Impossible("$.run.particles.strength", "none", most)
    if rules.criterion == "intensity" and rules.direction != "hoop":
        yield Impossible("$.run.particles.direction", rules.direction, "hoop as the criterion is intensity")


def _unheard(material: Material) -> Refusals:
    """Settings that a material's kind does not use."""
    kind = KINDS[material.model]
    for name, usual in refused_by(kind.name):
        if getattr(material, name) != usual:
            yield Refusal(name, f"none with model '{kind.name}'")
    if material.sight == "visibility" and material.gamma != USUAL.gamma:
        yield Refusal("gamma", "none with sight 'visibility'")
    if material.failure not in kind.failures:
        yield Refusal("failure", f"one of {', '.join(kind.failures)} with model '{kind.name}'")


def _missing(material: Material) -> Refusals:
    """Parameters that a word of the material asks for and that are not given."""
    for struct in KINDS[material.model].structs:
        switch = switch_of(struct)
        if switch is not None and getattr(material, switch[0]) == switch[1]:
            for name, needed in missing(material, struct):
                yield Refusal(name, f"{needed}, with {switch[0]} '{switch[1]}'")
