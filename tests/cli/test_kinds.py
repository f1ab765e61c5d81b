"""A file of another kind is called what it is, with the command that takes it; a misspelt word gets the nearest."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from messages import mentions
from plates import GEOMETRIES

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

PROGRAMS = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost}
DRAWING, MODEL, RESULTS, STUDY = "a plate.geo", "plate.json", "small.sqlite", "plate.toml"
TAKES = {
    DRAWING: "a drawing, .*`pdmesh build 'a plate.geo'`",
    MODEL: "a model in JSON, .*`pdsolve plate.json`",
    RESULTS: "a database of results, .*`pdpost report small.sqlite` .*`pdsolve --resume small.sqlite`",
    STUDY: "a study in TOML, .*`pdsolve study plate.toml`",
}


@pytest.fixture
def files(small_results: Path, here: Path) -> Path:
    """A folder with a file of each kind."""
    shutil.copy(GEOMETRIES / "duran50.geo", DRAWING)
    Path(MODEL).write_text('{"nodes": []}')
    Path(STUDY).write_text("")
    Path("folder.json").mkdir()
    return here


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("words", "wrong", "expected"),
    [
        ("pdsolve", [DRAWING, RESULTS, STUDY], "a model in JSON"),
        ("pdsolve --resume", [DRAWING, MODEL, STUDY], "a database of results"),
        ("pdsolve study", [DRAWING, MODEL, RESULTS], "a study in TOML"),
        ("pdmesh build", [RESULTS, STUDY], "a drawing or a model in JSON"),
        ("pdmesh info", [RESULTS, STUDY], "a drawing or a model in JSON"),
        ("pdmesh preview", [RESULTS, STUDY], "a drawing or a model in JSON"),
        ("pdmesh params", [RESULTS, STUDY], "a drawing or a model in JSON"),
        ("pdmesh plan", [RESULTS], "a drawing or a model in JSON or a study in TOML"),
        ("pdpost damage", [DRAWING, MODEL, STUDY], "a database of results"),
        ("pdpost study", [DRAWING, MODEL, STUDY], "a database of results"),
        ("pdpost tradeoff small.sqlite --reference", [DRAWING, MODEL, STUDY], "a database of results"),
        ("pdpost crack small.sqlite --compare", [DRAWING, MODEL, STUDY], "a database of results"),
    ],
)
def test_a_file_of_another_kind(
    words: str, wrong: list[str], expected: str, files: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whatever it would have written, before it looks at that."""
    program, *options = words.split()
    before = sorted(files.iterdir())
    for file in [*wrong, "folder.json"]:
        assert PROGRAMS[program]([*options, file]) == 2
        out, err = capfd.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert f": {file}" in err
        assert expected in err
        assert re.search(TAKES.get(file, "a folder; "), err), err
    assert sorted(files.iterdir()) == before


def test_what_a_file_is_goes_by_what_is_in_it_where_that_says(
    small_results: Path, here: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(small_results, "small.json")
    Path("model").write_text(' {"nodes": []}')
    assert pdsolve(["small.json"]) == 2
    assert mentions(capfd.readouterr().err, "small.json", found=("database", "results"))
    assert pdpost(["crack", "model"]) == 2
    assert mentions(capfd.readouterr().err, "model", found="JSON")


@pytest.mark.parametrize(
    ("words", "found", "expected"),
    [
        ("pdpost damge x.sqlite", "damge", "'damage'"),
        ("pdmesh biuld x.geo", "biuld", "'build'"),
        ("pdsolve stdy x.toml", "stdy", "words study and fit"),
        ("pdsolve Study", "Study", "words study and fit"),
        ("pdsolve x.json --adapt hybird", "hybird", "'hybrid'"),
        ("pdsolve x.json --treads 2", "--treads", "--threads"),
        ("pdsolve study x.toml --wrokers=2", "--wrokers=2", "--workers"),
        ("pdpost damage x.sqlite --zzz", "--zzz", "leave it out"),
        ("pdpost sif x.sqlite --evry 5", "--evry", "--every"),
        ("pdmesh build x.geo --refien crack:4e-3", "--refien", "--refine"),
        ("pdmesh build x.geo y.json", "y.json", "leave it out"),
    ],
)
def test_a_misspelt_word(words: str, found: str, expected: str, here: Path, capfd: pytest.CaptureFixture[str]) -> None:
    program, *options = words.split()
    with pytest.raises(SystemExit) as stop:
        PROGRAMS[program](options)
    out, err = capfd.readouterr()
    assert (stop.value.code, out, err.count("\n")) == (2, "", 1)
    assert mentions(err, f"'{found}'", expected)


def test_a_word_like_no_other_gets_them_all(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        pdmesh(["xyzzy"])
    assert mentions(capfd.readouterr().err, found="'xyzzy'", expected=("preview", "params"))
