"""The database of one rank, for results of very many nodes, written behind the march."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.background_thread import BackgroundThread
from pdsolve.numerics.team import Team
from pdsolve.results import Breaks, FrameRecord, ResultsError, Writer

WRITTEN = 9  # tag of messages: that a frame is in the files of all ranks
NOTHING = Breaks(*np.zeros((3, 0), dtype=np.int64))


class RankDatabase:
    """Writes what goes by own nodes; rank 0 is told of each frame that is written, or why it could not be.

    A checkpoint stays until the one after the next is there, as the index may still have to learn of that.
    """

    def __init__(self, team: Team, make_writer: Callable[[], Writer], first_row: int) -> None:
        """`make_writer` begins the database, on a thread of its own; `first_row` is the first own row."""
        self._team, self._make, self._first = team, make_writer, first_row
        self._thread = BackgroundThread("results")
        self._writer: Writer | None = None
        self._kept = 0  # step of the last checkpoint

    def write_frame(
        self, step: int, time: float, fields: Mapping[str, NDArray[Any]] | None, checkpoint: Mapping[str, NDArray[Any]]
    ) -> None:
        """Write a frame when the last one is written. Raises WriteError if that failed."""
        self._thread.wait()
        step_arrays = {f"{name}@{step}": values for name, values in checkpoint.items()} or None
        frame = FrameRecord(step, time, fields, NOTHING, (), (), step_arrays, first=self._first, keeps=self._kept)
        self._kept = step if step_arrays else self._kept
        self._thread.begin(partial(self._write_frame_and_notify_rank_0, frame))

    def close(self) -> None:
        """Close the database after everything is written. Raises WriteError."""
        self._thread.wait()
        self._thread.end()
        if self._writer is not None:
            self._writer.close("finished")

    def _write_frame_and_notify_rank_0(self, frame: FrameRecord) -> None:
        error: ResultsError | None = None
        try:
            if self._writer is None:
                self._writer = self._make()
            self._writer.write(frame)
        except ResultsError as found:
            error = found
            raise
        finally:
            self._team.comm.send(error, 0, WRITTEN)


def wait_until_all_ranks_wrote_frame(team: Team) -> None:
    """Wait until all ranks have written a frame. Raises WriteError if one could not."""
    errors = [team.received(rank, WRITTEN) for rank in range(team.size)]
    for error in errors:
        if error is not None:
            raise error
