"""What `pdsolve --static` says, and refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from messages import mentions, naming
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main
from pdsolve.results import Results
from pdsolve.run.progress import Watch

FOOT = Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0)
PULL = Load(box=(9.9e-3, -1.0, 1.0, 1.0), body_force=(1e9, 0.0), profile=((0.0, 0.0), (2.0, 1.0)))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "held.json").write_text(plate(square_grid(11, 6), 3, conditions=(FOOT, PULL)).to_json())
    (tmp_path / "free.json").write_text(plate(square_grid(11, 6), 3, conditions=(PULL,)).to_json())
    return tmp_path


@pytest.mark.slow
def test_what_a_run_says(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["held.json", "--static", "--dry-run"]) == 0
    assert mentions(capsys.readouterr().out, "66 nodes", "555 bonds", "10 load steps", "0.2 s")
    assert main(["held.json", "--static", "--set", "run.static.load_steps=4", "--threads", "1"]) == 0
    said = capsys.readouterr().out
    assert "4 load steps to 2 s" in said
    assert mentions(said, "Newton's", "factors", "residual")
    assert main(["held.json", "--static", "--json", "--force", "--threads", "1"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [step["step"] for step in found["load_steps"]] == list(range(1, 11))
    assert all(step["residual"] < 1e-8 for step in found["load_steps"])
    with Results.open(Path("held.sqlite")) as results:
        assert results.frames()[1][-1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["free.json", "--static"], 2, naming("free.json", "$.conditions", found="whole plate")),
        (["free.json", "--static", "--dry-run"], 2, naming("free.json", "$.conditions", found="whole plate")),
        *(
            (["held.json", "--static", "--set", f"run.static.tolerance={wrong}"], 2, naming("$.run.static.tolerance"))
            for wrong in (0, -1, "nan", "inf", 1e-300, 2)
        ),
        (
            ["held.json", "--static", "--every", "2"],
            2,
            naming("run.every", found="run.solver static"),
        ),
        (["held.json", "--static", "--set", "run.time_step=1"], 2, naming("run.time_step", found="run.solver static")),
        (
            ["held.json", "--set", "run.static.tolerance=1e-3"],
            2,
            naming("run.static.tolerance", found="run.solver explicit"),
        ),
        (
            ["held.json", "--set", "run.static.load_steps=3", "--set", "run.start=static"],
            2,
            naming("run.static.load_steps", expected=("run.solver static", "--static")),
        ),
        *(
            (["held.json", "--static", *words], 2, said)
            for words, said in (
                (
                    ["--set", "run.fatigue.A=1", "--set", "run.fatigue.m=0.5"],
                    r"run\.fatigue\.m.*0\.5",
                ),
                (
                    ["--set", "run.fatigue.A=1", "--set", "run.fatigue.m=2"],
                    naming("conditions[1].profile", found="2 points"),
                ),
                (["--set", "run.fatigue.A=1", "--set", "run.fatigue.cycles=2e15"], naming("run.fatigue.cycles")),
            )
        ),
        (["held.json", "--float"], 2, naming("--float", expected=("--static", "run.start static"))),
        (
            ["held.json", "--static", "--set", "run.static.method=relaxation", "--set", "run.static.iterations=3"],
            3,
            naming("held.json", "load step 1", "0.2 s", found=("3 iterations", "relaxation")),
        ),
    ],
)
def test_what_cannot_be_brought_to_rest(
    words: list[str], code: int, said: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "-o", "rest.sqlite", "--threads", "1", "-q"]) == code  # -q: a compile may take long
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(said, line)
    assert Path("rest.sqlite").exists() == (code == 3)
    if code == 3:
        with Results.open(Path("rest.sqlite")) as results:
            assert (results.meta()["status"], results.frames()[0].tolist()) == ("unsettled", [0])


@pytest.mark.slow
@pytest.mark.parametrize("command", ["damage", "balance", "report"])
def test_what_is_said_of_load_steps_is_in_seconds(command: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["held.json", "--static", "-q", "--threads", "1"]) == 0
    assert pdpost([command, "held.sqlite", "-o", f"{command}.{'html' if command == 'report' else 'svg'}"]) == 0
    said = capsys.readouterr().out if command != "report" else Path("report.html").read_text()
    assert "at 2 s" in said
    assert "e+06" not in said


@pytest.mark.slow
def test_the_report_of_load_steps_has_nothing_that_moves(here: Path) -> None:
    for words, name in ([], "moves"), (["--static"], "rests"):
        assert main(["held.json", *words, "-q", "--threads", "1", "-o", f"{name}.sqlite"]) == 0
        assert pdpost(["report", f"{name}.sqlite", "-o", f"{name}.html", "-q"]) == 0
    moves, rests = (Path(f"{name}.html").read_text() for name in ("moves", "rests"))
    for text in 'alt="velocity"', 'alt="acceleration"', "stable up to":
        assert text in moves
        assert text not in rests
    assert 'alt="displacement"' in rests
    first = [text.split("<h2>")[1].split("</h2>")[0] for text in (rests, moves)]
    assert first == ["Load and displacement", "Crack"]
    assert "the largest force is" in rests
    assert 'alt="damage"' not in rests  # nothing has broken
    assert re.search("Zero at all nodes: .*damage", rests)


def test_a_run_stopped_within_a_load_step_says_how_to_go_on(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Watch, "_show_progress", lambda _, progress: progress.load_step_progress is not None)
    assert main(["held.json", "--static", "--threads", "1"]) == 130
    said, last = capsys.readouterr().err.splitlines()
    assert said.endswith("which is lost; to go on: pdsolve --resume held.sqlite")
    assert last == "pdsolve: interrupted"
