"""Runs that were killed before their first frame begin anew; files are named by paths; processors are told apart."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from database_contents import contents
from messages import mentions

from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main
from pdsolve.model import Model
from pdsolve.results import Results, StateKind, state_of
from pdsolve.results.writer import _connected
from pdsolve.run import recorder
from pdsolve.run.simulation import simulate

PLATE = Path("plate.sqlite")


@pytest.fixture
def model(here: Path, probed: Model) -> Path:
    """A plate in a folder."""
    (here / "plate.json").write_text(probed.to_json())
    return Path("plate.json")


def leave_empty(how: str) -> None:
    """Leave a database as a killed run does, before its first transaction."""
    if how == "touched":
        PLATE.touch()
    else:
        _connected(PLATE).close()
        assert PLATE.stat().st_size > 0


@pytest.mark.parametrize("how", ["touched", "begun"])
def test_an_empty_file_is_taken_over(how: str, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    leave_empty(how)
    assert main([str(model), "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    assert state_of(PLATE).kind is StateKind.FINISHED


@pytest.mark.parametrize("how", ["touched", "begun"])
def test_resuming_an_empty_file_begins_anew(
    how: str, model: Path, probed: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second line of the job script of docs/how_to/clusters.md."""
    leave_empty(how)
    assert main(["--resume", str(PLATE), "--set", "run.steps=3"]) == 2
    assert capsys.readouterr().err.startswith("pdsolve: --resume keeps the options of the run; leave out --set")
    assert main(["--resume", str(PLATE)]) == 0
    out, err = capsys.readouterr()
    assert mentions(out.splitlines()[0], "plate.sqlite")
    assert err.splitlines()[0].startswith("pdsolve: warning: plate.sqlite: nothing in it")
    assert "plate.json is solved anew" in err.splitlines()[0]
    simulate(probed, Path("alone.sqlite")).close()
    assert contents(PLATE) == contents(Path("alone.sqlite"))


def test_an_empty_file_without_its_model_is_refused(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    PLATE.touch()
    model.unlink()
    assert main(["--resume", str(PLATE)]) == 2
    out, err = capsys.readouterr()
    assert (out, len(err.splitlines())) == ("", 1)
    assert mentions(err, "plate.sqlite")
    assert PLATE.stat().st_size == 0


def leave_something(what: str) -> None:
    """Leave a file with contents at the place of the results."""
    if what == "a database":
        with closing(sqlite3.connect(PLATE)) as connection:
            connection.execute("CREATE TABLE mine (number)")
    else:
        PLATE.write_bytes(b"\0" if what == "a byte" else b"SQLite format 3\0")


@pytest.mark.parametrize("what", ["a byte", "a head", "a database"])
def test_a_file_with_contents_is_never_taken_over(what: str, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    leave_something(what)
    before = PLATE.read_bytes()
    assert main([str(model)]) == 2
    assert mentions(capsys.readouterr().err, "plate.sqlite", "--force")
    assert main(["--resume", str(PLATE)]) == 2
    assert PLATE.read_bytes() == before


@pytest.mark.parametrize("name", ["file:x.sqlite", "file:x.sqlite?mode=memory", "file:%2e%2e/x"])
def test_a_name_like_a_uri_is_a_file_of_this_folder(name: str, model: Path, here: Path) -> None:
    path = Path(name)
    path.parent.mkdir(exist_ok=True)
    before = {file.name for file in here.parent.iterdir()}
    assert main([str(model), "-o", name, "-q"]) == 0
    assert path.stat().st_size > 0
    assert main(["--resume", name, "-q"]) == 0
    assert pdpost(["sql", name]) == 0
    expected = {"plate.json", Path(name).parts[0]}
    assert {file.name for file in here.iterdir()} == expected
    assert {file.name for file in here.parent.iterdir()} == before


def test_another_kind_of_processor_is_said(
    model: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(recorder, "processor_kind", lambda: "elsewhere")
    simulate_some(model)
    assert main(["--resume", str(PLATE)]) == 0
    err = capsys.readouterr().err
    assert len([line for line in err.splitlines() if "processor" in line]) == 1
    assert mentions(err, "plate.sqlite", "processor", "elsewhere", "bit-identical")
    with Results.open(PLATE) as results:
        assert results.meta()["processor"] != "elsewhere"


def test_the_same_kind_of_processor_is_not(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate_some(model)
    assert main(["--resume", str(PLATE)]) == 0
    assert capsys.readouterr().err == ""


def simulate_some(model: Path) -> None:
    """Solve a part of a run."""
    from pdsolve.model import read_model

    simulate(read_model(model), PLATE, watch=lambda progress: progress.step >= 20).close()
    assert state_of(PLATE).kind is StateKind.STOPPED
