"""A signal ends a program in time, with one line and its exit code, and leaves nothing half written."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from pdmesh import compiled_watch, stopping
from pdmesh.compiled_watch import SignalTable
from pdmesh.files import LARGE, check_regular

PROGRAM = """if True:
    import ctypes, hashlib, signal, sys, threading, time
    from pathlib import Path
    from pdmesh import commandline, stopping
    from pdmesh.files import replacing

    def call():
        "A long call into a library, which runs no handler of Python's; it leaves Python to other threads."
        hashlib.pbkdf2_hmac("sha512", b"", b"", 1 << 30)

    def hold():
        "A long call that keeps the interpreter's lock."
        sum(range(1 << 40))

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
@pytest.mark.parametrize("first", ["stopping._is_ready.wait(60.0)", "stopping.expect_long_call()"])
def test_while_a_call_holds_the_interpreter(tmp_path: Path, first: str) -> None:
    """After a second or so no thread of Python is needed any more, or at once where a long call is expected."""
    with started(tmp_path, f"{first}; print('ready', flush=True); hold()") as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.2)
        began = time.monotonic()
        child.send_signal(signal.SIGTERM)
        try:
            said = child.communicate(timeout=30)[1]
        finally:
            child.kill()
    assert time.monotonic() - began < 2.0 + 2.0  # on a busy machine; measured 1.53
    assert (child.returncode, said) == (143, "pdmesh: interrupted by SIGTERM\n")
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


# ---- the compiled watch


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The exit codes with which the compiled code would have ended this process."""
    codes: list[int] = []
    end = ctypes.CFUNCTYPE(None, ctypes.c_int)(codes.append)
    address = ctypes.cast(end, ctypes.c_void_p).value
    monkeypatch.setattr(compiled_watch, "SignalTable", partial(SignalTable, address))
    before = signal.signal(signal.SIGINT, lambda *_: None)
    yield codes
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


def written(folder: Path, *names: str) -> list[Path]:
    """New files of these names."""
    for name in names:
        (folder / name).write_text("{")
    return [folder / name for name in names]


def interrupted(number: int) -> tuple[int, str]:
    return 128 + number, "ended"


def test_the_compiled_watch_reads_signals_and_ends(
    tmp_path: Path, ended: list[int], pipe: tuple[int, int], capfd: pytest.CaptureFixture[str]
) -> None:
    """Other signals count for nothing; the first one that counts leaves all the time, and names the exit code."""
    watch = compiled_watch.compiled_watch()
    assert watch is not None
    partial_file, finished = written(tmp_path, "part", "finished")
    table = compiled_watch.SignalTable()
    table.listen(pipe[0], {2: (130, "by Ctrl-C"), 15: (143, "by SIGTERM \udcff")})
    table.begin(0, math.inf, 0)
    table.set_patience((math.inf, 0.05))
    table.add_file(0, str(partial_file))
    table.add_file(1, str(finished))
    table.add_file(1 << 20, str(finished))
    table.drop_file(1)
    table.drop_file(1 << 20)
    heard, words = os.pipe()
    table.set_words((words, b"all is said"))
    os.write(pipe[1], bytes([28, 255, 15, 28, 2]))
    began = time.monotonic()
    watch(table.address)
    assert time.monotonic() - began >= 0.05
    assert ended == [143]
    assert capfd.readouterr().err == "by SIGTERM \\udcff\n"
    assert os.read(heard, 99) == b"all is said"
    assert [path.name for path in tmp_path.iterdir()] == ["finished"]
    os.close(heard)
    os.close(words)


def test_the_compiled_watch_leaves_at_a_zero(ended: list[int], pipe: tuple[int, int]) -> None:
    watch = compiled_watch.compiled_watch()
    assert watch is not None
    table = compiled_watch.SignalTable()
    table.listen(pipe[0], {15: (143, "")})
    table.begin(1, time.monotonic() + 60.0, 15)
    table.set_patience((60.0,))
    os.write(pipe[1], bytes([15, 0]))
    watch(table.address)
    assert ended == []


def test_time_counts_from_a_signal_before_the_code_was_compiled(ended: list[int], pipe: tuple[int, int]) -> None:
    watch = compiled_watch.compiled_watch()
    assert watch is not None
    table = compiled_watch.SignalTable()
    table.listen(pipe[0], {15: (143, "")})
    table.begin(1, time.monotonic() - 1.0, 15)
    table.set_patience((math.inf,))
    watch(table.address)
    assert ended == [143]


def test_the_compiled_watch_knows_what_changes(
    tmp_path: Path, ended: list[int], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Files that were begun before and after it, those that are finished, and the patience."""
    monkeypatch.setattr(stopping, "_patience", (60.0, 60.0))
    paths = written(tmp_path, "early", "late", "early finished", "late finished")
    early, done = stopping.begin_file(paths[0]), stopping.begin_file(paths[2])
    try:
        with stopping.forced_end(frozenset([signal.SIGINT]), interrupted):
            stopping.expect_long_call()
            late = stopping.begin_file(paths[1])
            stopping.finish_file(done)
            stopping.finish_file(stopping.begin_file(paths[3]))
            stopping.set_patience((0.05, 0.0))
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.2)
            assert ended == [130]
        stopping.finish_file(late)
    finally:
        stopping.finish_file(early)
    assert capfd.readouterr().err == "ended\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["early finished", "late finished"]


def test_a_context_ends_the_compiled_watch(ended: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stopping, "_patience", (0.2, 0.0))
    with stopping.forced_end(frozenset([signal.SIGINT]), interrupted):
        stopping.expect_long_call()
        signal.raise_signal(signal.SIGINT)
    time.sleep(0.3)
    assert ended == []


def test_without_a_compiler_a_thread_of_python_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    codes: list[tuple[int, str]] = []
    monkeypatch.setattr(compiled_watch, "compiled_watch", lambda: None)
    monkeypatch.setattr(stopping, "_end", lambda *how: codes.append(how))
    monkeypatch.setattr(stopping, "_patience", (0.05, 0.0))
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        with stopping.forced_end(frozenset([signal.SIGINT]), interrupted):
            stopping.expect_long_call()
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert codes == [(130, "ended")]


def test_large_files_are_read_by_long_calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected: list[None] = []
    monkeypatch.setattr(stopping, "expect_long_call", lambda: expected.append(None))
    for size in (LARGE, LARGE + 1):
        with open(tmp_path / "plate.json", "wb") as file:
            file.truncate(size)
        check_regular(tmp_path / "plate.json")
    assert len(expected) == 1
