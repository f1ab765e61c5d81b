"""Functions for scripts take a path as text too, as NumPy and meshio do."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from pdmesh import Scene, box, build, build_file, file_parameters, read_scene
from pdmesh.model.document import Material, Run
from pdpost import figures, study_table
from pdsolve import Results, plan_study, read_model, read_study, resume, simulate, solve_study
from pdsolve.study import dispatch

SCENE = """from pdmesh import Material, Run, Scene, box
scene = Scene(box(0, 0, 0.01, 0.006), 1e-3, Material(E=65e9, rho=2235, G0=204), run=Run(steps=2))
"""
PLATE = Scene(box(0, 0, 0.01, 0.006), 1e-3, Material(E=65e9, rho=2235, G0=204), run=Run(steps=2))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of its own with the grid file of a plate, `plate.json`."""
    monkeypatch.chdir(tmp_path)
    build(PLATE).write("plate.json")


@pytest.mark.process
def test_drawings_have_paths_of_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plate.py").write_text(SCENE)
    assert read_scene("plate.py", trust=True).material == PLATE.material
    assert len(build_file("plate.py", trust=True).grid) == len(build(PLATE).grid)
    assert file_parameters("plate.py", trust=True) == []


@pytest.mark.usefixtures("here")
def test_models_and_results_have_paths_of_text() -> None:
    Path("more.toml").write_text("[run]\nsteps = 3\n")
    simulate(read_model("plate.json", "more.toml"), "plate.sqlite").close()
    with resume("plate.sqlite") as again, Results.open("plate.sqlite") as read:
        assert again.summary()["steps"] == read.summary()["steps"] == 3


def test_figures_have_paths_of_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    figures.save(Figure(), "plate.svg")
    assert Path("plate.svg").stat().st_size > 0


@pytest.mark.usefixtures("here")
def test_studies_have_paths_of_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dispatch, "task_solver", lambda workers: nullcontext(lambda tasks: []))  # by no process
    Path("study.toml").write_text('drawing = "plate.json"\n[vary.model]\nmaterial.G0 = [100, 204]\n')
    assert plan_study("study.toml")["runs"] == 2
    assert len(solve_study(read_study("study.toml"), "study.sqlite")) == 2
    assert len(study_table("study.sqlite")["number"]) == 2
