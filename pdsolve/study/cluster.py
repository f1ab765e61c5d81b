"""Workers of a Dask scheduler, on this machine or others. Only this module uses Dask."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

from pdsolve.study.description import StudyError
from pdsolve.study.one_run import LOST, Outcome, Task, solve_and_measure

MISSING = "--scheduler needs the package distributed; install it: pip install 'pdsuite[study]'"
PATIENCE = 10.0  # s until a scheduler has answered


def solved_by(tasks: Sequence[Task], scheduler: str) -> Iterator[Outcome]:
    """Outcomes of tasks as the workers of the scheduler at this address finish them.

    TLS credentials come from Dask's own settings. Raises StudyError.
    """
    if not tasks:
        return
    with _client(scheduler) as client:
        from distributed import KilledWorker, as_completed

        futures = dict(zip(client.map(solve_and_measure, tasks, pure=False), tasks, strict=True))
        for future in as_completed(futures):
            try:
                error = future.exception()
                if error is None:
                    outcome = future.result()
                else:
                    cause = LOST if isinstance(error, KilledWorker) else repr(error)
                    outcome = Outcome(futures[future].number, None, cause)
            except (CancelledError, OSError):
                raise StudyError(
                    f"--scheduler {scheduler} ended; begin it anew, and the same command goes on with the study"
                ) from None
            yield outcome
            future.release()


def expect_scheduler(scheduler: str) -> None:
    """Raise StudyError unless a Dask scheduler answers at this address."""
    _client(scheduler).close()


def _client(scheduler: str) -> Any:
    """A client of the scheduler at this address. Raises StudyError."""
    try:
        from distributed import Client
    except ImportError:
        raise StudyError(MISSING) from None
    try:
        return Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise StudyError(
            f"--scheduler {scheduler} does not answer ({error}); start it, or correct the address"
        ) from None
