"""The commands of pdpost that find numbers: pictures, JSON, tables, and one line for what is wrong."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import sqlite3
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from tampered_databases import tampered

from pdpost.__main__ import main
from pdsolve.results import Results

COMMANDS = ("history", "balance", "reaction", "crack")


def found(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict:
    """What a command says with --json."""
    assert main([*arguments, "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    result: dict = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    return result


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_picture_by_default_and_numbers_without(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """small.NAME.png in the current folder; --json or --csv alone draw none; SVG and PDF by -o."""
    assert main([command, str(small_results), "--json"]) == 0
    assert main([command, str(small_results), "--csv", "-"]) == 0
    assert list(here.glob("*.png")) == []
    assert main([command, str(small_results)]) == 0
    picture = here / f"small.{command}.png"
    assert picture.stat().st_size > 10_000
    before = picture.read_bytes()
    assert main([command, str(small_results)]) == 2
    assert mentions(capsys.readouterr().err, found="already exists")
    assert main([command, str(small_results), "--force", "-q"]) == 0
    assert picture.read_bytes() == before
    assert capsys.readouterr() == ("", "")
    for name in ("x.svg", "x.pdf"):
        assert main([command, str(small_results), "-o", name, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["output"] == name
        assert (here / name).stat().st_size > 5_000


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("command", COMMANDS)
def test_tables_have_a_header_and_numbers(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert main([command, str(small_results), "--csv", "-"]) == 0
    header, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert any("time, s" in name for name in header)
    assert len(rows) > 3
    assert {len(row) for row in rows} == {len(header)}
    assert main([command, str(small_results), "--csv", "x.csv", "-q"]) == 0
    assert (here / "x.csv").read_text().splitlines()[0].count(",") >= len(header) - 1
    assert main([command, str(small_results), "--csv", "x.csv", "-o", "late.png"]) == 2
    assert not (here / "late.png").exists()
    assert main([command, str(small_results), "--csv", "-", "--json"]) == 2


def test_the_history_of_a_place_says_which_node(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(7.2, 0.9) mm: the node at (7, 0.5) mm, 0.45 mm off; its numbers are those of the view."""
    result = found(["history", str(small_results), "--at", "0.0072,0.0009", "--component", "y"], capsys)
    (curve,) = result["curves"]
    (node,) = curve["nodes"]
    assert curve["place"] == pytest.approx([7e-3, 0.5e-3])
    assert curve["off"] == pytest.approx(np.hypot(0.2e-3, 0.4e-3))
    connection = sqlite3.connect(small_results)
    rows = connection.execute("SELECT time, uy FROM node_state WHERE node = ?", (node,)).fetchall()
    connection.close()
    assert list(zip(curve["time"], curve["value"], strict=True)) == rows


def test_several_curves_in_the_order_asked_for(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    places = ["--box", "0,0,0.002,0.001", "--node", "9", "--at", "0.02,0.0055"]
    result = found(["history", str(small_results), *places, "--quantity", "velocity"], capsys)
    assert [curve["label"] for curve in result["curves"]] == ["mean of 3 nodes", "node 9", "node 252"]
    assert (result["quantity"], result["unit"]) == ("velocity", "m/s")


@pytest.mark.slow
def test_several_components_at_once(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A curve for each, in the figure too, each as it is alone."""
    words = ["history", str(small_results), "--node", "9", "--component", "x", "--component", "y"]
    result = found(words, capsys)
    assert [curve["component"] for curve in result["curves"]] == result["components"] == ["x", "y"]
    for part, curve in zip("xy", result["curves"], strict=True):
        assert found([*words[:4], "--component", part], capsys)["curves"] == [curve]
    assert main([*words, "-o", "a.svg", "-q"]) == 0
    drawn = (here / "a.svg").read_text()
    assert drawn.count("node 9 at") == 2
    assert main([*words, "--csv", "-"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert {row["component"] for row in rows} == {"x", "y"}
    assert [curve["component"] for curve in found(words[:4], capsys)["curves"]] == ["magnitude"]


@pytest.mark.slow
def test_the_crack_of_the_whole_plate(solved: Callable[[str], Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Duran 50, conservative: a trunk from the pre-crack's tip and two arms, slower than 0.6 of the Rayleigh speed."""
    result = found(["crack", str(solved("conservative"))], capsys)
    assert result["along"] == "right"
    assert result["start"]["step"] == pytest.approx(366, abs=4)
    assert result["rayleigh_speed"] == pytest.approx(3036, abs=1)
    (trunk,) = [branch for branch in result["branches"] if branch["along"][0] == 0]
    arms = [branch for branch in result["branches"] if branch["along"][0] > 0]
    assert trunk["points"][0] == pytest.approx([50e-3, 0.0])
    assert len(arms) == 2
    assert arms[0]["length"] == pytest.approx(arms[1]["length"], rel=1e-9)
    speeds = [speed for branch in result["branches"] for speed in branch["speed"] if speed is not None]
    assert 0.2 < min(speeds) / 3036 < max(speeds) / 3036 < 0.6  # measured 0.32 and 0.51
    for branch in result["branches"]:
        assert branch["time"] == sorted(branch["time"])
        bands = zip(branch["speed_low"], branch["speed"], branch["speed_high"], strict=True)
        assert all(low <= speed <= high for low, speed, high in bands if speed is not None)
    spent = np.array(result["release"]["value"], dtype=float) / result["release"]["G0"]
    assert np.nanmedian(spent) == pytest.approx(1.16, abs=0.15)  # measured 1.16, from 1.01 to 1.62
    (fork,) = result["forks"]
    assert fork["place"] == pytest.approx([68.5e-3, 0.0], abs=3e-3)  # measured 68.4 mm
    assert fork["angle"] == pytest.approx(59, abs=10)  # measured 58.7 degrees; in the thesis mode 43.0
    assert [piece["nodes"] for piece in result["fragments"]["pieces"]] == [2464]


@pytest.mark.slow
def test_two_modes_compared(solved: Callable[[str], Path], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = str(solved("conservative")), str(solved("thesis"))
    result = found(["crack", one, "--compare", other, "-o", "both.png"], capsys)
    assert (here / "both.png").is_file()
    assert result["mean"] == pytest.approx(1.33e-3, abs=0.3e-3)  # measured 1.33 mm
    assert result["hausdorff"] == pytest.approx(3.35e-3, abs=0.7e-3)  # measured 3.35 mm
    assert result["start"] == pytest.approx(0.3e-6, abs=0.2e-6)  # steps 378 and 366 of 25 ns
    back = found(["crack", other, "--compare", one], capsys)
    assert back["mean"] == pytest.approx(result["mean"], rel=1e-12)
    assert back["start"] == -result["start"]
    same = found(["crack", one, "--compare", one], capsys)
    assert (same["mean"], same["hausdorff"], same["start"]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


@pytest.mark.slow
def test_cracks_of_two_plates_are_not_compared(
    small_results: Path, solved: Callable[[str], Path], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["crack", str(solved("thesis")), "--compare", str(small_results)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert mentions(err, small_results, found=("(-0.0005, -0.006)", "(0.0205, 0.006) m"))
    assert list(here.glob("*.png")) == []


@pytest.mark.process
def test_the_queries_that_sql_prints_work(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In Python's sqlite3, and in the program where it is installed; and the tables are those of the file."""
    result = found(["sql", str(small_results)], capsys)
    assert main(["sql", str(small_results)]) == 0
    printed = capsys.readouterr().out
    connection = sqlite3.connect(small_results)
    assert len(result["queries"]) == 3
    assert result["queries"][0]["sql"] == "SELECT time, uy FROM node_state WHERE node = 7"
    for query in result["queries"]:
        rows = connection.execute(query["sql"]).fetchall()
        assert rows
        assert f'sqlite3 {small_results} "{query["sql"]}"' in printed
        program = shutil.which("sqlite3")
        if program is not None:
            command = [program, "-readonly", str(small_results), query["sql"]]
            lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
            assert len(lines) == len(rows)
    assert sum(row[1] for row in rows) == connection.execute("SELECT count(*) / 2 FROM bond_break").fetchone()[0]
    for name, table in result["tables"].items():
        described = connection.execute(f"SELECT * FROM {name} LIMIT 1").description
        assert list(table["columns"]) == [column[0] for column in described]
    assert result["tables"]["reaction"]["columns"]["force_y"] == "N/m"
    connection.close()


@pytest.mark.slow
def test_the_report_is_one_page(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All sections, pictures inside, nothing from elsewhere, the same bytes twice."""
    shutil.copy(small_results, here / "a<b>.sqlite")
    assert main(["report", "a<b>.sqlite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["output"] == "a<b>.report.html"
    page = (here / "a<b>.report.html").read_text()
    assert "<title>a&lt;b&gt;</title>" in page
    assert "<b>" not in page
    for title in ("Scene", "Grid", "Settings", "Provenance", "Balance", "Crack", "Fields at 3 µs", "Animation"):
        assert f"<h2>{title}</h2>" in page
    assert page.count('src="data:image/png;base64,') == 9  # scene, balance, reactions, crack, five fields
    assert page.count('src="data:image/gif;base64,') == 1
    assert page.count("src=") == 10
    assert "http" not in page
    assert len(page) < 2e6
    assert main(["report", "a<b>.sqlite", "--force", "-q"]) == 0
    assert (here / "a<b>.report.html").read_text() == page


def other_file(path: Path) -> None:
    """A database of another program."""
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE t (x)")
    connection.commit()
    connection.close()


def older_file(path: Path) -> None:
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA user_version = 1")
    connection.close()


def half_file(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def empty_run(path: Path) -> None:
    """A run that has just been created: tables, no frame."""
    with tampered(path) as connection:
        for table in ("frame", "field_chunk", "bond_break", "history", "probe", "reaction", "checkpoint"):
            connection.execute(f"DELETE FROM {table}")


def locked_file(path: Path) -> None:
    """A database that another program is in the middle of writing."""
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA locking_mode = EXCLUSIVE")
    connection.execute("BEGIN EXCLUSIVE")
    LOCKS.append(connection)


LOCKS: list[sqlite3.Connection] = []


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("command", [*COMMANDS, "sql", "report"])
@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: path.unlink() or other_file(path), naming(found=("database", "program"))),
        (lambda path: path.write_text("no database, just text " * 100), re.escape("file is not a database")),
        (older_file, naming(found="version 1", expected="7")),
        (half_file, re.escape("malformed")),
        (Path.unlink, naming(found="no such file")),
    ],
)
def test_files_that_are_not_ours_are_two_and_one_line(
    small_results: Path,
    here: Path,
    capsys: pytest.CaptureFixture[str],
    command: str,
    spoil: Callable[[Path], object],
    message: str,
) -> None:
    spoil(small_results)
    assert main([command, str(small_results)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert re.search(message, err)
    assert list(here.glob(f"*.{command}.*")) == []


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("command", [*COMMANDS, "report"])
def test_a_run_without_a_frame_yet(small_results: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    empty_run(small_results)
    assert main([command, str(small_results)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "no" in err or mentions(err, found=("energy balance", "empty"))


def test_a_locked_file(
    small_results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite waits a while for the other program; here it is not let wait."""
    connect = sqlite3.connect
    locked_file(small_results)
    monkeypatch.setattr(sqlite3, "connect", lambda *args, **more: connect(*args, timeout=0.1, **more))
    assert main(["balance", str(small_results)]) == 2
    expected = f"pdpost: {small_results}: database is locked"
    assert capsys.readouterr().err.startswith(expected)
    LOCKS.pop().close()


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["history", "--node", "999"], naming(found="node 999", expected=("1", "252"))),
        (["history", "--at", "0.5,0"], naming("0.48 m", expected=("0,-0.0055", "0.02,0.0055"))),
        (["history", "--box", "1,1,2,2"], naming(found="1,1,2,2")),
        (["reaction", "--condition", "left"], naming(found="condition 'left'", expected=("0", "(condition 0)", "1"))),
        (["crack", "--step", "61"], naming("--step", found="61", expected=("0", "60"))),
        (["crack", "--compare", "none.sqlite"], naming("none.sqlite", found="no such file")),
        (["balance", "--style", "nothing=2"], naming("nothing", "--style", found=("matplotlib", "setting"))),
        (["balance", "-o", "x.foo"], naming("x.foo", found="suffix '.foo'")),
    ],
)
def test_what_is_not_there_is_named(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([arguments[0], str(small_results), *arguments[1:]]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert re.search(message, err)


@pytest.mark.parametrize("command", ["crack", "fatigue"])
def test_a_damage_is_a_share(small_results: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command, str(small_results), "--cracked", "2"])
    assert stop.value.code == 2
    assert re.search(naming("--cracked", "2", expected="0"), capsys.readouterr().err)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("words", [["--node", "x"], ["--node", "1.5"], ["--at", "1"], ["--box", "0,0,1,nan"]])
def test_places_that_are_none(small_results: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["history", str(small_results), *words])
    assert stop.value.code == 2
    assert f"'{words[1]}'" in capsys.readouterr().err


@pytest.mark.slow
def test_a_plate_that_does_not_break_has_a_picture_too(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM bond_break")
    assert main(["crack", str(small_results)]) == 0
    assert "nothing broke" in capsys.readouterr().out
    result = found(["crack", str(small_results), "--compare", str(small_results)], capsys)
    assert (result["mean"], result["hausdorff"], result["paths"]) == (None, None, [[], []])
    with Results.open(small_results) as results:
        assert not len(results.breaks().step)
