"""A signal ends a program in time, with one line and its exit code, and leaves nothing half written."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pdmesh import stopping

PROGRAM = """if True:
    import ctypes, hashlib, signal, sys, threading, time
    from pathlib import Path
    from pdmesh import commandline, stopping
    from pdmesh.files import replacing

    def call():
        "A long call into a library, which runs no handler of Python's; it leaves Python to other threads."
        hashlib.pbkdf2_hmac("sha512", b"", b"", 1 << 30)

    def command():
        with replacing(Path("plate.json")) as part:
            part.write_bytes(b"{")
            print("begun", flush=True)
            {body}
        return 0

    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(commandline.run("pdmesh", command, dict))
"""


def started(here: Path, body: str) -> subprocess.Popen[str]:
    """A program that has begun to write a file and does what `body` says."""
    code = PROGRAM.replace("{body}", body)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    child = subprocess.Popen([sys.executable, "-c", code], cwd=here, text=True, **pipes)  # type: ignore[call-overload]
    assert child.stdout.readline() == "begun\n"
    return child  # type: ignore[no-any-return]


@pytest.mark.endurance
@pytest.mark.parametrize(("number", "code", "line"), [("SIGINT", 130, ""), ("SIGTERM", 143, " by SIGTERM")])
def test_within_a_long_call(tmp_path: Path, number: str, code: int, line: str) -> None:
    with started(tmp_path, "call()") as child:
        began = time.monotonic()
        child.send_signal(getattr(signal, number))
        said = child.communicate(timeout=60)[1]
    assert time.monotonic() - began < 2.0 + 2.0  # on a busy machine
    assert (child.returncode, said) == (code, f"pdmesh: interrupted{line}\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.endurance
def test_a_handler_that_waits_for_ever_is_ended(tmp_path: Path) -> None:
    """A lock that stays taken, as after an interrupt within `concurrent.futures`."""
    body = "lock = threading.Lock(); lock.acquire()\n            try: call()\n            finally: lock.acquire()"
    body = body.replace("call()", "time.sleep(60)")
    with started(tmp_path, body) as child:
        child.send_signal(signal.SIGINT)
        said = child.communicate(timeout=60)[1]
    assert (child.returncode, said) == (130, "pdmesh: interrupted\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.endurance
def test_a_run_is_ended_by_its_second_signal(tmp_path: Path) -> None:
    """The first one is noted, as a run writes a checkpoint then."""
    body = "signal.signal(signal.SIGINT, lambda *_: None); stopping.set_patience((float('inf'), 0.2)); call()"
    with started(tmp_path, body) as child:
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(3.0)
        child.send_signal(signal.SIGINT)
        said = child.communicate(timeout=60)[1]
    assert (child.returncode, said) == (130, "pdmesh: interrupted\n")


def test_patience_is_as_before_after_a_context() -> None:
    before = stopping.set_patience(stopping.AT_ONCE)
    try:
        with stopping.patience(stopping.WORKERS):
            assert stopping.set_patience(stopping.WORKERS) == stopping.WORKERS
        assert stopping.set_patience(before) == stopping.AT_ONCE
    finally:
        stopping.set_patience(before)


def test_a_program_that_ends_by_itself_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its signal came late, and its watchdog ends with it."""
    ended: list[tuple[int, str]] = []
    monkeypatch.setattr(stopping, "_end", lambda *how: ended.append(how))
    monkeypatch.setattr(stopping, "_patience", (0.05, 0.0))
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        with stopping.forced_end(frozenset([signal.SIGINT]), lambda number: (128 + number, "ended")):
            signal.raise_signal(signal.SIGINT)
        time.sleep(0.1)
        assert ended == []
        with stopping.forced_end(frozenset([signal.SIGINT]), lambda number: (128 + number, "ended")):
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.2)
        assert ended == [(130, "ended")]
    finally:
        signal.signal(signal.SIGINT, before)


def test_of_a_link_its_own_name_is_noted(tmp_path: Path) -> None:
    """A forced end removes the link, never what it leads to."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "short").symlink_to("folder")
    (tmp_path / "folder" / "link").symlink_to(tmp_path / "victim")
    name = stopping.begin_file(tmp_path / "short" / "link")
    stopping.finish_file(name)
    assert name == str((tmp_path / "folder").resolve() / "link")
