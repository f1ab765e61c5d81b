"""What makes a model, and what is missing from one."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from messages import naming
from plates import GLASS, plate, square_grid

from pdmesh.model.document import GridError, Horizon, Load, Run, Settings, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.conditions import drive
from pdsolve.model import ModelError, model_of, read_model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

TOML = """
material = {E = 65e9, rho = 2235, G0 = 204}
horizon = {ratio = 4}
run = {time_step = 25e-9, steps = 1700}
[[conditions]]
kind = "load"
box = [0, 0.002, 0.1, 0.1]
body_force = [0, 1.5e9]
"""


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """A file with notch and nodes, and nothing of a material."""
    path = tmp_path / "bare.json"
    write_file(document_of(square_grid(5, 4), Settings()), path)
    return path


def test_a_bare_file_needs_a_material(bare: Path) -> None:
    with pytest.raises(ModelError, match=naming("bare.json", "$.material", found="missing", expected=("E", "G0"))):
        read_model(bare)


def test_settings_from_toml_and_from_assignments(bare: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text(TOML)
    model = read_model(bare, tmp_path / "settings.toml", [("run.steps", "5"), ("material.plane", "strain")])
    assert (model.settings.run.steps, model.settings.run.time_step) == (5, 25e-9)
    assert model.materials[0].plane == "strain"
    assert model.settings.horizon.ratio == 4
    (load,) = model.settings.conditions
    assert model.selected(load).tolist() == list(range(10, 20))


def test_settings_from_assignments_alone(bare: Path) -> None:
    model = read_model(bare, assignments=[("material", "{E = 1e9, rho = 1e3, G0 = 1}"), ("run", "{steps = 3}")])
    assert model.materials[0].E == 1e9
    assert model.settings.run.steps == 3
    pointed = [("material.E", "1.e9"), ("material.rho", "1000."), ("material.G0", "1"), ("run.steps", "3")]
    again = read_model(bare, assignments=[*pointed, ("run.time_step", ".5e-7")])  # no numbers of TOML, but of people
    assert again.materials == model.materials
    assert again.settings.run.time_step == 5e-8


def test_none_takes_back_what_may_be_left_out(bare: Path) -> None:
    material = ("material", "{E = 65e9, rho = 2235, G0 = 204, f_t = 3e7}")
    given = [("run", "{until = 'quiet', quiet = 1e-5, steps = 7}"), ("run.fatigue", "{A = 1.0, m = 2.0}")]
    none = [(name, "none") for name in ("run.until", "run.quiet", "run.fatigue", "run.duration", "material.f_t")]
    model = read_model(bare, assignments=[material, *given, *none, ("run.adapt", "none")])
    run = model.settings.run
    assert (run.until, run.quiet, run.fatigue, run.steps, run.adapt) == (None, None, None, 7, "none")
    assert model.materials[0].f_t is None


def test_a_model_comes_back_from_its_text() -> None:
    model = plate(square_grid(5, 4), conditions=(Load(nodes=(1, 2), traction=(1.0, 0.0), rows=1),), run=Run(steps=7))
    again = model_of(model.to_json(), "again")
    assert again.settings == model.settings
    assert np.array_equal(again.grid.position, model.grid.position)


def test_a_duration_is_counted_in_the_sure_step_and_the_end_said_last_counts(bare: Path) -> None:
    material = ("material", "{E = 65e9, rho = 2235, G0 = 204}")
    step = prepare(read_model(bare, assignments=[material]), Options()).system.time_step
    for more, steps in (
        ([("run.duration", f"{9.5 * step}")], 10),
        ([("run.duration", f"{10 * step}")], 10),  # but for round-off
        ([("run.duration", f"{9.5 * step}"), ("run.time_step", f"{step / 2}")], 19),
        ([("run.duration", "1"), ("run.steps", "7")], 7),
        ([("run.steps", "7"), ("run.duration", f"{9.5 * step}")], 10),
    ):
        run = prepare(read_model(bare, assignments=[material, *more]), Options()).system.requested_model.settings.run
        assert (run.steps, run.duration) == (steps, None)
    with pytest.raises(ModelError, match=naming("$.run.duration", found="1e+30 s", expected="2.14748e+09")):
        prepare(read_model(bare, assignments=[material, ("run.duration", "1e30")]), Options())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("run.steps", "many", r"\$.run.steps"),
        ("run.stepz", "3", r"\$.run.stepz is unknown"),
        ("run.time_step", "5MPa", naming("run.time_step", "'5MPa'", expected=("in s", "ms", "us"))),
        ("horizon.ratio", "4mm", naming("$.horizon.ratio", "'4mm'", expected="from 1 to 64")),
        ("material.E", "none", naming("$.material.E", "'none'", expected="above 0")),
        ("material.E", "-1", r"\$.material.E"),
        ("horizon.ratio", "nan", r"\$.horizon.ratio"),
        (
            "conditions",
            "[{kind = 'load', box = [9, 9, 9, 9], body_force = [0, 1]}]",
            naming("$.conditions[0].box", found=re.compile(r"\[9")),
        ),
        ("conditions", "[{kind = 'load', nodes = [99], body_force = [0, 1]}]", "nodes: id 99"),
        ("conditions", "[{kind = 'load', body_force = [0, 1]}]", naming(found=("neither", "nodes"))),
        ("conditions", "[{kind = 'load', nodes = [1]}]", naming(expected="body_force")),
        ("conditions", "[{kind = 'lode', nodes = [1]}]", r"\$.conditions\[0\].kind is 'lode'"),
    ],
)
def test_wrong_settings_are_named(bare: Path, name: str, value: str, message: str) -> None:
    material = ("material", "{E = 65e9, rho = 2235, G0 = 204}")
    with pytest.raises(ModelError, match=message):
        read_model(bare, assignments=[material, (name, value)])


def test_a_toml_file_that_is_none_is_named(bare: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text("material = ")
    with pytest.raises(
        ModelError, match=naming("settings.toml", "not valid TOML", "invalid value", expected="correct")
    ):
        read_model(bare, tmp_path / "settings.toml")


@pytest.mark.parametrize(
    "text", ["run = " + 20_000 * "[" + 20_000 * "]", "run = " + 20_000 * "{a=" + "1" + 20_000 * "}"]
)
def test_a_toml_file_nested_too_deep_is_named(text: str, bare: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text(text)
    with pytest.raises(ModelError, match=naming("settings.toml", found=("values", "nested"))):
        read_model(bare, tmp_path / "settings.toml")
    with pytest.raises(ModelError, match=naming("run", "--set", found=("values", "nested"))):
        read_model(bare, assignments=[("run", text.removeprefix("run = "))])


def test_a_traction_as_the_thesis_spreads_it_and_exactly() -> None:
    """12 MPa over 4 rows of 2 mm: 1.5e9 N/m^3 at each node; or so much that the sum is traction * length."""
    grid = square_grid(51, 10, delta=2e-3)
    top = tuple(range(51 * 6 + 1, 51 * 10 + 1))
    model = plate(grid, conditions=(Load(nodes=top, traction=(0.0, 12e6), rows=4, length=0.1),))
    area = np.full(len(grid), 3e-6)
    thesis = drive(model, area, False, np.float64).force
    assert thesis[-204:, 1] == pytest.approx(1.5e9, rel=1e-14)
    assert np.count_nonzero(thesis) == 204
    exact = drive(model, area, True, np.float64).force
    assert (exact[:, 1] * area).sum() == pytest.approx(12e6 * 0.1, rel=1e-14)


def test_two_nodes_at_one_place_are_named() -> None:
    grid = square_grid(3, 2)
    grid.position[4] = grid.position[1]
    with pytest.raises(ModelError, match=naming("$.nodes", found=("2", "5"), expected="apart")):
        plate(grid)


def test_horizons_follow_the_spacing() -> None:
    assert plate(square_grid(3, 3, delta=2e-3), ratio=4).horizons == pytest.approx(8e-3)
    assert Settings().horizon == Horizon(3.0)
    assert GLASS.law == "brittle"


CONDITION = 'conditions = [{kind = "%s", box = [-1, -1, 1, 1], %s}]'
LOAD = "traction = [1, 1], rows = 2, length = 0.01"
POSITIVE = (  # settings that are above 0
    "material.E = X",
    "material.rho = X",
    "material.G0 = X",
    "material.kr = X",
    "horizon.ratio = X",
    "run.time_step = X",
    "run.steps = X",
    "run.every = X",
    "run.ledger = X",
    "run = {until = 'quiet', quiet = X}",
    CONDITION % ("load", LOAD.replace("0.01", "X")),
    CONDITION % ("load", LOAD.replace("2", "X")),
    "regions = [{material = {E = X, rho = 1e3, G0 = 1}, box = [-1, -1, 1, 1]}]",
)
SIGNED = (
    "material.nu = X",
    "run.probes = [[X, 0]]",
    "run.probes = [[0, 0], [0, X]]",
    CONDITION % ("load", LOAD.replace("[1,", "[X,")),
    CONDITION % ("load", "body_force = [0, X]"),
    CONDITION % ("load", "body_force = [0, 1], profile = [[0, 1], [X, 2]]"),
    CONDITION % ("load", "body_force = [0, 1], profile = [[0, 1], [1, X]]"),
    CONDITION % ("displacement", "x = X"),
    CONDITION % ("velocity", "y = X"),
    CONDITION % ("acceleration", "x = X"),
    CONDITION % ("initial velocity", "y = X"),
    "conditions = [{kind = 'velocity', box = [X, 0, 1, 1], x = 1}]",
    "regions = [{material = {E = 1, rho = 1, G0 = 1}, box = [0, 0, X, 1]}]",
)


@pytest.mark.quick_cases(76)
@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "-1", "1e300", "-1e300", "1" + 40 * "0", "1" + 5000 * "0"])
@pytest.mark.parametrize("setting", [*POSITIVE, *SIGNED])
def test_numbers_that_are_none(bare: Path, tmp_path: Path, setting: str, number: str) -> None:
    """One line that names the setting, whether it is assigned or in a file."""
    if setting in SIGNED and number == "-1" and setting != "material.nu = X":
        return
    name, text = setting.replace("X", number).split(" = ", 1)
    (tmp_path / "settings.toml").write_text("material = {E = 1e9, rho = 1e3, G0 = 1}\n")
    with pytest.raises((ModelError, GridError)) as error:
        read_model(bare, tmp_path / "settings.toml", [(name, text)])
    assert str(error.value).startswith(str(bare))
    assert f"$.{name.split('.')[0]}" in str(error.value)
    assert "\n" not in str(error.value)


def test_numbers_that_are_none_in_a_file(bare: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text(TOML.replace("25e-9", "inf"))
    with pytest.raises(ModelError, match=naming("$.run.time_step", found="inf", expected=("-1e+30", "1e+30"))):
        read_model(bare, tmp_path / "settings.toml")
    for text in ("run.steps = 1" + 5000 * "0", "x = " + 20000 * "["):
        (tmp_path / "settings.toml").write_text(text)
        with pytest.raises(ModelError, match=r"settings\.toml: "):
            read_model(bare, tmp_path / "settings.toml")


def test_quiet_needs_its_seconds() -> None:
    with pytest.raises(
        ModelError, match=naming("model", "$.run.quiet", found="missing", expected=("seconds", "quiet"))
    ):
        prepare(plate(square_grid(5, 4), run=Run(until="quiet")), Options())
    with pytest.raises(ModelError, match=naming("model", "$.run.quiet", found="1e-06", expected="quiet")):
        prepare(plate(square_grid(5, 4), run=Run(quiet=1e-6)), Options())
    assert plate(square_grid(5, 4), run=Run(until="split", quiet=1e-6)).settings.run.until == "split"
