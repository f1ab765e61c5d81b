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


def solved_here(tasks: Sequence[Task], workers: int) -> Iterator[Outcome]:
    """Outcomes of tasks as `workers` processes finish them; the processes end with this generator.

    A run whose process died is tried once more, as another run may have caused it.
    """
    waiting, ended = deque(tasks), set[int]()
    done: SimpleQueue[Future[Outcome]] = SimpleQueue()  # an interrupted wait on futures may leave their locks taken
    processes = [Worker(done) for _ in range(min(workers, len(tasks)))]
    try:
        under_way = {worker.begin(waiting.popleft()): worker for worker in processes}
        while under_way:
            future = done.get()
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
        for worker in processes:
            worker.end()
    finally:
        for worker in processes:
            worker.stop()
        for worker in processes:
            worker.end()


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
