"""Every command of pdpost on a run whose nodes are born and die: each frame is of the nodes there were."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import pytest
from messages import mentions
from PIL import Image

from pdpost.__main__ import main
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.results import Results


@pytest.fixture
def given(moving: Path, here: Path) -> Path:
    """The run with a fine zone that moves, in the current folder."""
    return Path(shutil.copy(moving, here / "moving.sqlite"))


def counts(path: Path) -> dict[int, int]:
    """How many nodes each frame has."""
    with Results.open(path) as results:
        return {step: len(results.nodes(step).ids) for step in results.frames()[0].tolist()}


def said(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """What a command says with --json."""
    assert main([*arguments, "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    found: dict[str, Any] = json.loads(out)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["damage", "energy", "displacement", "stress"])
def test_fields_of_each_epoch(given: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """The numbers of a frame are those of its nodes, deformed or not."""
    for frame, (step, nodes) in enumerate(counts(given).items()):
        if frame in (2, 6):
            command = [name, str(given), "--frame", str(frame), "--csv", f"{frame}.csv", "-o", f"{frame}.png"]
            found = said([*command, "--scale", str(frame)], capsys)
            assert (found["step"], found["nodes"]) == (step, nodes)
            with open(f"{frame}.csv", newline="") as file:
                rows = list(csv.DictReader(file))
            with Results.open(given) as results:
                assert [int(row["node"]) for row in rows] == results.nodes(step).ids.tolist()
                if name == "damage":
                    values = [float(row["damage"]) for row in rows]
                    assert values == pytest.approx(damage_without_pre_cracks_at(results, step).tolist(), abs=1e-7)


@pytest.mark.slow
def test_nodes_and_bonds_of_each_epoch(given: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = []
    for frame, nodes in enumerate(counts(given).values()):
        if frame in (0, 6):
            found = said(["nodes", str(given), "--frame", str(frame), "-o", f"n{frame}.png"], capsys)
            assert sum(level["nodes"] for level in found["levels"]) == nodes
            found = said(["bonds", str(given), "--frame", str(frame), "-o", f"b{frame}.png"], capsys)
            broken.append(found["broken"])
    assert broken[0] == 0 < broken[1]


@pytest.mark.slow
def test_films_and_pages(given: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One size, one picture a frame; the page says that nodes change."""
    for name, scale in (("damage", "0"), ("velocity", "5")):
        assert main(["animate", str(given), "--field", name, "--scale", scale, "-q", "-o", f"{name}.gif"]) == 0
        with Image.open(f"{name}.gif") as film:
            assert film.n_frames == 7
    assert main(["watch", str(given), "-q"]) == 0
    assert main(["report", str(given), "-q"]) == 0
    page = Path("moving.report.html").read_text()
    assert mentions(page, "252 at the start", "300 at the end", "10 changes")
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_exports_of_each_epoch(given: Path) -> None:
    """Points and numbers of a frame are as many as its nodes; clouds are written when they change, and once."""
    nodes = counts(given)
    assert main(["export", str(given), "-o", "a.pvd", "--also", "strain", "-q"]) == 0
    for step, count in nodes.items():
        mesh = meshio.read(f"a/a_{step:08d}.vtu")
        assert len(mesh.points) == count
        assert {len(values) for values in mesh.point_data.values()} == {count}
    for squares in (False, True):
        assert main(["export", str(given), "-o", "a.xdmf", "-q", "--force", *["--squares"] * squares]) == 0
        root = ElementTree.parse("a.xdmf").getroot()
        for grid, count in zip(root.iterfind("Domain/Grid/Grid"), nodes.values(), strict=True):
            sizes = {int(item.attrib["Dimensions"].split()[0]) for item in grid.iter("DataItem")}
            assert sizes == ({4 * count, count} if squares else {count})
        places = {item.attrib["Seek"] for item in root.iterfind("Domain/Grid/Grid/Geometry/DataItem")}
        with Results.open(given) as results:
            assert len(places) == len({results.epoch(step) for step in nodes})
    assert main(["export", str(given), "-o", "a.csv", "--frame", "3", "-q"]) == 0
    assert len(Path("a.csv").read_text().splitlines()) == 1 + nodes[30]


@pytest.mark.slow
def test_numbers_over_time(given: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Crack, history, balance, reaction, tradeoff, sql."""
    found = said(["crack", str(given), "-o", "c.png"], capsys)
    assert found["first_break"]["step"] > 0
    assert found["branches"]
    area = sum(piece["area"] for piece in found["fragments"]["pieces"])
    area += found["fragments"]["crumbs_area"] + found["fragments"]["cracked_area"]
    assert area == pytest.approx(252e-6, rel=1e-9)
    early = said(["crack", str(given), "--step", "12", "-o", "d.png"], capsys)
    assert len(early["branches"]) < len(found["branches"])
    curves = said(["history", str(given), "--node", "700", "--at", "0.01,0.0005", "-o", "h.png"], capsys)["curves"]
    with Results.open(given) as results:
        there = [700 in results.nodes(step).ids for step in results.frames()[0].tolist()]
    assert [value is not None for value in curves[0]["value"]] == there
    assert len(set(there)) == 2
    assert None not in curves[1]["value"]
    assert said(["balance", str(given), "-o", "b.png"], capsys)["last"]["work"] > 0
    assert len(said(["reaction", str(given), "-o", "r.png"], capsys)["conditions"]) == 2
    found = said(["tradeoff", str(given), "--reference", str(given), "-o", "t.png"], capsys)
    with Results.open(given) as results:
        updates = results.bond_updates(60)
    assert found["points"][0]["bond_updates"] == updates
    assert found["points"][0]["worst"] < 1e-15
    tables = said(["sql", str(given)], capsys)["tables"]
    assert "birth" in tables["node"]["columns"]
    assert {"node_death", "epoch"} <= set(tables)


@pytest.mark.slow
def test_a_node_that_is_nowhere_is_refused(given: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["history", str(given), "--node", "99999"]) == 2
    assert mentions(capsys.readouterr().err, found="node 99999", expected="1")


@pytest.mark.slow
@pytest.mark.parametrize("words", ["damage", "strain", "nodes", "bonds", "history --at 0.05,0.12", "crack", "export"])
def test_a_fine_zone_that_moves(hybrid_results: Path, here: Path, words: str) -> None:
    """Coarse nodes beside fine ones: each command makes a picture or a table of the last frame."""
    name, *more = words.split()
    out = "x.csv" if name == "export" else "x.png"
    assert main([name, str(hybrid_results), *more, "-o", out, "-q"]) == 0
    assert (here / out).stat().st_size > 1000
