"""The three programs on a body in space."""

from __future__ import annotations

import json
import re
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest
from matplotlib import colormaps
from messages import mentions, naming
from PIL import Image

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdpost.figures import field
from pdpost.figures.field_figure import notebook_png
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import read_model
from pdsolve.results import Results
from pdsolve.study import dispatch, one_run
from pdsolve.study.table import Table

SCENE = """
from pdmesh import Body, Box, Material
h = 0.1  # m: between nodes
thin = 0.4  # m
scene = (
    Body(Box((0, 0, 0), (1, 0.4, thin)), h, Material(E=1e6, rho=1000.0, G0=1e9))
    .crack([[[0.5, -1, 0.2], [0.5, 3, 0.2], [0.5, -1, 3]]]).fix("left").load("right", (1e3, 0, 10))
)
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A body that is built and solved, in a folder of its own."""
    folder = tmp_path_factory.mktemp("body")
    (folder / "body.py").write_text(SCENE)
    model, results = str(folder / "body.json"), str(folder / "body.sqlite")
    assert pdmesh(["build", str(folder / "body.py"), "--trust", "-o", model, "-q"]) == 0
    assert (
        pdsolve([model, "-o", results, "--set", "run.steps=20", "--set", "run.every=10", "--threads", "1", "-q"]) == 0
    )
    return folder


@pytest.mark.slow
def test_a_body_is_told_of(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdmesh(["info", str(solved / "body.json"), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert info["nodes"] == 160
    assert info["volume_of_nodes"] == pytest.approx(0.16)
    assert info["volume_of_shape"] == pytest.approx(0.16)
    assert (info["crack_segments"], info["bonds_cut_by_cracks"] > 0) == (1, True)
    assert pdmesh(["plan", str(solved / "body.py"), "--trust", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["scene"]["bonds"] == info["bonds"]
    assert plan["one_scale"]["nodes"] == 160


@pytest.mark.slow
def test_a_body_is_drawn(solved: Path) -> None:
    assert pdmesh(["preview", str(solved / "body.json"), "-o", str(solved / "body.png"), "-q"]) == 0
    assert (solved / "body.png").stat().st_size > 20_000


@pytest.mark.slow
@pytest.mark.parametrize("cubes", [False, True])
def test_a_body_is_exported(solved: Path, cubes: bool) -> None:
    path = solved / f"body{cubes}.vtu"
    assert pdpost(["export", str(solved / "body.sqlite"), "-o", str(path), "-q", *["--squares"] * cubes]) == 0
    mesh = meshio.read(path)
    (cells,) = mesh.cells
    assert (cells.type, len(cells.data)) == ("hexahedron" if cubes else "vertex", 160)
    with Results.open(solved / "body.sqlite") as results:
        uz = results.field("uz", 20)
    assert np.array_equal(mesh.point_data["displacement"][:: 8 if cubes else 1, 2], uz)
    assert mesh.points[:, 2].max() == pytest.approx(0.4 if cubes else 0.35)
    assert np.unique(mesh.point_data["volume"]) == pytest.approx([1e-3])


@pytest.mark.slow
def test_xdmf_and_csv_have_all_three_axes(solved: Path) -> None:
    for suffix in (".xdmf", ".csv"):
        assert pdpost(["export", str(solved / "body.sqlite"), "-o", str(solved / f"all{suffix}"), "-q"]) == 0
    assert (solved / "all.csv").read_text().splitlines()[0].startswith("node,x,y,z,delta,volume,ux,uy,uz,vx")
    assert "Polyvertex" in (solved / "all.xdmf").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "words", "said"),
    [
        (
            pdmesh,
            ["build", "body.py", "--trust", "--set", "thin=0.2"],
            re.escape("where the body is thinner than 3 of them"),
        ),
        (pdmesh, ["build", "body.py", "--trust", "--refine", "crack:1"], naming("--refine", found=("body", "space"))),
        (pdmesh, ["plan", "body.py", "--trust", "--within", "2%"], naming("--within", found=("body", "space"))),
        (
            pdmesh,
            ["plan", "body.py", "--trust", "--mode", "thesis"],
            naming(found=("space", "thesis")),
        ),
        (pdmesh, ["preview", "body.json", "--bonds"], naming("--bonds", found=("body", "space"))),
        (pdsolve, ["body.json", "--mode", "thesis"], naming(found=("space", "thesis"))),
        (pdsolve, ["body.json", "--adapt", "split"], naming(found="'split'", expected=("none", "hybrid", "body"))),
        (pdsolve, ["body.json", "--cracks", "particles"], naming(found="particles", expected=("bonds", "space"))),
        (
            pdpost,
            ["nodes", "body.sqlite"],
            naming(found=("body", "space"), expected=("damage", "animate")),
        ),
        (
            pdpost,
            ["damage", "body.sqlite", "--scale", "auto"],
            naming("--scale", found=("body", "space"), expected="leave it out"),
        ),
        (pdpost, ["damage", "body.sqlite", "--window", "0,0,1,1"], naming("--window", found=("body", "space"))),
        (pdpost, ["damage", "body.sqlite", "--frames", "0,1"], naming("--frames", found=("body", "space"))),
        (pdpost, ["velocity", "body.sqlite", "--component", "xx"], naming(expected=("magnitude", "x"))),
        (pdpost, ["content", "body.sqlite"], naming(found=("model", "mechanics"), expected=("diffusion", "content"))),
        (pdpost, ["history", "body.sqlite", "--at", "0.5,0.2"], naming("--at", found="2 numbers", expected="3")),
        (pdpost, ["crack", "body.sqlite", "--along", "right"], naming("--along", found=("body", "space"))),
        (pdpost, ["crack", "body.sqlite", "--window", "0,0,1,1"], naming("--window", found=("body", "space"))),
        (pdpost, ["crack", "body.sqlite", "--surface", "body.obj"], naming("body.obj", found=".obj", expected=".vtp")),
        (
            pdpost,
            ["line", "body.sqlite", "--from", "0,0", "--to", "1,0,0"],
            naming("--from", found="2 numbers", expected="3"),
        ),
    ],
)
def test_what_is_of_plates_is_refused_in_one_line(
    solved: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    program: object,
    words: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(solved)
    before = sorted(path.name for path in solved.iterdir())
    assert program([*words, "-o", "refused.pvd" if words[0] == "export" else "refused.png"]) == 2  # type: ignore[operator]
    error = capsys.readouterr().err
    assert re.search(said, error)
    assert error.count("\n") == 1
    assert sorted(path.name for path in solved.iterdir()) == before


@pytest.mark.slow
def test_a_notebook_shows_planes_of_a_body(solved: Path) -> None:
    assert read_model(solved / "body.json")._repr_svg_() is None
    with Results.open(solved / "body.sqlite") as results:
        assert (notebook_png(results) or b"")[:4] == b"\x89PNG"


@pytest.mark.slow
def test_planes_through_a_body_show_what_their_nodes_have(solved: Path) -> None:
    """The nodes on the one side of the middle, front, side and from above, each in the colour of its value."""
    with Results.open(solved / "body.sqlite") as results:
        figure, uz = field(results, "displacement", 20, part="z"), results.field("uz", 20)
        position = results.nodes().position
    largest = float(np.abs(uz).max())
    factor = {"displacement, z, mm": 1e3, "displacement, z, µm": 1e6}[figure.axes[-1].get_xlabel()]
    assert figure.axes[-1].get_xlim()[1] == pytest.approx(factor * largest, rel=1e-6)
    assert [axes.get_title() for axes in figure.axes[:3]] == ["y = 200 mm", "x = 500 mm", "z = 200 mm"]
    for axes, (axis, at) in zip(figure.axes, ((1, 0.25), (0, 0.55), (2, 0.25)), strict=False):
        rows = np.isclose(position[:, axis], at)
        (squares,) = axes.collections
        middle = np.array([path.vertices[:4].mean(axis=0) for path in squares.get_paths()])
        assert middle == pytest.approx(1e3 * np.delete(position[rows], axis, axis=1))
        expected = colormaps["coolwarm"]((uz[rows] / largest + 1) / 2)
        assert np.abs(squares.get_facecolor() - expected).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["strain", "stress"])
def test_strain_and_stress_of_a_body_are_drawn_and_tabled(
    solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    picture, table, exported = tmp_path / "drawn.png", tmp_path / "drawn.csv", tmp_path / "drawn.vtu"
    results = str(solved / "body.sqlite")
    assert pdpost([name, results, "--component", "yz", "-o", str(picture), "--csv", str(table), "-q"]) == 0
    assert picture.stat().st_size > 10_000
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert rows.dtype.names[4:] == (
        "damage",
        "separation",
        *(f"{name}_{part}" for part in ("largest", "smallest", "xx", "yy", "xy", "zz", "xz", "yz")),
        *(["stress_mises"] * (name == "stress")),
    )
    assert np.isfinite(rows[f"{name}_largest"]).all()
    assert pdpost(["export", results, "-o", str(exported), "--also", name, "-q"]) == 0
    tensors = meshio.read(exported).point_data[name].reshape(-1, 3, 3)
    assert np.array_equal(tensors, tensors.transpose(0, 2, 1))
    assert tensors[:, 1, 2] == pytest.approx(rows[f"{name}_yz"], rel=1e-6, abs=1e-12)


def test_a_line_through_a_body_has_its_places(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["line", str(solved / "body.sqlite"), "--from", "0.05,0.15,0.15", "--to", "0.95,0.15,0.15"]
    assert pdpost([*words, "--component", "z", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    with Results.open(solved / "body.sqlite") as results:
        nodes, uz = results.nodes(), results.field("uz", 20)
    row = np.isclose(nodes.position[:, 1:], 0.15).all(axis=1)
    assert found["values"]["displacement_z"][::2] == pytest.approx(uz[row][np.argsort(nodes.position[row, 0])])
    assert pdpost([*words, "--csv", "-"]) == 0
    assert capsys.readouterr().out.startswith('"along, m","x, m","y, m","z, m",')


@pytest.mark.slow
def test_a_film_of_a_body_has_its_frames(solved: Path) -> None:
    path = solved / "film.gif"
    assert pdpost(["animate", str(solved / "body.sqlite"), "--field", "velocity", "-o", str(path), "-q"]) == 0
    with Image.open(path) as film:
        assert film.n_frames == 3
        first = np.asarray(film.convert("RGB"), dtype=int)
        film.seek(2)
        assert np.abs(np.asarray(film.convert("RGB"), dtype=int) - first).max() > 50


def test_curves_of_a_body_know_z(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = str(solved / "body.sqlite")
    with Results.open(solved / "body.sqlite") as found:
        uz, work = found.field("uz", 20), float(found.history()[-1]["work"])
    asked = ["history", results, "--at", "1,0.4,0.4", "--component", "z", "--json"]
    assert pdpost(asked) == 0
    (curve,) = json.loads(capsys.readouterr().out)["curves"]
    assert (curve["place"], curve["value"][-1]) == (pytest.approx([0.95, 0.35, 0.35]), pytest.approx(uz[-1], rel=1e-6))
    assert pdpost(["history", results, "--box", "0,0,0,1,1,1", "--component", "z", "--json"]) == 0
    (curve,) = json.loads(capsys.readouterr().out)["curves"]
    assert (len(curve["nodes"]), curve["high"][-1]) == (160, pytest.approx(uz.max(), rel=1e-6))
    assert pdpost(["balance", results, "--json"]) == 0
    books = json.loads(capsys.readouterr().out)
    assert (books["units"], books["last"]["work"]) == ("SI", pytest.approx(work))
    assert pdpost(["reaction", results, "--condition", "right", "--component", "z", "--csv", "-"]) == 0
    head, *_, last = capsys.readouterr().out.splitlines()
    assert '"force z, N"' in head
    assert float(last.split(",")[6]) == pytest.approx(10 * 0.16)


@pytest.mark.slow
def test_a_report_of_a_body(solved: Path) -> None:
    path = solved / "body.html"
    assert pdpost(["report", str(solved / "body.sqlite"), "-o", str(path), "-q"]) == 0
    page = path.read_text()
    titles = [part.split("<")[0] for part in page.split("<h2>")[1:]]
    assert titles[:2] == ["Crack", "Animation"]
    assert page.count("<img") == 8  # the pre-crack, a film, four fields (nothing is damaged), energies and forces
    assert "nothing opened" in page
    assert "1.6e+08 mm³" in page


@pytest.mark.slow
def test_a_study_of_bodies_has_the_measures_that_they_have(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(solved)
    Path("study.toml").write_text('drawing = "body.py"\n[set.model]\nrun.steps = 20\nrun.every = 10\n')
    monkeypatch.setattr(dispatch, "task_solver", lambda workers: nullcontext(partial(map, one_run.solve_and_measure)))
    assert pdmesh(["plan", "study.toml", "-q", "--trust"]) == 0
    assert pdsolve(["study", "study.toml", "-q", "--trust"]) == 0
    with Table.open(Path("study.sqlite")) as table, Results.open(solved / "body.sqlite") as results:
        (row,), columns = table.rows(), table.columns()
        u = np.column_stack([results.field(name, 20) for name in ("ux", "uy", "uz")])
        place = results.nodes(0).position
    assert columns["strain"].unit == "J"
    assert "branching" not in columns
    assert row.values["largest_displacement"] == pytest.approx(np.linalg.norm(u, axis=1).max(), rel=1e-6)
    assert row.values["largest_stretch"] == pytest.approx(_stretch(place, u), rel=1e-5)
    assert pdpost(["study", "study.sqlite", "-o", "study.png", "-q"]) == 0
    capsys.readouterr()
    assert pdpost(["crack", "study.sqlite"]) == 2
    assert mentions(capsys.readouterr().err, found=("body", "space"), expected="plate")


def _stretch(place: np.ndarray, u: np.ndarray) -> float:
    """The largest of all pairs within a horizon of 3.5 spacings that the crack does not part."""
    one, other = np.triu_indices(len(place), 1)
    before = place[other] - place[one]
    middle = (0.5 - place[one, 0]) / np.where(before[:, 0] == 0, np.inf, before[:, 0])
    cut = (middle > 0) & (middle < 1) & (place[one, 2] + middle * before[:, 2] > 0.2 - 1e-9)
    long = np.linalg.norm(before, axis=1)
    after = np.linalg.norm(before + u[other] - u[one], axis=1)
    return float((after / long)[(long < 0.35) & ~cut].max() - 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "kernel"),
    [((), "blocks, fused march"), (("model=correspondence", "nu=0.25", "failure=none"), "listed, Verlet")],
)
def test_how_bonds_were_summed_is_said(
    solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], kernel: str
) -> None:
    words = [str(solved / "body.json"), "--set", "run.steps=2", "--threads", "1", "-o", str(tmp_path / "body.sqlite")]
    assert pdsolve([*words, *(word for value in more for word in ("--set", f"material.{value}"))]) == 0
    assert f"bond updates a second ({kernel})" in capsys.readouterr().out
