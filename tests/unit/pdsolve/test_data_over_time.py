"""Data over place and time: what loads and prescribed motions do with it, in every kind of run that has them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from devices import missing
from messages import naming
from plates import plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh import Body, Box, Material, Run, Scene, Static, box, build, over_time
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.document import Displacement, GridError, Velocity
from pdmesh.model.load_resultants import resultants
from pdmesh.model.node_grid import document_of
from pdmesh.model.values_of_place import Table
from pdmesh.scene.shapes import SceneError
from pdsolve import simulate
from pdsolve.conditions import factor_now, factors_at
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare

STEEL = Material(E=200e9, rho=7850, G0=1e6)
DT, STEPS = 4e-8, 100
END = DT * STEPS
RISE = ((0.0, 0.0), (END / 4, 1.0), (END, -0.5))  # of a profile
TIMES = [time for time, _ in RISE]
ALL = (-1.0, -1.0, 1.0, 1.0)


def strip(**run: Any) -> Scene:
    return Scene(
        box(0, 0, 0.01, 0.006), 1e-3, STEEL, 3.0, Run(**(run or {"steps": STEPS, "time_step": DT, "every": 20}))
    )


def bar() -> Body:
    run = Run(steps=STEPS, time_step=DT, every=20)
    return Body(Box((0, 0, 0), (0.008, 0.004, 0.004)), 1e-3, STEEL, 3.0, run)


def factor(t: float) -> float:
    return float(np.interp(t, *np.array(RISE).T))


def loaded(scene: Any, by_data: bool) -> Any:
    """The scene pulled at its right and moved at its left: by values of place with a profile, or the same as data."""
    profile = {} if by_data else {"profile": RISE}
    rest = (0.0,) * (len(scene.AXES) - 1)

    def value(scale: float, y: float, t: float) -> float:
        return scale * (1 + y / 0.006) * (factor(t) if by_data else 1.0)

    def as_data(scale: float) -> Any:
        if not by_data:
            return lambda *at: value(scale, at[1], 0.0)
        return over_time(lambda *at: value(scale, at[1], at[-1]), TIMES)

    scene = scene.fix("left", as_data(1e-7), *rest, **profile, name="grip")
    return scene.load("right", traction=(as_data(1e6), *rest), **profile, name="pull")


def model_of(scene: Any) -> Model:
    built = build(scene)
    return Model(built.grid, built.settings)


def results_of(scene: Any, options: Options) -> Results:
    return simulate(model_of(scene), None, options)


STATIC = {"solver": "static", "static": Static(load_steps=4)}


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        (strip(), Options(kernel="listed")),
        (strip(), Options(kernel="blocks")),
        (strip(), Options("thesis", kernel="listed")),
        (strip(**STATIC), Options()),
        pytest.param(bar(), Options(kernel="blocks"), marks=pytest.mark.process),
    ],
    ids=["list", "lattice", "thesis", "load steps", "3D"],
)
def test_data_that_is_a_value_times_a_profile_acts_as_these(scene: Any, options: Options) -> None:
    with results_of(loaded(scene, True), options) as data, results_of(loaded(scene, False), options) as plain:
        last = int(plain.frames()[0][-1])
        for name in ("ux", "uy"):
            expected = plain.field(name, last)
            assert data.field(name, last) == pytest.approx(expected, abs=2e-7 * float(np.abs(expected).max()))
        forces = [np.array([[*row][3:5] for row in each.reactions()]) for each in (data, plain)]
        assert forces[0] == pytest.approx(forces[1], rel=1e-6, abs=1e-6 * float(np.abs(forces[1]).max()))


@pytest.mark.process
@pytest.mark.skipif(bool(missing()), reason=missing())
def test_a_device_moves_by_data_as_the_processor_does() -> None:
    scene = loaded(strip(), True)
    device = msgspec.structs.replace(scene.run, device="opencl")
    there = results_of(replace(scene, run=device), Options(kernel="blocks"))
    with results_of(scene, Options(kernel="blocks")) as here, there:
        expected = here.field("ux", STEPS)
        assert there.field("ux", STEPS) == pytest.approx(expected, abs=2e-7 * float(np.abs(expected).max()))


def test_factors_of_all_profiles_are_those_of_each() -> None:
    drive = prepare(model_of(loaded(strip(), True)), Options()).system.drive
    assert len(drive.profiles.start) > 10
    for time in (-1.0, *TIMES, *(sum(pair) / 3 for pair in pairwise(TIMES)), 2 * END):
        each = [factor_now(drive.profiles, number, time) for number in range(len(drive.profiles.start) - 1)]
        assert factors_at(drive.profiles, time).tolist() == each


def test_the_energy_of_moved_nodes_balances() -> None:
    """The work of each node's own motion is all that comes in, to second order in the step."""
    lost = []
    for parts in (1, 2):
        moved = strip(steps=STEPS * parts, time_step=DT / parts).fix(
            "left",
            x=over_time(lambda x, y, t: 1e-6 * (t / END) ** 2 * (1 + y / 0.006), np.linspace(0, END, 21).tolist()),
        )
        problem = prepare(model_of(moved), Options())
        problem.advance(1, STEPS * parts + 1)
        row = compute_energy_balance_row(*problem, STEPS * parts)
        assert row.strain > 0
        lost.append(abs(row.balance_error(problem.system.initial_energy)))
    assert lost[0] < 1e-3
    assert lost[0] > 3 * lost[1]


def test_a_prescribed_velocity_of_data_begins_with_that_of_time_0() -> None:
    rising = Table(((0.0,), (4e-3,)), (1.0, 2.0, 3.0, 6.0), "y", (0.0, 1e-6))
    model = plate(square_grid(5, 5), conditions=(Velocity(box=(-1, -1, 5e-4, 1), x=rising),), run=Run(time_step=1e-8))
    problem = prepare(model, Options())
    assert problem.state.rate[::5, 0].tolist() == [1.0, 1.25, 1.5, 1.75, 2.0]
    problem.advance(1, 51)
    assert problem.state.rate[::5, 0] == pytest.approx(np.array([2.0, 2.5, 3.0, 3.5, 4.0]), rel=1e-12)


@pytest.mark.process
def test_a_csv_file_moves_an_edge_of_a_drawing_and_of_a_scene(tmp_path: Path) -> None:
    rows = [f"{y},{t},{1e-3 * y * (1 + t)},{t}" for t in (0.0, 1.0) for y in (0.0, 0.006)]
    (tmp_path / "grip.csv").write_text("\n".join(["y, t, ux, f", *rows]))
    (tmp_path / "plate.geo").write_text(
        "Point(1)={0,0,0}; Point(2)={0.01,0,0}; Point(3)={0.01,0.006,0}; Point(4)={0,0.006,0};"
        "Line(1)={1,2}; Line(2)={2,3}; Line(3)={3,4}; Line(4)={4,1};"
        'Curve Loop(1)={1:4}; Plane Surface(1)={1}; Physical Surface("zone:all")={1};'
        'DefineConstant[ e = {200e9, Name "Peridynamics/Material/E"} rho = {7850, Name "Peridynamics/Material/rho"}'
        ' g = {1e6, Name "Peridynamics/Material/G0"} d = {1e-3, Name "Peridynamics/Zones/all/Spacing"}'
        ' w = {"static", Name "Peridynamics/Run/Solver"} edge = {"left", Name "Peridynamics/Fixes/grip/Edge"}'
        ' c = {"x", Name "Peridynamics/Fixes/grip/Components"}'
        ' x = {"grip.csv:ux", Name "Peridynamics/Fixes/grip/Displacement x"} ];\n'
    )
    (tmp_path / "scene.py").write_text(
        "from pdmesh import *\n"
        "scene = Scene(box(0, 0, 0.01, 0.006), 1e-3, Material(E=200e9, rho=7850, G0=1e6), 3.0, Run(solver='static'))"
        ".fix('left', x='grip.csv:ux', y=None, name='grip')\n"
    )
    for name in ("plate.geo", "scene.py"):
        (condition,) = build_file(tmp_path / name, trust=True).settings.conditions
        assert condition.x == Table(((0.0,), (0.006,)), (0.0, 6e-6, 0.0, 12e-6), "y", (0.0, 1.0))


def test_the_resultant_of_data_is_the_largest() -> None:
    scene = strip().load("right", traction=(over_time(lambda x, y, t: 1e6 * factor(t), TIMES), 0.0))
    built = build(scene)
    (resultant,) = resultants(document_of(built.grid, built.settings), built.grid)
    assert resultant.force == pytest.approx([6000.0, 0.0])


OVER = Table(((0.0,),), (0.0, 1.0), "x", (0.0, 1e-6))


@pytest.mark.parametrize(
    ("condition", "run", "message"),
    [
        (Displacement(box=ALL, x=OVER, profile=RISE), Run(), naming("$.conditions[0].x", found="times")),
        (Displacement(box=ALL, x=OVER), Run(duration=2e-6), naming("$.conditions[0]", found=("1e-06", "2e-06"))),
        (
            Displacement(box=ALL, x=Table(((0.0,),), (0.0, 1.0), "x", (1e-7, 1e-6))),
            Run(),
            naming("$.conditions[0].x", found="1e-07"),
        ),
        (
            Displacement(box=ALL, x=Table(((0.0,),), (0.0, 1.0, 2.0), "x", (0.0, 1e-6))),
            Run(),
            naming("$.conditions[0].x", found="3 values"),
        ),
    ],
    ids=["profile", "too short", "late", "values"],
)
def test_data_that_cannot_be_is_refused(condition: Displacement, run: Run, message: str) -> None:
    with pytest.raises((ModelError, GridError), match=message):
        plate(square_grid(3, 3), conditions=(condition,), run=run)


def test_a_run_that_goes_on_after_its_data_is_refused() -> None:
    with pytest.raises(ModelError, match=naming("$.conditions[0]", found="1e-06")):
        results_of(strip().fix("left", x=over_time(lambda x, y, t: 0.0, [0, 1e-6])), Options())


def test_times_of_a_function_that_do_not_increase_are_refused() -> None:
    with pytest.raises(SceneError, match=naming("displacement 'left': x", expected="times that increase")):
        build(strip().fix("left", x=over_time(lambda x, y, t: 0.0, [0, 0])))
