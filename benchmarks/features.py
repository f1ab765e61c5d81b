"""A small model of every feature, and of any two: what pages show, and what is tried of all pairs.

A sample is what its feature changes in the plate or the body below, by dotted names of settings; those of `OPTIONS` are
of `pdmesh.model.contradictions.Case`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import prod
from typing import Any, NamedTuple

import msgspec
import numpy as np

from benchmarks.kinds_of_run import BOND, H, lattice
from benchmarks.models import grid_of_nodes
from pdmesh.model.contradictions import Case
from pdmesh.model.document import (
    Absorb,
    Acceleration,
    AnyCondition,
    Concentration,
    Displacement,
    Fatigue,
    Gap,
    Horizon,
    InitialConcentration,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Pin,
    Region,
    RigidBody,
    Run,
    Settings,
    Spring,
    Velocity,
)
from pdmesh.model.interfaces import Interface
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.medium import Medium, Solid
from pdmesh.model.node_fields import FieldColumn
from pdmesh.model.node_grid import Bodies, Grid
from pdmesh.model.possible import impossible
from pdmesh.model.values_of_place import Table

Changes = dict[str, Any]
COUNTS = {2: (36, 26), 3: (12, 12, 12)}  # nodes along each axis
RISING = ((0.0, 0.0), (1.0, 1.0))


class Places(NamedTuple):
    """Boxes of nodes of a plate (2) or a body (3), m."""

    dimension: int
    everywhere: tuple[float, ...]
    left: tuple[float, ...]  # half
    right: tuple[float, ...]  # the last column
    middle: tuple[float, ...]  # some nodes
    upper: tuple[float, ...]  # some others
    low: tuple[float, ...]  # the first row
    high: tuple[float, ...]  # the last row
    mouth: tuple[tuple[float, ...], tuple[float, ...]]  # two places, on both sides of the crack


SOLID: Changes = {"material.model": "correspondence", "material.nu": 0.22}
ORDINARY: Changes = {"material.model": "ordinary", "material.nu": 0.22}
STATIC: Changes = {"run.solver": "static"}
SOFT: Changes = {"material.law": "bilinear", "material.kr": 2.0}
GROWN: Changes = {"run.cracks": "particles"}
HEAT = Medium(D=1e-3, carries="heat", heat_capacity=2e6)
WET: Changes = {"medium.C_solid": 1.0, "medium.C_sat": 0.2}
TOUCHING: Changes = {"contact": Contact()}

ANALYSES: dict[str, Changes] = {
    "explicit steps": {"run.solver": "explicit"},
    "implicit steps": {"run.solver": "implicit"},
    "static start": {"run.start": "static"},
    "load steps": STATIC,
    "a number of load steps": STATIC | {"run.static.load_steps": 2, "profile": RISING},
    "dynamic relaxation": STATIC | {"run.static.method": "relaxation"},
    "bodies without supports": STATIC | {"run.static.floating": True},
    "softening path": STATIC | SOFT,
    "opening control": STATIC | SOFT | {"gap": True, "run.static.control": "gap", "run.static.opening": 1e-6},
    "motion after a path": STATIC | SOFT | {"run.after": "motion", "run.duration": 1e-6},
    "arc length control": STATIC | {"run.cracks": "bonds", "run.static.control": "arc"},
    "crack length control": STATIC | GROWN | {"run.static.control": "crack"},
    "fatigue of bonds": STATIC | {"run.cracks": "bonds", "run.fatigue": Fatigue(A=1e9, m=3.0)},
    "fatigue of crack particles": STATIC | GROWN | {"run.fatigue": Fatigue(C=1e-30, m=3.0)},
}
PHYSICS: dict[str, Changes] = {
    "thermal stress": {"physics": "thermoelastic"},
    "heat of deformation": {"medium.deformation": True},
    "conductance of broken bonds": {"medium.broken": 0.5},
    "diffusion": {"physics": "diffusion"},
    "dissolution": WET,
    "kinetic dissolution": WET | {"medium.dissolution": "kinetic"},
}
DISCRETIZATION: dict[str, Changes] = {
    "3D": {"dimension": 3},
    "hybrid": {"run.adapt": "hybrid"},
    "hybrid in 3D": {"dimension": 3, "run.adapt": "hybrid"},
    "split": {"run.adapt": "split"},
    "collocation": {"run.adapt": "collocation", "run.collocation.damped": True},
    "crack particles": GROWN,
    "crack particles by strength": GROWN | {"run.particles.criterion": "stress", "run.particles.strength": 1e8},
    "areas of eq. 19": {"area_rule": "eq19"},
    "square areas": {"area_rule": "square"},
    "several materials": {"regions": True},
    "fields of the material by node": {"fields": ("E",)},
    "interfaces": {"interfaces": True},
    "strengths of coarse bonds": {"material.coarse": "matched"},
    "isotropic calibration": {"material.calibration": "isotropic"},
}
CONDITIONS: dict[str, Changes] = {
    "contact": TOUCHING,
    "friction": TOUCHING | {"contact.friction": 0.5},
    "a restitution below 1": TOUCHING | {"contact.restitution": 0.5},
    "rigid bodies": TOUCHING | {"rigid": True},
    "damping": {"run.damping": 1e3},
    "damping by stiffness": {"run.damping_time": 1e-8},
    "absorbing layers": {"conditions": (lambda at: Absorb(box=at.right),)},
    "corrected grips": {"conditions": (lambda at: Displacement(box=at.high, x=0.0, corrected=True),)},
    "springs": {"conditions": (lambda at: Spring(box=at.right, body_stiffness=(1e12,) * at.dimension),)},
    "following pressure": {"conditions": (lambda at: _following_pressure(at.dimension),)},
    "pins": {"conditions": (lambda at: Pin(box=at.middle, centre=(27 * H, 6.5 * H)),)},
    "accelerations": {"conditions": (lambda at: Acceleration(box=at.upper, x=1e3),)},
    "velocities": {"conditions": (lambda at: Velocity(box=at.middle, x=1e-3),)},
    "initial velocities": {"conditions": (lambda at: InitialVelocity(box=at.everywhere, x=1e-3),)},
    "initial spin": {"conditions": (lambda at: InitialVelocity(box=at.everywhere, spin=_spin(at)),)},
    "initial displacements": {"conditions": (lambda at: InitialDisplacement(box=at.middle, x=1e-9),)},
    "an early end": {"run.until": "split"},
    "initial contents": {"conditions": (lambda at: InitialConcentration(box=at.middle, value=0.1),)},
    "profiles of loads": {"profile": RISING},
    "data over time": {"conditions": (lambda at: _load_over_time(at),)},
    "probes": {"probe": True},
}
EXECUTION: dict[str, Changes] = {
    "thesis mode": {"mode": "thesis"},
    "single precision": {"precision": "float32"},
    "OpenCL": {"run.device": "opencl"},
    "MPI ranks": {"ranks": True},
    "kernels of blocks": {"kernel": "blocks"},
    "repeated runs with shorter steps": {"disturbances": ("step",)},
    "repeated runs with shifted cracks": {"disturbances": ("notch",)},
    "repeated runs with shifted nodes": {"disturbances": ("noise",)},
}
MATERIALS: dict[str, Changes] = {
    "brittle bonds": {"material.model": "bond", "material.law": "brittle"},
    "bilinear bonds": {"material.model": "bond"} | SOFT,
    "cohesive bonds": {"material.model": "bond", "material.law": "cohesive", "material.f_t": 1e7},
    "bonds of your own law": {"material.model": "bond", "material.law": "own"},
    "bonds with diffraction": {"material.model": "bond", "material.sight": "diffraction"},
    "ordinary": ORDINARY,
    "ordinary with failure by energy": ORDINARY | {"material.failure": "energy"},
    "correspondence": SOLID,
    "correspondence with svk": SOLID | {"material.solid": "svk"},
    "correspondence with neo hooke": SOLID | {"material.solid": "neo hooke"},
    "correspondence with an orthotropic solid": SOLID
    | {"material.solid": "orthotropic", "material.failure": "none"}
    | {"material.E2": 4e10, "material.G12": 2e10, "material.E3": 4e10, "material.G13": 2e10, "material.G23": 1.5e10}
    | {"material.nu13": 0.22, "material.nu23": 0.3},
    "correspondence with j2": SOLID | {"material.solid": "j2", "material.yield_stress": 1e8},
    "correspondence in rate form": SOLID | {"material.form": "rate"},
    "correspondence of order 2": SOLID | {"material.order": 2},
    "correspondence with control wan": SOLID | {"material.control": "wan"},
    "correspondence with control breitzman-dayal": SOLID | {"material.control": "breitzman-dayal"},
    "micropolar": {"material.model": "micropolar", "material.nu": 0.22},
    "micropolar with cohesive bonds": {
        "material.model": "micropolar",
        "material.nu": 0.22,
        "material.law": "cohesive",
        "material.f_t": 1e7,
    },
}
GROUPS = {
    "Analysis": ANALYSES,
    "Physics": PHYSICS,
    "Discretization": DISCRETIZATION,
    "Conditions": CONDITIONS,
    "Materials": MATERIALS,
    "Execution": EXECUTION,
}
SAMPLES: dict[str, Changes] = {name: changes for group in GROUPS.values() for name, changes in group.items()}
OF_MOTION = ("material.", "contact", "regions", "fields", "interfaces", "profile", "run.static")
OPTIONS = ("mode", "precision", "ranks", "kernel", "disturbances", "fields")


class Sample(NamedTuple):
    """The model of some features, before it is built."""

    grid: Grid
    case: Case


def together(first: str, second: str) -> Changes | None:
    """The changes of two features; None where both are values of one setting, or only one is of a motion."""
    one, two = SAMPLES[first], SAMPLES[second]
    if any(one[key] != two[key] for key in one.keys() & two.keys() if key != "conditions"):
        return None
    changes = one | two | {"conditions": (*one.get("conditions", ()), *two.get("conditions", ()))}
    still = physics_of(changes) == "diffusion" and any(key.startswith(OF_MOTION) for key in changes)
    return None if still else changes


def physics_of(changes: Changes) -> str:
    """The physics of a model with these changes: that of their medium if they say none."""
    usual = "diffusion" if "medium.C_solid" in changes else "thermoelastic"
    return str(changes.get("physics", usual if any(name.startswith("medium.") for name in changes) else "mechanics"))


def pairs() -> Iterator[tuple[str, str]]:
    """Every two features that a model could be asked for together."""
    return (pair for pair in combinations(SAMPLES, 2) if together(*pair) is not None)


def sample(changes: Changes) -> Sample:
    """The model with these changes."""
    grid = lattice(*COUNTS[changes.get("dimension", 2)])
    grid, case = _with_striker(grid) if changes.get("rigid") else grid, case_of(changes)
    columns = tuple(FieldColumn(name, np.linspace(BOND.E, BOND.E / 2, len(grid))) for name in case.fields)
    return Sample(replace(grid, fields=columns), case)


def case_of(changes: Changes) -> Case:
    """The settings and the options of the model with these changes."""
    dimension = changes.get("dimension", 2)
    physics = physics_of(changes)
    medium = {"mechanics": None, "diffusion": Medium(D=1.0), "thermoelastic": HEAT}[physics]
    usual = {"physics": physics, "medium": medium, "material": BOND, "horizon": Horizon(3.0)}
    at, settings = places_of(dimension), Settings(**usual, run=Run(steps=4, every=2))
    for name, value in changes.items():
        if "." in name or name in ("contact", "area_rule"):
            settings = _changed(settings, name.split("."), value)
    if changes.get("gap"):
        settings = _changed(settings, ["run", "gaps"], (Gap("gap", at.mouth),))
    if changes.get("probe"):
        settings = _changed(settings, ["run", "probes"], at.mouth[:1])
    if settings.physics == "thermoelastic":
        settings = _changed(_changed(settings, ["material", "alpha"], 1e-6), ["material", "T0"], 300.0)
    if changes.get("regions"):
        assert settings.material is not None
        softer = msgspec.structs.replace(settings.material, E=settings.material.E / 2)
        settings = msgspec.structs.replace(settings, regions=(Region(box=at.left, material=softer),))
    if changes.get("interfaces"):
        settings = msgspec.structs.replace(settings, interfaces=(_weak_middle(dimension),))
    if settings.physics == "diffusion":
        settings = msgspec.structs.replace(settings, material=None)
    conditions = (*_usual_conditions(settings, at, changes), *(make(at) for make in changes.get("conditions", ())))
    if changes.get("rigid"):
        first = prod(COUNTS[dimension]) + 1
        striker = tuple(range(first, first + STRIKER[dimension]))
        conditions = (*conditions, RigidBody(nodes=striker, mass=1.0, x=-1e-3))
    settings = msgspec.structs.replace(settings, run=_steps(settings), conditions=conditions)
    options = {name: changes[name] for name in OPTIONS if name in changes}
    return Case(settings, dimension, **options)


def refused(changes: Changes) -> str:
    """The sentence with which the model of these changes is refused; "" if it is not."""
    wrong = next(impossible(case_of(changes)), None)
    return "" if wrong is None else str(wrong)


def _changed(part: Any, names: list[str], value: Any) -> Any:
    """Settings with a value at a dotted name."""
    name, *rest = names
    return msgspec.structs.replace(part, **{name: _changed(getattr(part, name), rest, value) if rest else value})


def places_of(dimension: int) -> Places:
    """Boxes of the nodes of a plate (2) or a body (3)."""
    (nx, ny), z = COUNTS[dimension][:2], 5 * H

    def box(x0: float, y0: float, x1: float, y1: float) -> tuple[float, ...]:
        corners = (x0 * H, y0 * H, -1.0, x1 * H, y1 * H, 1.0)
        return corners if dimension == 3 else (*corners[:2], *corners[3:5])

    return Places(
        dimension,
        everywhere=box(0, 0, nx, ny),
        left=box(0, 0, nx / 2, ny),
        right=box(nx - 1, 0, nx, ny),
        middle=box(0.75 * nx - 2, ny / 4 - 2, 0.75 * nx + 2, ny / 4 + 2),
        upper=box(0.75 * nx - 2, 0.75 * ny - 2, 0.75 * nx + 2, 0.75 * ny + 2),
        low=box(0, 0, nx, 1),
        high=box(0, ny - 1, nx, ny),
        mouth=((0.0, H * ny / 3, z)[:dimension], (0.0, H * ny * 2 / 3, z)[:dimension]),
    )


def _spin(at: Places) -> float | tuple[float, float, float]:
    return 1.0 if at.dimension == 2 else (0.0, 0.0, 1.0)


def _following_pressure(dimension: int) -> Load:
    """A pressure on a piece of the left side."""
    vectors = ((-H,) + (0.0,) * (dimension - 1),) * 2
    face = (0.0, 2 * H, 0.0, 0.0) if dimension == 2 else (0.0, 0.0, 0.0, 0.0, 0.0, 2 * H, 0.0, 2 * H, 0.0)
    first = COUNTS[dimension][0] + 1
    return Load(nodes=(first, 2 * first - 1), pressure=1e3, area_vectors=vectors, following=True, faces=(face,))


def _load_over_time(at: Places) -> Load:
    """A body force that grows in time, twice as much at the end of some nodes as at their beginning."""
    rising = Table(((at.middle[0],), (at.middle[at.dimension],)), (0.0, 0.0, 1e3, 2e3), "x", (0.0, 1.0))
    return Load(box=at.middle, body_force=(rising,) + (0.0,) * (at.dimension - 1))


def _weak_middle(dimension: int) -> Interface:
    """An oblique line, or triangle, of half the fracture energy."""
    segment = (10 * H, -H, 14 * H, 30 * H)
    triangle = (-9 * H, -9 * H, 3 * H, 40 * H, -9 * H, 6 * H, -9 * H, 40 * H, 6 * H)
    return Interface(faces=(segment if dimension == 2 else triangle,), G0=BOND.G0 / 2)


def _usual_conditions(settings: Settings, at: Places, changes: Changes) -> Iterator[AnyCondition]:
    """The lowest row held and the highest moved; contents on the left and on the right."""
    if settings.physics != "diffusion":
        profile, zero = changes.get("profile", ()), dict.fromkeys("xyz"[: at.dimension], 0.0)
        yield Displacement(box=at.low, **zero)
        yield Displacement(box=at.high, y=1e-7, profile=profile)
    if settings.physics != "mechanics":
        yield Concentration(box=at.right, value=0.1 if settings.physics == "diffusion" else 290.0)
    if settings.medium is not None and settings.medium.C_solid is not None:
        yield Solid(box=at.left)


def _steps(settings: Settings) -> Run:
    """A few steps, of the kind that the run has."""
    run = settings.run
    if settings.physics == "thermoelastic" and run.solver == "static":
        return msgspec.structs.replace(run, time_step=1e-7, steps=2)
    if run.solver == "implicit":
        return msgspec.structs.replace(run, time_step=1e-8)
    if run.static.control is not None or run.after != "path":
        return msgspec.structs.replace(run, static=msgspec.structs.replace(run.static, load_steps=2))
    return run


STRIKER = {2: 9, 3: 27}  # nodes


def _with_striker(grid: Grid) -> Grid:
    """The grid with a body beside it, on the right."""
    axes = [np.arange(3)] * grid.dimension
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, grid.dimension)
    start = grid.position.max(axis=0) * np.where(np.arange(grid.dimension) == 0, 1.0, 0.5)
    place = start + H * (cells + 1.5 * (np.arange(grid.dimension) == 0))
    return grid_of_nodes(
        np.vstack([grid.position, place]),
        H,
        grid.cracks,
        outline=grid.outline,
        areas=np.full(len(grid) + len(cells), H**grid.dimension),
        bodies=Bodies(np.repeat([0, 1], [len(grid), len(cells)]), ("plate", "striker")),
    )
