"""Compiling is said while it lasts, and is no part of the time of a run."""

from __future__ import annotations

import threading
import time

import numba
import pytest
from numba.extending import overload

from pdsolve.codegen import compile_time

HEARD = threading.Event()


def _slowly() -> float:
    return 1.0


@overload(_slowly)
def _typed_slowly():  # type: ignore[no-untyped-def]
    assert HEARD.wait(30.0)
    return lambda: 1.0


def test_compiling_is_said_once_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        HEARD.set()

    monkeypatch.setattr(compile_time, "PATIENCE", 0.05)
    with compile_time.compile_time_said(say):
        assert numba.njit(lambda: _slowly())() == 1.0
    assert len(said) == 1


def test_the_clock_of_a_run_stands_still_while_kernels_compile() -> None:
    first, before, began, second = (
        time.perf_counter(),
        compile_time.compile_seconds(),
        compile_time.running_time(),
        time.perf_counter(),
    )
    numba.njit(lambda: 3)()
    passed, compiled = time.perf_counter() - second, compile_time.compile_seconds() - before
    ran = compile_time.running_time() - began
    assert 0 < compiled <= passed
    assert passed - compiled <= ran <= time.perf_counter() - first - compiled


def test_a_short_compilation_is_not_said(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(compile_time, "PATIENCE", 600.0)
    with compile_time.compile_time_said(said.append):
        assert numba.njit(lambda: 2)() == 2
    assert said == []
