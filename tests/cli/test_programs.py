"""The three programs from the outside: words, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from plates import GEOMETRIES

import pdmesh.__main__
import pdpost.__main__
import pdsolve.__main__
from pdmesh import VERSION, commandline
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import Model
from pdsolve.results import Results

MAIN: dict[str, Callable[[list[str]], int]] = {
    "pdmesh": pdmesh.__main__.main,
    "pdsolve": pdsolve.__main__.main,
    "pdpost": pdpost.__main__.main,
}


@pytest.fixture
def model(here: Path, small_plate: Model) -> Path:
    """The small plate as a file in a folder of its own."""
    (here / "models").mkdir()
    path = here / "models" / "plate.json"
    write_file(document_of(small_plate.grid, small_plate.settings), path)
    return path


@pytest.mark.slow
def test_the_pipeline_with_defaults(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each program writes the input's name with its suffix into the current folder, and --json says what."""
    pytest.importorskip("gmsh", exc_type=OSError)
    scene = str(GEOMETRIES / "duran50.geo")
    assert MAIN["pdmesh"](["build", scene, "--set", "Run/Duration=2.5e-6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["nodes"] == 2732
    assert MAIN["pdsolve"](["duran50.json", "--mode", "thesis", "--json", "-q", "--set", "run.every=25"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["steps"], summary["mode"], summary["status"]) == (100, "thesis", "finished")
    assert MAIN["pdpost"](["damage", "duran50.sqlite", "--time", "1.3us", "--json", "-o", "duran50.damage.png"]) == 0
    assert json.loads(capsys.readouterr().out)["step"] == 50
    assert sorted(path.name for path in here.iterdir()) == ["duran50.damage.png", "duran50.json", "duran50.sqlite"]


@pytest.mark.slow
def test_a_run_on_lattices_does_not_wait_for_scipy(model: Path) -> None:
    """Importing it takes as long as the rest of a small run; numba would import its BLAS."""
    asked = "('scipy.spatial', 'scipy.linalg', 'scipy.sparse')"
    code = f"""if True:
        import sys
        from pdsolve.__main__ import main
        assert main([{str(model)!r}, "-q", "--set", "run.steps=20"]) == 0
        print([name for name in sys.modules if name in {asked}])
        import numba.np.linalg
        numba.np.linalg.ensure_blas()  # there is still one, for whoever asks later
    """
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("program", MAIN)
def test_every_program_has_the_common_words(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        MAIN[program](["--version"])
    assert stop.value.code == 0
    first, libraries = capsys.readouterr().out.splitlines()
    assert first == f"{program} {VERSION}"
    assert [word.split()[0] for word in libraries.split(", ")] == ["Python", *commandline.LIBRARIES]
    assert f", numpy {np.__version__}, " in libraries
    command = {"pdmesh": ["build"], "pdsolve": [], "pdpost": ["damage"]}[program]
    with pytest.raises(SystemExit):
        MAIN[program]([*command, "--help"])
    text = capsys.readouterr().out
    assignment = "--style NAME=VALUE" if program == "pdpost" else "--set NAME=VALUE"
    for word in ("-o", "--output", "--json", "--force", assignment, "-q", "--quiet"):
        assert word in text
    if program == "pdsolve":
        for word in ("--mode {thesis,conservative}", "--threads N", "--precision {float64,float32}", "--resume"):
            assert word in text


@pytest.mark.parametrize("program", MAIN)
def test_usage_is_two(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        MAIN[program](["--no-such-word"])
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith(program)
    assert err.count("\n") == 1
    assert "--help says more" in err


@pytest.mark.slow
def test_nothing_is_overwritten_unless_forced(model: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "plate.sqlite").write_text("precious")
    assert MAIN["pdsolve"]([str(model)]) == 2
    assert mentions(capsys.readouterr().err, "plate.sqlite", found="already exists", expected="--force")
    assert (here / "plate.sqlite").read_text() == "precious"
    assert MAIN["pdsolve"]([str(model), "--force", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    assert MAIN["pdpost"](["damage", "plate.sqlite", "-q"]) == 0
    before = (here / "plate.damage.png").stat().st_mtime_ns
    assert MAIN["pdpost"](["damage", "plate.sqlite"]) == 2
    assert (here / "plate.damage.png").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["pdmesh", "build", "none.geo"], re.escape("none.geo: cannot be read: there is no such file")),
        (["pdmesh", "build", "models/plate.json"], re.escape("plate.json")),
        (["pdsolve", "none.json"], re.escape("none.json: cannot be read: there is no such file")),
        (
            ["pdsolve", "models/plate.json", "--set", "run.steps=-1"],
            re.escape("$.run.steps"),
        ),
        (["pdsolve", "models/plate.json", "--settings", "none.toml"], re.escape("none.toml: cannot be read")),
        (["pdsolve", "models/plate.json", "-o", "gone/x.sqlite"], naming("gone/x.sqlite", found="no folder")),
        (["pdsolve", "models/plate.json", "--threads", "1000"], naming("threads", found="1000", expected="1")),
        (
            ["pdsolve", "models/plate.json", "--probe", "nan,0"],
            naming("--probe", found="'nan,0'"),
        ),
        (
            ["pdsolve", "models/plate.json", "--set", "run.time_step=inf"],
            naming("$.run.time_step", found="inf"),
        ),
        (
            ["pdsolve", "models/plate.json", "--set", "run.until=quiet"],
            naming("$.run.quiet", found="missing", expected="seconds"),
        ),
        (["pdsolve", "models/plate.json", "--until", "quiet:nan"], naming("--until", found="'nan'")),
        (
            ["pdsolve", "models/plate.json", "--every", "inf"],
            re.escape("$.run.every"),
        ),
        (["pdsolve", "--resume", "none.sqlite"], naming("none.sqlite", found="no such file")),
        (["pdsolve", "--resume", "models/plate.json"], naming("plate.json", found="JSON", expected="database")),
        (["pdsolve", "--resume", "x.sqlite", "--mode", "thesis"], naming("--resume", found="--mode")),
        (["pdpost", "damage", "none.sqlite"], naming("none.sqlite", found="no such file")),
        (["pdpost", "damage", "models/plate.json"], naming("plate.json", found="JSON", expected="database")),
    ],
)
def test_bad_input_is_two_and_one_line(
    model: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert MAIN[arguments[0]](arguments[1:]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"{arguments[0]}: ")
    assert err.count("\n") == 1
    assert re.search(message, err)
    assert [path.name for path in here.iterdir()] == ["models"]


def test_the_input_is_never_overwritten(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = model.read_bytes()
    assert MAIN["pdsolve"]([str(model), "-o", str(model), "--force"]) == 2
    assert mentions(capsys.readouterr().err, found="input", expected="file")
    assert model.read_bytes() == before
    assert MAIN["pdpost"](["damage", "."]) == 2
    err = capsys.readouterr().err
    assert err.startswith("pdpost: . is ")
    assert mentions(err, found="folder", expected="database")
    assert err.count("\n") == 1


def test_steps_a_run_does_not_have(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert MAIN["pdpost"](["crack", str(small_results), "--step", "61"]) == 2
    assert mentions(capsys.readouterr().err, "--step", found="61", expected=("0", "60"))


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(("option", "value"), [("--frame", "4"), ("--frame", "-5"), ("--time", "9"), ("-o", "x.foo")])
def test_pictures_that_cannot_be_drawn(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], option: str, value: str
) -> None:
    assert MAIN["pdpost"](["damage", str(small_results), option, value]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(here.glob("*.png")) == []


def test_an_unstable_run_is_three(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert MAIN["pdsolve"]([str(model), "--set", "run.time_step=1e-6", "--set", "run.steps=200"]) == 3
    err = capsys.readouterr().err
    assert "unstable at step" in err
    assert "warning" in err.splitlines()[0]
    assert len(err.splitlines()) == 2


def test_a_step_above_the_bound_warns(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert MAIN["pdsolve"]([str(model), "--set", "run.time_step=2.2e-7", "--set", "run.steps=2"]) == 0
    assert mentions(capsys.readouterr().err, "plate.json", "2.2e-07 s", "stable time step")


def test_flags_stand_for_settings(model: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flags = ["--every", "30", "--fields", "uy,energy", "--probe", "10,0mm", "--probe", "0,0", "--until", "quiet:1ms"]
    assert MAIN["pdsolve"]([str(model), *flags, "-q"]) == 0
    connection = sqlite3.connect(here / "plate.sqlite")
    assert connection.execute("SELECT step FROM frame").fetchall() == [(0,), (30,), (60,)]
    assert connection.execute("SELECT DISTINCT field FROM field_chunk ORDER BY 1").fetchall() == [("energy",), ("uy",)]
    assert connection.execute("SELECT count(*), count(DISTINCT node) FROM probe").fetchone() == (6, 2)
    connection.close()
    assert MAIN["pdsolve"]([str(model), "--until", "quiet"]) == 2
    assert mentions(capsys.readouterr().err, "--until", found="'quiet'", expected="quiet:SECONDS")
    for words, parts in (
        (["--probe", "10,0kg"], ("--probe", "'10,0kg'")),
        (["--until", "quiet:3mm"], ("--until", "'3mm'")),
        (["--probe", "100,0mm"], ("$.run.probes[0]", "(0.1, 0) m", "plate")),
        (["--set", "material.E=65mm"], ("material.E", "'65mm'")),
        (["--set", "material.young=1"], ("with material.young=1", "$.material.young", "`material.E`")),
    ):
        assert MAIN["pdsolve"]([str(model), "--dry-run", *words]) == 2
        said = capsys.readouterr().err
        assert mentions(said, *parts)
        assert said.count("\n") == 1
    assert MAIN["pdsolve"]([str(model), "--fields", "heat"]) == 2
    assert mentions(capsys.readouterr().err, "$.run.fields[0]", found="'heat'")


def test_settings_take_units(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--set", "run.time_step=50ns", "--set", "run.duration=3us", "--set", "material.E=65GPa", "--json"]
    words += ["--set", "run.until=quiet", "--set", "run.quiet=10us", "--until", "none"]
    assert MAIN["pdsolve"]([str(model), "--dry-run", *words]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert (plan["time_step"], plan["steps"]) == (5e-8, 60)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["pdsolve", "x.json", "--dt", "1e-8"], ("'--dt'", "--set run.time_step")),
        (["pdsolve", "x.json", "--young=65e9"], ("'--young=65e9'", "--set material.E")),
        (["pdsolve", "x.json", "--cores", "2"], ("'--cores'", "--threads")),
        (["pdsolve", "study", "x.toml", "--dry-run"], ("'--dry-run'", "pdmesh plan")),
        (["pdmesh", "build", "x.geo", "--dt", "1"], ("'--dt'", "--set run.time_step")),
        (["pdmesh", "build", "x.geo", "--every", "1"], ("'--every'", "--set run.every")),
        (["pdmesh", "build", "x.geo", "--dx", "1"], ("'--dx'", "--set Zones/NAME/Spacing")),
        (["pdpost", "damage", "x.sqlite", "--dpi", "300"], ("'--dpi'", "--style savefig.dpi")),
        (["pdpost", "damage", "x.sqlite", "--vmax", "1"], ("'--vmax'", "--largest")),
        (["pdpost", "damage", "x.sqlite", "--frame"], ("--frame",)),
        (["pdpost", "damage", "x.sqlite", "--frame", "1", "--step", "2"], ("--frame", "--step")),
        (["pdpost", "line", "x.sqlite", "--from", "0,0"], ("--to",)),
    ],
)
def test_an_option_of_another_name_leads_to_ours(
    words: list[str], parts: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        MAIN[words[0]](words[1:])
    said = capsys.readouterr().err
    assert stop.value.code == 2
    assert said.count("\n") == 1
    assert mentions(said, *parts)


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize(
    ("asked", "stored"),
    [
        ([], "ux uy vx vy ax ay energy damage"),
        (["--fields", "uy,energy"], "uy energy"),
        (["--set", "run.fields=['uy']", "--fields", "+energy,ax"], "uy ax energy"),
        (["--set", "run.fields=uy,damage", "--set", "run.fields=+vx,uy"], "uy vx damage"),
        (["--fields", "+energy"], "ux uy vx vy ax ay energy damage"),
        (["--set", "run.fields=['uy']", "--fields", "all"], "ux uy vx vy ax ay energy damage"),
    ],
)
def test_fields_are_added_or_taken(model: Path, here: Path, asked: list[str], stored: str) -> None:
    assert MAIN["pdsolve"]([str(model), "-q", "--set", "run.steps=1", *asked]) == 0
    with Results.open(here / "plate.sqlite") as results:
        assert results.stored(1) == stored.split()


def test_fields_besides_those_of_a_model(model: Path, here: Path) -> None:
    """Which a file names, not the program."""
    text = json.loads(model.read_text())
    model.write_text(json.dumps(text | {"run": text["run"] | {"fields": ["vy"], "steps": 1}}))
    assert MAIN["pdsolve"]([str(model), "-q", "--fields", "+energy"]) == 0
    with Results.open(here / "plate.sqlite") as results:
        assert results.stored(1) == ["vy", "energy"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["--fields", "+heat"], "$.run.fields[8] is 'heat'"),
        (["--fields", ""], "$.run.fields[0] is ''"),
        (["--set", "run.fields=3", "--fields", "+ax,"], "$.run.fields[1] is ''"),
    ],
)
def test_fields_that_are_none(model: Path, capsys: pytest.CaptureFixture[str], asked: list[str], message: str) -> None:
    assert MAIN["pdsolve"]([str(model), *asked]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1


def test_a_dry_run_writes_nothing(model: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert MAIN["pdsolve"]([str(model), "--dry-run", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["nodes"], found["steps"]) == (252, 60)
    assert [path.name for path in here.iterdir()] == ["models"]


@pytest.mark.slow
@pytest.mark.endurance
def test_ctrl_c_is_130_after_a_checkpoint(model: Path, here: Path) -> None:
    long = ["--set", "run.steps=2000000", "--set", "run.every=1000000", "--set", "run.time_step=1e-12"]
    child = subprocess.Popen(
        [sys.executable, "-m", "pdsolve", str(model), *long, "--json"], stdout=subprocess.PIPE, text=True
    )
    while not (here / "plate.sqlite").exists():
        time.sleep(0.05)
    time.sleep(1.0)
    os.kill(child.pid, signal.SIGINT)
    out, _ = child.communicate(timeout=60)
    assert child.returncode == 130
    result = json.loads(out)
    assert result["status"] == "interrupted"
    assert 0 < result["steps"] < 2000000
    connection = sqlite3.connect(here / "plate.sqlite")
    assert connection.execute("SELECT DISTINCT step FROM checkpoint").fetchall() == [(result["steps"],)]
    connection.close()


@pytest.mark.process
def test_help_does_not_wait_for_the_solver() -> None:
    """Nothing heavy is imported for --help."""
    code = (
        "import sys, contextlib\n"
        "from {0}.__main__ import main\n"
        "with contextlib.suppress(SystemExit): main(['--help'])\n"
        "heavy = {{'numpy', 'numba', 'scipy', 'shapely', 'matplotlib', 'gmsh', 'tqdm'}} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    for program in MAIN:
        subprocess.run([sys.executable, "-c", code.format(program)], check=True, stdout=subprocess.DEVNULL)
