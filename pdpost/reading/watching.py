"""Follow a run that is still writing, without blocking it: the database is open only for short reads."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

from pdsolve.results import EmptyError, Results, ResultsError

POLL = 0.5  # s between two looks
FIRST_WORD = 10.0  # s of silence after which something is said; then after twice as long, and so on


class SilentError(ResultsError):
    """A run that has the status "running" but writes nothing: most likely it was killed."""


def frames(
    path: Path,
    patience: float,
    tell: Callable[[str], None],
    poll: float = POLL,
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], None] = time.sleep,
) -> Iterator[int]:
    """The step of each new frame in the database at `path` until its run ends; of several new frames, the newest.

    `tell` receives a message after a long silence. The database is open only during a read and need not exist yet.
    Raises SilentError after `patience` seconds without a frame, ResultsError for a file that is not a database of
    results.
    """
    last, since, word = -1, clock(), FIRST_WORD
    while True:
        status, step = _look(path)
        if step is not None and step != last:
            yield step
            last, since, word = step, clock(), FIRST_WORD
            continue
        if status not in ("running", "not there yet"):
            return
        silent = clock() - since
        if silent >= patience:
            raise SilentError(
                f"{path}: nothing new came for {silent:.0f} s; its status is '{status}' (was the run killed?"
                " --patience waits longer)"
            )
        if silent >= word:
            tell(f"{path}: nothing new for {silent:.0f} s; the run is '{status}'")
            word *= 2
        wait(min(poll, patience - silent))


def _look(path: Path) -> tuple[str, int | None]:
    """The run's status and the step of its last frame; the status is read first, so that no frame is missed."""
    if not path.exists():
        return "not there yet", None
    try:
        with Results.open(path) as results:
            status = str(results.meta().get("status", "running"))
            steps, _ = results.frames()
    except EmptyError:
        return "not there yet", None
    return status, int(steps[-1]) if len(steps) else None
