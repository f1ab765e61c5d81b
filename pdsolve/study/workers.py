"""Processes on this machine that solve runs: no port is opened, and only runs are written.

Each process is an executor of its own, so that one that dies takes only its own run with it. A worker stops when the
other end of its pipe is closed: by its parent, or by the system when the parent has died.
"""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue

from pdmesh import trust
from pdsolve.study.one_run import LOST, Outcome, Task
from pdsolve.study.worker import prepare, solve


class Processes:
    """At most `number` processes, which begin with their first runs and wait for more until this context ends."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._done: SimpleQueue[Future[Outcome]] = SimpleQueue()  # an interrupted wait on futures may leave locks taken
        self._workers: list[Worker] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            for worker in self._workers if kind is None else ():
                worker.end()
        finally:
            for worker in self._workers:
                worker.stop()
            for worker in self._workers:
                worker.end()

    def solve(self, tasks: Sequence[Task]) -> Iterator[Outcome]:
        """Outcomes of tasks as processes finish them.

        A run whose process died is tried once more, as another run may have caused it.
        """
        waiting, ended = deque(tasks), set[int]()
        while len(self._workers) < min(self._number, len(tasks)):
            self._workers.append(Worker(self._done))
        under_way = {worker.begin(waiting.popleft()): worker for worker in self._workers[: len(tasks)]}
        while under_way:
            future = self._done.get()
            worker = under_way.pop(future)
            task, outcome = worker.outcome(future)
            again = outcome.error == LOST and task.number not in ended
            if again:
                ended.add(task.number)
                waiting.append(task)
            if waiting:
                under_way[worker.begin(waiting.popleft())] = worker
            if not again:
                yield outcome


class Worker:
    """A process that solves one run after the other; it is replaced when it dies."""

    def __init__(self, done: SimpleQueue[Future[Outcome]]) -> None:
        """`done` gets each future when it is done."""
        self._done = done
        self._task: Task | None = None
        self._executor, self._hold = _process()

    def begin(self, task: Task) -> Future[Outcome]:
        """Start solving a run."""
        self._task = task
        with _uninterrupted(), trust.child_environment():  # a process may start
            future = self._executor.submit(solve, task)
            future.add_done_callback(self._done.put)
        return future

    def outcome(self, future: Future[Outcome]) -> tuple[Task, Outcome]:
        """The last started run and its outcome."""
        assert self._task is not None
        try:
            outcome = future.result()
        except BrokenExecutor:
            self.end()
            self._hold.close()
            self._executor, self._hold = _process()
            outcome = Outcome(self._task.number, None, LOST)
        except Exception as error:  # such as an outcome that does not travel
            outcome = Outcome(self._task.number, None, f"{type(error).__name__}: {error}")
        return self._task, outcome

    def stop(self) -> None:
        """Request an early stop, within the current run."""
        self._hold.close()

    def end(self) -> None:
        """Wait for its end."""
        self._executor.shutdown(cancel_futures=True)


def _process() -> tuple[ProcessPoolExecutor, Connection]:
    """A process, which starts with its first run, and the end of the pipe whose closing stops it."""
    spawn = get_context("spawn")
    worker_end, parent_end = spawn.Pipe(duplex=False)
    with _uninterrupted(), trust.child_environment():  # Python's own keeper of semaphores may start
        return ProcessPoolExecutor(1, spawn, prepare, (worker_end,)), parent_end


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """A context in which new processes ignore Ctrl-C, which a terminal sends to all; their parent stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
