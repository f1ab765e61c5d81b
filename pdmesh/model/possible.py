"""What can be combined: one table of the features of a model and of the pairs that exclude each other.

A feature is recognised by settings, at their places. An exclusion is about one feature, which its message names, and
says by which other it is excluded, what to use in its place, and why. Messages, `pdmesh info` and the guide's page on
combinations come from here. Numbers that contradict each other are in `contradictions`; what depends on nodes is
refused where nodes are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple, get_args

import msgspec
import numpy as np

from pdmesh.messages import listed
from pdmesh.model.contradictions import Case, Impossible, contradictions
from pdmesh.model.document import (
    ARC,
    CRACK,
    Absorb,
    Acceleration,
    Condition,
    GridError,
    InitialDisplacement,
    InitialVelocity,
    Load,
    OfDiffusion,
    OfMechanics,
    Pin,
    Settings,
    Spring,
    Velocity,
)
from pdmesh.model.material import USUAL_LAW, Material
from pdmesh.model.materials.kind import softens
from pdmesh.model.materials.solids import SOLIDS
from pdmesh.model.mechanical_conditions import Contact, Grip, RigidBody
from pdmesh.model.unused_settings import USUAL, value_of, word
from pdmesh.model.values_of_place import is_over_time, named, varying

DEFAULTS = msgspec.structs.replace(USUAL, contact=Contact())  # as everything is that is left out
Occurrences = Iterator[tuple[str, str]]  # places and values there
Recognise = Callable[[Case], Occurrences]


class Feature(NamedTuple):
    """Something that a model can have."""

    name: str  # for users
    occurrences: Recognise
    use: str = "none"  # what to use in its place
    why: str = ""  # it excludes others; {} stands for its value


class Exclusion(NamedTuple):
    """Two features of which a model can have one."""

    feature: Feature  # the one that a message is about
    by: Feature
    use: str  # in its place
    because: str  # more of why


def setting(name: str, *values: object) -> Recognise:
    """A setting of this dotted name with one of these values, or, if there are none, with another than the usual."""
    usual = value_of(DEFAULTS, name)

    def occurrences(case: Case) -> Occurrences:
        value = value_of(case.settings, name)
        if value in values if values else value is not None and value != usual:
            text = "some" if isinstance(value, tuple) else word(value)
            yield f"$.{name}", f"'{value}'" if isinstance(value, str) else text

    return occurrences


def present(*names: str) -> Recognise:
    """Settings of these names that are there at all."""

    def occurrences(case: Case) -> Occurrences:
        return ((f"$.{name}", "some") for name in names if value_of(case.settings, name))

    return occurrences


def option(name: str, *values: object) -> Recognise:
    """An option of a run with one of these values."""

    def occurrences(case: Case) -> Occurrences:
        if getattr(case, name) in values:
            yield name, word(getattr(case, name))

    return occurrences


def disturbances(name: str) -> Recognise:
    """A disturbance by which a study repeats runs."""

    def occurrences(case: Case) -> Occurrences:
        if name in case.disturbances:
            yield f"repeat.{name}", "some"

    return occurrences


def conditions(*kinds: type, key: str = "") -> Recognise:
    """Conditions of these kinds; with a `key`, those that have more there than 0 or nothing."""

    def occurrences(case: Case) -> Occurrences:
        for number, condition in enumerate(case.settings.conditions):
            if isinstance(condition, kinds) and (not key or np.any(getattr(condition, key))):
                value: Any = getattr(condition, key) if key else condition.__struct_config__.tag
                text = f"{len(value)} points" if key == "profile" else word(value)
                yield f"$.conditions[{number}]{key and f'.{key}'}", text

    return occurrences


def data_over_time(case: Case) -> Occurrences:
    """Values of conditions that are tables with times."""
    for number, condition in enumerate(case.settings.conditions):
        for name, at, value in varying(condition):
            if is_over_time(value):
                yield f"$.conditions[{number}].{named(name, at)}", "a table with times"


def materials(key: str, which: Callable[[Material], bool]) -> Recognise:
    """Materials with a property, which shows in this setting of theirs."""

    def occurrences(case: Case) -> Occurrences:
        for place, material in case.materials:
            if which(material):
                yield f"{place}.{key}", f"'{getattr(material, key)}'"

    return occurrences


def models(*names: str) -> Recognise:
    """Materials of these models."""
    return materials("model", lambda material: material.model in names)


def both(first: Recognise, *others: Recognise) -> Recognise:
    """The places of the first, where the others are found too."""

    def occurrences(case: Case) -> Occurrences:
        if all(any(True for _ in other(case)) for other in others):
            yield from first(case)

    return occurrences


def regions(case: Case) -> Occurrences:
    """Regions of several materials."""
    if len(case.materials) > 1:
        yield "$.regions", f"{len(case.materials)} materials"


def node_fields(case: Case) -> Occurrences:
    """Constants of the material by node."""
    return (("$.fields", quantity) for quantity in case.fields)


AT_REST, BREAKING, GROWN = setting("run.solver", "static"), setting("run.cracks", "bonds"), setting("run.cracks")
MOTION, ARC_LENGTH = setting("physics", "mechanics", "thermoelastic"), setting("run.static.control", ARC)
OTHERS = "'bond', 'ordinary' or 'correspondence'"
ROTATIONS = " (load steps solve for displacements, not for the rotations that 'micropolar' needs)"
CONSERVATIVE = "conservative"


def tags(conditions: Any) -> str:
    """The names of kinds of conditions, as a choice."""
    return listed(str(kind.__struct_config__.tag) for kind in get_args(conditions))


def adaptive(*names: str) -> Recognise:
    """A motion with one of these adaptivities, or with any."""
    return both(setting("run.adapt", *names), MOTION)


# Physics
DIFFUSION = Feature("diffusion", setting("physics", "diffusion"), "mechanics", ", as the physics is diffusion")
HEAT = Feature("thermal stress", setting("physics", "thermoelastic"), "mechanics", ", as the physics is thermoelastic")
MECHANICS = Feature("mechanics", setting("physics", "mechanics"), why=", as the physics is mechanics")
MATERIAL = Feature("materials", present("material", "regions"))
MEDIUM = Feature("media", present("medium", "media"))
MECHANICAL = Feature("mechanical conditions", conditions(*get_args(OfMechanics)), tags(OfDiffusion))
CONTENTS = Feature("conditions of a content", conditions(*get_args(OfDiffusion)), tags(OfMechanics))
SOLID = Feature("dissolution", setting("medium.C_solid"))
KINETIC = Feature(
    "kinetic dissolution", setting("medium.dissolution", "kinetic"), "enthalpy", ", as the dissolution is kinetic"
)
CONDUCTANCE = Feature("conductance of broken bonds", setting("medium.broken"), "1")
HEATING = Feature("heat of deformation", setting("medium.deformation"), "false")
# Analysis
IMPLICIT = Feature("implicit steps", setting("run.solver", "implicit"), "explicit or static")
STATIC = Feature("load steps", AT_REST, "explicit", ", as the solver is static")
COUNT = Feature("a number of load steps", both(setting("run.static.load_steps"), AT_REST))
RELAXATION = Feature(
    "dynamic relaxation", both(setting("run.static.method"), AT_REST), "newton", ", as the method is relaxation"
)
FLOATING = Feature("bodies without supports", both(setting("run.static.floating"), AT_REST), "false")
SOFT = both(materials("law", softens), AT_REST)
SOFTENING = Feature("softening bonds in load steps", SOFT, USUAL_LAW)
PATH = Feature("a softening path", both(SOFT, BREAKING), USUAL_LAW, ", as bonds soften")
ARC_STEPS = Feature(
    "arc length control", both(ARC_LENGTH, AT_REST, BREAKING), "a gap or none", ", as the arc length is the control"
)
CRACK_STEPS = Feature(
    "crack length control",
    both(setting("run.static.control", CRACK), AT_REST, GROWN),
    why=", as the length of cracks is the control",
)
AFTER = Feature(
    "motion after a path", both(setting("run.after", "motion"), AT_REST), "path or stop", ", as run.after is motion"
)
START = Feature("a static start", setting("run.start"), "unloaded", ", as run.start is static")
FATIGUE = Feature("fatigue", both(present("run.fatigue"), AT_REST), why=" in fatigue analysis")
BOND_FATIGUE = Feature("fatigue of bonds", both(FATIGUE.occurrences, BREAKING), why=" in fatigue analysis")
PROFILE = Feature("profiles of loads", conditions(Condition, key="profile"))
DATA = Feature("data over time", data_over_time, "a value and a profile")
DAMPING = Feature("damping", setting("run.damping"))
STIFFNESS_DAMPING = Feature(
    "damping by stiffness", setting("run.damping_time"), "0, or run.damping", ", as run.damping_time is {}"
)
UNTIL = Feature("an early end", setting("run.until"))
PROBES = Feature("probes", setting("run.probes"))
# Discretization
SPACE = Feature("3D", option("dimension", 3), why=" in a body in space")
AREA_RULE = Feature("another area rule", setting("area_rule", "eq19", "square"), "cells")
EQ19 = Feature("the area rule of the thesis (eq. 19)", setting("area_rule", "eq19"), "cells or square")
ADAPTIVE = Feature("adaptivity", adaptive(), why=", as run.adapt is {}")
ZONES = Feature("adaptivity of plates", adaptive("split", "collocation"), "none or hybrid")
HYBRID = Feature("hybrid", adaptive("hybrid"), why=", as run.adapt is {}")
PLATES = Feature("hybrid in 2D", both(HYBRID.occurrences, option("dimension", 2)), why=", as run.adapt is {}")
SPLIT = Feature("split", adaptive("split"), why=", as run.adapt is {}")
OTHER_ZONES = Feature("hybrid and split", setting("run.adapt", "hybrid", "split"), "none or collocation")
COLLOCATION = Feature("collocation", setting("run.adapt", "collocation"), why=", as run.adapt is {}")
BONDS_COLLOCATED = Feature("collocation of bonds", adaptive("collocation"), why=", as run.adapt is {}")
PARTICLES = Feature("crack particles", GROWN, "bonds", " with cracks that are particles")
PARTICLES_AT_REST = Feature(
    "crack particles in load steps", both(GROWN, AT_REST), "bonds", ", as the solver is static and cracks are particles"
)
REGIONS = Feature("several materials", regions, "one")
NODE_FIELDS = Feature("fields of the material by node", node_fields, "regions")
INTERFACES = Feature("interfaces", present("interfaces"), "none")
# Conditions
CONTACT = Feature("contact", present("contact"), why=", as bodies touch")
RESTITUTION = Feature("a restitution below 1", setting("contact.restitution"), "1")
RIGID = Feature("rigid bodies", conditions(RigidBody), why=", as a body is rigid")
SPRINGS = Feature("springs", conditions(Spring), "a load, a displacement or a velocity")
PINS = Feature("pins", conditions(Pin), "a load, a displacement or a velocity")
FOLLOWING = Feature("following pressure", conditions(Load, key="following"), "false", ", as a pressure is following")
ACCELERATION = Feature("accelerations", conditions(Acceleration), "a load, a displacement or a velocity")
VELOCITY = Feature("velocities", conditions(Velocity, InitialVelocity))
SPIN = Feature("an initial spin", conditions(InitialVelocity, key="spin"), "0")
ABSORB = Feature("absorbing layers", conditions(Absorb), "a load, a displacement or a velocity")
CORRECTED = Feature("corrected grips", conditions(Grip, key="corrected"), "false")
DISPLACED = Feature("initial displacements", conditions(InitialDisplacement))
# Materials
STATE_BASED = Feature("state-based and micropolar models", models("ordinary", "correspondence", "micropolar"), "bond")
ORDINARY = Feature("ordinary", models("ordinary"), "bond")
CORRESPONDENCE = Feature("correspondence", models("correspondence"), "bond or ordinary")
MICROPOLAR = Feature("micropolar", models("micropolar"), "bond or ordinary")
BEAMS = Feature("micropolar beams", materials("model", lambda m: m.model == "micropolar" and not softens(m)), OTHERS)
COHESIVE = Feature("cohesive bonds", materials("law", lambda m: m.law == "cohesive"), f"{USUAL_LAW} or bilinear")
LAW = Feature("laws other than brittle", materials("law", lambda m: m.law != USUAL_LAW), USUAL_LAW)
DIFFRACTION = Feature("diffraction", materials("sight", lambda m: m.sight != "visibility"), "visibility")
COARSE = Feature("strengths of coarse bonds", materials("coarse", lambda m: m.coarse != "own"), "own")
CALIBRATION = Feature("isotropic calibration", materials("calibration", lambda m: m.calibration != "mean"), "mean")
ENERGY = Feature("failure by energy", materials("failure", lambda m: m.failure == "energy"), "none or stretch")
LARGE = Feature(
    "neo hooke, orthotropic and plastic flow",
    materials("solid", lambda m: m.model == "correspondence" and not SOLIDS[m.solid].particles),
    "linear or svk",
)
FLOW = Feature(
    "plastic flow",
    materials("solid", lambda m: SOLIDS[m.solid].flows),
    " or ".join(f"'{solid.name}'" for solid in SOLIDS.values() if not solid.flows),
    ", as the solid flows",
)
LISTED = Feature(
    "laws of listed bonds",
    materials(
        "model",
        lambda m: (
            m.model == "micropolar"
            or SOLIDS[m.solid].flows
            or m.order > 1
            or m.constant_term
            or m.control == "breitzman-dayal"
        ),
    ),
    why=", as blocks do not have the law of the material",
)
ORTHOTROPIC = Feature(
    "orthotropic",
    materials("solid", lambda m: m.model == "correspondence" and m.solid == "orthotropic"),
    "'linear'",
    ", as the solid is orthotropic",
)
RATE = Feature("rate form", materials("form", lambda m: m.form == "rate"), "total")
HISTORY = Feature(
    "failure of plastic flow or rate form",
    both(materials("failure", lambda m: m.failure != "none" and (SOLIDS[m.solid].flows or m.form == "rate")), BREAKING),
    "'none' with solid 'j2' or form 'rate'",
)
# Execution
THESIS = Feature("thesis mode", option("mode", "thesis"), CONSERVATIVE, " in the thesis mode")
SINGLE = Feature("single precision", option("precision", "float32"), "float64")
DEVICE = Feature("OpenCL", setting("run.device"), "cpu", ", as run.device is {}")
KERNEL = Feature("kernels of blocks", option("kernel", "blocks", "hybrid", "collocation"), "listed")
RANKS = Feature("MPI ranks", option("ranks", True), why=" on many ranks")
SHORTER = Feature("shorter steps of repeated runs", disturbances("step"), "none (notch and noise can)")
SHIFTED = Feature("shifted cracks of repeated runs", disturbances("notch"), "none (step and noise can)")
NOISE = Feature("shifted nodes of repeated runs", disturbances("noise"), "none (notch and step can)")


def excluded(by: Feature, *features: Feature, use: str = "", because: str = "") -> Iterator[Exclusion]:
    """Exclusions of these features by one, with what to use in their place if it is not the usual."""
    return (Exclusion(feature, by, use or feature.use, because) for feature in features)


ONE_BODY = " (adaptive cells exist for a single body only, and coarse cells would not detect contact)"
NO_HEAT = " (contact transmits forces but no heat)"
UNHELD = " (dynamic relaxation cannot distinguish slow convergence from free motion)"
LAST = "bond (or --adapt none; version 1.0.0 was the last with zones of ordinary solids)"
TABLE: tuple[Exclusion, ...] = (
    *excluded(DIFFUSION, UNTIL, START, DAMPING, PROBES, PARTICLES, CONDUCTANCE, HEATING, EQ19, THESIS, SINGLE),
    *excluded(DIFFUSION, STIFFNESS_DAMPING, KERNEL, MECHANICAL),
    *excluded(DIFFUSION, NODE_FIELDS, use="none (they are of a material)"),
    *excluded(DIFFUSION, INTERFACES, use="none (they are of a material)"),
    *excluded(DIFFUSION, MATERIAL, because=" (mechanics and thermoelastic have some)"),
    *excluded(DIFFUSION, STATIC, use="explicit or implicit"),
    *excluded(DIFFUSION, OTHER_ZONES),
    *excluded(KINETIC, IMPLICIT, use="explicit"),
    *excluded(KINETIC, COLLOCATION),
    *excluded(COLLOCATION, IMPLICIT, use="explicit"),
    *excluded(SPACE, ZONES, PARTICLES, EQ19, THESIS),
    *excluded(SPACE, CORRECTED, SHIFTED),
    *excluded(SPACE, MICROPOLAR, use=OTHERS),
    *excluded(SPACE, PINS, use="none"),
    *excluded(HEAT, SOLID, IMPLICIT, SOFTENING, ZONES, PARTICLES, START, DISPLACED, THESIS),
    *excluded(HEAT, STIFFNESS_DAMPING, EQ19),
    *excluded(HEAT, COUNT, use="run.time_step and steps"),
    *excluded(HEAT, ORTHOTROPIC, because=" (it has one expansion, not one along and one across the fibres)"),
    *excluded(ORTHOTROPIC, ABSORB),
    *excluded(ORTHOTROPIC, INTERFACES, because=" (interfaces weaken bonds that fail by stretch or energy)"),
    *excluded(CONTACT, HEAT, because=NO_HEAT),
    *excluded(CONTACT, ADAPTIVE, because=ONE_BODY),
    *excluded(CONTACT, START, PARTICLES, FATIGUE, THESIS),
    *excluded(CONTACT, MICROPOLAR, use="a model without rotations"),
    *excluded(RIGID, DISPLACED),
    *excluded(RIGID, STIFFNESS_DAMPING),
    *excluded(START, DISPLACED, FLOW, RATE),
    *excluded(START, MICROPOLAR, use=OTHERS, because=ROTATIONS),
    *excluded(MECHANICS, IMPLICIT, CONTENTS),
    *excluded(MECHANICS, MEDIUM, because=" (diffusion and thermoelastic have some)"),
    *excluded(STATIC, DAMPING, UNTIL, HISTORY, SINGLE),
    *excluded(STATIC, STIFFNESS_DAMPING, SHORTER),
    *excluded(STATIC, RESTITUTION, because=" (nothing bounces)"),
    *excluded(FLOW, SINGLE),
    *excluded(LISTED, KERNEL),
    *excluded(STATIC, START, use="none"),
    *excluded(STATIC, VELOCITY, ACCELERATION, DISPLACED, ABSORB, RIGID, use="a load or a displacement"),
    *excluded(STATIC, BEAMS, use=f"{OTHERS}, or law 'cohesive'", because=ROTATIONS),
    *excluded(PARTICLES_AT_REST, MICROPOLAR, use=OTHERS, because=ROTATIONS),
    *excluded(RELAXATION, FLOATING, because=UNHELD),
    *excluded(PATH, DATA, because=" (loads follow from what bonds dissipate)"),
    *excluded(PATH, RELAXATION, FLOATING, ARC_STEPS, THESIS),
    *excluded(AFTER, CONTACT),
    *excluded(CRACK_STEPS, FATIGUE, AFTER, HEAT, RATE, DATA),
    *excluded(ARC_STEPS, DATA, FATIGUE, RELAXATION, FLOATING, CONTACT, HEAT),
    *excluded(FATIGUE, FLOATING, COUNT, HEAT, LAW),
    *excluded(FATIGUE, PROFILE, because=" (the loads of the model are the maximum loads of a cycle)"),
    *excluded(FATIGUE, DATA, because=" (the loads of the model are the maximum loads of a cycle)"),
    *excluded(BOND_FATIGUE, STATE_BASED, THESIS),
    *excluded(ADAPTIVE, NODE_FIELDS, use="regions (or --adapt none: coarse cells have one material)"),
    *excluded(ADAPTIVE, INTERFACES, use="none (or --adapt none: coarse cells do not weaken along a line)"),
    *excluded(ADAPTIVE, DATA, because=" (coarse cells do not have the motion of each node)"),
    *excluded(ADAPTIVE, NOISE, AREA_RULE, STATIC, START, COARSE, PINS),
    *excluded(SPLIT, ACCELERATION, SPIN, DISPLACED, SPRINGS),
    *excluded(BONDS_COLLOCATED, ACCELERATION, SPIN, DISPLACED, SPRINGS),
    *excluded(HYBRID, HEATING, because=" (coarse nodes have no heat of deformation)"),
    *excluded(HYBRID, DIFFRACTION, THESIS),
    *excluded(PLATES, ORDINARY, use=LAST),
    *excluded(ADAPTIVE, STATE_BASED, use="bond (or --adapt none)"),
    *excluded(ADAPTIVE, STIFFNESS_DAMPING, because=" (the march of moving zones has no stiffness matrix)"),
    *excluded(STIFFNESS_DAMPING, STATE_BASED, because=" (bonds that break leave other families as they are)"),
    *excluded(SPLIT, LAW, ABSORB, SINGLE, KERNEL),
    *excluded(BONDS_COLLOCATED, DAMPING, use="0"),
    *excluded(BONDS_COLLOCATED, REGIONS, LAW, ABSORB, DIFFRACTION, THESIS, SINGLE),
    *excluded(PARTICLES, STIFFNESS_DAMPING),
    *excluded(PARTICLES, INTERFACES, because=" (tips grow by one toughness)"),
    *excluded(PARTICLES, ADAPTIVE, LARGE, THESIS),
    *excluded(DEVICE, STATIC, IMPLICIT, use="explicit"),
    *excluded(DEVICE, STIFFNESS_DAMPING, NOISE),
    *excluded(DEVICE, HEAT, use="mechanics or diffusion"),
    *excluded(DEVICE, ADAPTIVE, COLLOCATION, PARTICLES, KINETIC, CORRESPONDENCE, MICROPOLAR),
    *excluded(STATIC, FOLLOWING, because=" (use a dynamic run with damping)"),
    *excluded(FOLLOWING, START, ADAPTIVE, DEVICE, RANKS, STIFFNESS_DAMPING, THESIS),
    *excluded(DEVICE, CONTACT, RIGID, SPRINGS, PINS, use="none"),
    *excluded(RANKS, STATIC, IMPLICIT, use="explicit"),
    *excluded(RANKS, HEAT, use="mechanics or diffusion"),
    *excluded(RANKS, START, ADAPTIVE, COLLOCATION, PARTICLES, DEVICE, SPIN, CORRESPONDENCE, MICROPOLAR, ENERGY),
    *excluded(RANKS, CONTACT, RIGID, SPRINGS, PINS, DISPLACED, use="none"),
    *excluded(THESIS, STATE_BASED, DIFFRACTION, CALIBRATION, COARSE),
    *excluded(THESIS, INTERFACES, because=" (interfaces need a calibrated lattice)"),
    *excluded(THESIS, COHESIVE, because=" (cohesive bonds need a calibrated lattice)"),
)


def impossible(case: Case) -> Iterator[Impossible]:
    """What cannot be combined in a model and the options of its run."""
    if case.settings.run.adapt == "auto" and not case.ranks:  # where hybrid is refused, that is none
        run = msgspec.structs.replace(case.settings.run, adapt="none")
        case = case._replace(settings=msgspec.structs.replace(case.settings, run=run))
    first = cache(lambda feature: next(feature.occurrences(case), None))
    for feature, by, use, because in TABLE:
        excluder = first(by)
        if excluder is not None:
            why = by.why.format(excluder[1].strip("'")) + because
            yield from (Impossible(*occurrence, use + why) for occurrence in feature.occurrences(case))
    yield from contradictions(case)


def excluded_from(case: Case) -> list[str]:
    """The names of the features that exclude, or are excluded by, those of a model."""
    there = cache(lambda feature: next(feature.occurrences(case), None) is not None)
    rows = ((feature, by) for feature, by, *_ in TABLE if there(feature) != there(by))
    return sorted({(by if there(feature) else feature).name for feature, by in rows})


def refuse(settings: Settings, dimension: int, name: str, fields: tuple[str, ...] = ()) -> None:
    """Raise GridError for impossible settings of the file called `name`, with these `fields` by node."""
    for wrong in impossible(Case(settings, dimension, fields=fields)):
        raise GridError(f"{name}: {wrong}")
