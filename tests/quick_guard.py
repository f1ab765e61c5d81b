"""Keeps the quick suite quick: a quick test that takes too long, or starts a process unmarked, fails.

What is done once in a process, such as imports and caches of fonts, falls on the test that happens to be first. So one
that took too long runs once more, and fails if it takes too long again.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import pytest
from _pytest.runner import runtestprotocol
from tiers import tier_of

LIMIT = 1.0  # s of CPU time of a quiet machine in a test and in fixtures of its own
REFERENCE = 0.012  # s of CPU time of `_loop` on the machine that the limit was chosen on, when it was quiet
STARTS = frozenset({"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn"})


class _Clock:
    """CPU time and started processes of the test that runs, without compiling and without what tests share."""

    def __init__(self) -> None:
        self.process_starts = 0
        self._shared = 0.0  # s, and the number of starts, in fixtures of wider scope
        self._shared_starts = 0
        self._compiling = 0.0
        self._listens = False

    def seconds(self) -> float:
        """CPU seconds of this process that count."""
        return time.process_time() - self._shared - self._compiling

    def starts(self) -> int:
        """Processes started by what counts."""
        return self.process_starts - self._shared_starts

    def leave_out(self, seconds: float, starts: int) -> None:
        """Leave out what a fixture of wider scope took."""
        self._shared += seconds
        self._shared_starts += starts

    def listen(self) -> None:
        """Leave out what numba compiles, which depends on which test comes first."""
        if self._listens or "numba" not in sys.modules:
            return
        from numba.core import event

        clock = self

        class Compiling(event.Listener):
            """Adds up the CPU time between the outermost start and end of compiling."""

            depth, begin = 0, 0.0

            def on_start(self, event: Any) -> None:
                if self.depth == 0:
                    self.begin = time.process_time()
                self.depth += 1

            def on_end(self, event: Any) -> None:
                self.depth -= 1
                if self.depth == 0:
                    clock._compiling += time.process_time() - self.begin

        event.register("numba:compile", Compiling())
        self._listens = True


CLOCK = _Clock()


def _loop() -> int:
    """Some work of the interpreter."""
    return sum(len(str(i)) for i in range(100_000))


def slowness() -> float:
    """CPU time of a loop on this machine, as busy as it is now, over that on the quiet machine of reference."""
    seconds = []
    for _ in range(5):
        begin = time.process_time()
        _loop()
        seconds.append(time.process_time() - begin)
    return statistics.median(seconds) / REFERENCE


def _note_start(event: str, _: tuple[Any, ...]) -> None:
    if event in STARTS:
        CLOCK.process_starts += 1


def pytest_configure() -> None:
    """Count processes that are started from now on."""
    sys.addaudithook(_note_start)


@contextmanager
def shared() -> Iterator[None]:
    """Leave out what several tests share: which test pays is chance."""
    seconds, starts = CLOCK.seconds(), CLOCK.starts()
    try:
        yield
    finally:
        CLOCK.leave_out(CLOCK.seconds() - seconds, CLOCK.starts() - starts)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Iterator[None]:
    """Leave out what fixtures of wider scope take."""
    with nullcontext() if fixturedef.scope == "function" else shared():
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, and once more if it took too long; what is reported is the last run."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    if item.stash.get(TOO_LONG, False):
        item._initrequest()  # type: ignore[attr-defined]  # fixtures anew
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """Note where the test's own time begins."""
    CLOCK.listen()
    item.stash[BEGIN] = CLOCK.seconds(), CLOCK.starts()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a quick test that is not quick."""
    yield
    if tier_of(item) != "quick":
        return
    CLOCK.listen()
    seconds, starts = item.stash[BEGIN]
    if (spent := CLOCK.seconds() - seconds) > LIMIT and spent > (limit := LIMIT * max(1.0, slowness())):
        if item.stash.get(TOO_LONG, False):
            pytest.fail(
                f"A quick test took {spent:.2f} s of CPU time, {limit:.2f} s at most: mark it slow", pytrace=False
            )
        item.stash[TOO_LONG] = True
    if CLOCK.starts() > starts and not item.get_closest_marker("process"):
        pytest.fail("A quick test started a process: mark it process, or call main(argv)", pytrace=False)


BEGIN = pytest.StashKey[tuple[float, int]]()
TOO_LONG = pytest.StashKey[bool]()  # the first time
