"""The frames of a run and its last step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.results import Results, ResultsError


def frames(results: Results) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Steps (t,) and times (t,), s, of the frames. Raises ResultsError if there is none yet."""
    steps, times = results.frames()
    if not len(steps):
        raise ResultsError(f"{results.name} has no frame yet; wait for the first")
    return steps, times


def chosen(results: Results, every: int) -> list[int]:
    """Steps of every `every`-th frame, beginning with the first. Raises ResultsError if there is no frame yet."""
    steps: list[int] = frames(results)[0][::every].tolist()
    return steps


def last_frame(results: Results) -> int:
    """Step of the last frame. Raises ResultsError if there is none yet."""
    return int(frames(results)[0][-1])


def last_step(results: Results) -> int:
    """The last step of the ledger, which may follow the last frame. Raises ResultsError if there is no frame yet."""
    steps = results.history()["step"]
    return int(steps[-1]) if len(steps) else last_frame(results)
