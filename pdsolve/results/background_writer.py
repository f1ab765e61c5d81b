"""Writing on a separate thread while the run continues."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import contextmanager, suppress

from pdsolve.results.schema import Frame
from pdsolve.results.writer import Writer

LOOK = 0.05  # s between two looks whether a run that waits for its writer is to stop
TURN = 2e-4  # s after which the writer's Python gives way to the run's: Python's own 5 ms are as long as many steps


class Behind:
    """A writer one frame behind the run; an error in writing a frame is raised by the next call.

    The first frame creates the writer, on that thread; a new run leaves nothing behind before it.
    """

    def __init__(self, make: Callable[[], Writer], new: bool, pool: ThreadPoolExecutor) -> None:
        """`make` creates the writer on the thread of `pool`; `new` marks a run that begins."""
        self.stop: Callable[[], bool] = lambda: False  # whether the run is to stop
        self._make, self._new, self._pool = make, new, pool
        self._writer: Writer | None = None
        self._stopping = False
        self._pending: Future[None] | None = None

    def write(self, frame: Callable[[], Frame]) -> None:
        """Write a frame, which is made after the previous one is written, so that memory holds one.

        Raises WriteError if that failed.
        """
        self._wait()
        self._pending = self._pool.submit(self._write, frame())

    def look(self) -> None:
        """Raise WriteError if writing is known to have failed."""
        if self._pending is not None and self._pending.done():
            self._pending.result()

    def done(self) -> Writer:
        """The writer, after everything is written. Raises WriteError."""
        self._wait()
        return self._made()

    def abandon(self, status: str) -> None:
        """After an error: keep the frames written so far, if any, with this status."""
        self._stopping = True
        while self._pending is not None and not self._pending.done():
            with suppress(KeyboardInterrupt):  # it does not take long, and nobody else may write meanwhile
                wait_for([self._pending])
        if self._writer is not None and self._new:
            self._writer.discard()
        elif self._writer is not None:
            self._writer.abandon(status)

    def _wait(self) -> None:
        if self._pending is not None:
            while not wait_for([self._pending], LOOK).done:
                self._stopping = self._stopping or self.stop()
            self._pending.result()

    def _made(self) -> Writer:
        if self._writer is None:
            self._writer = self._make()
            self._writer.stop = lambda: self._stopping
        return self._writer

    def _write(self, frame: Frame) -> None:
        self._made().write(frame)
        self._new = False


@contextmanager
def behind(make: Callable[[], Writer], new: bool) -> Iterator[Behind]:
    """A context with a writer on its own thread."""
    turn = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        with ThreadPoolExecutor(1, "results") as pool:
            yield Behind(make, new, pool)
    finally:
        sys.setswitchinterval(turn)
