"""`pdsolve fit` from its TOML to its picture, and the measured points of `pdpost reaction`."""

from __future__ import annotations

import csv
import json
from argparse import Namespace
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from messages import mentions
from plates import ROOT

from pdmesh import Material, Run, Scene, Static, box, build, ramp
from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdpost.commands import curves
from pdsolve.__main__ import main
from pdsolve.measures.forces import ConditionForceHistory
from pdsolve.study import dispatch, one_run
from pdsolve.study.one_run import Outcome, Task

FIT = """drawing = "bar.json"
[fit]
condition = "pull"
thickness = 0.01
[fit.model]
material.E = {first = 150e9, bounds = [50e9, 500e9]}
"""
WORDS = ["fit", "fit.toml", "--measured", "curve.csv"]
OVERLAY = ["--measured", "curve.csv", "--thickness", "10mm"]


def in_this_process(tasks: list[Task]) -> list[Outcome]:
    return [one_run.solve_and_measure(task) for task in tasks]


@pytest.fixture
def bar(here: Path, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A bar that is to be fitted in the current folder; the numbers of the runs that are solved."""
    steel = Material(E=210e9, rho=7800, G0=1e9)
    run = Run(solver="static", static=Static(load_steps=1))
    scene = (
        Scene(box(0, 0, 0.016, 0.008), 2e-3, steel, run=run)
        .fix("left", name="clamp")
        .fix("right", x=1e-5, y=None, profile=ramp(1), name="pull")
    )
    build(scene).write("bar.json")
    Path("fit.toml").write_text(FIT)
    solved: list[int] = []

    def solve(tasks: list[Task]) -> list[Outcome]:
        solved.extend(task.number for task in tasks)
        return in_this_process(tasks)

    monkeypatch.setattr(dispatch, "task_solver", lambda how: nullcontext(solve))
    return solved


def table(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(Path(name).read_text().splitlines()))


def measure(modulus: float) -> None:
    """The curve of a bar of this modulus, Pa, as a test of a specimen of 10 mm measures it."""
    main(["bar.json", "-q", "--set", f"material.E={modulus:g}"])
    pdpost(["reaction", "bar.sqlite", "--condition", "pull", "--csv", "bar.csv", "-q"])
    last = table("bar.csv")[-1]
    way, force = float(last["displacement x, m"]), float(last["force x, N/m"])
    Path("curve.csv").write_text(f'"way, um","load, N"\n0,0\n{way * 5e5},{force * 0.005}\n{way * 1e6},{force * 0.01}\n')


def test_the_modulus_of_a_bar_comes_back(bar: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    """In a linear bar it is that of the first guess times the ratio of the forces."""
    Path("curve.csv").write_text('"way, m","load, N"\n1e-5,10e3\n')
    assert main([*WORDS, "--json", "-q"]) == 0
    result = json.loads(capsys.readouterr().out)
    (first,), (fitted,) = result["points"]["first"], result["points"]["fitted"]
    assert fitted == pytest.approx(10e3 / 0.01, rel=1e-5)
    assert result["parameters"][0]["value"] == pytest.approx(150e9 * fitted / first, rel=1e-5)
    assert result["parameters"][0]["standard_error"] is None  # of one point
    assert bar == list(range(1, result["runs"] + 1))


@pytest.mark.slow
def test_a_fit_is_printed_drawn_and_written(bar: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    measure(210e9)
    capsys.readouterr()
    assert main([*WORDS, "--csv", "points.csv"]) == 0
    captured = capsys.readouterr()
    assert mentions(captured.out, "material.E", "2.1e+11", "1.5e+11", "3 points")
    assert captured.err.startswith("1: material.E = 1.5e+11")
    assert Path("fit.fit.png").stat().st_size > 0
    assert [float(point["residual, N/m"]) for point in table("points.csv")] == pytest.approx([0, 0, 0], abs=10)
    runs = len(bar)
    assert main([*WORDS, "--json", "-q"]) == 0  # all runs are there
    result = json.loads(capsys.readouterr().out)
    assert len(bar) == runs == result["runs"]
    assert result["parameters"][0]["value"] == pytest.approx(210e9, rel=1e-5)
    assert result["converged"]
    assert pdpost(["study", "fit.sqlite", "-q"]) == 0
    assert pdpost(["reaction", result["fitted_run"], "--condition", "pull", *OVERLAY]) == 0
    assert mentions(capsys.readouterr().out, "curve.csv", "0.000%", "3 points")


@pytest.mark.slow
def test_a_fit_that_was_stopped_repeats_no_run(bar: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    measure(180e9)

    def stopped(tasks: list[Task]) -> list[Outcome]:
        if len(bar) == 3:
            raise KeyboardInterrupt
        bar.extend(task.number for task in tasks)
        return in_this_process(tasks)

    with monkeypatch.context() as patch:
        patch.setattr(dispatch, "task_solver", lambda how: nullcontext(stopped))
        assert main([*WORDS, "-q"]) == 130
    assert main([*WORDS, "-q"]) == 0
    assert bar == list(range(1, len(bar) + 1))
    began = {path.name: path.stat().st_mtime_ns for path in Path("fit.runs").glob("*.sqlite")}
    Path("fit.sqlite").unlink()  # and the table is made anew from the runs, also where others come first
    Path("fit.toml").write_text(FIT.replace("first = 150e9", "first = 200e9"))
    bar.clear()
    assert main([*WORDS, "-q"]) == 0
    assert min(bar) == len(began) + 1
    Path("fit.sqlite").unlink()
    Path("fit.toml").write_text(FIT)
    assert main([*WORDS, "-q"]) == 0
    assert {path.name: path.stat().st_mtime_ns for path in Path("fit.runs").glob("*.sqlite")}.items() >= began.items()


@pytest.mark.parametrize(
    ("text", "curve", "parts"),
    [
        (FIT.replace('"pull"', '"push"'), '"a, mm","b, N"\n1,2\n', ("fit.toml", "$.fit.condition", "push", "pull")),
        (FIT, '"a","b, N"\n1,2\n', ("curve.csv", "length")),
        (FIT.replace("thickness = 0.01\n", ""), '"a, mm","b, N"\n1,2\n', ("curve.csv", "$.fit.thickness")),
        (FIT.split("[fit]")[0], '"a, mm","b, N"\n1,2\n', ("fit.toml", "[fit]")),
    ],
)
def test_bad_input_is_one_line(
    bar: list[int], capsys: pytest.CaptureFixture[str], text: str, curve: str, parts: tuple[str, ...]
) -> None:
    Path("fit.toml").write_text(text)
    Path("curve.csv").write_text(curve)
    assert main(WORDS) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert mentions(said, "pdsolve fit", *parts)
    assert bar == []


@pytest.mark.parametrize(("force", "way"), [(1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)])
def test_measured_points_have_the_signs_of_the_run(here: Path, force: float, way: float) -> None:
    """Of a beam that is bent downwards, both are negative."""
    Path("curve.csv").write_text('"a, mm","b, N"\n1,20\n2,30\n')
    columns = np.array([0.0, 2.0, 1.0])
    history = ConditionForceHistory(
        0,
        "pull",
        "displacement",
        columns.astype(int),
        columns,
        force * np.outer(columns, (0, 1)),
        way * np.outer(columns, (0, 1)),
    )
    args = Namespace(measured=Path("curve.csv"), thickness=0.1, gap=None)
    measured = curves._measured(SimpleNamespace(dimension=2), args, [history], None)
    assert measured.force.tolist() == [force * 200, force * 300]
    assert measured.displacement.tolist() == pytest.approx([way * 1e-3, way * 2e-3])


def test_an_output_is_not_the_measured_curve(bar: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    Path("curve.csv").write_text('"a, mm","b, N"\n1,2\n')
    assert main([*WORDS, "--csv", "curve.csv"]) == 2
    assert mentions(capsys.readouterr().err, "curve.csv", "input")


@pytest.mark.slow
def test_strength_and_toughness_of_a_notched_beam_come_back(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Force over CMOD of a coarse beam of cohesive bonds; the first guess is 22 % below and 29 % above."""
    drawing = ROOT / "geometries" / "notched_beam.py"
    assert pdmesh(["build", str(drawing), "--trust", "-q", "--set", "layers=5"]) == 0
    assert main(["notched_beam.json", "-q"]) == 0
    over_gap = ["reaction", "notched_beam.sqlite", "--condition", "middle", "--gap", "mouth"]
    assert pdpost([*over_gap, "--csv", "curve.csv", "-q"]) == 0
    Path("fit.toml").write_text(
        f"drawing = {str(drawing)!r}\nset.drawing.layers = 5\n"
        '[fit]\ncondition = "middle"\ngap = "mouth"\n[fit.model]\n'
        "material.f_t = {first = 2.6e6, bounds = [1e6, 8e6]}\nmaterial.G0 = {first = 160, bounds = [40, 400]}\n"
    )
    capsys.readouterr()
    assert main([*WORDS, "--trust", "--json", "-q"]) == 0
    result = json.loads(capsys.readouterr().out)
    strength, toughness = (parameter["value"] for parameter in result["parameters"])
    assert strength == pytest.approx(3.33e6, rel=1e-2)  # 3.3299e6, 18 runs
    assert toughness == pytest.approx(124, rel=1e-2)  # 123.99
    assert result["first_misfit"] > 0.1
    assert result["misfit"] < 2e-3


@pytest.mark.slow
def test_the_measured_curve_of_a_panel_is_fitted(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As docs/how_to/fit.md has it, from a first guess that is nearer."""
    Path("fit.toml").write_text(
        f"drawing = {str(ROOT / 'geometries' / 'l_panel.py')!r}\n"
        'set.drawing = {spacing = 0.025, lift = 1.01e-3}\n[fit]\ncondition = "arm"\nthickness = 0.1\n[fit.model]\n'
        "material.E = {first = 22e9, bounds = [5e9, 60e9]}\nmaterial.f_t = {first = 1.9e6, bounds = [1e6, 6e6]}\n"
        "material.G0 = {first = 120, bounds = [20, 300]}\n"
    )
    measured = ROOT / "docs" / "verification" / "reproductions" / "data" / "winkler_l_panel.csv"
    assert main(["fit", "fit.toml", "--measured", str(measured), "--trust", "--json", "-q"]) == 0
    result = json.loads(capsys.readouterr().out)
    values = [parameter["value"] for parameter in result["parameters"]]
    assert values == pytest.approx([21.35e9, 1.772e6, 130.4], rel=0.01)
    assert result["misfit"] == pytest.approx(0.0308, abs=2e-4)
    assert [parameter["standard_error"] for parameter in result["parameters"]] == pytest.approx(
        [5.5e8, 4.7e4, 2.6], rel=0.1
    )
