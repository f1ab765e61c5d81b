"""A worker process on this machine, which solves one run after the other and ends when its parent is gone.

Its libraries are imported only when it solves: before, nothing protects them from settings in the current folder.
"""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from types import FrameType
from typing import TYPE_CHECKING

from pdmesh import trust

if TYPE_CHECKING:
    from pdsolve.study.one_run import Outcome, Task

GRACE = 10.0  # s in which a worker that is to stop may write down where its run is

_solves = threading.Event()
_stops = threading.Event()


def prepare(parent_pipe: Connection) -> None:
    """Prepare a worker; it stops when the other end of the pipe `parent_pipe` is closed."""
    trust.settle()
    signal.signal(signal.SIGINT, _interrupted)
    threading.Thread(target=_stop_when_closed, args=(parent_pipe,), daemon=True).start()


def _interrupted(number: int, frame: FrameType | None) -> None:
    if _stops.is_set() and _solves.is_set():
        raise KeyboardInterrupt


def _stop_when_closed(parent_pipe: Connection) -> None:
    """Wait until the pipe closes, then interrupt the current run and end the process."""
    with suppress(EOFError, OSError):
        parent_pipe.recv_bytes()
    _stops.set()
    if _solves.is_set():
        if hasattr(signal, "pthread_kill"):  # the main thread, in Python code or in a system call
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        else:
            signal.raise_signal(signal.SIGINT)
        threading.Event().wait(GRACE)
    os._exit(1)


def solve(task: Task) -> Outcome:
    """Solve a run and measure it."""
    from pdsolve.study.one_run import solve_and_measure

    _solves.set()
    try:
        return solve_and_measure(task)
    finally:
        _solves.clear()
        if _stops.is_set():
            os._exit(1)
