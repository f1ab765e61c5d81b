"""Distributes the runs of a study to processes on this machine, or to those of a Dask scheduler.

One process, this one, writes the table; workers solve, and write the databases of their runs to the study's folder.

Progress is one bar over all runs in a terminal or notebook; an occasional line elsewhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pdmesh import VERSION, SceneError, file_parameters
from pdmesh.files import FilePath
from pdmesh.plain_text import print_to_stderr
from pdsolve.numerics.thread_team import cores
from pdsolve.results import holder, remove, writing_to
from pdsolve.run.progress import LINE_EVERY, make_progress_bar
from pdsolve.study.cluster import expect_scheduler, solved_by
from pdsolve.study.description import Case, Study, StudyError
from pdsolve.study.measure_columns import further_measures, measures_of
from pdsolve.study.one_run import PATIENCE, Outcome, Task
from pdsolve.study.recovered_runs import kept, own_runs
from pdsolve.study.run_model import NAMED, check_study_and_return_dimension
from pdsolve.study.table import FAILED, FINISHED, Row, Table, run_folder
from pdsolve.study.workers import Processes


class StudyProgress(NamedTuple):
    """The progress of a study."""

    runs: int
    finished: int
    failed: int
    last: Outcome | None = None  # None: before the first
    held: Mapping[int, str] = {}  # before the first: who else writes to the database of a run, by its number


class StudyWorkers(NamedTuple):
    """The workers of a study."""

    workers: int | None = None  # processes on this machine; None: as many as cores, over threads
    threads: int = 1  # of each run
    scheduler: str | None = None  # the address of Dask's, in place of processes of one's own
    trust: bool = False


DEFAULT_WORKERS = StudyWorkers()
TaskSolver = Callable[[Sequence[Task]], Iterable[Outcome]]


def solve_study(
    study: Study,
    output: FilePath,
    workers: StudyWorkers = DEFAULT_WORKERS,
    watch: Callable[[StudyProgress], None] | None = None,
    again: bool = False,
    force: bool = False,
) -> list[Row]:
    """Solve all unsolved runs of a study; returns their rows in the table at `output`.

    Failed runs are skipped unless `again`; `force` discards existing results. `watch` is called after each run. Raises
    StudyError, BusyError, OSError; a failed run raises none.
    """
    with open_runs(study, output, workers, force) as runs:
        return runs.solve(study.cases(), watch, again)


@contextmanager
def open_runs(
    study: Study, output: FilePath, workers: StudyWorkers = DEFAULT_WORKERS, force: bool = False
) -> Iterator[StudyRuns]:
    """The runs of a study whose table at `output` is open for writing; `force` discards existing results.

    Raises StudyError, BusyError, OSError.
    """
    output = Path(output)
    with writing_to(output):
        dimension = check_study_and_return_dimension(study, workers.trust)
        if force:
            if workers.scheduler is not None:
                expect_scheduler(workers.scheduler)
            _clear(study, output)
        if not output.exists():
            kept(run_folder(output), study)
        with Table.create(output, study, f"pdsolve {VERSION}") as table:
            run_folder(output).mkdir(exist_ok=True)
            # of a fit, the table may have been lost and begun anew: its runs come one after the other
            existing = {} if table.rows() and study.description.fit is None else kept(run_folder(table.path), study)
            with task_solver(workers) as solve_tasks:
                yield StudyRuns(study, table, workers, dimension, existing, solve_tasks)


class StudyRuns:
    """The runs of a study, in its table and in the folder beside it."""

    def __init__(
        self,
        study: Study,
        table: Table,
        workers: StudyWorkers,
        dimension: int,
        existing: Mapping[str, int],
        solve_tasks: TaskSolver,
    ) -> None:
        """`existing` are the numbers of databases that are there, by the keys of their runs."""
        self.dimension = dimension
        self._study, self._table, self._workers, self._existing = study, table, workers, existing
        self._solve_tasks = solve_tasks
        self._described = _describe_parameters(study, workers.trust)

    def solve(
        self,
        cases: Sequence[Case],
        watch: Callable[[StudyProgress], None] | None = None,
        again: bool = False,
    ) -> list[Row]:
        """Solve those of the cases that are not solved; returns the rows of all. Raises StudyError."""
        study, table, workers = self._study, self._table, self._workers
        further = study.description.measures
        measures = measures_of(self.dimension) | further_measures(further, self.dimension)
        numbers = table.add(cases, self._described, measures, self._existing)
        rows = table.rows(numbers.values())
        over = (FINISHED,) if again else (FINISHED, FAILED)
        waiting = {row.number for row in rows if row.status not in over}
        drawing = study.drawing.resolve()
        files = {row.number: row.file.parent.resolve() / row.file.name for row in rows}
        bad = {row.number for row in rows if row.status == FAILED}
        how = (workers.threads, workers.trust, study.digest)
        tasks = [
            Task(number, drawing, case, files[number], *how, number in bad, further)
            for case in cases
            if (number := numbers[case.key]) in waiting
        ]
        failed = len(bad - waiting)
        holders = {task.number: name for task in tasks if (name := holder(task.output)) is not None}
        progress = StudyProgress(len(rows), len(rows) - len(tasks) - failed, failed, None, holders)
        _report_progress(watch, progress)
        for outcome in self._solve_tasks(tasks):
            table.finish(*outcome)
            ended = outcome.error is not None
            progress = StudyProgress(progress.runs, progress.finished + (not ended), progress.failed + ended, outcome)
            _report_progress(watch, progress)
        return table.rows(numbers.values())


def _report_progress(watch: Callable[[StudyProgress], None] | None, progress: StudyProgress) -> None:
    if watch is not None:
        watch(progress)


def _clear(study: Study, output: Path) -> None:
    """Remove a table and the runs that it names, after all checks.

    Raises StudyError if it is no study's table, or if anything else is in the folder of its runs; BusyError.
    """
    runs = run_folder(output)
    if runs.is_symlink():
        raise StudyError(f"{runs} is a link; remove its runs where it leads to")
    if output.exists() and output.stat().st_size:
        with Table.open(output) as table:
            rows, digest = table.rows(), table.about().get("drawing_sha256", "")
        files = own_runs(output, runs, rows, digest)
    elif kept(runs, study):
        raise StudyError(
            f"{runs} has runs without the table that names them; remove the folder to solve them anew, or go on"
            " with them without --force"
        )
    else:
        files = []
    for file in [*files, output]:
        remove(file, of_ranks=False)


def _describe_parameters(study: Study, trust: bool) -> dict[str, tuple[str, str]]:
    """Units and meanings of the drawing's parameters, as far as it gives them."""
    if study.drawing.suffix.lower() not in NAMED:
        return {}
    try:
        parameters = file_parameters(study.drawing, (), trust)
    except SceneError:
        return {}
    return {entry.name.removeprefix("Peridynamics/"): (entry.unit, entry.meaning) for entry in parameters}


@contextmanager
def task_solver(workers: StudyWorkers) -> Iterator[TaskSolver]:
    """What solves tasks on these workers, whose processes end with this context. Raises StudyError."""
    if workers.scheduler is not None:
        yield partial(solved_by, scheduler=workers.scheduler)
        return
    with Processes(workers.workers or max(1, cores() // workers.threads)) as processes:
        yield processes.solve


class StudyWatch:
    """Shows the progress of a study.

    with StudyWatch() as watch:
        solve_study(study, path, watch=watch)
    """

    def __init__(self, quiet: bool = False, price: Callable[[], str] | None = None) -> None:
        """A watch that first prints the line that `price` returns, and is `quiet` but for runs that wait."""
        self._price = price
        self._quiet, self._said = quiet, time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> StudyWatch:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, progress: StudyProgress) -> None:
        done, text = progress.finished + progress.failed, f"{progress.failed} failed"
        for number, name in progress.held.items():
            print_to_stderr(
                f"pdsolve study: run {number} waits up to {PATIENCE:g} s for {name}, which writes to its database"
            )
        if self._quiet:
            return
        if self._price is not None and (line := self._price()):
            print_to_stderr(line)
        self._price = None
        if self._bar is None:
            self._bar = make_progress_bar("solving", " runs", total=progress.runs, initial=done)
        if self._bar is not None:
            self._bar.set_postfix_str(text, refresh=False)
            self._bar.update(done - self._bar.n)
        elif time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print_to_stderr(f"run {done} of {progress.runs}, {text}")
