"""Ctrl-C, once and twice, at any moment: one line at most, exit code 130, a run that can be gone on with."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from database_contents import contents
from messages import mentions

from pdmesh import commandline
from pdsolve.__main__ import main
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results, Writer
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.state import State
from pdsolve.stepper import Stepper

READING = ("msgspec", "numpy._core.multiarray", "numpy.random")  # what all that is read takes


@pytest.fixture(autouse=True)
def _listens() -> Iterator[None]:
    """Whoever runs the tests in the background has them ignore Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def model(here: Path, probed: Model, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plate in a folder, looked at after every step, without a word of progress."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    monkeypatch.setattr("pdsolve.run.progress.LINE_EVERY", 1e9)
    (here / "plate.json").write_text(probed.to_json())
    return here / "plate.json"


@pytest.mark.parametrize("before", [signal.default_int_handler, signal.SIG_IGN])
def test_a_process_of_its_own_is_ended_at_once_before_it_listens(
    before: signal.Handlers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a traceback; one in the background ignores it as before."""
    monkeypatch.setattr(commandline.trust, "settle", lambda: None)
    monkeypatch.setattr(sys, "argv", ["pdmesh", "doctor"])
    signal.signal(signal.SIGINT, before)
    assert commandline.words(["info"]) == ["info"]
    assert signal.getsignal(signal.SIGINT) is before
    assert commandline.words(None) == ["doctor"]
    is_usual = before is signal.default_int_handler
    assert signal.getsignal(signal.SIGINT) is (signal.SIG_DFL if is_usual else before)
    assert commandline.run("pdmesh", lambda: signal.raise_signal(signal.SIGINT) or 0, dict) == (130 if is_usual else 0)


def check_resumed(probed: Model, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--resume", "plate.sqlite", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    simulate(probed, Path("alone.sqlite")).close()
    assert contents(Path("plate.sqlite")) == contents(Path("alone.sqlite"))


@pytest.mark.endurance
@pytest.mark.parametrize(
    ("program", "module"),
    [
        *(("pdsolve", name) for name in (*READING, "numba.core", "pdsolve.run.system")),
        *(("pdpost", name) for name in READING),  # it does without the others: test_imports.py
    ],
)
def test_while_libraries_are_imported(here: Path, program: str, module: str) -> None:
    words = {"pdsolve": ["x.json"], "pdpost": ["damage", "x.sqlite"]}[program]
    code = f"""if True:
        import importlib.abc, signal, sys
        class Finder(importlib.abc.MetaPathFinder):
            def find_spec(self, name, path, target=None):
                if name == {module!r}:
                    signal.raise_signal(signal.SIGINT)
        sys.meta_path.insert(0, Finder())
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from {program}.__main__ import main
        sys.exit(main({words!r}))
    """
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (130, f"{program}: interrupted\n")


def test_what_a_library_makes_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    """NumPy, interrupted while it is imported, says that it cannot be imported more than once."""

    def command() -> int:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("cannot load module more than once per process") from None
        return 0

    assert commandline.run("pdmesh", command, dict) == 130
    assert capsys.readouterr().err == "pdmesh: interrupted\n"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.slow
def test_between_two_entries_of_the_ledger(
    model: Path, probed: Model, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    stepper = type(prepare(probed, Options()).system.stepper)
    march = stepper.advance

    def interrupted(own: Stepper, state: State, first: int, end: int) -> int:
        last = march(own, state, first, end)
        if first == 33:
            signal.raise_signal(signal.SIGINT)
        return last

    with monkeypatch.context() as patch:
        patch.setattr(stepper, "advance", interrupted)
        assert main([str(model)]) == 130
    out, err = capsys.readouterr()
    assert out.startswith("interrupted; to go on: pdsolve --resume plate.sqlite\n")
    assert err == ""
    with Results.open(Path("plate.sqlite")) as results:
        assert (results.checkpoint()[0], results.summary()["steps"]) == (33, 33)
        assert results.history()["step"].max() == 30
    check_resumed(probed, capsys)


@pytest.mark.endurance
def test_twice_while_a_frame_is_written(
    model: Path, probed: Model, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write = Writer._write_field

    def interrupted(writer: Writer, step: int, *more: object) -> None:
        write(writer, step, *more)  # type: ignore[arg-type]
        if step == 40:
            for _ in range(2):
                signal.raise_signal(signal.SIGINT)
                time.sleep(0.05)  # two at once are one

    with monkeypatch.context() as patch:
        patch.setattr(Writer, "_write_field", interrupted)
        assert main([str(model)]) == 130
    assert capsys.readouterr() == ("", "pdsolve: interrupted\n")
    with Results.open(Path("plate.sqlite")) as results:
        assert results.meta()["status"] == "interrupted"
        assert results.frames()[0].max() == 40  # which is written to its end
    check_resumed(probed, capsys)


@pytest.mark.endurance
def test_while_another_program_is_waited_for(
    model: Path, probed: Model, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said what for; after Ctrl-C that is why the run has ended."""
    monkeypatch.setattr("pdsolve.results.writer.FIRST_WORD", 0.2)
    write, foreign = Writer.write, []

    def locked(writer: Writer, frame: object) -> None:
        if getattr(frame, "step", 0) == 30:
            foreign.append(sqlite3.connect("plate.sqlite", isolation_level=None, check_same_thread=False))
            foreign[0].execute("BEGIN IMMEDIATE")
            threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT)).start()
        write(writer, frame)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Writer, "write", locked)
        assert main([str(model)]) == 1
    foreign[0].close()
    out, err = capsys.readouterr()
    assert out == ""
    first, *_, last = err.splitlines()
    assert mentions(first, "pdsolve: warning: plate.sqlite", "locked", "0 s")
    assert mentions(last, "pdsolve: plate.sqlite", "last checkpoint", found=("locked", "1 s"))
    check_resumed(probed, capsys)
