"""Ends a program in time after a signal, also within a long compiled call, where Python runs no handler of its own.

Python notes a signal in C and runs its handler when the main thread is back from such a call. A thread is woken by the
note itself. It ends the process if that has not ended by itself when its time is over.
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

AT_ONCE = (1.5, 0.0)  # s from the first signal to the end, and from each later one, where nothing is to be saved
SAVING = (math.inf, 10.0, 1.5)  # likewise, of a run that writes a checkpoint when it is asked to end
WORKERS = (15.0, 1.5)  # likewise, where processes write checkpoints

_patience: tuple[float, ...] = AT_ONCE
_unfinished: dict[str, None] = {}  # files, in the order of their creation
_last_acts: list[Callable[[], None]] = []


def set_patience(seconds: tuple[float, ...]) -> tuple[float, ...]:
    """Set the seconds from the first signal to a forced end, and from each later one; returns the previous ones."""
    global _patience
    before, _patience = _patience, seconds
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
    _unfinished[name] = None
    return name


def finish_file(name: str) -> None:
    """A forced end leaves this file alone from now on."""
    _unfinished.pop(name, None)


@contextmanager
def last_act(act: Callable[[], None]) -> Iterator[None]:
    """A context in which a forced end calls `act` first."""
    _last_acts.append(act)
    try:
        yield
    finally:
        _last_acts.remove(act)


@contextmanager
def forced_end(numbers: frozenset[int], line: Callable[[int], tuple[int, str]]) -> Iterator[None]:
    """A context within which one of these signals ends the process in time.

    `line` returns the exit code and the line on stderr that go with a signal. Nothing is forced on Windows, or where
    others listen for signals in the same way.
    """
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        yield
        return
    ear, mouth = os.pipe()
    os.set_blocking(mouth, False)
    before = signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    if before != -1:
        signal.set_wakeup_fd(before)
        os.close(ear)
        os.close(mouth)
        yield
        return
    watchdog = threading.Thread(target=_watch, args=(ear, numbers, line), name="watchdog", daemon=True)
    watchdog.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(-1)
        os.write(mouth, b"\0")
        watchdog.join()
        os.close(ear)
        os.close(mouth)


def _watch(ear: int, numbers: frozenset[int], line: Callable[[int], tuple[int, str]]) -> None:
    """Read the numbers of signals, up to a zero; end the process if time is over before."""
    signals, until, last = 0, math.inf, 0
    while select.select([ear], [], [], None if until == math.inf else max(until - time.monotonic(), 0.0))[0]:
        number = os.read(ear, 1)[0]
        if number == 0:
            return
        if number in numbers:
            until = min(until, time.monotonic() + _patience[min(signals, len(_patience) - 1)])
            signals, last = signals + 1, last or number
    _end(*line(last))


def _end(code: int, line: str) -> None:
    for act in _last_acts[::-1]:
        with suppress(Exception):
            act()
    for name in list(_unfinished)[::-1]:
        with suppress(OSError):
            os.unlink(name)
    with suppress(OSError):  # not by sys.stderr, whose lock the main thread may have
        os.write(2, f"{line}\n".encode(errors="backslashreplace"))
    os._exit(code)
