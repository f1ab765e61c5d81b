"""What kernels are compiled for, and how long: no part of a run's time, and said while it lasts."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numba
from llvmlite import binding
from numba.core import event

PATIENCE = 1.0  # s of compiling that nobody hears of


class _Clock(event.Listener):
    """Sums the time of compilations, s; those inside another one are part of it."""

    def __init__(self) -> None:
        self._total, self._depth, self._begun = 0.0, 0, 0.0

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1:
            self._begun = time.perf_counter()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._total += time.perf_counter() - self._begun

    @property
    def seconds(self) -> float:
        return self._total + (time.perf_counter() - self._begun if self._depth else 0.0)


@cache
def _clock() -> _Clock:
    """The clock of this process, which runs from now on."""
    clock = _Clock()
    event.register("numba:compile", clock)
    return clock


def compile_seconds() -> float:
    """Seconds that this process has compiled kernels for, since the first call."""
    return _clock().seconds


def running_time() -> float:
    """Seconds on a clock that stands still while kernels are compiled; only differences mean something."""
    return time.perf_counter() - compile_seconds()


class _Listener(event.Listener):
    """Says once that kernels are compiled, when that has taken `PATIENCE`."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._said, self._say, self._depth = False, say, 0
        self._timer = threading.Timer(PATIENCE, self._report)

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1 and not self._said:
            self._timer = threading.Timer(PATIENCE, self._report)
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()

    def _report(self) -> None:
        self._said = True
        self._say("compiling kernels for this processor, once")


@contextmanager
def compile_time_said(say: Callable[[str], None]) -> Iterator[None]:
    """A context that says that kernels are compiled, if that takes more than a second."""
    with event.install_listener("numba:compile", _Listener(say)):
        yield


def processor_kind() -> str:
    """Name of the processor in LLVM's words, such as "znver3", or what numba is told to compile for.

    It decides the last bits of sums.
    """
    name = numba.config.CPU_NAME or binding.get_host_cpu_name()
    return f"{name} {numba.config.CPU_FEATURES}" if numba.config.CPU_FEATURES else str(name)
