"""Conditions whose values depend on the place: in scenes, in files, in what a run begins with; and contradictions."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh import Material, Run, Scene, box, build, ramp
from pdmesh.model.document import (
    Displacement,
    GridError,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Velocity,
    read_file,
)
from pdmesh.model.values_of_place import Table
from pdmesh.scene.shapes import SceneError
from pdsolve.checks import warn_of_doubtful_conditions
from pdsolve.conditions import initial_velocity
from pdsolve.model import Model, ModelError, read_model
from pdsolve.run.initial_states import apply_initial_displacements
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options

STEEL = Material(E=200e9, rho=7850, G0=1e6)
ALL = (-1.0, -1.0, 1.0, 1.0)


def strip(**run: object) -> Scene:
    return Scene(box(0, 0, 0.01, 0.006), 1e-3, STEEL, 3.0, Run(**run))  # type: ignore[arg-type]


def model_of(scene: Scene) -> Model:
    built = build(scene)
    return Model(built.grid, built.settings)


def velocity(*conditions: InitialVelocity) -> list[float]:
    return initial_velocity(plate(square_grid(3, 3), conditions=conditions))[4].tolist()


def test_components_of_initial_velocities_combine() -> None:
    up, right = InitialVelocity(box=ALL, y=1.0), InitialVelocity(box=ALL, x=2.0)
    assert velocity(up, right) == [2.0, 1.0]
    assert velocity(InitialVelocity(box=ALL, x=0.0, y=1.0), InitialVelocity(box=ALL, x=2.0, y=0.0)) == [2.0, 1.0]
    assert velocity(up, right, InitialVelocity(box=ALL, x=3.0)) == [3.0, 1.0]  # of one component the later counts
    assert velocity(up, right, InitialVelocity(box=ALL, x=0.0, y=0.0)) == [0.0, 0.0]
    assert velocity(up, InitialVelocity(box=ALL, spin=1.0)) == [0.0, 0.0]  # the node in the centre of what turns


def test_components_of_a_scene_that_are_none_are_free() -> None:
    scene = (
        strip().move(strip().outline, initial_velocity=(None, 1.0)).move(strip().outline, initial_velocity=(2.0, None))
    )
    assert (initial_velocity(model_of(scene)) == [2.0, 1.0]).all()


def test_a_zero_that_leaves_an_earlier_component_is_named() -> None:
    first, second = InitialVelocity(box=ALL, x=0.0, y=1.0), InitialVelocity(box=ALL, x=2.0, y=0.0)
    with pytest.warns(UserWarning, match=naming("$.conditions[1].y", "$.conditions[0]", found="0")):
        warn_of_doubtful_conditions(plate(square_grid(3, 3), conditions=(first, second)), 1e-7)


@pytest.mark.parametrize("other", [Velocity(box=ALL, x=1.0), Velocity(box=ALL, x="y")], ids=["number", "expression"])
def test_a_component_is_prescribed_in_one_way(other: Velocity) -> None:
    with pytest.raises(
        ModelError, match=naming("$.conditions[1].x", "$.conditions[0]", found=("velocity", "displacement"))
    ):
        plate(square_grid(3, 3), conditions=(Displacement(box=ALL, x=0.0, y=0.0), other))
    plate(square_grid(3, 3), conditions=(Displacement(box=ALL, y=0.0), other))  # of other components


def test_a_scene_that_prescribes_a_component_twice_is_refused_when_built() -> None:
    scene = strip().fix("left", name="wall").move("left", velocity=(1.0, None), name="pull")
    with pytest.raises(SceneError, match=naming("velocity 'pull': x", found="displacement 'wall'")):
        build(scene)


def test_functions_expressions_and_tables_give_the_same_values() -> None:
    table = Table(((0.0,), (0.006,)), (0.0, 6e-6), "y")
    models = [
        model_of(strip().fix("left", x=x, y=None).load("right", traction=traction))
        for x, traction in (
            (lambda x, y: 1e-3 * y, lambda x, y: (1e6 * y, 0.0)),
            ("1e-3*y", ("1e6*y", 0.0)),
            (table, (lambda x, y: 1e6 * y, 0)),
        )
    ]
    drives = [prepare(model, Options()).system.drive for model in models]
    y = models[0].grid.position[drives[0].holds.node, 1]
    for drive in drives:
        assert drive.holds.value == pytest.approx(1e-3 * y, rel=1e-12)
        assert drive.loads.value == pytest.approx(drives[0].loads.value, rel=1e-12)
    area, rows = models[0].grid.cells, drives[0].loads.node
    assert drives[0].loads.value @ area[rows] == pytest.approx(1e6 * 0.003 * 0.006, rel=1e-12)  # the mean times length


def test_a_function_that_fails_names_the_place() -> None:
    with pytest.raises(SceneError, match=naming("load 'top': traction", found=("ZeroDivisionError", "0"))):
        build(strip().load("top", traction=(0, lambda x, y: 1 / x), name="top"))
    with pytest.raises(SceneError, match=naming("displacement 'left': x", expected="finite")):
        build(strip().fix("left", x=lambda x, y: float("nan")))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("1/x", naming("$.conditions[0].x", expected="finite")),
        ("z", naming("$.conditions[0].x", found="z")),
        ("lost.csv", naming("$.conditions[0].x", found="'lost.csv'")),
        (Table(((0.0, 0.0), (1.0,)), (0.0, 1.0)), naming("$.conditions[0].x", expected=("x", "y"))),
    ],
)
def test_values_that_cannot_be_are_refused(value: str | Table, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        plate(square_grid(3, 3), conditions=(Displacement(box=ALL, x=value),))


def test_files_of_values_are_read_beside_the_model(tmp_path: Path) -> None:
    built, path = build(strip().fix("left", x=1.0, name="grip")), tmp_path / "model.json"
    built.write(path)
    text = json.loads(path.read_text())
    text["conditions"][0]["x"] = "grip.csv"
    del text["digest"]
    path.write_text(json.dumps(text))
    with pytest.raises(GridError, match=naming(str(path), "$.conditions[0].x", "grip.csv")):
        read_file(path)
    (tmp_path / "grip.csv").write_text("y,ux\n0,0\n0.006,6e-6\n")
    model = read_model(path)
    drive = prepare(model, Options()).system.drive
    assert drive.holds.value[drive.holds.axis == 0] == pytest.approx(1e-3 * np.arange(7) * 1e-3)
    assert "grip.csv" not in model.to_json()  # which results and resumed runs carry


def test_initial_displacements_are_those_of_time_0() -> None:
    from pdsolve import simulate

    scene = strip(steps=1, time_step=1e-9).move(strip().outline, initial_displacement=("1e-6*x", None))
    with simulate(model_of(scene), None) as results:
        x = results.nodes(0).position[:, 0]
        assert results.field("ux", 0) == pytest.approx(1e-6 * x, rel=1e-6)
        assert not results.field("uy", 0).any()
        history = results.history()
        # no lateral strain: E / (1 - nu^2) eps^2 / 2 over the area
        assert history["strain"][0] == pytest.approx(
            200e9 * 9 / 8 * 1e-12 / 2 * 6e-5, rel=0.05
        )  # measured: 1.037, as stiff as corrected edges are


def test_a_displaced_run_begins_with_its_forces_and_with_what_is_prescribed() -> None:
    """Forces are the slope of the strain energy, by differences; held nodes are where they are held, and at rest."""
    pulled, held = InitialDisplacement(box=ALL, x="1e-5 * x"), Displacement(nodes=(1, 10), x=2e-8)
    model = plate(square_grid(9, 9), conditions=(pulled, held))
    system, state = apply_initial_displacements(prepare(model, Options(threads=1)))
    expected = 1e-5 * model.grid.position[:, 0]
    expected[[0, 9]] = 2e-8
    assert state.value[:, 0] == pytest.approx(expected, rel=1e-12)
    assert not state.second[[0, 9], 0].any()
    acceleration, energy = float(state.second[8, 0]), []
    for step in (-1e-11, 2e-11):
        state.value[8, 0] += step
        energy.append(float((system.area * system.operator.energies(state)[0]).sum()))
    force = -(energy[1] - energy[0]) / 2e-11
    assert abs(acceleration) > 1
    assert acceleration == pytest.approx(force / (system.area[8] * model.rho[8]), rel=1e-4)


@pytest.mark.parametrize(
    ("run", "why"), [({"solver": "static"}, "static"), ({"start": "static"}, "start"), ({"adapt": "split"}, "adapt")]
)
def test_initial_displacements_are_refused_where_runs_begin_otherwise(run: dict[str, str], why: str) -> None:
    conditions = (InitialDisplacement(box=ALL, x=1e-6), Load(box=ALL, body_force=(1.0, 0.0)))
    with pytest.raises(ModelError, match=naming(found="initial displacement", expected=why)):
        prepare(plate(square_grid(9, 9), conditions=conditions, run=Run(**run)), Options())  # type: ignore[arg-type]


def test_a_load_of_which_little_acts_is_named() -> None:
    model = model_of(strip(steps=100).load("top", traction=(0, 1e6), profile=ramp(1.0), name="pull"))
    with pytest.warns(UserWarning, match=naming("$.conditions[0].profile", "load 'pull'", found="4e-05")):
        warn_of_doubtful_conditions(model, 4e-7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_doubtful_conditions(model, 2e-3)  # a fifth acts
