"""Ends a program in time after a signal, also within a long compiled call, where Python runs no handler of its own.

Python notes a signal in C and runs its handler when the main thread is back from such a call. A thread is woken by the
note itself. It ends the process if that has not ended by itself when its time is over. In a program that is not quick
the thread is compiled code (`pdmesh.compiled_watch`), as a call may hold the interpreter's lock.
"""

from __future__ import annotations

import math
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pdmesh.compiled_watch import SignalTable

AT_ONCE = (1.5, 0.0)  # s from the first signal to the end, and from each later one, where nothing is to be saved
SAVING = (math.inf, 10.0, 1.5)  # likewise, of a run that writes a checkpoint when it is asked to end
WORKERS = (15.0, 1.5)  # likewise, where processes write checkpoints

QUICK = 0.3  # s: a program that takes longer loads the compiler, which takes .1 s
READY = 2.0  # s: the longest wait for the compiled code
COMPILE = 255  # what the pipe hears when a long call is near; no signal has this number

_patience: tuple[float, ...] = AT_ONCE
_unfinished: dict[str, int] = {}  # files, in the order of their creation, and their rows in the table
_last_words: tuple[int, bytes] | None = None
_table: SignalTable | None = None  # of the compiled code, while it watches
_mouth: int | None = None  # of the pipe, while a thread listens
_is_ready = threading.Event()  # the compiled code watches, or there is none


def set_patience(seconds: tuple[float, ...]) -> tuple[float, ...]:
    """Set the seconds from the first signal to a forced end, and from each later one; returns the previous ones."""
    global _patience
    before, _patience = _patience, seconds
    if _table is not None:
        _table.set_patience(seconds)
    return before


def has_nothing_to_save() -> bool:
    """Whether a signal may end at once what is being done."""
    return _patience == AT_ONCE


@contextmanager
def patience(seconds: tuple[float, ...]) -> Iterator[None]:
    """A context in which a forced end leaves so many seconds after the first signal, and after each later one."""
    before = set_patience(seconds)
    try:
        yield
    finally:
        set_patience(before)


def begin_file(path: str | os.PathLike[str]) -> str:
    """Note a file that a forced end removes as half written; returns the name for `finish_file`.

    Of a link, the link itself is removed.
    """
    folder, last = os.path.split(os.fspath(path))
    name = os.path.join(os.path.realpath(folder), last)
    row = _unfinished[name] = 1 + max(_unfinished.values(), default=-1)
    if _table is not None:
        _table.add_file(row, name)
    return name


def finish_file(name: str) -> None:
    """A forced end leaves this file alone from now on."""
    row = _unfinished.pop(name, None)
    if _table is not None and row is not None:
        _table.drop_file(row)


@contextmanager
def last_words(handle: int, words: bytes) -> Iterator[None]:
    """A context in which a forced end first writes these words to a file that is open."""
    _set_words((handle, words))
    try:
        yield
    finally:
        _set_words(None)


def _set_words(words: tuple[int, bytes] | None) -> None:
    global _last_words
    _last_words = words
    if _table is not None:
        _table.set_words(words)


def expect_long_call() -> None:
    """Return when a forced end no longer needs the interpreter's lock; for the main thread, before a call that has it.

    A program that is not quick comes to this by itself.
    """
    if _mouth is not None and not _is_ready.is_set():
        os.write(_mouth, bytes([COMPILE]))
        _is_ready.wait(READY)


@contextmanager
def forced_end(numbers: frozenset[int], line: Callable[[int], tuple[int, str]]) -> Iterator[None]:
    """A context within which one of these signals ends the process in time.

    `line` returns the exit code and the line on stderr that go with a signal. Nothing is forced on Windows, or where
    others listen for signals in the same way.
    """
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        yield
        return
    global _mouth
    ear, mouth = os.pipe()
    os.set_blocking(mouth, False)
    before = signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    if before != -1:
        signal.set_wakeup_fd(before)
        os.close(ear)
        os.close(mouth)
        yield
        return
    _is_ready.clear()
    watchdog = threading.Thread(target=_watch, args=(ear, numbers, line), name="watchdog", daemon=True)
    watchdog.start()
    _mouth = mouth
    try:
        yield
    finally:
        _mouth = None
        signal.set_wakeup_fd(-1)
        os.write(mouth, b"\0")
        watchdog.join()
        os.close(ear)
        os.close(mouth)


def _watch(ear: int, numbers: frozenset[int], line: Callable[[int], tuple[int, str]]) -> None:
    """Read the numbers of signals, up to a zero; end the process if time is over before."""
    signals, until, last, quick = 0, math.inf, 0, time.monotonic() + QUICK
    while True:
        due = min(until, quick)
        if select.select([ear], [], [], None if due == math.inf else max(due - time.monotonic(), 0.0))[0]:
            number = os.read(ear, 1)[0]
            if number == 0:
                return
            if number == COMPILE:
                quick = min(quick, time.monotonic())
            elif number in numbers:
                until = min(until, time.monotonic() + _patience[min(signals, len(_patience) - 1)])
                signals, last = signals + 1, last or number
        elif until <= quick:
            _end(*line(last))
            return
        else:
            quick = math.inf
            if _watch_compiled(ear, {number: line(number) for number in numbers}, (signals, until, last)):
                return


def _watch_compiled(ear: int, lines: dict[int, tuple[int, str]], begin: tuple[int, float, int]) -> bool:
    """Go on with the watch in compiled code, up to a zero; False where there is none.

    Other threads may change what the table is to have meanwhile: each value is looked at again when it is written.
    """
    global _table
    from pdmesh.compiled_watch import SignalTable, compiled_watch

    watch = compiled_watch()
    if watch is None:
        _is_ready.set()
        return False
    _table = table = SignalTable()
    try:
        table.listen(ear, lines)
        table.begin(*begin)
        patience = words = None
        while patience is not _patience or words is not _last_words:
            patience, words = _patience, _last_words
            table.set_patience(patience)
            table.set_words(words)
        for name, row in list(_unfinished.items()):
            table.add_file(row, name)
            if name not in _unfinished:
                table.drop_file(row)
        _is_ready.set()
        watch(table.address)
    finally:
        _table = None
    return True


def _end(code: int, line: str) -> None:
    with suppress(OSError):
        if _last_words is not None:
            os.write(*_last_words)
    for name in list(_unfinished)[::-1]:
        with suppress(OSError):
            os.unlink(name)
    with suppress(OSError):  # not by sys.stderr, whose lock the main thread may have
        os.write(2, f"{line}\n".encode(errors="backslashreplace"))
    os._exit(code)
