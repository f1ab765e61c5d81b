"""A path followed by a monitored opening."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Gap, LoadCell, Material, Run, Static, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.__main__ import main as pdsolve
from pdsolve.estimate import estimate_run
from pdsolve.measures.forces import (
    ForceOpeningCurve,
    force_over_gap_opening,
    read_condition_force_histories,
    read_named_gap,
    select_condition_force_histories,
)
from pdsolve.model import Model, ModelWarning
from pdsolve.rest.controls import OpeningControl
from pdsolve.rest.equilibrium import NotConvergedError
from pdsolve.results import Results
from pdsolve.run.simulation import Options, resume, simulate

RAMP = ((0.0, 0.0), (1.0, 1.0))
ONE = Options(threads=1)
CONCRETE = Material(E=30e9, rho=2400, G0=124, law="cohesive", f_t=3.33e6, shape="linear", micromodulus="constant")


def beam(static: Static) -> Model:
    """0.4 x 0.1 m, notched to 0.04 m, in three-point bending; 320 nodes."""
    h = 0.01125
    grid = square_grid(36, 9, h, x0=h / 2 - 18 * h, y0=h / 2)
    grid = dataclasses.replace(grid, cracks=np.array([[0, -0.01, 0, 4 * h]]))
    ends = (Gap("mouth", ((-h / 2, h / 2), (h / 2, h / 2))), Gap("top", ((-h / 2, 8.5 * h), (h / 2, 8.5 * h))))
    conditions = (
        Displacement(name="left", nodes=(1,), x=0.0, y=0.0),
        Displacement(name="right", nodes=(36,), y=0.0),
        Displacement(name="middle", nodes=(8 * 36 + 18,), y=-1e-3, profile=RAMP, breakable=True),
    )
    run = Run(solver="static", static=static, gaps=ends, load_cells=(LoadCell("supports", ("left", "right")),))
    return plate(grid, 3, material=CONCRETE, conditions=conditions, run=run)


def curve(results: Results, name: str) -> ForceOpeningCurve:
    return force_over_gap_opening(
        read_named_gap(results, "mouth"),
        select_condition_force_histories(read_condition_force_histories(results), [name])[0],
        1,
    )


@pytest.mark.slow
def test_the_path_is_that_by_dissipation() -> None:
    with simulate(beam(Static(load_steps=160)), None, Options(threads=1)) as results:
        energy = curve(results, "middle")
    static = Static(control="mouth", opening=4e-4, load_steps=160)
    with simulate(beam(static), None, Options(threads=1)) as results:
        opened, cell = curve(results, "middle"), curve(results, "supports")
        assert results.meta()["status"] == "finished"
        assert results.summary()["ended"] == "the opening is reached"
    assert opened.opening[-1] == pytest.approx(4e-4, rel=1e-3)
    assert np.abs(opened.force).max() == pytest.approx(np.abs(energy.force).max(), rel=0.005)
    assert cell.force == pytest.approx(-opened.force, rel=1e-4, abs=1e-4 * np.abs(opened.force).max())
    order = np.argsort(energy.opening)
    there = np.interp(opened.opening, energy.opening[order], energy.force[order])
    assert np.abs(there - opened.force).max() < 0.03 * np.abs(energy.force).max()
    steps = np.diff(opened.opening)
    assert steps.min() > 0
    work = cell.work_under_curve
    assert work == pytest.approx(-opened.work_under_curve, rel=1e-4)


@pytest.mark.slow
def test_a_path_by_an_opening_goes_on_to_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    whole, stopped = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    model = beam(Static(control="mouth", opening=2e-4, load_steps=16))
    simulate(model, whole, Options(threads=1)).close()
    with simulate(model, stopped, Options(threads=1), watch=lambda progress: progress.step == 6) as results:
        assert results.meta()["status"] == "interrupted"
        assert len(results.checkpoint()[1]["worst"]) > 0
    resume(stopped, 1).close()
    assert contents(stopped) == contents(whole)


def test_an_opening_that_closes_ends_with_its_own_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, path = beam(Static(control="top", opening=1e-4)), tmp_path / "beam.json"
    write_file(document_of(model.grid, model.settings), path)
    assert pdsolve([str(path), "-o", str(tmp_path / "beam.sqlite"), "-q"]) == 3
    said = capsys.readouterr().err
    assert re.search(naming("path step 1", found="'top'", expected="grows"), said)
    assert said.count("\n") == 1


def test_an_opening_that_closes_is_refused_and_the_start_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "beam.sqlite"
    with pytest.raises(NotConvergedError, match=naming("path step 1", found="'top'", expected="grows")):
        simulate(beam(Static(control="top", opening=1e-4)), path, Options(threads=1))
    with Results.open(path) as results:
        assert results.meta()["status"] == "unsettled"


def test_a_path_by_an_opening_is_planned_with_its_steps() -> None:
    """A body with rotations takes longer, by the bonds' entries and those of factors at least."""
    model = beam(Static(control="mouth", opening=1e-4, load_steps=16))
    plan = estimate_run(model, ONE)
    assert (plan.steps_are_path_steps, plan.steps) == (True, 16)
    turning = msgspec.structs.replace(model.settings.material, model="micropolar", nu=0.18)
    turns = estimate_run(Model(model.grid, msgspec.structs.replace(model.settings, material=turning)), ONE)
    assert turns.wall_time > 1.2 * plan.wall_time


def test_a_brittle_plate_has_no_control() -> None:
    model = beam(Static(control="mouth", opening=1e-4))
    brittle = Material(E=30e9, rho=2400, G0=124)
    with pytest.raises(ValueError, match=naming(r"$.run.static.control", found="'mouth'")):
        simulate(Model(model.grid, msgspec.structs.replace(model.settings, material=brittle)), None, Options(threads=1))


@pytest.mark.slow
def test_a_crack_that_arrives_at_what_does_not_break_is_told() -> None:
    """One line, with the name of the load."""
    model = beam(Static(control="mouth", opening=4e-4, load_steps=20))
    ends = tuple(msgspec.structs.replace(one, breakable=False) for one in model.settings.conditions)  # type: ignore[call-arg]
    held = Model(model.grid, msgspec.structs.replace(model.settings, conditions=ends))
    with pytest.warns(ModelWarning) as told:
        simulate(held, None, Options(threads=1)).close()
    lines = [str(one.message) for one in told if "conditions[" in str(one.message)]
    assert len(lines) == 1
    expected = ("breakable=True", "Moves/middle/Breakable=1")
    assert re.search(naming("$.conditions[2]", found="'middle'", expected=expected), lines[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        simulate(model, None, Options(threads=1)).close()


def test_the_gradient_of_an_opening_is_that_of_its_measure() -> None:
    """By central differences, in a state of large displacements and with an unknown rotation beside them."""
    random = np.random.default_rng(2)
    position, value, way = random.standard_normal((5, 2)), *random.standard_normal((2, 5, 3))
    gap = OpeningControl("a", position, (1, 3))
    low, high = (gap.control_value(value + side * 1e-6 * way, 0.0) for side in (-1, 1))
    rate = float((gap.gradient_by_displacement(value, None) * way).sum())  # type: ignore[arg-type]
    assert rate == pytest.approx((high - low) / 2e-6, rel=1e-6)
    assert gap.control_value(np.zeros((5, 3)), 0.0) == 0
