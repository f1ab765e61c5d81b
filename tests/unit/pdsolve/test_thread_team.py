"""Threads that share work: all begin or none, and an interrupt of the one that waits leaves nothing behind."""

from __future__ import annotations

import re
import signal
import threading
import time

import pytest
from interrupts import interrupted_at
from plates import ROOT

from pdsolve.numerics import thread_team
from pdsolve.numerics.thread_team import side_by_side

pytestmark = pytest.mark.usefixtures("listens")
THREADS = 3


class Parts:
    """Parts of some work, each of which needs all others, as kernels that meet at a gate do."""

    def __init__(self) -> None:
        self.begun, self.ended = list[int](), list[int]()
        self._gate = threading.Barrier(THREADS)

    def __call__(self, part: int) -> None:
        self.begun.append(part)
        self._gate.wait(10.0)
        self.ended.append(part)


def test_an_interrupt_at_any_line_lets_all_parts_end_or_none_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C as each line of the waiting thread begins: none hangs."""
    line, interrupts = 0, 0
    monkeypatch.setattr(thread_team._Helper, "idle", [])
    while True:
        parts = Parts()
        interrupted = interrupted_at(line, lambda parts=parts: side_by_side(parts, THREADS))  # type: ignore[misc]
        assert sorted(parts.begun) == sorted(parts.ended)
        assert len(parts.ended) in ((0, THREADS) if interrupted else (THREADS,))
        interrupts += interrupted
        line += 1
        if not interrupted and line > 1:
            break
    assert interrupts > 15


def test_what_is_decided_first_counts() -> None:
    """An interrupt may come between the decision and its end."""
    for decision in (True, False):
        parts = list[int]()
        work = thread_team._SharedWork(parts.append, 1)
        work.decide(decision)
        work.decide(False)
        work.run(0, lambda: None)
        work.wait()
        assert parts == [0] * decision


def test_interrupts_while_it_waits_come_after_the_end() -> None:
    parts = Parts()

    def work(part: int) -> None:
        for _ in range(3 if part == 0 else 0):
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            time.sleep(0.01)
        parts(part)

    with pytest.raises(KeyboardInterrupt):
        side_by_side(work, THREADS)
    assert sorted(parts.ended) == list(range(THREADS))


def test_an_error_of_a_part_is_raised_and_threads_are_used_again() -> None:
    names: list[set[str]] = []
    for _ in range(3):
        used = set[str]()

        def work(part: int, used: set[str] = used) -> None:
            used.add(str(threading.get_ident()))
            if part == 1:
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            side_by_side(work, THREADS)
        names.append(used)
    assert names[0] == names[1] == names[2]


def test_of_too_many_threads_none_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are there are used again."""
    parts, helpers = Parts(), thread_team._helpers(2)
    monkeypatch.setattr(thread_team._Helper, "idle", helpers)

    def refuse(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(thread_team, "start_new_thread", refuse)
        with pytest.raises(RuntimeError, match="can't start new thread"):
            side_by_side(parts, THREADS)
    assert (parts.begun, len(helpers)) == ([], 2)
    side_by_side(parts, THREADS)
    assert len(parts.ended) == len(helpers) == THREADS


def test_no_thread_of_a_parent_is_asked_in_a_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is left of them there."""
    monkeypatch.setattr(thread_team._Helper, "idle", [])
    (helper,) = thread_team._helpers(1)
    helper.process = -1
    thread_team._Helper.idle.append(helper)
    parts = Parts()
    side_by_side(parts, THREADS)
    assert len(parts.ended) == THREADS
    assert helper not in thread_team._Helper.idle


def test_only_studies_wait_for_futures() -> None:
    """Of processes, by a queue, or of Dask: a signal raised within a future may leave its lock taken for ever."""
    users = {
        file.relative_to(ROOT).as_posix(): set(re.findall(r"\b(?:wait|as_completed|ThreadPoolExecutor)\b", imports))
        for package in ("pdmesh", "pdsolve", "pdpost")
        for file in (ROOT / package).rglob("*.py")
        for imports in re.findall(r"^ *(?:from|import) concurrent.*", file.read_text("utf-8"), re.MULTILINE)
    }
    assert users == {"pdsolve/study/cluster.py": set(), "pdsolve/study/workers.py": set()}
