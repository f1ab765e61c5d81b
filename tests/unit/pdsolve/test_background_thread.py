"""Work on a thread of its own: in order, one at a time, and never waited for without end."""

from __future__ import annotations

import signal
import threading
import time
from queue import SimpleQueue
from types import SimpleNamespace

import pytest
from interrupts import interrupted_at

from pdmesh import background_thread
from pdmesh.background_thread import BackgroundThread
from pdsolve.results.background_writer import BackgroundWriter

pytestmark = pytest.mark.usefixtures("listens")


class Slow:
    """A writer whose frames take as long as a test lets them."""

    def __init__(self) -> None:
        self.go: SimpleQueue[None] = SimpleQueue()  # of C: an interrupt leaves no lock of the test's own taken
        self.frames, self.status = list[int](), ""
        self.stop = lambda: False

    def write(self, frame: int) -> None:
        if frame == 1:
            self.go.get(timeout=10.0)
        self.frames.append(frame)

    def abandon(self, status: str) -> None:
        self.status = status

    def discard(self) -> None:
        self.status = "discarded"


def test_frames_are_written_one_by_one_in_their_order() -> None:
    """The first frame is the slow one; with two threads the second would overtake it."""
    writer = Slow()
    open_background_writer = BackgroundWriter(lambda: writer, True)  # type: ignore[arg-type, return-value]
    threading.Timer(0.05, writer.go.put, (None,)).start()
    for frame in (1, 2, 3):
        open_background_writer.write(lambda frame=frame: frame)  # type: ignore[misc]
        assert len(writer.frames) >= frame - 1  # a frame is made when the last one is written
    assert open_background_writer.done() is writer
    assert writer.frames == [1, 2, 3]


def test_an_error_is_raised_by_the_next_call_and_once() -> None:
    thread = BackgroundThread("test")
    thread.begin(lambda: 1 / 0)  # type: ignore[arg-type, return-value]
    with pytest.raises(ZeroDivisionError):
        thread.wait()
    assert thread.wait()
    assert thread.end()


def test_an_interrupt_at_any_line_of_waiting_leaves_the_writer_free() -> None:
    """Ctrl-C as each line of the waiting thread begins, in our modules and in those of Python: none hangs."""
    line = 0
    while True:
        writer = Slow()
        open_background_writer = BackgroundWriter(lambda writer=writer: writer, False)  # type: ignore[arg-type, return-value, misc]
        open_background_writer.stop = lambda writer=writer: bool(writer.go.put(None))  # type: ignore[misc]  # lets go at the first look
        open_background_writer.write(lambda: 1)  # type: ignore[arg-type, return-value]
        interrupted = interrupted_at(line, open_background_writer._wait)
        writer.go.put(None)
        began = time.monotonic()
        open_background_writer.abandon("interrupted")
        assert time.monotonic() - began < 5.0
        assert (writer.frames, writer.status) == ([1], "interrupted")
        line += 1
        if not interrupted and line > 1:
            break
    assert line > 5


def test_a_writer_that_does_not_end_is_left_alone_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_thread, "LIMIT", 0.05)
    writer = Slow()
    open_background_writer = BackgroundWriter(lambda: writer, False)  # type: ignore[arg-type, return-value]
    open_background_writer.write(lambda: 1)  # type: ignore[arg-type, return-value]
    open_background_writer.abandon("interrupted")
    assert writer.status == ""  # its connection is the other thread's
    writer.go.put(None)


def test_a_further_interrupt_shortens_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_thread, "AGAIN", 0.0)
    thread, go = BackgroundThread("test"), threading.Event()
    thread.begin(lambda: go.wait(30.0) and None)  # type: ignore[arg-type, return-value]
    main = threading.main_thread().ident
    assert main is not None
    threading.Timer(0.05, signal.pthread_kill, (main, signal.SIGINT)).start()
    began = time.monotonic()
    assert not thread.end()
    assert time.monotonic() - began < background_thread.LIMIT / 2
    go.set()


def test_a_new_run_without_a_frame_leaves_nothing() -> None:
    writer = SimpleNamespace(write=lambda frame: 1 / 0, discard=lambda: left.append("discarded"))
    left: list[str] = []
    open_background_writer = BackgroundWriter(lambda: writer, True)  # type: ignore[arg-type, return-value]
    open_background_writer.write(lambda: 1)  # type: ignore[arg-type, return-value]
    with pytest.raises(ZeroDivisionError):
        open_background_writer.done()
    open_background_writer.abandon("failed")
    assert left == ["discarded"]
