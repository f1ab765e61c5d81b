"""Runs that are to end, were killed or lost their file, as the programs answer: a line, an exit code, nothing lost."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

import pytest
from database_contents import contents, newest
from messages import mentions

from pdmesh import commandline
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import _says_how_to_go_on, main
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.results.lock import Token
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Progress, resume, simulate
from pdsolve.state import State
from pdsolve.stepper import Stepper

ENDS = [signal.SIGTERM, signal.SIGHUP]


@pytest.fixture(autouse=True)
def _listens() -> Iterator[None]:
    before = {number: signal.signal(number, signal.SIG_DFL) for number in ENDS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def model(here: Path, probed: Model, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plate in a folder, looked at after every step."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    (here / "plate.json").write_text(probed.to_json())
    return here / "plate.json"


def signalled(probed: Model, number: signal.Signals, times: int, patch: pytest.MonkeyPatch) -> None:
    """Let the steps from 33 on of each run send a signal to it so many times."""
    stepper = type(prepare(probed, Options()).system.stepper)
    march, sent = stepper.advance, []

    def send(own: Stepper, state: State, first: int, end: int) -> int:
        last = march(own, state, first, end)
        if first >= 33 and len(sent) < times:
            sent.append(first)
            signal.raise_signal(number)
        return last

    patch.setattr(stepper, "advance", send)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("number", ENDS)
def test_what_schedulers_and_terminals_send_is_a_stop_with_a_checkpoint(
    model: Path,
    probed: Model,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    number: signal.Signals,
) -> None:
    with monkeypatch.context() as patch:
        signalled(probed, number, 1, patch)
        assert main([str(model)]) == 128 + number
    out, err = capsys.readouterr()
    assert (out.splitlines()[0], err) == ("interrupted; to go on: pdsolve --resume plate.sqlite", "")
    with Results.open(Path("plate.sqlite")) as results:
        assert (results.meta()["status"], results.checkpoint()[0]) == ("interrupted", 33)
    assert signal.getsignal(number) is signal.SIG_DFL
    assert main(["--resume", "plate.sqlite", "-q"]) == 0
    simulate(probed, Path("alone.sqlite")).close()
    assert contents(Path("plate.sqlite")) == contents(Path("alone.sqlite"))


@pytest.mark.parametrize("number", ENDS)
def test_sent_twice_it_ends_at_once(
    model: Path,
    probed: Model,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    number: signal.Signals,
) -> None:
    signalled(probed, number, 2, monkeypatch)
    monkeypatch.setattr("pdsolve.run.simulation._can_stop_before_next_balance_row", lambda *_: False)
    assert main([str(model)]) == 128 + number
    assert capsys.readouterr() == ("", f"pdsolve: interrupted by {number.name}\n")


def test_under_nohup_a_terminal_that_is_closed_stops_nothing(
    model: Path, probed: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signalled(probed, signal.SIGHUP, 2, monkeypatch)
    assert main([str(model), "-q"]) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, *ENDS])
def test_every_program_ends_with_the_code_that_shells_give(
    capsys: pytest.CaptureFixture[str], number: signal.Signals
) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert commandline.run("pdmesh", lambda: signal.raise_signal(number) or 0, dict) == 128 + number
    finally:
        signal.signal(signal.SIGINT, before)
    by = "" if number == signal.SIGINT else f" by {number.name}"
    assert capsys.readouterr().err == f"pdmesh: interrupted{by}\n"


@pytest.mark.slow
@pytest.mark.endurance
def test_a_process_that_is_asked_to_end(model: Path, probed: Model) -> None:
    """From shell to shell."""
    words = ["--set", "run.steps=2000000", "--set", "run.every=100", "--set", "run.time_step=1e-10", "-q"]
    path = Path("long.sqlite")
    child = subprocess.Popen([sys.executable, "-m", "pdsolve", str(model), *words, "-o", str(path)])
    while child.poll() is None and not (path.exists() and path.stat().st_size):
        time.sleep(0.05)
    child.terminate()
    assert child.wait() == 128 + signal.SIGTERM
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
        results.verify()


@pytest.mark.slow
def test_another_run_has_begun_to_write(
    model: Path, probed: Model, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that saw no lock: the first ends in a line, and leaves all to the other."""
    path = Path("plate.sqlite")
    monkeypatch.setattr(Token, "is_alive", lambda *_: False)  # as of one on another machine
    stepper = type(prepare(probed, Options()).system.stepper)
    march, others = stepper.advance, []

    def resumed(own: Stepper, state: State, first: int, end: int) -> int:
        last = march(own, state, first, end)
        if first >= 33 and not others:
            others.append(first)
            newest(path, at_least=30)
            Path(f"{path}-lock").unlink()
            resume(path).close()
        return last

    with monkeypatch.context() as patch:
        patch.setattr(stepper, "advance", resumed)
        assert main([str(model), "-q"]) == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert mentions(err, "plate.sqlite", found=("another", "run", "writing"), expected="this one stops")
    simulate(probed, Path("alone.sqlite")).close()
    assert contents(path) == contents(Path("alone.sqlite"))


def test_to_ask_what_is_left_solves_nothing(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path("plate.sqlite")
    simulate_to = {"watch": lambda progress: progress.step == 33}
    from pdsolve.model import read_model

    simulate(read_model(model), path, **simulate_to).close()  # type: ignore[arg-type]
    before = path.read_bytes()
    assert main(["--dry-run", "--resume", str(path)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(
        "plate.sqlite: its run was stopped: --resume goes on from its last checkpoint, at step 33\n27 of 60"
    )
    assert err == ""
    assert main(["--dry-run", "--resume", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["state"], found["step"], found["left"], found["steps"]) == ("stopped", 33, 27, 60)
    assert path.read_bytes() == before
    assert sorted(file.name for file in Path().iterdir()) == ["plate.json", "plate.sqlite"]
    assert main(["--resume", str(path), "-q"]) == 0
    assert main(["--dry-run", "--resume", str(path)]) == 0
    assert capsys.readouterr().out == "plate.sqlite: its run is finished\n"
    for missing, words in (("none.sqlite", "no such file"), ("empty.sqlite", "nothing in it")):
        Path("empty.sqlite").touch()
        assert main(["--dry-run", "--resume", missing]) == 2
        assert words in capsys.readouterr().err


@pytest.mark.slow
def test_what_was_lost_of_a_log_is_said(model: Path, probed: Model, capsys: pytest.CaptureFixture[str]) -> None:
    """And a log without its database is neither removed nor read as nothing."""
    path, copy = Path("plate.sqlite"), Path("copy.sqlite")

    def kill(progress: Progress) -> bool:
        if progress.step == 57:
            newest(path, at_least=50)
            for beside in ("", "-wal"):
                shutil.copy(f"{path}{beside}", f"{copy}{beside}")
        return False

    simulate(probed, path, watch=kill).close()
    log = Path(f"{copy}-wal")
    whole = log.read_bytes()
    spoilt = bytearray(whole)
    spoilt[-10000] ^= 1
    for data, lost in ((whole, False), (bytes(spoilt), True)):
        log.write_bytes(data)
        assert pdpost(["damage", str(copy), "--json", "--force"]) == 0
        out, err = capsys.readouterr()
        until = 40 if lost else 50
        assert json.loads(out)["step"] == until
        assert err == "" or (mentions(err, f"step {until}") and err.count("\n") == 1)
        assert bool(err) == lost
    copy.rename("renamed.sqlite")
    for words in ([str(model), "-o", str(copy)], ["--dry-run", "--resume", str(copy)]):
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert mentions(err, "copy.sqlite", found="copy.sqlite-wal", expected=("rename", "remove"))
    assert log.exists()
    log.rename("renamed.sqlite-wal")
    assert main(["--resume", "renamed.sqlite", "-q"]) == 0
    assert contents(Path("renamed.sqlite")) == contents(path)


def test_a_run_is_prepared_where_a_signal_needs_no_interpreter(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long compiled calls may come from the first look at the model on."""
    events: list[str] = []

    def read(*_: object) -> None:
        events.append("read")
        raise commandline.UsageError("no further")

    monkeypatch.setattr("pdmesh.stopping.expect_long_call", lambda: events.append("expect"))
    monkeypatch.setattr("pdsolve.model.read_model", read)
    assert main([str(model), "-q"]) == 2
    assert events == ["expect", "read"]


def test_a_command_to_go_on_is_one_for_a_shell(capsys: pytest.CaptureFixture[str]) -> None:
    """Its file may have any name."""
    with pytest.raises(KeyboardInterrupt), _says_how_to_go_on(Path("$(touch a) b.sqlite"), Namespace(quiet=False)):
        raise KeyboardInterrupt("in a load step")
    assert "--resume '$(touch a) b.sqlite'" in capsys.readouterr().err
