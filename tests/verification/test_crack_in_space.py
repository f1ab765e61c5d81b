"""A block with an edge crack that is pulled apart: a crack runs through the 8 x 4 mm that are left of its middle plane.

Two halves of 12 x 4 x 4 mm remain, and move apart.
"""

from __future__ import annotations

import csv
import json
import sys
import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from messages import mentions
from PIL import Image

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.measures.fragments import node_masses
from pdsolve.results import Results

SCENE = """
from pdmesh import Body, Box, Material
from pdmesh.model.document import Run
corners = [(-7e-3, -3e-3, 0), (-2e-3, -3e-3, 0), (-2e-3, 3e-3, 0), (-7e-3, 3e-3, 0)]
ramp = ((0, 0), (2e-6, 1))
glass = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
scene = (
    Body(Box((-6e-3, -2e-3, -4e-3), (6e-3, 2e-3, 4e-3)), 5e-4, glass, run=Run(duration=80e-6))
    .crack([[corners[i] for i in (0, 1, 2)], [corners[i] for i in (0, 2, 3)]])
    .move("top", velocity=(None, None, 0.10), profile=ramp)
    .move("bottom", velocity=(None, None, -0.10), profile=ramp)
)
"""
LIGAMENT = 32e-6  # m^2
HALF = 12e-3 * 4e-3 * 4e-3 * 2235  # kg


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the block."""
    folder = tmp_path_factory.mktemp("block")
    (folder / "block.py").write_text(SCENE)
    model, results = str(folder / "block.json"), folder / "block.sqlite"
    assert pdmesh(["build", str(folder / "block.py"), "--trust", "-o", model, "-q"]) == 0
    assert pdsolve([model, "-o", str(results), "--threads", "1", "-q"]) == 0
    return results


def numbers(results: Path, capsys: pytest.CaptureFixture[str], *more: str) -> dict[str, Any]:
    """What `pdpost crack --json` says."""
    assert pdpost(["crack", str(results), "--json", *more]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
def test_area_speed_and_fragments(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Measured: area 1.001 of the ligament's; masses 0.999 of a half; 1.17 G0, as bonds break beside a running crack
    too; a median of 0.42 of the Rayleigh speed."""
    found = numbers(block, capsys)
    assert found["area"] == pytest.approx(LIGAMENT, rel=0.05)
    assert found["pre_crack_area"] == pytest.approx(16e-6, rel=0.02)
    assert found["dissipated_over_area"] / found["G0"] == pytest.approx(1.17, rel=0.05)
    assert 0.3 < found["speed"]["median"] / found["rayleigh_speed"] < 0.8
    pieces = found["fragments"]["pieces"]
    assert [piece["mass"] for piece in pieces] == pytest.approx([HALF, HALF], rel=0.02)
    assert sorted(piece["centre"][2] for piece in pieces) == pytest.approx([-2e-3, 2e-3], abs=2e-5)
    lower, upper = sorted(pieces, key=lambda piece: piece["centre"][2])
    assert lower["velocity"][2] < 0 < upper["velocity"][2]
    with Results.open(block) as results:
        whole = node_masses(results, found["step"]).sum()
    crumbs = found["fragments"]["crumbs_mass"]
    assert sum(piece["mass"] for piece in pieces) + crumbs == pytest.approx(whole, rel=1e-12)
    assert whole == pytest.approx(2 * HALF, rel=1e-12)


@pytest.mark.slow
def test_before_it_runs_its_front_is_that_of_the_pre_crack(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = numbers(block, capsys, "--step", "10")
    assert (found["area"], found["speed"], found["first_opened"]) == (0, None, None)
    (front,) = found["fronts"]
    assert np.abs(np.diff(np.array(front)[:, 1])).sum() == pytest.approx(4e-3, rel=1e-6)
    assert np.array(front)[:, 0] == pytest.approx(-2e-3, abs=1e-9)
    assert len(found["fragments"]["pieces"]) == 1


@pytest.mark.slow
def test_its_surface_is_exported(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for suffix in (".stl", ".vtp"):
        found = numbers(block, capsys, "--surface", str(tmp_path / f"crack{suffix}"))
    mesh = meshio.read(tmp_path / "crack.stl")
    (cells,) = mesh.cells
    corners = mesh.points[cells.data]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(found["area"] + found["pre_crack_area"], rel=1e-6)
    text = (tmp_path / "crack.vtp").read_text()
    assert f'NumberOfPolys="{found["faces"]}"' in text
    assert [name for name in ("opened", "speed", "area") if f'Name="{name}"' in text] == ["opened", "speed", "area"]
    assert pdpost(["crack", str(block), "--json", "--surface", str(tmp_path / "crack.vtp")]) == 2
    assert "--force" in capsys.readouterr().err


@pytest.mark.slow
def test_its_picture(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture, numbers = tmp_path / "crack.png", tmp_path / "crack.csv"
    assert pdpost(["crack", str(block), "-o", str(picture), "--csv", str(numbers)]) == 0
    assert picture.stat().st_size > 30_000
    said = capsys.readouterr().out
    assert "2 fragments" in said
    head, *_, last = csv.reader(numbers.read_text().splitlines())
    assert head[2] == "area, m^2"
    assert float(last[2]) == pytest.approx(LIGAMENT, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [["render", "--crack"], ["render", "--explode", "0.5"], ["damage", "--clip", "y=0"], ["damage"]],
    ids="-".join,
)
def test_it_is_rendered(block: Path, tmp_path: Path, words: list[str]) -> None:
    pytest.importorskip("pyvista")
    path = tmp_path / "look.png"
    assert pdpost([words[0], str(block), *words[1:], "-q", "-o", str(path)]) == 0
    seen = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
    assert len(np.unique(seen, axis=0)) > 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "one", "other"),
    [
        (["--crack", "--explode", "1"], "--crack", "--explode"),
        (["--explode", "1", "--plane", "z=0"], "--explode", "--plane"),
    ],
)
def test_what_does_not_go_together(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], one: str, other: str
) -> None:
    assert pdpost(["render", str(block), *words, "-o", str(tmp_path / "look.png")]) == 2
    assert mentions(capsys.readouterr().err, one, found=other)


def test_to_cut_a_body_open_takes_pyvista(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    assert pdpost(["damage", str(block), "--clip", "y=0", "-o", str(tmp_path / "open.png")]) == 2
    assert mentions(capsys.readouterr().err, found="PyVista", expected="pip install 'pdsuite[render]'")
    assert not (tmp_path / "open.png").exists()


@pytest.mark.slow
def test_without_pyvista_damage_is_drawn_on_planes(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    assert pdpost(["damage", str(block), "-o", str(tmp_path / "planes.png")]) == 0
    said = capsys.readouterr().err
    assert "pip install 'pdsuite[render]'" in said
    assert said.count("\n") == 1
    assert (tmp_path / "planes.png").exists()


@pytest.mark.slow
def test_a_film_of_a_body_cut_open(block: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    path = tmp_path / "film.gif"
    words = [
        "animate",
        str(block),
        "--clip",
        "y=0",
        "--stride",
        "5",
        "--style",
        "savefig.dpi=50",
        "-q",
        "-o",
        str(path),
    ]
    assert pdpost(words) == 0
    with Image.open(path) as film, Results.open(block) as results:
        assert film.n_frames == len(results.frames()[0][::5])
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)
        assert (np.abs(np.asarray(film.convert("RGB")) - first).max(axis=2) > 60).mean() > 0.005


@pytest.mark.slow
def test_paraview_opens_frames_with_their_cracks(block: Path, tmp_path: Path) -> None:
    """Each frame is two parts: its nodes, and the surface of the cracks then."""
    path = tmp_path / "block.pvd"
    assert pdpost(["export", str(block), "-q", "-o", str(path)]) == 0
    parts = ElementTree.parse(path).findall(".//DataSet")
    with Results.open(block) as results:
        steps = results.frames()[0].tolist()
    assert [each.get("part") for each in parts] == ["0", "1"] * len(steps)
    faces = []
    for each in parts[1::2]:
        piece = ElementTree.parse(tmp_path / str(each.get("file"))).find(".//Piece")
        assert piece is not None
        faces.append(int(piece.get("NumberOfPolys", "-1")))
    assert faces[0] > 0  # of the pre-crack
    assert all(later > 0.98 * before for before, later in pairwise(faces))  # crumbs that come loose take some along
    assert faces[-1] > 2 * faces[0]


@pytest.mark.slow
def test_vtk_reads_the_last_frame_with_its_crack(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One file to open: all nodes with their fields, and the faces of the crack with when they opened."""
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "block.pvd"
    assert pdpost(["export", str(block), "--also", "strain,stress", "-q", "-o", str(path)]) == 0
    reader = pyvista.get_reader(path)
    reader.set_active_time_value(reader.time_values[-1])
    body, crack = reader.read()
    with Results.open(block) as results:
        uz, nodes = results.field("uz", int(results.frames()[0][-1])), results.nodes()
    assert np.array_equal(body.points, nodes.position)
    assert np.array_equal(body.point_data["displacement"][:, 2], uz)
    assert {"displacement", "velocity", "damage", "strain", "stress", "volume"} <= set(body.point_data)
    found = numbers(block, capsys)
    assert crack.n_cells == found["faces"]
    assert set(crack.cell_data) == {"opened", "speed", "area"}
    assert crack.cell_data["opened"].max() > found["first_opened"]
    drawn = crack.triangulate().compute_cell_sizes(length=False, volume=False).cell_data["Area"].sum()
    assert drawn == pytest.approx(found["area"] + found["pre_crack_area"], rel=1e-3)


@pytest.mark.slow
def test_what_opened_is_the_notch_of_another_run(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The triangles have 1.001 of the ligament's area, and part the block into its two halves from the start."""
    model, again = tmp_path / "next.json", tmp_path / "next.sqlite"
    assert pdpost(["notch", str(block), "--json", "-o", str(model)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["area"] == pytest.approx(LIGAMENT, rel=0.05)  # measured 1.001
    corners = np.array(json.loads(model.read_text())["notch"]).reshape(-1, 3, 3)
    assert corners.reshape(-1, 9).tolist() == said["triangles"]
    area = np.linalg.norm(np.cross(corners[2:, 1] - corners[2:, 0], corners[2:, 2] - corners[2:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(said["area"], rel=1e-12)  # without the two of the pre-crack, which come first
    assert pdsolve([str(model), "--set", "run.steps=2", "-o", str(again), "--threads", "1", "-q"]) == 0
    found = numbers(again, capsys)
    assert found["area"] == 0
    assert found["pre_crack_area"] == pytest.approx(16e-6 + LIGAMENT, rel=0.05)
    pieces = found["fragments"]["pieces"]
    assert [piece["mass"] for piece in pieces] == pytest.approx([HALF, HALF], rel=0.02)
    assert pdpost(["notch", str(again), "-q", "-o", str(tmp_path / "same.json")]) == 0
    assert json.loads((tmp_path / "same.json").read_text())["notch"] == said["triangles"]


def test_before_anything_opened_the_notch_is_the_pre_crack(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["notch", str(block), "--frame", "0", "--csv", "-"]) == 0
    head, *rows = csv.reader(capsys.readouterr().out.splitlines())
    assert head == ["triangle", "x, m", "y, m", "z, m"]
    with Results.open(block) as results:
        assert np.array(rows, dtype=float)[:, 1:].reshape(-1, 9).tolist() == results.cracks().tolist()
