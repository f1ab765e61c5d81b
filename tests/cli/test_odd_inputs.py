"""Inputs that are empty, large or damaged get one line; quiet hides no warning."""

from __future__ import annotations

import io
import json
import shutil
import sys
import time
import warnings
from argparse import Namespace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import shapely
from forged_databases import COMMANDS
from messages import mentions
from plates import GLASS
from tampered_databases import tampered

from pdmesh import Scene, box
from pdmesh.__main__ import main as pdmesh
from pdmesh.commandline import warnings_as_notes
from pdmesh.drawing.sandbox import gmsh_reader, mesh_reader
from pdmesh.drawing.sandbox.gmsh_reader import _silent
from pdmesh.grid.lattice import build_grid
from pdmesh.grid.pieces import faces_of, ligaments
from pdmesh.model.visibility import plate_of
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.measures.cracked_nodes import find_free_pre_crack_tips
from pdsolve.model import ModelNote, ModelWarning

NODES = [
    {"id": at, "border": "false", "position": [x, y, z], "hole_id": -1, "delta": [1e-3] * 3}
    for at, (x, y, z) in enumerate(np.ndindex(3, 3, 3), start=1)
]
BODY = {
    "version": 2,
    "notch": [],
    "nodes": [{**node, "position": [1e-3 * x for x in node["position"]]} for node in NODES],  # type: ignore[attr-defined]
    "material": {"E": 1e9, "rho": 1e3, "G0": 1.0, "plane": "space"},
}
MORE = {
    "history": [["--node", "1"], ["--box", "0,0,0.01,0.01"]],
    "reaction": [["--gap", "0,0", "0.01,0"]],
    "crack": [["--compare", "whole.sqlite"]],
    "export": [["-o", "out.xdmf"], ["-o", "out.msh"], ["-o", "out.pvd"]],
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [[name, *words] for name, usual in COMMANDS.items() for words in (usual, *MORE.get(name, []))],
    ids=lambda words: " ".join(words[:2]),
)
def test_no_command_reads_results_without_nodes(
    words: list[str], small_results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small_results.parent)
    shutil.copy(small_results, "whole.sqlite")
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM node")
    before = sorted(small_results.parent.iterdir())
    assert pdpost([words[0], small_results.name, *words[1:]]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert sorted(small_results.parent.iterdir()) == before


@pytest.mark.slow
def test_results_without_nodes_are_damaged(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM node")
    for words in (["history", "--node", "1"], ["history", "--box", "0,0,1,1"]):
        assert pdpost([words[0], str(small_results), *words[1:], "--json"]) == 2
        assert mentions(capsys.readouterr().err, small_results.name, "node", found="no")


def test_results_without_energies_have_no_tradeoff(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(small_results, "whole.sqlite")
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM history")
    assert pdpost(["tradeoff", small_results.name, "--reference", "whole.sqlite", "--force"]) == 2
    assert mentions(capsys.readouterr().err, found="no energies")


@pytest.mark.slow
def test_a_mesh_without_faces(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "bare.off").write_text("OFF\n\n3 0 0\n\n0 0 0\n1 0 0\n0 1 0\n")
    assert pdmesh(["build", "bare.off"]) == 2
    said = capsys.readouterr().err
    assert mentions(said, "bare.off", found="no face", expected="triangles")
    assert said.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("triangles", [[], [[[0, 0, 0], [2e-3, 0, 0], [0, 2e-3, 0]]]], ids=["no outline", "no edge"])
def test_preview_of_a_body_without_sharp_edges(triangles: list[object], here: Path) -> None:
    (here / "body.json").write_text(json.dumps({**BODY, "outline": triangles}))
    assert pdmesh(["preview", "body.json"]) == 0
    assert (here / "body.png").stat().st_size > 1000


def test_gmsh_that_says_nothing_gets_words() -> None:
    entry = {"name": "Peridynamics/Zones/body/Spacing", "type": "number", "values": [1e-6]}
    assert mentions(_silent([entry]), "1e-06", "memory", "spacing")
    assert mentions(_silent([]), "memory")


def test_an_error_of_gmsh_without_words_gets_some(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a drawing, of a mesh that is read, and of one whose elements are asked for."""
    logger = SimpleNamespace(start=lambda: None, get=lambda: ["Error   : "])
    option = SimpleNamespace(setNumber=lambda *_: None)
    fake = SimpleNamespace(logger=logger, option=option, merge=Mock(side_effect=Exception), initialize=lambda **_: None)
    monkeypatch.setitem(sys.modules, "gmsh", fake)
    for name, stand_in in (("limit_time", lambda _: None), ("_open", fake.merge), ("with_names", lambda *_: ([], []))):
        monkeypatch.setattr(gmsh_reader, name, stand_in)
    file = io.StringIO()
    gmsh_reader._read({"path": "a.geo", "cad": False, "walls": False, "seconds": 60}, file)
    assert mentions(json.loads(file.getvalue())["messages"][0], "memory")
    job = {"path": "a.msh", "reader": "gmsh", "tags": []}
    assert mentions(mesh_reader._found(job)[0]["error"], "Gmsh says", "memory", expected="fewer")
    monkeypatch.setattr(fake, "merge", Mock(side_effect=MemoryError("Unable to allocate 2 GiB")))
    monkeypatch.setattr(mesh_reader, "OTHERS", {"gmsh": SimpleNamespace(read=fake.merge)})
    assert mentions(mesh_reader._found(job)[0]["error"], "memory", expected="fewer")
    monkeypatch.setattr(mesh_reader, "OTHERS", {"gmsh": SimpleNamespace(read=Mock(side_effect=Exception))})
    assert mesh_reader._found(job)[0]["error"] == "Gmsh cannot read the file"


# ---- cracks of many points


def wave(count: int) -> np.ndarray:
    """Segments (count, 4), m, of a wavy crack in a plate of 40 x 20 mm."""
    x = np.linspace(2e-3, 22e-3, count + 1)
    points = np.column_stack([x, 0.0102 + 0.002 * np.sin(1e3 * x)])
    return np.hstack([points[:-1], points[1:]])


def test_tips_of_a_crack_of_30000_points() -> None:
    """They were sought pair by pair: 117 s for 30 000."""
    segments, start = wave(30_000), time.process_time()
    tips = np.array([tip for tip, _ in find_free_pre_crack_tips(segments)])
    assert np.array_equal(np.sort(tips[:, 0]), [segments[0, 0], segments[-1, 2]])
    assert time.process_time() - start < 20


@pytest.mark.slow
def test_thin_places_beside_a_crack_of_20000_points() -> None:
    """They are those beside the same crack of few points, in about the same time."""
    plate = Scene(box(0, 0, 0.04, 0.02), 1e-3, GLASS)
    places = []
    for count in (200, 20_000):
        line = wave(count)
        scene = plate.crack([tuple(line[0, :2]), *map(tuple, line[:, 2:])])
        grid = build_grid(scene)[0]
        shape = plate_of(grid)
        assert isinstance(shape, shapely.Polygon)
        start = time.process_time()
        places.append(ligaments(grid, faces_of(shape, grid)))
        assert time.process_time() - start < 20
    few, many = places
    assert len(few) == len(many)


# ---- quiet


def test_quiet_does_not_hide_that_a_file_is_damaged(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from pdmesh.model.document import read_document, write_file

    write_file(read_document(json.dumps({**BODY, "outline": []}), "body"), here / "body.json")
    text = (here / "body.json").read_text()
    (here / "body.json").write_text(text.replace('"E":1000000000.0', '"E":300000000.0'))
    assert (here / "body.json").read_text() != text
    for main, words in ((pdmesh, ["info", "body.json"]), (pdsolve, ["body.json", "--dry-run"])):
        assert main([*words, "-q"]) == 0  # type: ignore[operator]
        said = capsys.readouterr()
        assert said.out == ""
        assert mentions(said.err, "body.json", "$.digest", "damaged")


@pytest.mark.parametrize(("kind", "lines"), [(ModelWarning, 1), (ModelNote, 0)])
def test_quiet_hides_what_only_informs(kind: type[Warning], lines: int, capsys: pytest.CaptureFixture[str]) -> None:
    with warnings_as_notes("pdsolve", Namespace(quiet=True), ModelWarning):
        warnings.warn("plate.json: something", kind, stacklevel=1)
    assert capsys.readouterr().err.count("\n") == lines
