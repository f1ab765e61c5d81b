"""Threads that share the work of compiled code.

numba's own parallel loops take long to compile, and some microseconds to begin and end each time. Here Python's threads
run compiled code side by side, and synchronize inside it. The caller only waits: in the main thread a signal's handler
raises between any two lines of Python, and the others would wait without end for what it leaves undone. The queues are
of C: each call is done or not begun.
"""

from __future__ import annotations

import ctypes
import os
import sys
from _thread import start_new_thread
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from queue import SimpleQueue
from typing import ClassVar, NamedTuple

import numba
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.atomics import call, counted, take

LEAST = 1000  # rows: a smaller part is done before another thread has begun
PATIENCE = 100_000  # looks at whether others have come, some 0.1 ms, before one sleeps
NAP = 20  # us


class Gate(NamedTuple):
    """A barrier for threads."""

    arrived: NDArray[np.int64]  # (1,) how often any thread has come
    threads: int
    idle: int  # the address of what lets somebody else have the processor


def cores() -> int:
    """Largest number of threads: the cores that the process may use, or NUMBA_NUM_THREADS."""
    return int(numba.config.NUMBA_NUM_THREADS)


def useful_threads(rows: int, least: int = LEAST) -> int:
    """Number of threads worth using for `rows` rows, with at least `least` rows each."""
    return max(1, min(cores(), rows // least))


def gate_of(threads: int) -> Gate:
    """A gate for so many threads."""
    return Gate(np.zeros(1, dtype=np.int64), threads, _idle())


@cache
def _idle() -> int:
    """Address of a system function that yields the processor for a moment.

    Offering it (sched_yield) waits for all others' turns, some milliseconds each; a sleeping thread is woken in time.
    """
    if sys.platform == "win32":
        idle = ctypes.windll.kernel32.SwitchToThread  # leaves the number alone
    else:
        idle = ctypes.CDLL(None).usleep
    return ctypes.cast(idle, ctypes.c_void_p).value or 0


@njit(_nrt=False, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def meet(gate):  # type: ignore[no-untyped-def]
    """Wait until all threads have arrived here."""
    if gate.threads == 1:
        return
    wait(gate.arrived, 0, (take(gate.arrived, 0) // gate.threads + 1) * gate.threads, gate)


@njit(_nrt=False, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def wait(counts, at, goal, gate):  # type: ignore[no-untyped-def]
    """Wait until a count reaches its goal."""
    looks = 0
    while counted(counts, at) < goal:
        looks += 1
        if looks > PATIENCE:
            call(gate.idle, NAP)


class _SharedWork:
    """Work that several threads begin together, or none of them."""

    def __init__(self, work: Callable[[int], None], threads: int) -> None:
        self._work, self._threads = work, threads
        self._decisions: list[bool] = []  # whether it is done; the first one counts
        self._start: SimpleQueue[None] = SimpleQueue()
        self._ends: SimpleQueue[None] = SimpleQueue()
        self.errors: list[BaseException | None] = []  # of the threads that are done

    def decide(self, is_done: bool) -> None:
        """Let the threads begin, or none of them if it is not to be done; only the first call counts."""
        self._decisions.append(is_done)
        self._start.put(None)

    def run(self, thread: int, release: Callable[[], None]) -> None:
        """Do the part of a thread once it is decided; `release` is called before its end is known."""
        self._start.get()
        self._start.put(None)  # for the next one
        error: BaseException | None = None
        if self._decisions[0]:
            try:
                self._work(thread)
            except BaseException as reason:
                error = reason
        release()
        self.errors.append(error)
        self._ends.put(None)

    def wait(self) -> None:
        """Wait for the end of all threads, if they begin; an interrupt meanwhile is raised after that."""
        interrupt: KeyboardInterrupt | None = None
        while self._decisions[0] and len(self.errors) < self._threads:
            try:
                self._ends.get()
            except KeyboardInterrupt as reason:
                interrupt = reason
        if interrupt is not None:
            raise interrupt


class _Helper:
    """A thread that does its part of one piece of work after the other, as long as the process runs.

    The class `threading.Thread` begins one in many lines of Python, between which a signal's handler may raise.
    """

    idle: ClassVar[list[_Helper]] = []

    def __init__(self) -> None:
        self._parts: SimpleQueue[tuple[_SharedWork, int]] = SimpleQueue()
        self.process = os.getpid()
        start_new_thread(self._run, ())

    def begin(self, work: _SharedWork, part: int) -> None:
        """Do a part of some work."""
        self._parts.put((work, part))

    def _run(self) -> None:
        while True:
            work, part = self._parts.get()
            work.run(part, lambda: self.idle.append(self))
            del work  # and the arrays that it has


def _helpers(count: int) -> list[_Helper]:
    """Threads that have nothing to do. Raises RuntimeError for too many."""
    helpers: list[_Helper] = []
    try:
        while len(helpers) < count:
            helper = _Helper.idle.pop() if _Helper.idle else _Helper()
            if helper.process == os.getpid():  # not that of a process from which this one was forked
                helpers.append(helper)
    except BaseException:
        _Helper.idle.extend(helpers)
        raise
    return helpers


def side_by_side(work: Callable[[int], None], threads: int) -> None:
    """Run `work(thread)` on `threads` threads; it must release the GIL. Raises RuntimeError for too many threads.

    An interrupt is raised when all of them are done.
    """
    if threads == 1:
        work(0)
        return
    shared_work, helpers = _SharedWork(work, threads), _helpers(threads)
    try:
        for thread, helper in enumerate(helpers):
            helper.begin(shared_work, thread)
        shared_work.decide(True)
        shared_work.wait()
    except BaseException:
        shared_work.decide(False)  # where not all of them have come
        shared_work.wait()
        raise
    for error in shared_work.errors:
        if error is not None:
            raise error


def share(work: Callable[[int, int], None], rows: int, threads: int) -> None:
    """Run `work(first, last)` on all rows, divided equally among threads; it must release the GIL."""
    parts = max(1, min(threads, rows // LEAST))
    ends = list(pairwise(rows * part // parts for part in range(parts + 1)))
    side_by_side(lambda part: work(*ends[part]), parts)
