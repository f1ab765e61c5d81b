"""Names in models, names of files and words of a command line are shown as text by every command."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
import shutil
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.__main__ import main as pdmesh
from pdmesh.model.document import Load, Run, write_file
from pdmesh.model.node_grid import document_of
from pdpost.__main__ import main as pdpost
from pdsolve.model import Model
from pdsolve.run.simulation import simulate

NAMES = [
    "$x^$",
    "=HYPERLINK(1)",
    "a\nb" * 50,
    "\x1b[31m\x07",
    "\u202egnp",
    "<script>",
    "nul\0",
    "x" * 100_000,
    "_a,b;\"'",
]
FILES = ["$x^$", "=1", "a\nb", "\x1b[31m", "\u202egnp", "<script>", "b\udcff", "_,;\"'"]


def named(names: list[str]) -> Model:
    """A cracked plate that loads of these names pull apart."""
    grid = dataclasses.replace(square_grid(9, 6, y0=-2.5e-3), cracks=np.array([[0.0, 0.0, 3e-3, 0.0]]))
    top, low = (0.0, 1e-3, 8e-3, 3e-3), (0.0, -3e-3, 8e-3, -1e-3)
    loads = (
        Load(name=name, box=(low, top)[at % 2], body_force=(0.0, 1e10 * (2 * (at % 2) - 1)))
        for at, name in enumerate(names)
    )
    return plate(grid, conditions=tuple(loads), run=Run(time_step=50e-9, steps=2, every=1))


@pytest.fixture
def results(here: Path) -> Path:
    """The database of a plate of loads with hostile names, in the current folder."""
    simulate(named(NAMES), here / "wild.sqlite").close()
    return here / "wild.sqlite"


def quiet_terminal(capsys: pytest.CaptureFixture[str]) -> str:
    """What was printed, which no terminal obeys."""
    said = capsys.readouterr()
    assert (said.out + said.err).replace("\n", "").replace("\t", "").isprintable()
    return said.out + said.err


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Glyph")
def test_preview_shows_names(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = named(NAMES)
    write_file(document_of(model.grid, model.settings), here / "wild.json")
    with matplotlib.rc_context({"svg.fonttype": "none"}):  # text stays text
        assert pdmesh(["preview", "wild.json", "-o", "wild.svg"]) == 0
    assert pdmesh(["info", "wild.json"]) == 0
    assert len(quiet_terminal(capsys)) < 20_000
    picture = (here / "wild.svg").read_text()
    assert "$x^$" in picture
    assert "&lt;script&gt;" in picture
    assert len(picture) < 10**6


def test_a_table_holds_names_as_text(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["reaction", str(results), "--csv", "-"]) == 0
    rows = list(csv.reader(io.StringIO(quiet_terminal(capsys))))
    assert {len(row) for row in rows} == {len(rows[0])}
    cells = {row[0] for row in rows[1:]}
    assert len(cells) == len(NAMES)
    assert "'=HYPERLINK(1)" in cells
    assert not any(cell.lstrip().startswith(("=", "+", "-", "@")) for cell in cells)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Glyph")
def test_reaction_draws_names(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also one that begins with an underscore, which legends leave out."""
    assert pdpost(["reaction", str(results), "-o", "r.svg"]) == 0
    quiet_terminal(capsys)
    picture = results.with_name("r.svg").read_text()
    assert "$x^$ (load)" in picture
    assert "_a,b" in picture


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Glyph")
def test_compare_draws_names_of_files_and_titles(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(results, "$x^$.sqlite")
    assert pdpost(["compare", "$x^$.sqlite", "wild.sqlite", "-o", "c.svg"]) == 0
    assert "$x^$, " in Path("c.svg").read_text()
    assert pdpost(["compare", "$x^$.sqlite", "wild.sqlite", "--titles", "$\\a$,\x1b[1m", "-o", "d.png"]) == 0
    quiet_terminal(capsys)


@pytest.mark.quick_cases(8)
@pytest.mark.parametrize("name", FILES, ids=ascii)
@pytest.mark.parametrize("suffix", ["pvd", "xdmf"])
def test_files_that_name_others_do_so_in_plain_names(
    name: str, suffix: str, results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And the named ones are there."""
    path = results.with_name(f"{name}.{suffix}")
    assert pdpost(["export", str(results), "-o", str(path)]) == 0
    quiet_terminal(capsys)
    ElementTree.parse(path)
    listed = re.findall(r'file=(?:"([^"]*)"|\'([^\']*)\')|>([^<]*\.bin)<', path.read_text())
    files = {unescape("".join(one)) for one in listed}
    assert files
    assert all((path.parent / file).is_file() for file in files)


def test_views_of_gmsh_have_names_of_one_quoted_line(results: Path) -> None:
    """A line end, a quotation mark or a line that is too long would make Gmsh read what follows wrongly."""
    assert pdpost(["export", str(results), "-o", "wild.msh"]) == 0
    views = Path("wild.msh").read_bytes().split(b"$NodeData\n1\n")[1:]
    names = [view.split(b"\n1\n")[0] for view in views]
    assert all(re.fullmatch(rb'"[^"\n]{1,250}"', name) for name in names)
    assert sum(name.startswith(b'"load ') for name in names) == len(NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES, ids=ascii)
def test_a_report_of_a_file_of_any_name(name: str, results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(results, f"{name}.sqlite")
    assert pdpost(["report", f"{name}.sqlite"]) == 0
    quiet_terminal(capsys)
    page = Path(f"{name}.report.html").read_text(encoding="utf-8")
    assert "<script>" not in page
    assert "\x1b" not in page
    assert len(page) < 3_000_000


@pytest.mark.slow
def test_a_report_of_a_name_that_is_no_utf_8(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The parts of the page that are drawn are left out here."""
    from pdpost.figures import page

    monkeypatch.setattr(page, "_image", lambda *_: "")
    monkeypatch.setattr(page, "gif", lambda *_, **how: b"")
    shutil.copy(results, "b\udcff.sqlite")
    assert pdpost(["report", "b\udcff.sqlite"]) == 0
    text = Path("b\udcff.report.html").read_text(encoding="utf-8")
    assert "<title>b\\xff</title>" in text
    assert "&lt;script&gt;" in text
    assert "<script>" not in text


@pytest.mark.slow
def test_a_key_of_a_million_letters_is_one_short_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for key in ("k" * 1_000_000, "k " * 500_000):
        (here / "long.json").write_text(json.dumps({"notch": [], "nodes": [], key: 1}))
        assert pdmesh(["info", "long.json"]) == 2
        said = quiet_terminal(capsys)
        assert said.count("\n") == 1
        assert len(said) < 5000
        assert "long.json" in said


def test_a_word_of_100_000_letters_is_one_short_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["i" * 100_000], ["info", "x.json", "--" + "o" * 100_000], ["info", "n" * 100_000]):
        try:
            code = pdmesh(words)
        except SystemExit as end:
            code = int(end.code or 0)
        assert code == 2
        assert len(quiet_terminal(capsys)) < 5000


def test_tex_would_run_names(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["damage", str(results), "--set", "text.usetex=True"]) == 2
    assert "text.usetex" in quiet_terminal(capsys)
    assert pdpost(["damage", str(results), "-o", "x.pgf"]) == 2
    assert ".png" in quiet_terminal(capsys)
