"""Work on a thread of its own, handed over so that an exception in the waiting thread leaves no lock taken.

A signal's handler raises between any two lines of Python. Within `concurrent.futures` it can leave the lock of a future
taken for ever. The queues of this module are of C: each call is done or not begun.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue

LIMIT, AGAIN = 10.0, 1.5  # s that `end` waits for the work in hand, and from an interrupt meanwhile


class BackgroundThread:
    """Does one piece of work after the other, each begun when the previous one is done."""

    def __init__(self, name: str) -> None:
        self._work: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._results: SimpleQueue[BaseException | None] = SimpleQueue()
        self._is_busy = False
        self._ended = False
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def begin(self, work: Callable[[], None]) -> None:
        """Begin a piece of work; the previous one is done."""
        self._is_busy = True
        self._work.put(work)

    def wait(self, seconds: float | None = None) -> bool:
        """Whether the work is done within so many seconds (None: wait until it is). Raises what the work raised."""
        if self._is_busy:
            try:
                error = self._results.get(timeout=seconds)
            except Empty:
                return False
            self._is_busy = False
            if error is not None:
                raise error
        return True

    def end(self) -> bool:
        """Let the thread end after the work in hand; whether it does within LIMIT. Interrupts shorten the wait."""
        self._work.put(None)
        until = time.monotonic() + LIMIT
        while not self._ended and time.monotonic() < until:
            try:
                with suppress(Empty):
                    self._results.get(timeout=max(until - time.monotonic(), 0.0))
            except KeyboardInterrupt:
                until = min(until, time.monotonic() + AGAIN)
        return self._ended

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            error: BaseException | None = None
            try:
                work()
            except BaseException as reason:
                error = reason
            del work  # and what it holds
            self._results.put(error)
        self._ended = True
        self._results.put(None)
