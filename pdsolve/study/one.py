"""One run of a study, from its drawing to its measures: what a worker does."""

from __future__ import annotations

import threading
import warnings
from pathlib import Path
from typing import NamedTuple

from pdsolve.results import EmptyError, Results, ResultsError, remove
from pdsolve.simulation import resume, simulate
from pdsolve.study.description import Case
from pdsolve.study.making import made, options
from pdsolve.study.measured import measured

ALONE = threading.Lock()  # a process solves one run at a time

ENDED = ("unstable", "unsettled", "failed")  # badly: such a run begins anew


class Task(NamedTuple):
    """What is to be done; a plain tuple that travels to another process, and may be another machine."""

    number: int
    drawing: Path
    case: Case
    output: Path
    threads: int = 1
    trust: bool = False


class Outcome(NamedTuple):
    """How a run of the table ended."""

    number: int
    measures: dict[str, float | None] | None = None  # None: it failed
    error: str | None = None


def solved(task: Task) -> Outcome:
    """Solve a run, or go on with one that was stopped, and measure it. What goes wrong is in the outcome."""
    with ALONE, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with _results(task) as results:
                return Outcome(task.number, measured(results))
        except Exception as error:  # of any kind: it is this run's, the others go on
            said = str(error) if isinstance(error, ValueError | OSError) else f"{type(error).__name__}: {error}"
            return Outcome(task.number, None, " ".join(said.split()))


def _results(task: Task) -> Results:
    provenance = f"pdsolve study: {task.case.key}"
    if task.output.exists():
        try:
            with Results.open(task.output) as results:
                meta = results.meta()
        except EmptyError:
            meta = {}
        if meta.get("provenance") == provenance and meta.get("status") not in ENDED:
            return resume(task.output, task.threads)
        if meta.get("provenance") not in (provenance, None):
            raise ResultsError(f"{task.output}: found results of another run, expected this one's or none")
        remove(task.output)
    how = options(task.case, task.threads)
    return simulate(made(task.drawing, task.case, task.trust), task.output, how, provenance=provenance)
