"""What `pdsolve --static` says, and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load
from pdsolve.__main__ import main
from pdsolve.results import Results

FOOT = Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0)
PULL = Load(box=(9.9e-3, -1.0, 1.0, 1.0), body_force=(1e9, 0.0), profile=((0.0, 0.0), (2.0, 1.0)))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "held.json").write_text(plate(square_grid(11, 6), 3, conditions=(FOOT, PULL)).to_json())
    (tmp_path / "free.json").write_text(plate(square_grid(11, 6), 3, conditions=(PULL,)).to_json())
    return tmp_path


def test_what_a_run_says(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["held.json", "--static", "--dry-run"]) == 0
    assert "66 nodes, 1110 bonds, 10 load steps of 0.2 s, times without cracks" in capsys.readouterr().out
    assert main(["held.json", "--static", "--set", "run.static.load_steps=4", "--threads", "1"]) == 0
    said = capsys.readouterr().out
    assert "4 load steps to 2 s" in said
    assert "iterations of Newton's method with factors, residual" in said
    assert main(["held.json", "--static", "--json", "--force", "--threads", "1"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [step["step"] for step in found["load_steps"]] == list(range(1, 11))
    assert all(step["residual"] < 1e-8 for step in found["load_steps"])
    with Results.open(Path("held.sqlite")) as results:
        assert results.frames()[1][-1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["free.json", "--static"], 2, "free.json: $.conditions: found the whole plate around"),
        (["free.json", "--static", "--dry-run"], 2, "free.json: $.conditions: found the whole plate around"),
        (["held.json", "--static", "--set", "run.static.tolerance=0"], 2, "Expected `float` > 0.0 - at `$.run.static"),
        (["held.json", "--float"], 2, "--float: found a run in time, expected --static or run.start static"),
        (
            ["held.json", "--static", "--set", "run.static.method=relaxation", "--set", "run.static.iterations=3"],
            3,
            "held.json: load step 1, 0.2 s: found no rest after 3 iterations of adaptive dynamic relaxation",
        ),
    ],
)
def test_what_cannot_be_brought_to_rest(
    words: list[str], code: int, said: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "-o", "rest.sqlite", "--threads", "1"]) == code
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert Path("rest.sqlite").exists() == (code == 3)
    if code == 3:
        with Results.open(Path("rest.sqlite")) as results:
            assert (results.meta()["status"], results.frames()[0].tolist()) == ("unsettled", [0])
