"""Writing on a thread of its own, while the run goes on."""

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
    """A writer one frame behind the run; what goes wrong with a frame is raised by the next call.

    The writer is made there too, with the first frame; of a new run there is nothing to keep before that is written.
    """

    def __init__(self, make: Callable[[], Writer], new: bool, pool: ThreadPoolExecutor) -> None:
        """`make` gives the writer, on the thread of `pool`; `new`: of a run that begins."""
        self.stop: Callable[[], bool] = lambda: False  # whether the run is to stop
        self._make, self._new, self._pool = make, new, pool
        self._writer: Writer | None = None
        self._stopping = False
        self._pending: Future[None] | None = None

    def write(self, frame: Frame) -> None:
        """Write a frame as soon as the last one is written. Raises WriteError for that."""
        self._wait()
        self._pending = self._pool.submit(self._write, frame)

    def look(self) -> None:
        """Raises WriteError for what is known by now to have gone wrong."""
        if self._pending is not None and self._pending.done():
            self._pending.result()

    def done(self) -> Writer:
        """The writer, when all is written. Raises WriteError."""
        self._wait()
        return self._made()

    def abandon(self, status: str) -> None:
        """After an error: keep the frames there are, if there are any, with this status."""
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
    """A writer on a thread that ends with the block."""
    turn = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        with ThreadPoolExecutor(1, "results") as pool:
            yield Behind(make, new, pool)
    finally:
        sys.setswitchinterval(turn)
