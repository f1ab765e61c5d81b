"""Threads that share the work of compiled code.

numba's own parallel loops take long to compile, and some microseconds to begin and end each time. Here Python's threads
run compiled code side by side, and synchronize inside it.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from threading import Barrier
from typing import NamedTuple

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


def crew(rows: int, least: int = LEAST) -> int:
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


def side_by_side(work: Callable[[int], None], threads: int) -> None:
    """Run `work(thread)` on `threads` threads; it must release the GIL. Raises RuntimeError for too many threads."""
    if threads == 1:
        work(0)
        return
    begin = Barrier(threads)

    def begun(thread: int) -> None:
        begin.wait()
        work(thread)

    with ThreadPoolExecutor(threads - 1) as pool:
        try:
            others = [pool.submit(begun, thread) for thread in range(1, threads)]
        except RuntimeError:
            begin.abort()  # nobody waits for one who never comes
            raise
        begun(0)
        for future in others:
            future.result()


def share(work: Callable[[int, int], None], rows: int, threads: int) -> None:
    """Run `work(first, last)` on all rows, divided equally among threads; it must release the GIL."""
    parts = max(1, min(threads, rows // LEAST))
    ends = list(pairwise(rows * part // parts for part in range(parts + 1)))
    side_by_side(lambda part: work(*ends[part]), parts)
