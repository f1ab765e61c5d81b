"""The commands of pdpost that draw, film, follow and export."""

from __future__ import annotations

import csv
import io
import json
import re
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from new_databases import create_writer
from tampered_databases import tampered

from pdpost.__main__ import main
from pdpost.commands import pictures
from pdpost.figures import frames_figure, style
from pdsolve.measures.fields import FIELDS
from pdsolve.results import Families, Nodes, Results

PICTURES = ("damage", "displacement", "velocity", "strain", "stress", "nodes", "bonds")


def test_the_commands_and_the_library_know_the_same_fields() -> None:
    assert tuple(pictures.FIELDS) == tuple(FIELDS)


def test_the_end_of_the_colours_may_have_a_unit(few_results: Path, here: Path) -> None:
    words = ["displacement", str(few_results)]
    assert main([*words, "--largest", "20um", "-o", "unit.svg"]) == 0
    assert main([*words, "--largest", "2e-5", "-o", "si.svg"]) == 0
    assert main([*words, "--largest", "2e-6", "-o", "less.svg"]) == 0
    unit, si, less = ((here / f"{name}.svg").read_bytes() for name in ("unit", "si", "less"))
    assert unit == si != less


@pytest.mark.parametrize(("field", "unit"), [("stress", "um"), ("velocity", "mm"), ("damage", "m")])
def test_a_unit_of_something_else_is_refused(
    few_results: Path, here: Path, capsys: pytest.CaptureFixture[str], field: str, unit: str
) -> None:
    assert main([field, str(few_results), "--largest", f"5{unit}", "-o", "no.png"]) == 2
    err = capsys.readouterr().err
    assert (err.count("\n"), list(here.glob("*.png"))) == (1, [])
    assert mentions(err, "--largest", found=f"'5{unit}'", expected="number above 0")


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", PICTURES)
def test_every_picture_needs_no_option(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """A PNG; its numbers as finite JSON and as a table, which draw nothing unless -o names a picture."""
    assert main([name, str(small_results)]) == 0
    assert capsys.readouterr().err == ""
    assert (here / f"small.{name}.png").read_bytes().startswith(b"\x89PNG")
    (here / f"small.{name}.png").unlink()
    assert main([name, str(small_results), "--json", "--csv", "table.csv"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    told = json.loads(out, parse_constant=pytest.fail)
    assert (told["step"], told["output"]) == (60, None)
    assert list(here.glob("*.png")) == []
    assert main([name, str(small_results), "--json", "-o", "drawn.png"]) == 0
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == told | {"output": "drawn.png"}
    assert (here / "drawn.png").read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader(io.StringIO((here / "table.csv").read_text())))
    if name == "bonds":
        assert sum(int(row["broken"]) for row in rows) == told["broken"] > 0
        assert len(rows) == told["broken"] + told["intact"]
    else:
        assert len(rows) == 252


@pytest.mark.slow
def test_numbers_are_those_of_the_frame(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Results.open(small_results) as results:
        vy = results.field("vy", 40)
    given = ["velocity", str(small_results), "--component", "y", "--frame", "2"]
    assert main([*given, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["smallest"], told["largest"], told["unknown"]) == (vy.min(), vy.max(), 0)
    assert main([*given, "--force", "--csv", "-"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert np.array_equal(np.array([row["velocity_y"] for row in rows], dtype=np.float32), vy)
    assert float(rows[5]["velocity_magnitude"]) == pytest.approx(
        np.hypot(float(rows[5]["velocity_x"]), float(rows[5]["velocity_y"])), rel=1e-8
    )


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stress", "--component", "zx"], naming("stress", found="component 'zx'", expected=("largest", "smallest"))),
        (["damage", "--csv", "-", "--json"], naming("--csv", found="--json")),
        (["damage", "--csv", "gone/x.csv"], naming("gone/x.csv", found="no folder")),
        (["damage", "-o", "x.png", "--csv", "./x.png"], naming("--csv", found="x.png")),
        (["history", "-o", "x.png", "--csv", "x.png"], naming("--csv", found="x.png")),
        (["bonds", "--frame", "4"], naming(found="frame 4", expected=("0", "3", "-4", "-1"))),
        (["bonds", "--frame", "-5"], naming(found="frame -5", expected=("0", "3", "-4", "-1"))),
        (["damage", "--time", "5"], naming("--time", found="5", expected=("0", "3e-06"))),
        (["stress", "--time", "-1"], naming("--time", found="-1", expected=("0", "3e-06"))),
        (["nodes", "--time", "3.1e-6"], naming("--time", found="3.1e-06", expected=("0", "3e-06"))),
        (["damage", "--step", "25"], naming("step 25", expected=("20", "40"))),
        (["animate", "--every", "30"], naming("--every", found="30", expected=("multiple", "20", "--stride"))),
        (["export", "-o", "x.vtu", "--time", "1"], naming("--time", found="1", expected=("0", "3e-06"))),
        (["crack", "--step", "61"], naming("--step", found="61", expected=("0", "60"))),
        (["crack", "--step", "-1"], naming("--step", found="-1", expected=("0", "60"))),
        (["damage", "--time", "-1us"], naming("--time", found="-1e-06", expected=("0", "3e-06"))),
        (["damage", "--window", "-5,-2,-1,-1mm"], naming("-0.005,-0.002,-0.001,-0.001", expected="0.0205")),
        (["damage", "--window", "0,0,20,6"], naming("0,0,20,6", found="point", expected=("0.0205", "20mm"))),
        (["damage", "--style", "dpi=100"], naming("--style dpi", expected="savefig.dpi")),
        (["nodes", "--style", "fontsize=9"], naming("--style fontsize", expected="font.size")),
        (["damage", "--window", "1,1,2,2"], naming("1,1,2,2", expected="-0.0005,-0.006,0.0205,0.006")),
        (["watch", "--window", "1,1,2,2"], naming("--window", found="1,1,2,2", expected="plate")),
        (["animate", "--window", "1,1,2,2"], naming("--window", found="1,1,2,2", expected="plate")),
        (["crack", "--window", "1,1,2,2"], naming("--window", found="1,1,2,2", expected="plate")),
        (["damage", "--style", "savefig.dpi=0"], naming("--style", "savefig.dpi=0", expected=("10", "1200"))),
        (["crack", "--style", "savefig.dpi=-5"], naming("--style", "savefig.dpi=-5", expected=("10", "1200"))),
        (["report", "--style", "savefig.dpi=1e9"], naming("--style", "savefig.dpi=1e9", expected=("10", "1200"))),
        (["balance", "--style", "figure.dpi=nan"], naming("--style", "figure.dpi=nan", expected=("10", "1200"))),
        (["history", "--style", "font.size=inf"], naming("--style", "font.size=inf", expected=("1", "72"))),
        (["nodes", "--style", "font.size=0"], naming("--style", "font.size=0", expected=("1", "72"))),
        (
            ["bonds", "--style", "lines.linewidth=nan"],
            naming("lines.linewidth=nan", expected=("-1000", "1000")),
        ),
        (
            ["reaction", "--style", "axes.titlesize=0"],
            naming("axes.titlesize=0", found=("settings", "picture")),
        ),
        (
            ["animate", "--style", "font.family=None Such"],
            naming("--style", "font.family=None Such", found=("settings", "picture")),
        ),
        (["watch", "--style", "path.simplify_threshold=7"], re.escape("--style path.simplify_threshold=7: ")),
        (["damage", "--style", "webagg.port=1"], naming("webagg.port", "--style", found=("matplotlib", "setting"))),
        (["animate", "-o", "x.avi"], naming("x.avi", found="suffix '.avi'", expected=(".gif", ".mp4"))),
        (["watch", "-o", "x.foo"], naming("x.foo", found="suffix '.foo'")),
        (
            ["export", "-o", "x.foo"],
            naming("x.foo", found="suffix '.foo'", expected=(".vtu", ".pvd", ".xdmf", ".msh", ".csv")),
        ),
        (["export", "--frame", "1"], naming("--frame", "--time", found=".pvd")),
        (["export", "-o", "x.vtu", "--every", "2"], naming("--every", found=".vtu")),
        (["export", "-o", "x.csv", "--squares"], naming("--squares", found=".csv")),
    ],
)
def test_what_cannot_be_drawn_is_two_and_one_line(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([arguments[0], str(small_results), *arguments[1:]]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert re.search(message, err)
    assert sorted(path.name for path in here.iterdir()) == ["small.sqlite"]


def test_a_window_in_a_hole_shows_nothing(
    small_results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is within the plate's bounds: its picture was empty, with exit code 0."""
    import shapely

    from pdsolve.measures import plate_geometry

    ring = shapely.difference(shapely.box(0, -0.006, 0.02, 0.006), shapely.box(0.005, -0.003, 0.015, 0.003))
    holed = plate_geometry.PlateGeometry((), np.zeros((0, 2, 2)), ring, False, False)
    monkeypatch.setattr(plate_geometry, "read_plate_geometry", lambda results: holed)
    assert main(["bonds", str(small_results), "--window", "6,-2,14,2mm"]) == 2
    assert mentions(capsys.readouterr().err, "--window", "0.006,-0.002,0.014,0.002", "plate")


def test_a_window_between_nodes_is_refused_and_numbers_are_of_the_window(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A picture of no node was blank, with the counts of the whole plate beside it."""
    assert main(["bonds", str(small_results), "--window", "6.1,0.6,6.2,0.7mm"]) == 2
    assert mentions(capsys.readouterr().err, "--window", "node")
    counts = []
    for window in ([], ["--window", "6,-2,10,2mm"]):
        assert main(["bonds", str(small_results), *window, "--json"]) == 0
        counts.append(json.loads(capsys.readouterr().out)["intact"])
    assert 0 < counts[1] < counts[0]


@pytest.mark.parametrize(
    "command", [["damage"], ["bonds"], ["reaction"], ["balance"], ["line", "--from", "0,0", "--to", "20,0mm"]]
)
def test_json_is_the_result_and_no_picture(
    command: list[str], small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [command[0], str(small_results), *command[1:], "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told.get("output") is None
    assert [path.name for path in here.iterdir()] == ["small.sqlite"]


def test_a_frame_is_chosen_by_its_number_step_or_time(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words in (["--frame", "1"], ["--step", "20"], ["--time", "1us"], ["--time", "1e-6"]):
        assert main(["damage", str(small_results), "--json", *words]) == 0
        assert json.loads(capsys.readouterr().out)["step"] == 20


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["energy"], naming(found="field 'energy'", expected="--fields")),
        (["animate", "--field", "acceleration"], naming(found="field 'ax'")),
        (["history", "--quantity", "acceleration", "--node", "5"], naming(found="field 'ax'")),
    ],
)
def test_fields_that_were_not_stored_are_named(
    few_results: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([arguments[0], str(few_results), *arguments[1:]]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert re.search(message, err)
    assert sorted(path.name for path in here.iterdir()) == ["few.sqlite"]


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", ["energy", "acceleration"])
def test_energy_and_acceleration_need_no_option(small_results: Path, here: Path, name: str) -> None:
    assert main([name, str(small_results), "-q"]) == 0
    assert (here / f"small.{name}.png").is_file()


@pytest.mark.parametrize(
    "arguments",
    [["damage", "--scale", "-1"], ["damage", "--largest", "0"], ["animate", "--every", "0"], ["export", "--also", "u"]],
)
def test_options_that_make_no_sense(small_results: Path, arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main([arguments[0], str(small_results), *arguments[1:]])
    assert stop.value.code == 2


@pytest.mark.slow
def test_the_table_of_a_stress_says_where_it_says_nothing(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["stress", str(small_results), "--json", "--csv", "a.csv"]) == 0
    told = json.loads(capsys.readouterr().out)
    rows = list(csv.DictReader(io.StringIO((here / "a.csv").read_text())))
    torn = [row for row in rows if float(row["separation"]) > 0.35]
    assert told["torn"] == len(torn) > 0
    assert all(float(row["damage"]) <= float(row["separation"]) for row in rows)
    sound = [float(row["stress_largest"]) for row in rows if float(row["separation"]) <= 0.35]
    assert told["largest"] == pytest.approx(max(sound), rel=1e-8)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("command", [*PICTURES, "watch", "crack"])
def test_every_picture_has_a_window(
    small_results: Path, here: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """The axes end at the window, whatever is drawn; the picture differs from the whole one."""
    kept = []
    save = style.save
    monkeypatch.setattr(style, "save", lambda figure, path: kept.append(figure) or save(figure, path))
    assert main([command, str(small_results), "--window", "0.006,-0.002,0.016,0.003", "-o", "a.png", "-q"]) == 0
    assert main([command, str(small_results), "-o", "b.png", "-q"]) == 0
    axes = kept[0].axes[0]
    assert (*axes.get_xlim(), *axes.get_ylim()) == pytest.approx((6, 16, -2, 3))
    assert (here / "a.png").read_bytes() != (here / "b.png").read_bytes()


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("words", ["0,0,1", "0,0,0,1", "1,0,0,1", "0,0,1,nan", "a,b,c,d", ""])
def test_windows_that_are_none(small_results: Path, capsys: pytest.CaptureFixture[str], words: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["damage", str(small_results), f"--window={words}"])
    assert stop.value.code == 2
    assert mentions(capsys.readouterr().err, found=f"'{words}'", expected=re.compile("(?:lower left|4 finite numbers)"))


@pytest.mark.slow
def test_the_first_and_the_last_time_are_of_the_run(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for at, step in (("0", 0), ("3e-6", 60), ("1.4e-6", 20)):
        assert main(["damage", str(small_results), "--time", at, "--force", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["step"] == step


def spoilt(good: Path, what: str) -> tuple[Path, str]:
    """A database that is no good, and what is said of it."""
    path = good.with_name("bad.sqlite")
    data = good.read_bytes()
    if what == "empty":
        path.write_bytes(b"")
        return path, "nothing in it"
    if what == "truncated":
        path.write_bytes(data[: len(data) // 2])
        return path, "malformed"
    if what == "older":
        path.write_bytes(data[:63] + b"\x01" + data[64:])
        return path, "schema version 1"
    if what == "no frame":
        one = np.array([1])
        nodes = Nodes(one, np.zeros((1, 2)), np.ones(1), np.ones(1), one, one)
        alone = Families(np.array([0, 0]), np.zeros(0, dtype=np.int64))
        create_writer(path, nodes, lambda first, last: alone, np.empty((0, 4)), {"time_step": 1.0}).close("running")
        return path, "no frame yet"
    path.write_bytes(data)
    return path, "database is locked"


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("command", ["damage", "bonds", "animate", "export"])
@pytest.mark.parametrize("what", ["empty", "truncated", "older", "no frame"])
def test_databases_that_are_no_good(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], what: str, command: str
) -> None:
    path, message = spoilt(small_results, what)
    before = sorted(here.iterdir())
    assert main([command, str(path)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert message in err
    assert sorted(here.iterdir()) == before


@pytest.mark.slow
def test_a_database_that_someone_keeps_to_himself(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, message = spoilt(small_results, "locked")
    connection = sqlite3.connect(path)
    connection.execute("BEGIN EXCLUSIVE")
    assert main(["damage", str(path)]) == 2
    connection.close()
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_frame_without_displacements_is_drawn_where_it_was(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM field_chunk WHERE field <> 'damage'")
        connection.execute("UPDATE frame SET fields = 'damage'")
    assert main(["nodes", str(small_results), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["scale"] == 0.0
    assert mentions(err, "displacements", "reference")
    assert main(["damage", str(small_results), "--scale", "2"]) == 2
    assert mentions(capsys.readouterr().err, found="field 'ux'", expected="damage")


@pytest.mark.slow
def test_a_film_of_a_window(small_results: Path, here: Path) -> None:
    for name, more in (("a.gif", []), ("b.gif", ["--window", "0.006,-0.002,0.016,0.003"])):
        assert main(["animate", str(small_results), "--field", "stress", "-o", name, *more, "-q"]) == 0
    assert (here / "a.gif").read_bytes() != (here / "b.gif").read_bytes()


def test_numbers_are_not_written_over(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "a.bin").write_text("mine")
    assert main(["export", str(small_results), "-o", "a.xdmf"]) == 2
    assert mentions(capsys.readouterr().err, "a.bin", found="already exists", expected="--force")
    assert (here / "a.bin").read_text() == "mine"
    assert main(["export", str(small_results), "-o", "a.xdmf", "--force", "-q"]) == 0


@pytest.mark.slow
def test_a_film(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["animate", str(small_results), "--stride", "2", "--scale", "auto", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["output"], told["frames"], list(here.glob("*.gif"))) == (None, 2, [])  # as of other pictures
    assert main(["animate", str(small_results), "--stride", "2", "--scale", "auto"]) == 0
    assert capsys.readouterr().out.startswith("small.damage.gif: damage, 2 frames, ")
    assert (here / "small.damage.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("arguments", "written"),
    [
        ([], ["small", "small.pvd"]),
        (["-o", "a.vtu", "--frame", "1", "--also", "strain,stress"], ["a.vtu"]),
        (["-o", "a.vtu", "--squares"], ["a.vtu"]),
        (["-o", "a.xdmf", "--stride", "3"], ["a.bin", "a.xdmf"]),
        (["-o", "a.csv", "--time", "1e-6", "--also", "stress"], ["a.csv"]),
    ],
)
def test_exports(small_results: Path, here: Path, arguments: list[str], written: list[str]) -> None:
    assert main(["export", str(small_results), *arguments, "-q"]) == 0
    assert sorted(path.name for path in here.iterdir()) == sorted([*written, "small.sqlite"])
    if not arguments:
        assert len(list((here / "small").glob("*.vtu"))) == 4
        assert main(["export", str(small_results)]) == 2
        assert main(["export", str(small_results), "--force"]) == 0


@pytest.mark.slow
def test_watching_a_run_that_has_ended(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", str(small_results), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {"output": "small.damage.png", "field": "damage", "drawn": 1, "status": "finished"}
    assert err == "small.damage.png: damage at 3 us (step 60)\n"


@pytest.mark.slow
def test_a_watcher_is_out_of_patience_or_interrupted(small_results: Path, here: Path) -> None:
    """A run that was killed still says it is running: 1 when patience ends, 130 at Ctrl-C."""
    with tampered(small_results) as connection:
        connection.execute("UPDATE meta SET value = 'running' WHERE key = 'status'")
    assert main(["watch", str(small_results), "--patience", "0.1", "-q"]) == 1
    command = [sys.executable, "-m", "pdpost", "watch", str(small_results), "--force"]

    def listens() -> None:  # whoever runs the tests in the background has them ignore Ctrl-C
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=listens) as child:
        assert child.stderr is not None
        assert "damage at 3 us" in child.stderr.readline()
        time.sleep(0.2)
        child.send_signal(signal.SIGINT)
        assert "interrupted" in child.stderr.read()
    assert child.returncode == 130


@pytest.mark.process
def test_help_is_there_at_once() -> None:
    """No picture is needed to say what there is: numpy and matplotlib are not imported."""
    words = "import sys; from pdpost.__main__ import parser; parser().format_help(); "
    words += "print([name for name in ('numpy', 'matplotlib', 'meshio') if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", words], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.slow
def test_runs_side_by_side(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Frames of two runs under their names, at their own times, in the colours of both."""
    other = here / "other.sqlite"
    other.write_bytes(small_results.read_bytes())
    given = ["compare", str(small_results), str(other), "-o", "both.png", "--field", "velocity"]
    assert main([*given, "--frame", "2", "--titles", "one, another", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [run["title"] for run in told["runs"]] == ["one", "another"]
    assert len({run["time"] for run in told["runs"]}) == 1
    assert (here / "both.png").read_bytes().startswith(b"\x89PNG")
    with Results.open(small_results) as results:
        each = [frames_figure.Panel(results, step, f"{step}") for step in (0, 60)]
        first, last, bar = frames_figure.panels(each, "velocity").axes
    assert (first.get_title(), last.get_title()) == ("0", "60")
    ends = [float(axes.collections[0].norm.vmax) for axes in (first, last)]
    assert ends[0] == ends[1] == bar.get_ylim()[1] > 0  # although nothing moves at first


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], naming("compare", found="1", expected="two")),
        (["{other}", "--titles", "a"], naming("--titles", found="1", expected="2")),
        (["{other}", "--time", "7"], naming("--time", found="7 s", expected="3e-06 s")),
        (["none.sqlite"], naming("none.sqlite", found="file")),
    ],
)
def test_runs_that_cannot_stand_side_by_side(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    other = here / "other.sqlite"
    other.write_bytes(small_results.read_bytes())
    assert main(["compare", str(small_results), *(word.format(other=other) for word in words)]) == 2
    err = capsys.readouterr().err
    assert re.search(message, err)
    assert err.count("\n") == 1
