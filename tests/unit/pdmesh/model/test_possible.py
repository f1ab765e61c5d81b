"""Settings that no solver can do are refused by whoever meets them first: build, info, a dry run, a run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from messages import mentions, naming
from plates import GEOMETRIES, plate, square_grid

from pdmesh.__main__ import main as mesh_command
from pdmesh.model.contradictions import Case
from pdmesh.model.document import (
    Absorb,
    Collocation,
    Fatigue,
    Gap,
    Horizon,
    Load,
    Material,
    ParticleRules,
    Region,
    RigidBody,
    Run,
    Settings,
    Static,
    write_file,
)
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.medium import Medium, Solid
from pdmesh.model.node_grid import document_of
from pdmesh.model.possible import impossible
from pdmesh.reports.report import info, info_lines
from pdsolve.__main__ import main as solve_command

GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)
SOLID = msgspec.structs.replace(GLASS, model="correspondence", nu=0.2, failure="none")
GAP = Gap("gap", ((0.01, 0.0), (0.03, 0.0)))
BOX = (0.0, 0.0, 1e-3, 1e-3)
OWN = msgspec.structs.replace(GLASS, law="own")
CONSTANT = msgspec.structs.replace(GLASS, micromodulus="constant")
COLLOCATED = Run(adapt="collocation", collocation=Collocation(damped=True))


def of(material: Material, run: Run, **more: Any) -> Settings:
    return Settings(material=material, run=run, **more)


def heated(material: Material, run: Run) -> Settings:
    swells = msgspec.structs.replace(material, alpha=1e-5, T0=300.0)
    return of(swells, run, physics="thermoelastic", medium=Medium(D=1.0))


def of_medium(run: Run) -> Settings:
    return Settings(physics="diffusion", medium=Medium(D=1.0), run=run)


def changed(**more: Any) -> Material:
    return msgspec.structs.replace(SOLID, **more)


@pytest.mark.parametrize(
    ("settings", "dimension", "said"),
    [
        (
            of(SOFT, Run(solver="static", after="motion")),
            2,
            naming("$.run.duration", found="missing", expected="seconds"),
        ),
        (
            of(SOFT, Run(solver="static", after="motion", duration=1e-3), contact=Contact()),
            2,
            naming("$.contact", expected="leave it out"),
        ),
        (
            of(SOFT, Run(solver="static", static=Static(method="relaxation"))),
            2,
            naming("$.run.static.method", found="relaxation", expected="newton"),
        ),
        (
            of(SOFT, Run(solver="static", static=Static(floating=True))),
            2,
            naming("$.run.static.floating", found="true", expected="false"),
        ),
        (
            of(changed(failure="stress", strength=1e6, form="rate"), Run(solver="static")),
            2,
            naming("$.material.failure", found="'stress'"),
        ),
        (of(changed(solid="j2", yield_stress=1e8), Run(start="static")), 2, re.escape("$.material.solid is 'j2'")),
        (
            of(changed(solid="j2", yield_stress=1e8, order=2), Run()),
            2,
            naming("$.material.control", found="'silling'", expected=("'none'", "flows")),
        ),
        (
            of(msgspec.structs.replace(GLASS, coarse="matched"), Run(adapt="hybrid")),
            2,
            naming("$.material.coarse", found="matched", expected=("own", "run.adapt is hybrid")),
        ),
        (of(GLASS, Run(solver="static", damping=1.0)), 2, naming("$.run.damping", found="1", expected="leave it out")),
        (
            of(GLASS, Run(solver="static", start="static")),
            2,
            naming("$.run.start", found="static", expected="leave it out"),
        ),
        (
            of(GLASS, Run(solver="static", static=Static(method="relaxation", floating=True))),
            2,
            re.escape("static.floating"),
        ),
        (of(GLASS, Run(solver="static"), conditions=(Absorb(box=BOX),)), 2, re.escape("$.conditions[0] is absorb")),
        (
            of(SOLID, Run(adapt="hybrid")),
            2,
            naming("$.material.model", found="correspondence", expected="bond"),
        ),
        (
            of(
                GLASS, Run(solver="static", cracks="particles", gaps=(GAP,), static=Static(control="gap", opening=1e-4))
            ),
            2,
            naming("$.run.static.control", found="'gap'", expected="no bond softens"),
        ),
        (
            of(GLASS, Run(solver="static", gaps=(GAP,), static=Static(control="gap", opening=1e-4))),
            2,
            naming("$.run.static.control", found="'gap'", expected="no bond softens"),
        ),
        (
            of(SOFT, Run(solver="static", adapt="hybrid")),
            2,
            naming("$.run.solver", found="static", expected=("explicit", "run.adapt is hybrid")),
        ),
        (of_medium(Run(solver="static")), 2, naming("$.run.solver", found="static", expected="implicit")),
        (of_medium(Run(damping=1.0)), 3, naming("$.run.damping", found="1", expected="diffusion")),
        (of(SOFT, COLLOCATED), 2, naming("$.material.law", found="bilinear", expected="run.adapt")),
        (of(OWN, COLLOCATED), 2, naming("law", found="own", expected=("brittle", "run.adapt"))),
        (
            of(GLASS, Run(adapt="split")),
            3,
            naming("$.run.adapt", found="'split'", expected=("none", "hybrid", "space")),
        ),
        (
            heated(GLASS, Run(adapt="split")),
            2,
            naming("$.run.adapt", found="'split'", expected=("none", "hybrid", "thermoelastic")),
        ),
        (
            of(changed(solid="neo hooke"), Run(cracks="particles")),
            2,
            naming("$.material.solid", found=("neo", "hooke")),
        ),
        (
            of(GLASS, Run(cracks="particles", particles=ParticleRules(criterion="stress"))),
            2,
            re.escape("strength is missing"),
        ),
        (
            of(changed(model="micropolar", failure="stretch"), Run()),
            3,
            naming("$.material.model", found="'micropolar'"),
        ),
        (of(changed(nu=0.5), Run()), 2, re.escape("$.material.nu is 0.5")),
        (heated(GLASS, Run(solver="static")), 2, naming("$.run.time_step", found="missing", expected="one")),
        (
            of(GLASS, Run(solver="static", fatigue=Fatigue(A=1.0))),
            2,
            naming("run.fatigue.m", found="missing", expected=("a number", "A")),
        ),
        (
            of(GLASS, Run(solver="static", fatigue=Fatigue())),
            2,
            naming("run.fatigue.A", found="missing", expected="A1"),
        ),
        (
            of(GLASS, Run(solver="static", after="motion", duration=1e-3)),
            2,
            naming("$.run.after", found="motion", expected=("path", "softens")),
        ),
        (
            of(changed(form="rate"), Run(solver="static", cracks="particles", static=Static(control="crack"))),
            2,
            naming("$.material.form", found="rate", expected=("total", "length of cracks")),
        ),
        (
            heated(SOFT, Run(solver="static", time_step=1.0)),
            2,
            naming("$.material.law", found="bilinear", expected="brittle"),
        ),
        (
            of(GLASS, Run(adapt="hybrid"), horizon=Horizon(6.5)),
            2,
            naming("$.horizon.ratio", found="6.5", expected=("1 to 6", "run.adapt is hybrid")),
        ),
        (
            of(CONSTANT, Run(adapt="hybrid"), horizon=Horizon(6.0)),
            2,
            naming("$.horizon.ratio", found="6", expected="5.5"),
        ),
        (of(GLASS, COLLOCATED, horizon=Horizon(2.5)), 2, naming("$.horizon.ratio", found="2.5", expected="3 to 32")),
        (
            of(GLASS, Run(), regions=(Region(nodes=(1,), material=SOLID),)),
            2,
            naming("$.regions[0].material.model", found="correspondence", expected=("brittle", "$.material")),
        ),
        (
            of(GLASS, Run(), regions=(Region(nodes=(1,), material=msgspec.structs.replace(GLASS, plane="strain")),)),
            2,
            naming("$.regions[0].material.plane", found="'strain'", expected="'stress'"),
        ),
        (
            of(GLASS, Run(), conditions=(RigidBody(nodes=(1,), mass=1.0),)),
            2,
            naming("$.contact", found="missing", expected="rigid"),
        ),
        (
            of(GLASS, Run(solver="static"), contact=Contact(restitution=0.5)),
            2,
            naming("$.contact.restitution", found="0.5", expected=("1", "static")),
        ),
        (of(GLASS, Run(), conditions=(Solid(box=BOX),)), 2, naming("$.conditions[0]", found="solid", expected="load")),
        (of(GLASS, Run(), medium=Medium(D=2.0)), 2, naming("$.medium", expected=("diffusion", "leave it out"))),
    ],
)
def test_what_cannot_be_is_found(settings: Settings, dimension: int, said: str) -> None:
    assert re.search(said, str(next(impossible(Case(settings, dimension)))))


@pytest.mark.parametrize(
    "settings",
    [
        of(SOFT, Run()),
        of(SOFT, Run(start="static")),  # no bond breaks on the way
        of(SOFT, Run(solver="static", cracks="particles")),  # by itself
        of(msgspec.structs.replace(SOFT, kr=1.0), Run(solver="static")),  # which is brittle
        of(SOFT, Run(adapt="hybrid")),
        of(SOLID, Run(solver="static")),
        of(SOFT, Run(solver="static")),
        of(changed(solid="j2", yield_stress=1e8), Run(solver="static")),
        of(GLASS, Run(adapt="split", damping=1.0)),
        heated(SOFT, Run()),
        heated(GLASS, Run(solver="static", time_step=1.0)),
    ],
)
def test_what_can_be_is_not(settings: Settings) -> None:
    assert not list(impossible(Case(settings, 2)))


def test_info_lists_what_a_model_excludes() -> None:
    """And nothing that it goes with."""
    grid = square_grid(9, 9)
    for run, excluded, possible in (
        (Run(solver="static"), {"damping", "OpenCL", "adaptivity", "micropolar beams"}, {"3D", "contact", "fatigue"}),
        (Run(), set(), {"damping", "OpenCL", "adaptivity", "contact", "fatigue", "3D"}),
    ):
        document = document_of(grid, of(GLASS, run, conditions=(Load(box=BOX, force=(0.0, 1.0)),)))
        found = info(document, "plate")
        assert excluded <= set(found["excluded"])
        assert not possible & set(found["excluded"])
        assert any("cannot be combined with: " + ", ".join(found["excluded"]) in line for line in info_lines(found))


@pytest.mark.slow
def test_every_command_refuses_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Damping at rest, before a file is written or a bond is filled."""
    run = Run(solver="static", damping=1.0)
    model, path, out = plate(square_grid(9, 9), material=GLASS, run=run), tmp_path / "a.json", tmp_path
    write_file(document_of(model.grid, model.settings), path)
    static = ["--set", "Run/Solver=static", "--set", "Run/Damping=1"]
    drawing = str(GEOMETRIES / "duran50.geo")
    for command, words in (
        (mesh_command, ["build", drawing, *static, "-o", str(out / "b.json")]),
        (mesh_command, ["plan", drawing, *static]),
        (mesh_command, ["info", str(path)]),
        (solve_command, [str(path), "--dry-run"]),
        (solve_command, [str(path), "-o", str(out / "a.sqlite")]),
    ):
        assert command(words) == 2
        said = capsys.readouterr().err
        assert mentions(said, "$.run.damping", found="1", expected="leave it out")
        assert said.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize(
    ("run", "law", "expected"),
    [
        (Run(solver="static"), {}, "or law 'cohesive', as the solver is static"),
        (Run(solver="static", cracks="particles"), {"law": "cohesive", "f_t": 3e6}, "static and cracks are particles"),
        (Run(start="static"), {}, "as run.start is static"),
    ],
)
def test_nodes_that_rotate_are_refused_at_rest_for_their_rotations(
    run: Run, law: dict[str, Any], expected: str
) -> None:
    """The message said "expected one without rotations at rest", which named no model and no cause."""
    beams = msgspec.structs.replace(GLASS, model="micropolar", nu=0.2, **law)
    said = [str(wrong) for wrong in impossible(Case(of(beams, run), 2)) if wrong.place == "$.material.model"]
    assert any(expected in each and "rotations that 'micropolar' needs" in each for each in said)
