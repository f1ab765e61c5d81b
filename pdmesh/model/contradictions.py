"""Settings that contradict each other in their numbers, or that are missing; see `possible` for what excludes what.

Calculations hold numbers that are neither so large nor so small that products of a few of them are lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import starmap
from typing import NamedTuple

import msgspec

from pdmesh.messages import unfit
from pdmesh.model.document import ARC, CRACK, MOST, Fatigue, ParticleRules, Run, Settings
from pdmesh.model.lattice_calibration import has_partial_cells
from pdmesh.model.material import UNKNOWN, Expansion, Material, missing, switch_of
from pdmesh.model.materials import KINDS, MIXED, Refusal, Refusals, law_name, refused_by
from pdmesh.model.materials.kind import softens
from pdmesh.model.mechanical_conditions import RigidBody
from pdmesh.model.medium import Medium, Solid, contradiction
from pdmesh.model.orthotropic import not_of_springs
from pdmesh.model.output_fields import OF_CONTENT
from pdmesh.model.output_fields import USUAL as USUAL_FIELDS

FEWEST = 12.0  # spacings in the horizon with which collocation need not be asked to damp its seam
# Measured in the plate of docs/verification/collocation.md
LOSSY = "with fewer the seam is damped, which takes more than 60 % of the work from a struck plate with 4"
USUAL = Material(E=1.0, rho=1.0, G0=1.0)
LEAST = 1e-100  # products of a few smaller ones are 0
LEAST_OF_MATERIAL = 1e-30  # likewise, of E, rho and G0


class Impossible(NamedTuple):
    """A setting that is refused: its place, its value, and what to use."""

    place: str  # dotted, from $ on
    value: str  # none: it is missing; some: it is not quoted
    use: str  # none, and why: it cannot be there

    def __str__(self) -> str:
        return unfit(self.place, self.value, self.use)


Places = list[tuple[str, Material]]


class Case(NamedTuple):
    """The settings of a model, and the options of its run that not every model takes."""

    settings: Settings
    dimension: int  # of a plate (2) or a body in space (3)
    mode: str = "conservative"
    precision: str = "float64"
    ranks: bool = False  # whether the run is on MPI ranks
    kernel: str | None = None  # that the caller asks for
    disturbances: tuple[str, ...] = ()  # notch, step, noise: those by which a study repeats the run
    fields: tuple[str, ...] = ()  # constants of the material by node

    @property
    def materials(self) -> Places:
        """The materials of a model that moves, with their places."""
        settings = self.settings
        if settings.physics == "diffusion" or settings.material is None:
            return []
        every = [("$.material", settings.material)]
        every += [(f"$.regions[{number}].material", region.material) for number, region in enumerate(settings.regions)]
        if self.dimension == 2:
            return every
        return [(place, msgspec.structs.replace(material, plane="space")) for place, material in every]


def contradictions(case: Case) -> Iterator[Impossible]:
    """Settings that contradict each other, or are missing."""
    settings, run = case.settings, case.settings.run
    yield from _of_materials_together(case)
    for place, material in case.materials:
        yield from of_material(material, place)
        if settings.physics == "thermoelastic":
            for name, needed in missing(material, Expansion):
                yield Impossible(f"{place}.{name}", "none", f"{needed}, as the physics is thermoelastic")
    if settings.physics == "thermoelastic" and run.solver == "static" and run.time_step is None:
        yield Impossible("$.run.time_step", "none", "one, after which the body is brought to rest")
    if settings.physics == "diffusion" and settings.medium is not None:
        yield from _of_content(run, settings.medium)
    elif run.solver == "static" and case.materials:
        yield from _of_control(case)
        if run.fatigue is not None:
            by_bonds = run.cracks == "bonds"
            yield from _of_bond_fatigue(run.fatigue) if by_bonds else _of_paris_growth(run.fatigue, run.particles)
    if case.materials and run.adapt != "none":
        yield from _of_zones(case)
    if case.materials and run.cracks == "particles":
        yield from _of_particles(run.particles)
    yield from _of_interfaces(case)
    yield from _of_settings_that_need_others(settings)


def _of_settings_that_need_others(settings: Settings) -> Iterator[Impossible]:
    """Rigid bodies without contact, solids of nothing, and a time without broken bonds that is not given, or not waited
    for."""
    run, medium = settings.run, settings.medium
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, RigidBody) and settings.contact is None:
            yield Impossible("$.contact", "none", "it, as a body is rigid")
        if isinstance(condition, Solid) and medium is not None and medium.C_solid is None:
            yield Impossible(f"$.conditions[{number}]", "solid", "none, as the medium has no C_solid and C_sat")
    if run.until == "quiet" and run.quiet is None:
        yield Impossible("$.run.quiet", "none", "seconds, as until is quiet")
    if run.until is None and run.quiet is not None:
        yield Impossible("$.run.quiet", f"{run.quiet:g}", "none, as until is not quiet")


def _of_interfaces(case: Case) -> Iterator[Impossible]:
    """Constants of interfaces that a material's bonds do not use."""
    for number, interface in enumerate(case.settings.interfaces):
        for at, material in case.materials:
            springs = material.model == "bond" or material.law == "cohesive"
            for name, used, key in (
                ("f_t", interface.f_t is None or material.law == "cohesive", "law"),
                ("stiffness", interface.stiffness == 1 or springs, "model"),
                ("G0", interface.G0 is None or springs or material.failure in ("energy", "stretch"), "failure"),
            ):
                if not used:
                    why = f"none with {key} '{getattr(material, key)}' of {at}"
                    yield Impossible(f"$.interfaces[{number}].{name}", f"{getattr(interface, name):g}", why)


def _of_materials_together(case: Case) -> Iterator[Impossible]:
    """Materials that are not of the plate's or the body's dimension, or that differ where all are alike."""
    settings, first = case.settings, case.settings.material
    if settings.physics == "diffusion" or first is None:
        return
    if first.plane == ("space" if case.dimension == 2 else "strain"):
        use = "stress or strain in a plate" if case.dimension == 2 else "space in a body in space"
        yield Impossible("$.material.plane", f"'{first.plane}'", use)
    for number, region in enumerate(settings.regions):
        place = f"$.regions[{number}].material"
        for name in ("plane", "sight", "gamma"):
            value, elsewhere = getattr(region.material, name), getattr(first, name)
            if value != elsewhere:
                yield Impossible(f"{place}.{name}", f"'{value}'", f"'{elsewhere}' as elsewhere")
        law, elsewhere = law_name(region.material), law_name(first)
        if law != elsewhere and not {law, elsewhere} <= MIXED:
            key, use = "law" if first.model == region.material.model else "model", f"the law of $.material, {elsewhere}"
            yield Impossible(f"{place}.{key}", f"'{law}'", f"{use}: bonds between them have one")


def of_material(material: Material, place: str) -> Iterator[Impossible]:
    """What a material cannot be, or says to a kind that it means nothing to."""
    for name, expected in _refusals(material):
        value = getattr(material, name)
        value_text = "none" if value is None else f"{value:g}" if isinstance(value, float) else f"'{value}'"
        yield Impossible(f"{place}.{name}", value_text, expected)


def _too_small(material: Material) -> Refusals:
    """Constants that no material has."""
    for name in ("E", "rho", "G0"):
        value = getattr(material, name)
        if value < LEAST_OF_MATERIAL and not (name == "G0" and value == UNKNOWN):  # which a critical stretch gives
            yield Refusal(name, f"{LEAST_OF_MATERIAL:g} to {MOST:g} in SI units")


def _refusals(material: Material) -> Refusals:
    """Settings that a material's kind does not use or refuses, and parameters that a word asks for and that are not
    given."""
    kind = KINDS[material.model]
    yield from _too_small(material)
    if material.model == "bond" and material.solid == "orthotropic":
        yield from starmap(Refusal, not_of_springs(material))
    for name, usual in refused_by(kind.name):
        if getattr(material, name) != usual:
            yield Refusal(name, f"none with model '{kind.name}'")
    if material.sight == "visibility" and material.gamma != USUAL.gamma:
        yield Refusal("gamma", "none with sight 'visibility'")
    if material.failure not in kind.failures:
        yield Refusal("failure", f"one of {', '.join(kind.failures)} with model '{kind.name}'")
    yield from kind.wrong(material)
    for struct in kind.structs:
        switch = switch_of(struct)
        if switch is not None and getattr(material, switch[0]) == switch[1]:
            for name, needed in missing(material, struct):
                yield Refusal(name, f"{needed}, with {switch[0]} '{switch[1]}'")


def _of_content(run: Run, medium: Medium) -> Iterator[Impossible]:
    """Contradictions of diffusion."""
    wrong = contradiction(medium)
    if wrong is not None:
        yield Impossible(f"$.medium.{wrong[0]}", *wrong[1:])
    for name in run.fields if run.fields != USUAL_FIELDS else ():
        if name not in OF_CONTENT:
            yield Impossible("$.run.fields", f"'{name}'", f"one of {', '.join(OF_CONTENT)}")
    if run.solver == "implicit" and run.time_step is None:
        yield Impossible("$.run.time_step", "none", "one, as the solver is implicit")


def _of_control(case: Case) -> Iterator[Impossible]:
    """Controls of a path that has none, and motions without an end."""
    run = case.settings.run
    path = run.cracks == "bonds" and any(softens(material) for _, material in case.materials)
    length = CRACK if run.cracks == "particles" else ARC
    if run.static.control not in (None, length) and not path:
        expected = f"{length} or none, as no bond softens, whose paths alone follow an opening"
        yield Impossible("$.run.static.control", f"'{run.static.control}'", expected)
    if run.after == "motion" and not path and run.static.control is None:
        yield Impossible("$.run.after", "'motion'", "path, as no bond softens, whose paths alone end in a motion")
    if run.after == "motion" and run.duration is None:
        yield Impossible("$.run.duration", "none", "seconds, as run.after is motion")


def _of_zones(case: Case) -> Iterator[Impossible]:
    """Numbers of splitting cells and of moving fine zones that contradict each other."""
    run, ratio, why = case.settings.run, case.settings.horizon.ratio, f", as run.adapt is {case.settings.run.adapt}"
    if run.adapt == "collocation" and ratio < FEWEST and not run.collocation.damped:
        value = f"false with {ratio:g} spacings in the horizon"
        yield Impossible("$.run.collocation.damped", value, f"true, or at least {FEWEST:g} spacings: {LOSSY}")
    least, most = 1.0, 64.0
    if run.adapt == "collocation":
        least, most = 3.0, 32.0
    elif run.adapt == "hybrid" and case.dimension == 2:
        # half of a family has a bit of 64 for each bond; one whose cells count in part is half a spacing wider
        most = 5.5 if any(has_partial_cells(material) for _, material in case.materials) else 6.0
    if not least <= ratio <= most:
        yield Impossible("$.horizon.ratio", f"{ratio:g}", f"{least:g} to {most:g}{why}")
    if run.adapt == "split" and not run.split.merge < run.split.threshold:
        less = f"less than the threshold, {run.split.threshold:g}{why}"
        yield Impossible("$.run.split.merge", f"{run.split.merge:g}", less)
    if run.adapt == "collocation" or (run.adapt == "hybrid" and case.dimension == 3):
        first = case.materials[0][1].micromodulus
        for place, material in case.materials:
            if material.micromodulus != first:
                yield Impossible(f"{place}.micromodulus", f"'{material.micromodulus}'", f"{first}, as elsewhere{why}")


def _of_particles(rules: ParticleRules) -> Iterator[Impossible]:
    """Rules of particles that contradict each other."""
    for name, criterion in (("strength", "stress"), ("toughness", "intensity")):
        value = getattr(rules, name)
        if value is not None and rules.criterion != criterion:
            yield Impossible(f"$.run.particles.{name}", f"{value:g}", f"none as the criterion is {rules.criterion}")
    if rules.criterion == "stress" and rules.strength is None:
        most = "the largest principal stress, Pa, as the criterion is stress"
        yield Impossible("$.run.particles.strength", "none", most)
    if rules.criterion == "intensity" and rules.direction != "hoop":
        yield Impossible("$.run.particles.direction", rules.direction, "hoop as the criterion is intensity")


def _of_paris_growth(fatigue: Fatigue, rules: ParticleRules) -> Iterator[Impossible]:
    """Settings with which cracks of particles do not grow by Paris's line."""
    usual, words = Fatigue(), "with cracks that are particles"
    for name in ("C", "m"):
        if getattr(fatigue, name) is None:
            yield Impossible(f"$.run.fatigue.{name}", "none", f"a number, {words}")
    for name in ("A", "A1", "m1", "endurance", "threshold", "damaged", "blocks"):
        if getattr(fatigue, name) != getattr(usual, name):
            yield Impossible(f"$.run.fatigue.{name}", f"{getattr(fatigue, name)}", f"none {words}")
    if rules.criterion != "intensity":
        yield Impossible("$.run.particles.criterion", rules.criterion, "intensity, as cracks grow by it")


def _of_bond_fatigue(fatigue: Fatigue) -> Iterator[Impossible]:
    """Halves of a line of growth or initiation, and what is of particles."""
    for name in ("C", "threshold_K"):
        if getattr(fatigue, name):
            yield Impossible(f"$.run.fatigue.{name}", f"{getattr(fatigue, name):g}", "A in its place, as bonds tire")
    if fatigue.A is None and fatigue.A1 is None:
        yield Impossible("$.run.fatigue.A", "none", "a number, or A1")
    for pair in (("A", "m"), ("A1", "m1")):
        for name, partner in (pair, pair[::-1]):
            if getattr(fatigue, name) is None and getattr(fatigue, partner) is not None:
                yield Impossible(f"$.run.fatigue.{name}", "none", f"a number, with {partner}")


def wrong_monitors(run: Run, conditions: Sequence[str]) -> str | None:
    """What is wrong with the monitors of a run whose `conditions` have these names; None if nothing is.

    The place below ``run``, what was found and expected.
    """
    gaps = [gap.name for gap in run.gaps]
    for key, names in (("gaps", gaps), ("load_cells", [cell.name for cell in run.load_cells])):
        for number, name in enumerate(names):
            if not name or Counter(names)[name] > 1:
                return f"{key}[{number}].name: '{name}' is used {Counter(names)[name]} times; use a name of its own"
    for number, gap in enumerate(run.gaps):
        if gap.ends[0] == gap.ends[1]:
            return f"gaps[{number}].ends: both are one place; use two places"
    for number, cell in enumerate(run.load_cells):
        missing = [name for name in cell.of if name not in conditions]
        if missing or not cell.of:
            actual = f"'{missing[0]}'" if missing else "none"
            condition_names = ", ".join(filter(None, conditions)) or "a name"
            return f"load_cells[{number}].of has {actual}; use names of conditions: {condition_names}"
    return _wrong_control(run, gaps)


def _wrong_control(run: Run, gaps: list[str]) -> str | None:
    """What is wrong with the control of a path."""
    static, length = run.static, CRACK if run.cracks == "particles" else ARC
    if static.control == length:
        if length in gaps:
            return f"gaps[{gaps.index(length)}].name is '{length}', which is a control by a length; use another"
        unused = "none, as a length is the control"
        return (
            None
            if static.opening is None
            else f"static.opening ({static.opening:g}) cannot be used; leave it out: {unused}"
        )
    if static.control is not None and static.control not in gaps:
        gap_names = ", ".join(gaps) or "a gap (run.gaps has none)"
        return f"static.control is '{static.control}'; use {gap_names}, or {length}"
    if (static.control is None) != (static.opening is None):
        present_key, missing_key = ("opening", "control") if static.control is None else ("control", "opening")
        return f"static.{missing_key} is missing; give it, as there is a static.{present_key}"
    return None


def beyond(value: object, place: str, leave_out: Collection[str] = ()) -> str | None:
    """Place and value of the first number out of range (0 is allowed), with what was expected; None without one.

    `leave_out` names fields of the outermost struct that are not checked.
    """
    if not leave_out and _is_within(value):
        return None
    if isinstance(value, float):
        if value == 0 or LEAST <= abs(value) <= MOST:
            return None
        expected = f"a number from {-MOST:g} to {MOST:g}" if abs(value) > 1 or value != value else f"{LEAST:g} or more"
        return f"{place} is {value:g}; use {expected}"
    parts: Iterable[tuple[str, object]] = ()
    if isinstance(value, msgspec.Struct):
        names = (name for name in value.__struct_fields__ if name not in leave_out)
        parts = ((f"{place}.{name}", getattr(value, name)) for name in names)
    elif isinstance(value, tuple):
        parts = ((f"{place}[{at}]", part) for at, part in enumerate(value) if not isinstance(part, int))
    return next(filter(None, (beyond(part, at) for at, part in parts)), None)


def _is_within(value: object) -> bool:
    """Whether all numbers are in range; many regions are read in a tenth of the time that places would take."""
    if isinstance(value, float):
        return value == 0 or LEAST <= abs(value) <= MOST
    parts = value if isinstance(value, tuple) else ()
    if isinstance(value, msgspec.Struct):
        parts = msgspec.structs.astuple(value)
    return all(_is_within(part) for part in parts if not isinstance(part, int | str | None))
