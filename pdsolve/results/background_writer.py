"""Writing on a separate thread while the run continues."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from pdmesh import stopping
from pdmesh.background_thread import BackgroundThread
from pdsolve.results.schema import FrameRecord
from pdsolve.results.writer import Writer

LOOK = 0.05  # s between two looks whether a run that waits for its writer is to stop
BESIDE = ("", "-wal", "-shm", "-journal")  # ends of the names of a database and of the files SQLite keeps beside it
TURN = 2e-4  # s after which the writer's Python gives way to the run's: Python's own 5 ms are as long as many steps


class BackgroundWriter:
    """A writer one frame behind the run; an error in writing a frame is raised by the next call.

    The first frame creates the writer, on that thread; a new run leaves nothing behind before it.
    """

    def __init__(self, make: Callable[[], Writer], new: bool, path: Path | None = None) -> None:
        """`make` creates the writer on the writer's thread; `new` marks a run that begins, at `path` if not in memory.

        A forced end of the program removes a new database before its first frame is written.
        """
        self.stop: Callable[[], bool] = lambda: False  # whether the run is to stop
        self._make, self._new = make, new
        self._writer: Writer | None = None
        self._stopping = False
        real = os.path.realpath(path or ".")
        self._unfinished = [stopping.begin_file(f"{real}{end}") for end in BESIDE if new and path is not None]
        self._thread = BackgroundThread("results")

    def write(self, frame: Callable[[], FrameRecord]) -> None:
        """Write a frame, which is made after the previous one is written, so that memory holds one.

        Raises WriteError if that failed.
        """
        self._wait()
        self._thread.begin(partial(self._write, frame()))

    def look(self) -> None:
        """Raise WriteError if writing is known to have failed."""
        self._thread.wait(0.0)

    def done(self) -> Writer:
        """The writer, after everything is written. Raises WriteError."""
        self._wait()
        return self._made()

    def abandon(self, status: str) -> None:
        """After an error: keep the frames written so far, if any, with this status.

        A writer that does not end its frame in time is left alone, as if the run were killed.
        """
        self._stopping = True
        if not self._thread.end():
            return
        if self._writer is not None and self._new:
            self._writer.discard()
            self._finish_files()
        elif self._writer is not None:
            self._writer.abandon(status)

    def end(self) -> None:
        """Let the writer's thread end."""
        self._thread.end()

    def _wait(self) -> None:
        while not self._thread.wait(LOOK):
            self._stopping = self._stopping or self.stop()

    def _made(self) -> Writer:
        if self._writer is None:
            self._writer = self._make()
            self._writer.stop = lambda: self._stopping
        return self._writer

    def _write(self, frame: FrameRecord) -> None:
        self._made().write(frame)
        self._new = False
        self._finish_files()

    def _finish_files(self) -> None:
        while self._unfinished:
            stopping.finish_file(self._unfinished.pop())


@contextmanager
def open_background_writer(make: Callable[[], Writer], new: bool, path: Path | None) -> Iterator[BackgroundWriter]:
    """A context with a writer on its own thread; the arguments are those of `BackgroundWriter`."""
    turn = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        writer = BackgroundWriter(make, new, path)
        yield writer
        writer.end()
    finally:
        sys.setswitchinterval(turn)
