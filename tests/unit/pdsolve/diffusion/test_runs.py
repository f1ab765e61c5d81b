"""Runs of diffusion: stopped and killed ones, what is refused, what is supplied."""

from __future__ import annotations

import dataclasses
import random
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents, kill_when
from diffusion_models import CORRODING, disc, ids, lattice, model
from messages import naming

from pdmesh.model.document import Concentration, InitialConcentration, Load, Material, Run, Solid, Source
from pdmesh.model.medium import Medium
from pdsolve.diffusion.system import prepare
from pdsolve.model import Model, ModelError
from pdsolve.results import Results
from pdsolve.run.prepare import prepare as prepare_run
from pdsolve.run.simulation import Options, resume, simulate

KINETIC = msgspec.structs.replace(CORRODING, dissolution="kinetic", k_diss=0.5)
ONE = Options(threads=1)


@pytest.fixture(autouse=True)
def _look_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)


def small(medium: Medium = CORRODING, **run: object) -> Model:
    """A coarse disc with a source that follows time, 60 steps."""
    base = disc(0.2, 60, medium, end=0.6)
    ramp = Source(box=(1.0, 1.0, 2.0, 2.0), rate=0.05, profile=((0.0, 0.0), (0.3, 1.0)))
    settings = msgspec.structs.replace(
        base.settings,
        conditions=(*base.settings.conditions, ramp),
        run=msgspec.structs.replace(base.settings.run, every=10, ledger=5, **run),
    )
    return dataclasses.replace(base, settings=settings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("medium", "run"), [(CORRODING, {}), (KINETIC, {}), (CORRODING, {"solver": "implicit", "theta": 0.5})]
)
def test_stopped_anywhere_a_run_goes_on_to_the_same_bits(
    medium: Medium, run: dict[str, object], tmp_path: Path
) -> None:
    whole, path, dice = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", random.Random(4)
    simulate(small(medium, **run), whole, ONE).close()
    expected = contents(whole)
    assert len(expected["mass"]) == 13
    assert len(expected["frame"]) == 7
    for stops in ([33], [10], [15], [1, 2], sorted(dice.sample(range(1, 60), 5))):
        for number, stop in enumerate(stops):
            go = (resume, (path,)) if number else (simulate, (small(medium, **run), path, ONE))
            with go[0](*go[1], watch=lambda progress, stop=stop: progress.step == stop) as results:
                assert (results.meta()["status"], results.checkpoint()[0]) == ("interrupted", stop)
        resume(path, 1).close()
        found = contents(path)
        assert [table for table in expected if found[table] != expected[table]] == [], stops


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    base = disc(0.1, 2000, CORRODING)
    run = msgspec.structs.replace(base.settings.run, every=100)
    base = dataclasses.replace(base, settings=msgspec.structs.replace(base.settings, run=run))
    drawn, whole, path = (tmp_path / name for name in ("disc.json", "whole.sqlite", "killed.sqlite"))
    drawn.write_text(base.to_json())
    words = ["-m", "pdsolve", str(drawn), "-o", str(path), "--quiet", "--threads", "1"]
    kill_when(lambda results: len(results.frames()[0]) > 4, path, words)
    with Results.open(path) as results:
        assert results.meta()["status"] == "running"
    resume(path, 1).close()
    simulate(base, whole, ONE).close()
    assert contents(path) == contents(whole)


@pytest.mark.parametrize(("solver", "off"), [("explicit", 1e-12), ("implicit", 1e-12)])
def test_what_is_there_is_what_was_there_and_came(solver: str, off: float) -> None:
    """Solid, held, and supplied by a profile, of which the books know all: balance 1e-12 of what there was."""
    with simulate(small(solver=solver, theta=0.5 if solver == "implicit" else 1.0), None, ONE) as results:
        masses, summary = results.masses(), results.summary()
    assert abs(summary["balance"]) < off
    assert masses["supplied"][-1] > 0.01
    assert masses["through"][-1] > 0
    assert (np.diff(masses["solid"]) < 0).all()
    assert masses["dissolved"][-1] == pytest.approx(masses["solid"][0] - masses["solid"][-1], rel=1e-12)


def test_a_flux_comes_in_by_its_length() -> None:
    """0.3 mol/(m^2 s) through an edge of 12 m for 10 s is 36 mol, to 1e-12."""
    position = lattice(1.0, 6.0, 2)
    flux = Source(nodes=ids(position[:, 1] < -4), flux=0.3, length=12.0)
    run = Run(time_step=0.1, steps=100)
    system, state = prepare(model(position, 1.0, Medium(D=1.0), conditions=(flux,), run=run), 1)
    system.stepper.advance(state, 1, 101)
    assert (system.operator.volume * state.value[:, 0]).sum() == pytest.approx(36.0, rel=1e-12)


def changed(**more: object) -> Model:
    """The small disc with other settings."""
    base = small()
    return dataclasses.replace(base, settings=msgspec.structs.replace(base.settings, **more))


REFUSED = {
    "a step above the bound": (
        lambda: small(time_step=0.05),
        naming("run.time_step", found="0.05 s", expected=re.compile("0\\.0368\\d*")),
    ),
    "C_sat above C_solid": (
        lambda: small(Medium(D=1.0, C_solid=1.0, C_sat=2.0)),
        naming("medium.C_sat", found="2 mol/m^3", expected=("C_solid", "1 mol/m^3")),
    ),
    "C_solid alone": (lambda: small(Medium(D=1.0, C_solid=1.0)), naming("medium.C_sat", found="missing")),
    "a kinetic rule without a solid": (
        lambda: small(Medium(D=1.0, dissolution="kinetic")),
        naming("medium.C_solid", found="missing", expected=("dissolution", "kinetic")),
    ),
    "a solid of nothing": (
        lambda: small(Medium(D=1.0)),
        naming("conditions[0]", found="solid", expected="leave it out"),
    ),
    "held and solid": (
        lambda: changed(conditions=(Solid(box=(0, 0, 1, 1)), Concentration(box=(0, 0, 1, 1), value=0.0))),
        naming("conditions[0]", found=("node", "solid")),
    ),
    "more than liquid can hold": (
        lambda: changed(conditions=(InitialConcentration(box=(0, 0, 1, 1), value=0.3),)),
        naming("conditions[0].value", found="0.3 mol/m^3", expected=("C_sat", "0.2 mol/m^3")),
    ),
    "a load": (lambda: changed(conditions=(Load(box=(0, 0, 1, 1), body_force=(1, 0)),)), naming(found="load")),
    "a material": (lambda: changed(material=Material(E=1.0, rho=1.0, G0=1.0)), naming("$.material")),
    "no medium": (lambda: changed(medium=None), naming("$.medium", found="missing", expected="D")),
    "an end of cracks": (lambda: small(until="split"), naming("run.until", found="'split'", expected="diffusion")),
    "rest": (lambda: small(solver="static"), naming("run.solver", found="static", expected=("explicit", "implicit"))),
    "an implicit kinetic rule": (lambda: small(KINETIC, solver="implicit"), naming(expected=("explicit", "kinetic"))),
    "collocation on one lattice": (
        lambda: small(adapt="collocation"),
        naming("run.adapt", found="0.2 m", expected=("twice", "collocation")),
    ),
    "a zone that moves": (
        lambda: small(adapt="hybrid"),
        naming("run.adapt", found="hybrid", expected=("none", "collocation")),
    ),
    "a field of mechanics": (
        lambda: small(fields=("ux",)),
        naming("run.fields", found="'ux'", expected=("c", "solid")),
    ),
    "an implicit step of no length": (
        lambda: small(solver="implicit", time_step=None),
        naming("run.time_step", found="missing", expected=("solver", "implicit")),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_in_one_line(name: str) -> None:
    make, message = REFUSED[name]
    with pytest.raises(ModelError, match=message) as refused:
        prepare_run(make(), ONE)
    assert "\n" not in str(refused.value)


def test_other_modes_are_refused() -> None:
    with pytest.raises(ModelError, match=naming("mode", found="thesis", expected="conservative")):
        simulate(small(), None, Options(mode="thesis"))


def test_mechanics_does_not_take_what_is_of_diffusion(small_plate: Model) -> None:
    settings = msgspec.structs.replace(small_plate.settings, conditions=(Solid(box=(0, 0, 1, 1)),))
    with pytest.raises(ModelError, match=naming(found="solid", expected=("load", "displacement"))):
        prepare_run(dataclasses.replace(small_plate, settings=settings), ONE)
    settings = msgspec.structs.replace(small_plate.settings, medium=CORRODING)
    with pytest.raises(ModelError, match=naming("$.medium", found="mechanics", expected=("diffusion", "leave it out"))):
        prepare_run(dataclasses.replace(small_plate, settings=settings), ONE)


def test_fields_are_those_asked_for() -> None:
    with simulate(small(fields=("solid",)), None, ONE) as results:
        assert results.stored(60) == ["solid"]
        assert results.field("solid", 0).max() == 1
    with simulate(small(), None, ONE) as results:
        assert results.stored(60) == ["c", "h", "solid"]
        assert results.field("c", 60).max() == pytest.approx(0.2)
