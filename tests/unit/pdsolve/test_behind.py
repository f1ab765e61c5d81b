"""The writer behind a run: what waits for what, and who hears of an error."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from pdsolve.results import Breaks, Frame, WriteError, Writer, behind
from pdsolve.results.behind import AHEAD

NOTHING, PARTS = np.zeros(0, dtype=np.int64), 4
PART = np.zeros(round(AHEAD / 4 / PARTS), dtype=np.float32)  # a fourth of what may wait


class Slow(Writer):
    """Writes nothing; notes the steps."""

    def __init__(self, fails: int | None = None) -> None:
        self.steps: list[int] = []
        self.fails = fails
        self.discarded = False

    def write(self, frame: Frame) -> None:
        if frame.step == self.fails:
            raise WriteError("full")
        self.steps.append(frame.step)

    def discard(self) -> None:
        self.discarded = True

    def abandon(self, status: str) -> None:
        pass


def frame(step: int) -> Frame:
    return Frame(step, 0.0, {"ux": PART}, Breaks(NOTHING, NOTHING, NOTHING), [], [], None)


def test_a_run_goes_on_while_its_file_is_begun() -> None:
    """But not without end: one frame more than may wait, and it waits."""
    may, writer = threading.Event(), Slow()

    def make() -> Writer:
        may.wait()
        return writer

    with behind(make, True) as there:
        for step in range(PARTS + 1):
            there.write(frame(step))
        assert not writer.steps
        late = threading.Thread(target=there.write, args=(frame(PARTS + 1),))
        late.start()
        late.join(0.2)
        assert late.is_alive()
        may.set()
        late.join()
        assert there.done() is writer
    assert writer.steps == list(range(PARTS + 2))


@pytest.mark.parametrize("fails", [0, 2])
def test_nothing_is_written_after_what_could_not_be(fails: int) -> None:
    may, writer = threading.Event(), Slow(fails)

    def make() -> Writer:
        may.wait()
        return writer

    with behind(make, True) as there:
        for step in range(4):
            there.write(frame(step))
        may.set()
        with pytest.raises(WriteError, match="full"):
            there.done()
        there.abandon("failed")
    assert writer.steps == list(range(fails))
    assert writer.discarded == (fails == 0)
