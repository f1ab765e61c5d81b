"""The processes of a study: what one of them may take along, and what is left when the study is killed."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from messages import mentions

from pdmesh.__main__ import main as pdmesh
from pdsolve.__main__ import main

PLATE = """
import os
from pdmesh import Material, Run, Scene, box

deadly = 0

if deadly:
    os.kill(os.getppid(), 9)
scene = Scene(box(0, 0, 0.02, 0.012), 1e-3, Material(E=65e9, rho=2235, G0=204), run=Run(steps=20, every=20))
"""
LONG = """
drawing = "plate.py"
set.model.run.steps = 30_000_000
set.model.run.every = 10_000
vary.model."material.G0" = [204, 100, 50]
"""


@pytest.fixture
def plate(here: Path) -> Path:
    """A folder, the current one, with a Python scene, which may end the process that reads it."""
    Path("plate.py").write_text(PLATE)
    return here


@pytest.mark.endurance
def test_a_worker_that_ends_takes_one_run_with_it(plate: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(
        'drawing = "plate.py"\nvary.drawing.deadly = [0, 1, 2]\nrepeat.times = 2\nrepeat.step = 0.1'
    )
    assert main(["study", "study.toml", "--workers", "2", "--trust"]) == 1
    said = capsys.readouterr()
    assert mentions(said.out, "study.sqlite", "6 runs", "2 finished", "4 failed")
    assert sum(mentions(line, found="process") for line in said.err.splitlines()) == 4


@pytest.mark.endurance
def test_a_run_whose_worker_was_ended_goes_on(plate: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("plate.py").write_text(
        PLATE.replace("if deadly:", 'if deadly and not os.path.exists("ran"):\n    open("ran", "w").close()')
    )
    Path("study.toml").write_text('drawing = "plate.py"\nvary.drawing.deadly = [0, 1]')
    assert main(["study", "study.toml", "--workers", "1", "--trust"]) == 0
    assert mentions(capsys.readouterr().out, "study.sqlite", "2 runs", "2 finished", "0 failed")


@pytest.mark.slow
def test_a_program_that_a_study_names_is_not_run(plate: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("plate.py").write_text(f"{PLATE}\nopen('ran', 'w').close()\n")
    Path("study.toml").write_text('drawing = "plate.py"')
    for command in (lambda: pdmesh(["plan", "study.toml"]), lambda: main(["study", "study.toml"])):
        assert command() == 2
        said = capsys.readouterr().err
        assert mentions(said, "study.toml", "$.drawing", found="Python", expected="--trust")
        assert said.count("\n") == 1
    assert not Path("ran").exists()
    assert pdmesh(["plan", "study.toml", "--trust", "-q"]) == 0
    assert Path("ran").exists()


@pytest.mark.endurance
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="looks at processes by Linux's means")
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_a_study_that_is_ended_leaves_no_process_and_no_folder_and_opens_no_port(plate: Path, end: int) -> None:
    Path("study.toml").write_text(LONG)
    (plate / "temporary").mkdir()
    words = [sys.executable, "-P", "-m", "pdsolve", "study", "study.toml", "--workers", "2", "--trust"]
    environment = os.environ | {"TMPDIR": str(plate / "temporary")}
    with subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=_listens) as study:
        try:
            until(lambda: len(list(Path("study.runs").glob("*.sqlite"))) == 2)
        except AssertionError:
            study.kill()
            raise
        family = [study.pid, *children(study.pid)]
        assert len(family) >= 3
        sockets = [link for pid in family for link in links(pid) if link.startswith("socket:")]
        os.killpg(study.pid, end) if end == signal.SIGINT else study.kill()
        said = study.communicate()[1]
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in family))
    assert sockets == []
    assert list((plate / "temporary").iterdir()) == []
    if end == signal.SIGINT:
        assert study.returncode == 130
        lines = said.splitlines()[1:]  # after the price
        assert [line.startswith("pdsolve study: interrupted") for line in lines] == [True, True]
    with sqlite3.connect("study.sqlite") as table:
        assert [status for (status,) in table.execute("SELECT status FROM run")] == ["waiting"] * 3


def _listens() -> None:
    os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)


def until(so: object, patience: float = 600.0) -> None:
    """Waits until something is so."""
    end = time.monotonic() + patience
    while not so():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.1)


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    found = (Path(f"/proc/{pid}/task") / name / "children" for name in os.listdir(f"/proc/{pid}/task"))
    return [int(word) for path in found for word in path.read_text().split()]


def links(pid: int) -> list[str]:
    """What a process has open."""
    found = []
    for name in os.listdir(f"/proc/{pid}/fd"):
        try:
            found.append(os.readlink(f"/proc/{pid}/fd/{name}"))
        except OSError:
            continue
    return found
