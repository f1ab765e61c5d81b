"""What a run with stencils on a coarse grid refuses, what it says of itself, and what a killed one goes on to."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from collocation_plates import cracked, torn, with_material, with_run
from database_contents import contents, kill_when
from messages import naming
from plates import STEEL

from pdmesh import Scene, box
from pdmesh.__main__ import main as build_command
from pdmesh.drawing.parameters import Parameters, run
from pdmesh.model.contradictions import Case
from pdmesh.model.document import Collocation, Region, Run, write_file
from pdmesh.model.node_grid import document_of
from pdmesh.model.possible import impossible
from pdmesh.quantities import UNITS
from pdpost.__main__ import main as show_command
from pdpost.figures.page import report
from pdsolve.__main__ import main as solve_command
from pdsolve.adaptivity.collocation import operator as operator_module
from pdsolve.measures.balance import energy_loss_warnings
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate

TESTS = Path(__file__).parents[2]
RUN = Run(adapt="collocation", collocation=Collocation(damped=True), steps=10)
PLATE = cracked(41, 41, 4.0, 12.0, run=RUN)
SEAM = naming("damped seam", re.compile(r"\b\d+ %"))  # what it took, of what was put in
REGION = Region(box=(0.0, 0.0, 0.01, 0.01), material=msgspec.structs.replace(PLATE.materials[0], E=2e11))


@pytest.mark.slow
def test_bonds_of_the_start_stay_as_they_are_while_others_march(monkeypatch: pytest.MonkeyPatch) -> None:
    """A writer asks for them in a thread of its own: here bonds break amid the answer."""
    problem = prepare(torn("collocation"), Options(threads=1))
    operator, listed = problem.system.operator, operator_module.list_bonds
    expected = operator.bonds(at_start=True)

    def listed_while_bonds_break(*arguments: Any) -> Any:
        found = listed(*arguments)
        problem.advance(1, 91)
        return found

    monkeypatch.setattr(operator_module, "list_bonds", listed_while_bonds_break)
    for found, before in zip(operator.bonds(at_start=True), expected, strict=True):
        assert np.array_equal(found, before)
    assert len(operator.broken().step) > 100


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (with_material(PLATE, law="bilinear", kr=2.0), naming("material.law", found="bilinear", expected="brittle")),
        (cracked(41, 41, 4.0, 0.0, run=RUN, regions=(REGION,)), naming(found="2 materials")),
        (cracked(41, 41, 2.0, 0.0, run=RUN), naming("ratio", found="2", expected="3")),
        (cracked(91, 91, 40.0, 0.0, run=RUN), naming("ratio", found="40", expected="32")),
        (with_run(PLATE, damping=10.0), naming("run.damping", found="10", expected="0")),
        (
            dataclasses.replace(PLATE, grid=dataclasses.replace(PLATE.grid, cracks=1e-3 * np.array([[0.0, 9, 9, 9]]))),
            naming(found="node"),
        ),
    ],
)
def test_what_cannot_be_solved_so_is_refused(model: Model, words: str) -> None:
    """In one sentence that names the place."""
    with pytest.raises(ModelError, match=words) as error:
        prepare(model, Options(threads=1))
    assert str(error.value).endswith("as run.adapt is collocation")


@pytest.mark.slow
def test_the_commands_take_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene, a drawing and both programs may ask for it; bad input leaves one line and no file."""
    scene = Scene(box(0, 0, 0.04, 0.024), 1e-3, STEEL).adapt("collocation", damped=True)
    assert (scene.run.adapt, scene.run.collocation) == ("collocation", Collocation(damped=True))
    assert run(Parameters({"Peridynamics/Run/Adapt": "collocation"}, UNITS["m"])).adapt == "collocation"
    path, script = tmp_path / "plate.json", tmp_path / "plate.py"
    script.write_text(
        "from pdmesh import Material, Run, Scene, box\n"
        "steel = Material(E=191e9, rho=8000, G0=42408, plane='strain')\n"
        "scene = Scene(box(0, 0, 0.06, 0.06), 1e-3, steel, 4, Run(steps=10, every=5)).adapt('collocation', True)\n"
    )
    assert build_command(["build", str(script), "--trust", "-o", str(path), "-q"]) == 0
    assert solve_command([str(path), "--dry-run", "--threads", "1", "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert planned["nodes"] < 61 * 61  # active ones
    assert planned["finest"] < planned["nodes"]
    assert solve_command([str(path), "--threads", "1", "-q", "--json", "-o", str(tmp_path / "plate.sqlite")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kernel"] == "collocation"
    assert 0.1 < told["hybrid"]["fine_share"] < 0.6
    (tmp_path / "plate.sqlite").unlink()
    assert solve_command([str(path), "--set", "run.collocation.kappa=1.5", "-o", str(tmp_path / "x.sqlite")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert solve_command([str(path), "--set", "material.law=bilinear", "-o", str(tmp_path / "x.sqlite")]) == 2
    words = "$.material.law is 'bilinear'; use brittle, as run.adapt is collocation"
    assert capsys.readouterr().err == f"pdsolve: {path}: {words}\n"
    assert sorted(file.name for file in tmp_path.glob("*.sqlite")) == []


FEW = (
    "$.run.collocation.damped is false with 4 spacings in the horizon; use true, or at least 12 spacings: with"
    " fewer the seam is damped, which takes more than 60 % of the work from a struck plate with 4"
)


@pytest.mark.slow
def test_few_spacings_have_to_be_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Built, planned and solved they are refused in one line that says what they cost; a drawing may ask too."""
    script, path = tmp_path / "plate.py", tmp_path / "plate.json"
    script.write_text(
        "from pdmesh import Material, Run, Scene, box\n"
        "steel = Material(E=191e9, rho=8000, G0=42408, plane='strain')\n"
        "scene = Scene(box(0, 0, 0.06, 0.06), 1e-3, steel, 4, Run(steps=10, every=5))\n"
    )
    for command in ("build", "info", "plan"):
        assert build_command([command, str(script), "--trust", "--adapt", "collocation"]) == 2
        line = capsys.readouterr().err
        assert line.startswith("pdmesh: ")
        assert line.endswith(f"plate.py: {FEW}\n")
    assert build_command(["build", str(script), "--trust", "--adapt", "hybrid", "-o", str(path), "-q"]) == 0
    for more in (["--dry-run"], ["-o", str(tmp_path / "plate.sqlite")]):
        assert solve_command([str(path), "--adapt", "collocation", *more]) == 2
        assert capsys.readouterr().err == f"pdsolve: {path}: {FEW}\n"
    asked = ["--adapt", "collocation", "--set", "run.collocation.damped=true", "--dry-run"]
    assert solve_command([str(path), *asked, "-q"]) == 0
    assert not list(tmp_path.glob("*.sqlite"))
    drawn = run(Parameters({"Peridynamics/Run/Collocation damped": 1.0}, UNITS["m"]))
    assert drawn.collocation == Collocation(damped=True)
    for ratio, lines in ((11.9, 1), (12.0, 0)):
        settings = cracked(41, 41, ratio, 0.0, run=Run(adapt="collocation")).settings
        assert len(list(impossible(Case(settings, 2)))) == lines


@pytest.mark.slow
def test_what_the_seam_takes_is_booked_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A plate that nothing breaks in: bonds spend nothing at all, the seam much, which every command says."""
    path = tmp_path / "plate.sqlite"
    model = with_run(with_material(torn("collocation"), G0=1e30), steps=240, every=60)
    with pytest.warns(ModelWarning, match=SEAM):
        simulate(model, path, Options(threads=1)).close()
    with Results.open(path) as results:
        history, told = results.history(), results.summary()
        report_page = report(results, "plate")
        (remark,) = energy_loss_warnings(results)
    assert not history["dissipated"].any()
    assert history["damped"][-1] > 0.1 * history["work"][-1]
    assert np.all(np.diff(history["damped"]) > 0)
    assert told["energy"]["damped"] == history["damped"][-1]
    assert abs(told["balance"]) < 0.02  # measured 0.0004
    assert re.search(SEAM, remark)
    assert remark in report_page
    assert show_command(["balance", str(path), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["remarks"] == [remark]
    assert shown["damped"] == history["damped"].tolist()


@pytest.mark.endurance
def test_a_killed_run_goes_on_to_the_same_tables(tmp_path: Path) -> None:
    """kill -9 after nodes were switched, and other numbers of steps and threads at a time: the same to the bit."""
    whole, killed = tmp_path / "whole.sqlite", tmp_path / "killed.sqlite"
    model = with_run(torn("collocation", steps=160), every=20, collocation=Collocation(damped=True, damping=0.02))
    with pytest.warns(ModelWarning, match=SEAM):
        simulate(model, whole, Options(threads=2)).close()
    write_file(document_of(model.grid, model.settings), tmp_path / "plate.json")
    program = f"""
import sys, time
from pathlib import Path
from pdsolve.model import read_model
from pdsolve.run.simulation import Options, simulate
import pdsolve.run.simulation, pdsolve.run.recorder
pdsolve.run.simulation.PATIENCE, pdsolve.run.recorder.KEPT = 1e6, 0.0
watch = lambda progress: bool(time.sleep(0.02))
simulate(read_model(Path({str(tmp_path / "plate.json")!r})), Path(sys.argv[1]), Options(threads=1), watch)
"""
    kill_when(lambda results: len(results.frames()[0]) >= 6, killed, ["-c", program, str(killed)])
    with Results.open(killed) as results:
        assert results.meta()["status"] == "running"
        assert len(results.nodes(int(results.frames()[0].max())).ids) > len(results.nodes(0).ids)
    with pytest.warns(ModelWarning, match=SEAM):
        resume(killed, 1).close()
    assert contents(killed) == contents(whole)
    with Results.open(whole) as results:
        for step in results.frames()[0].tolist():
            nodes = results.nodes(step)
            assert nodes.area.sum() == pytest.approx(0.060 * 0.059, rel=1e-12)
            assert len(results.field("ux", step)) == len(nodes.ids)
        books = results.history()
        assert np.all(np.diff(books["fine_share"]) >= 0)
        assert 0 < books["clipped_stretch"][-1] < 1
        assert len(results.breaks().step) > 500
        assert books["damped"][-1] > 0.05 * books["work"][-1]
