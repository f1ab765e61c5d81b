"""One run of a study, from its drawing to its measures: the work of a worker."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from pdsolve.results import BusyError, Results, ResultsError, StateKind, WriteError, state_of
from pdsolve.run.simulation import resume, simulate
from pdsolve.study.description import Case, RunMeasure
from pdsolve.study.recovered_runs import provenance
from pdsolve.study.run_measures import compute_run_measures
from pdsolve.study.run_model import model_of_run, options

ALONE = threading.Lock()  # a process solves one run at a time

LOST = "the process that solved it ended (too little memory?); the same command with --again solves it once more"
PATIENCE, PAUSE = 30.0, 0.2  # s that a run waits for another process that writes to its database; s between two looks


class Task(NamedTuple):
    """A run to solve; a plain tuple that can be sent to another process or machine."""

    number: int
    drawing: Path
    case: Case
    output: Path
    threads: int = 1
    trust: bool = False
    digest: str = ""  # of the drawing
    again: bool = False  # it has failed before
    measures: Mapping[str, RunMeasure] = {}  # further ones


class Outcome(NamedTuple):
    """How a run in the table ended."""

    number: int
    measures: dict[str, float | None] | None = None  # None: it failed
    error: str | None = None


def solve_and_measure(task: Task) -> Outcome:
    """Solve a run, or continue an interrupted one, and measure it. Errors are part of the outcome."""
    with ALONE, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with _open_results_when_free(task) as results:
                return Outcome(task.number, compute_run_measures(results, task.measures))
        except Exception as error:  # of any kind: it is this run's, the others go on
            said = str(error) if isinstance(error, ValueError | OSError) else f"{type(error).__name__}: {error}"
            return Outcome(task.number, None, " ".join(said.split()))


def _open_results_when_free(task: Task) -> Results:
    """Results of a run; waits for another writer of its database, such as a killed study's worker."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return _resume_or_restart(task)
        except BusyError as error:
            if time.monotonic() > until:
                raise ResultsError(f"{error}; waited {PATIENCE:g} s (--again: goes on with it)") from None
        time.sleep(PAUSE)


def _resume_or_restart(task: Task) -> Results:
    """Results of a run, continued if possible, else restarted. Raises BusyError, and others."""
    own_provenance = provenance(task.case.key, task.digest)
    if task.output.is_symlink():
        raise ResultsError(f"{task.output} is a link, and the run's own database is written there; move it away")
    try:
        state = state_of(task.output)
    except ResultsError as error:
        raise ResultsError(f"{error} (remove it, and --again solves it anew)") from None
    if state.kind is StateKind.RUNNING:
        raise BusyError(f"{task.output}: a run is writing to it ({state.holder}); wait for its end")
    if state.meta and state.meta.get("provenance") not in (
        own_provenance,
        f"pdsolve study: {task.case.key}",
    ):  # an older one
        raise ResultsError(f"{task.output} has results of another run; move it away")
    if state.kind in (StateKind.UNBEGUN, StateKind.STOPPED, StateKind.FINISHED):
        try:
            return resume(task.output, task.threads)
        except (BusyError, WriteError):
            raise
        except ResultsError as error:
            if not task.again:
                raise ResultsError(f"{error} (--again: solves it anew)") from None
    how = options(task.case, task.threads)  # what is there stays until the new run is prepared
    return simulate(model_of_run(task.drawing, task.case, task.trust), task.output, how, provenance=own_provenance)
