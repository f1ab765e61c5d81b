"""What is said of runs whose cells split: settings, what is refused, drawings, plans."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from messages import mentions, naming
from plates import GEOMETRIES, GLASS, plate, square_grid

from pdmesh.__main__ import main as build_command
from pdmesh.drawing.parameters import Parameters, run
from pdmesh.model.document import Absorb, Acceleration, Region, Run, Split, read_file, write_file
from pdmesh.model.node_grid import Grid, document_of
from pdmesh.quantities import UNITS
from pdsolve.__main__ import main as solve_command
from pdsolve.adaptivity.quadtree.operator import create_quadtree
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare, select_scheme


def off_lattice() -> Grid:
    """Nodes of two spacings."""
    grid = square_grid(9, 9)
    return dataclasses.replace(grid, delta=np.where(grid.position[:, 0] > 4e-3, 2e-3, 1e-3))


SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)
BOX = (0.0, 0.0, 1e-3, 1e-3)
NOTCH = 1e-3 * np.array([[0.0, 4.25, 4.0, 4.25]])


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (plate(square_grid(9, 9), material=SOFT), naming("material.law", found="bilinear", expected="brittle")),
        (plate(square_grid(9, 9), regions=(Region(box=BOX, material=SOFT),)), r"regions\[0\]\.material\.law"),
        (plate(square_grid(9, 9), conditions=(Absorb(box=BOX),)), r"conditions\[0\].*absorb"),
        (plate(square_grid(9, 9), conditions=(Acceleration(box=BOX, x=1.0),)), r"conditions\[0\].*acceleration"),
        (plate(square_grid(9, 9), run=Run(solver="static")), naming("run.solver", found="static", expected="explicit")),
        (plate(square_grid(9, 9), run=Run(start="static")), naming("run.start", found="static", expected="unloaded")),
        (plate(square_grid(9, 9), area_rule="eq19"), naming("area_rule", found="eq19", expected="cells")),
        (plate(off_lattice()), naming(found="spacings")),
        (
            plate(square_grid(9, 9), run=Run(split=Split(merge=0.5))),
            naming("split.merge", found="0.5", expected="less"),
        ),
        (
            plate(dataclasses.replace(square_grid(9, 9), cracks=NOTCH)),
            naming("notch[0]", found="(0.00025, 0.00425) m"),
        ),
    ],
)
def test_what_cannot_be_solved_so_is_refused(model: Model, words: str) -> None:
    """In one sentence that names the place."""
    run = msgspec.structs.replace(model.settings.run, adapt="split")
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with pytest.raises(ModelError, match=words) as error:
        _ = select_scheme(model, Options()), create_quadtree(model)
    assert str(error.value).endswith("as run.adapt is split")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--adapt", "split", "--set", "run.split.threshold=1.5"),
            re.escape("$.run.split.threshold"),
        ),
        (
            ("--adapt", "split", "--set", "run.split.threshold=0"),
            re.escape("$.run.split.threshold"),
        ),
        (
            ("--adapt", "split", "--set", "run.split.levels=9"),
            re.escape("$.run.split.levels"),
        ),
        (
            ("--adapt", "split", "--set", "run.split.treshold=0.5"),
            re.escape(".treshold is unknown"),
        ),
        (
            ("--adapt", "split", "--precision", "float32"),
            naming("precision", found="float32", expected=("float64", "run.adapt")),
        ),
        (
            ("--adapt", "split", "--mode", "thesis", "--set", "material.sight=diffraction"),
            naming("$.material.sight", found="'diffraction'", expected="visibility"),
        ),
        (("--set", "run.split.levels=2"), naming("run.split.levels", found="run.adapt none", expected="run.adapt")),
    ],
)
def test_bad_settings_get_one_line(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And exit code 2, before anything is written."""
    model, path = plate(square_grid(9, 9)), tmp_path / "plate.json"
    write_file(document_of(model.grid, model.settings), path)
    assert solve_command([str(path), *words, "-o", str(tmp_path / "plate.sqlite")]) == 2
    err = capsys.readouterr().err
    assert re.search(said, err)
    assert err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["plate.json"]


@pytest.mark.slow
def test_a_drawing_is_built_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The coarsest spacing everywhere; its zones say how often cells split; plans and dry runs say it is the start."""
    path = tmp_path / "plate.json"
    assert run(Parameters({"Peridynamics/Run/Adapt": "split"}, UNITS["m"])).adapt == "split"
    assert build_command(["build", str(GEOMETRIES / "duran50.geo"), "--adapt", "split", "-o", str(path), "-q"]) == 0
    document = read_file(path)
    assert (document.run.adapt, document.run.split.levels, len(document.nodes)) == ("split", 1, 1020)
    capsys.readouterr()
    assert solve_command([str(path), "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("1020 nodes, 19042 bonds, 1700 steps of 2.5e-08 s")
    assert mentions(said, "4080 nodes")
    assert build_command(["plan", str(GEOMETRIES / "duran50.geo"), "--set", "Run/Adapt=split"]) == 0
    planned = capsys.readouterr().out
    assert "nodes                           1020          4040" in planned
    assert planned.endswith("are those of the start; cells may split into 4080 nodes at most\n")
    assert build_command(["info", str(path)]) == 0
    assert mentions(capsys.readouterr().out, "4080 nodes")


@pytest.mark.parametrize("mode", ["conservative", "thesis"])
def test_bonds_between_cells_match_their_work_as_those_of_the_mode(mode: str) -> None:
    operator: Any = prepare(plate(square_grid(9, 9), 3, run=Run(adapt="split")), Options(mode)).system.operator
    assert operator.law.matches_work == operator.columns.matches_work == (mode == "conservative")
