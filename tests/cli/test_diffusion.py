"""A disc from drawing to picture, and what is refused on the way, as a user types it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from PIL import Image
from plates import GEOMETRIES

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdpost.figures.field_figure import DPI, field, notebook_png
from pdpost.figures.style import styled, written
from pdsolve.__main__ import main as pdsolve
from pdsolve.results import Results

COARSE = ("--set", "Zones/liquid/Spacing=0.2", "--set", "Run/Time step=10", "--set", "Run/Duration=500", "-q")


@pytest.fixture(scope="module")
def disc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped disc, coarse."""
    path = tmp_path_factory.mktemp("disc") / "disc.json"
    assert pdmesh(["build", str(GEOMETRIES / "disc.geo"), *COARSE, "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def results(disc: Path) -> Path:
    path = disc.with_suffix(".sqlite")
    assert pdsolve([str(disc), "-o", str(path), "--threads", "1", "-q"]) == 0
    return path


@pytest.mark.slow
def test_the_drawing_says_what_dissolves(disc: Path) -> None:
    model = json.loads(disc.read_text())
    assert model["physics"] == "diffusion"
    assert model["medium"] == {"D": 1e-9, "C_solid": 71600.0, "C_sat": 14320.0, "k_diss": 1.0}
    assert {one["kind"]: one["name"] for one in model["conditions"]} == {"solid": "disc", "concentration": "clean"}


def test_a_run_says_what_is_dissolved(disc: Path, results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert pdpost(["history", str(results), "--json"]) == 0
    last = json.loads(capsys.readouterr().out)["last"]
    assert last["left"] == pytest.approx(1 - 0.3993, abs=0.06)  # of a front that is tracked, this one is coarse
    assert abs(last["error"]) < 1e-12
    assert pdsolve([str(disc), "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["stable_time_step"] == pytest.approx(36.848, rel=1e-4)
    assert pdmesh(["info", str(disc)]) == 0
    assert "medium: D = 1e-09" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", ["concentration", "content", "solid", "history"])
def test_pictures(results: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "picture.png"
    assert pdpost([name, str(results), "-o", str(path), "--json"]) == 0
    assert path.stat().st_size > 10_000
    largest = {"concentration": 14320, "content": 71600, "solid": 1.0}
    if name in largest:
        assert json.loads(capsys.readouterr().out)["largest"] == pytest.approx(largest[name], rel=1e-6)


@pytest.mark.parametrize("name", ["balance", "bonds", "crack", "damage", "displacement", "sif", "stress"])
def test_what_shows_mechanics_says_so(
    results: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "never.png"
    assert pdpost([name, str(results), "-o", str(path)]) == 2
    said = capsys.readouterr().err
    assert mentions(said, found=("model", "diffusion"), expected="mechanics")
    assert said.count("\n") == 1
    assert not path.exists()


@pytest.mark.slow
def test_a_plan_refuses_what_a_run_does(disc: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for option, value in (("mode", "thesis"), ("precision", "float32")):
        assert pdsolve([str(disc), "--dry-run", f"--{option}", value]) == 2
        assert mentions(capsys.readouterr().err, expected=(option, value, "diffusion"))
    for command, model in (("info", str(disc)), ("plan", str(GEOMETRIES / "disc.geo"))):
        assert pdmesh([command, model, "--mode", "thesis"]) == 2
        said = capsys.readouterr().err
        assert mentions(said, expected=("mode", "thesis", "diffusion"))
        assert said.count("\n") == 1


@pytest.mark.slow
def test_a_study_is_of_mechanics(disc: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = disc.with_name("study.toml")
    gel = "from pdmesh import Medium, Scene, box\nscene = Scene(box(0, 0, 8, 8), 1.0, medium=Medium(D=1.0))\n"
    disc.with_name("gel.py").write_text(gel)
    for drawing in ("disc.json", "gel.py"):
        study.write_text(f'drawing = "{drawing}"\n[vary.model]\n"medium.D" = [1.0, 2.0]\n')
        for program, words in ((pdmesh, ["plan"]), (pdsolve, ["study", "-o", str(disc.with_name("study.sqlite"))])):
            assert program([*words, str(study), "--trust"]) == 2
            said = capsys.readouterr().err
            assert mentions(said, drawing, found=("model", "diffusion"), expected="mechanics")
            assert said.count("\n") == 1
    assert not disc.with_name("study.sqlite").exists()


@pytest.mark.slow
def test_a_film_and_a_report_show_what_diffuses(results: Path, tmp_path: Path) -> None:
    film, page = tmp_path / "film.gif", tmp_path / "page.html"
    assert pdpost(["animate", str(results), "-o", str(film), "--json"]) == 0
    with Image.open(film) as first:
        assert len(np.unique(np.asarray(first.convert("RGB")).reshape(-1, 3), axis=0)) > 5
    assert pdpost(["report", str(results), "-o", str(page), "-q"]) == 0
    text = page.read_text()
    assert [part.split("<")[0] for part in text.split("<h2>")[1:]][:2] == ["Animation", "Fields at 500 s"]
    assert text.count("<img") == 6  # a film, three fields, amounts, the plate
    assert "solid left" in text


@pytest.mark.slow
def test_a_notebook_shows_the_content(results: Path) -> None:
    with Results.open(results) as found:
        shown = notebook_png(found)
        assert shown is not None
        with styled():
            assert shown == written(field(found, "content"), "png", DPI)


def test_exports_hold_what_there_is(results: Path, tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "disc.vtu"
    assert pdpost(["export", str(results), "-o", str(path), "-q"]) == 0
    assert {"concentration", "content", "solid"} <= set(meshio.read(path).point_data)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("medium.D=-1e-9", re.escape("$.medium.D")),
        ("medium.C_sat=80000", naming("$.medium.C_sat", found="80000 mol/m^3", expected=("C_solid", "71600 mol/m^3"))),
        ("run.time_step=39", naming("$.run.time_step", found="39 s", expected=re.compile(r"36\.84"))),
        ("run.theta=0.3", re.escape("$.run.theta")),
        ("physics=mechanics", naming("$.material", found="missing", expected=("E", "G0"))),
        ("run.adapt=split", naming("$.run.adapt", found="split", expected=("collocation", "diffusion"))),
        ("run.cracks=particles", naming("$.run.cracks", found="particles", expected="bonds")),
        ("run.particles.strength=1", naming("run.particles.strength", found="run.cracks bonds")),
        ("area_rule=eq19", naming("$.area_rule", found="eq19", expected=("square", "diffusion"))),
        ("run.theta=0.6", naming("run.theta", found="run.solver explicit", expected="run.solver implicit")),
        ("run.collocation.kappa=0.5", naming("run.collocation.kappa", found="run.adapt none")),
    ],
)
def test_bad_input_gets_one_line(
    disc: Path, tmp_path: Path, setting: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "never.sqlite"
    assert pdsolve([str(disc), "-o", str(path), "--set", setting]) == 2
    found = capsys.readouterr().err
    assert re.search(said, found)
    assert found.count("\n") == 1
    assert not path.exists()


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("how", ["hybrid", "split", "collocation"])
def test_a_drawing_of_a_plate_that_is_to_adapt_is_refused(
    tmp_path: Path, how: str, capsys: pytest.CaptureFixture[str]
) -> None:
    source, path = tmp_path / "bath.py", tmp_path / "never.json"
    source.write_text(
        "from pdmesh import Medium, Scene, box\nscene = Scene(box(0, 0, 8, 8), 1.0, medium=Medium(D=1.0))\n"
    )
    assert pdmesh(["build", str(source), "--trust", "--adapt", how, "-o", str(path)]) == 2
    said = capsys.readouterr().err
    assert mentions(said, "run.adapt", found=how, expected=("plate", "diffusion"))
    assert said.count("\n") == 1
    assert not path.exists()


@pytest.mark.slow
def test_a_drawing_of_an_impossible_solid_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "never.json"
    words = ["build", str(GEOMETRIES / "disc.geo"), "--set", "Medium/C sat=8e4", "-o", str(path)]
    assert pdmesh(words) == 2
    assert mentions(capsys.readouterr().err, "medium", "C_sat", found="80000 mol/m^3", expected="C_solid")
    assert not path.exists()
