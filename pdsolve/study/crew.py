"""Several processes at work on a study: Dask's, on this machine or where its scheduler says.

Only this module knows Dask, and it is imported when a study is solved. The table is written here, by one process; the
others solve, and write the databases of their runs to the study's folder.
"""

from __future__ import annotations

import logging
import signal
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pdmesh import VERSION
from pdmesh.drawing import sources
from pdmesh.scene.shapes import SceneError
from pdsolve.results import remove, writing_to
from pdsolve.study.columns import measures_of
from pdsolve.study.description import Study, StudyError
from pdsolve.study.making import NAMED, check
from pdsolve.study.one import Outcome, Task, solved
from pdsolve.study.table import FAILED, FINISHED, Row, Table, runs_of
from pdsolve.threads import cores

if TYPE_CHECKING:
    from distributed import Client

MISSING = (
    "pdsolve study: found no package distributed, which shares the runs among processes,"
    " expected it (pip install 'pdsuite[study]')"
)

ENDED = "found the process that solved it ended, expected it to go on (too little memory?)"
# Of Dask: a process that ends takes the run with it that it solves, and no other
ONE_BY_ONE = {"distributed.scheduler.allowed-failures": 0, "distributed.scheduler.worker-saturation": 1.0}


class Going(NamedTuple):
    """How far a study is."""

    runs: int
    finished: int
    failed: int
    last: Outcome | None = None  # None: before the first


class Crew(NamedTuple):
    """Who solves, and how."""

    workers: int | None = None  # processes on this machine; None: as many as cores, over threads
    threads: int = 1  # of each run
    scheduler: str | None = None  # the address of Dask's, in place of processes of one's own
    trust: bool = False


ALONE = Crew()


def solve_study(
    study: Study,
    output: Path,
    crew: Crew = ALONE,
    watch: Callable[[Going], None] | None = None,
    again: bool = False,
    force: bool = False,
) -> list[Row]:
    """Solve all runs of a study that are not solved yet; returns their rows of the table in the file `output`.

    Runs that failed are left alone unless `again`; with `force` nothing is kept of what is there. `watch` is called
    after each run. Raises StudyError, BusyError, OSError; a run that fails is none of them.
    """
    with writing_to(output):
        dimension = check(study, crew.trust)
        if force:
            _clear(output)
        with _table(study, output) as table:
            numbers = table.add(study.cases(), _described(study, crew.trust), measures_of(dimension))
            rows = table.rows(numbers.values())
            over = (FINISHED,) if again else (FINISHED, FAILED)
            waiting = {row.number for row in rows if row.status not in over}
            cases = [(numbers[case.key], case) for case in study.cases() if numbers[case.key] in waiting]
            drawing = study.drawing.resolve()
            files = {row.number: row.file.resolve() for row in rows}
            tasks = [Task(number, drawing, case, files[number], crew.threads, crew.trust) for number, case in cases]
            failed = sum(row.status == FAILED and row.number not in waiting for row in rows)
            going = Going(len(rows), len(rows) - len(tasks) - failed, failed)
            _tell(watch, going)
            for outcome in _solved(tasks, crew):
                table.finish(*outcome)
                bad = outcome.error is not None
                going = Going(going.runs, going.finished + (not bad), going.failed + bad, outcome)
                _tell(watch, going)
            return table.rows(numbers.values())


def _tell(watch: Callable[[Going], None] | None, going: Going) -> None:
    if watch is not None:
        watch(going)


def _table(study: Study, output: Path) -> Table:
    """The table, and a folder for the runs. Raises StudyError."""
    runs = runs_of(output)
    if not output.exists() and runs.exists() and any(runs.iterdir()):
        raise StudyError(f"{runs}: found files in it, expected none before the first run (--force removes old runs)")
    table = Table.create(output, study, f"pdsolve {VERSION}")
    runs.mkdir(exist_ok=True)
    return table


def _clear(output: Path) -> None:
    """Remove a table and the runs that it names."""
    if output.exists():
        with Table.open(output) as table:
            files = [row.file for row in table.rows()]
        for file in [*files, output]:
            remove(file)


def _described(study: Study, trust: bool) -> dict[str, tuple[str, str]]:
    """Units and meanings of the drawing's parameters, where it says them."""
    if study.drawing.suffix.lower() not in NAMED:
        return {}
    try:
        found = sources.parameters(study.drawing, (), trust)
    except SceneError:
        return {}
    return {entry.name.removeprefix("Peridynamics/"): (entry.unit, entry.meaning) for entry in found}


def _solved(tasks: Sequence[Task], crew: Crew) -> Iterator[Outcome]:
    """The outcomes of tasks, as they come."""
    if not tasks:
        return
    from distributed import KilledWorker, as_completed

    with _client(crew, len(tasks)) as client:
        futures = dict(zip(client.map(solved, tasks, pure=False), tasks, strict=True))
        for future in as_completed(futures):
            error = future.exception()
            if error is None:
                yield future.result()
            else:
                yield Outcome(futures[future].number, None, ENDED if isinstance(error, KilledWorker) else repr(error))
            future.release()


@contextmanager
def _client(crew: Crew, tasks: int) -> Iterator[Client]:
    """Who hands tasks out. Raises StudyError."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise StudyError(MISSING) from None
    if crew.scheduler is not None:
        try:
            client = Client(crew.scheduler, timeout=10)
        except (OSError, ValueError) as error:
            raise StudyError(f"--scheduler {crew.scheduler}: found none that answers ({error}), expected one") from None
        with client:
            yield client
        return
    workers = crew.workers or max(1, cores() // crew.threads)
    settings: dict[str, Any] = {"n_workers": min(workers, tasks), "threads_per_worker": 1, "memory_limit": 0}
    settings |= {"dashboard_address": None, "silence_logs": logging.CRITICAL}
    with dask.config.set(ONE_BY_ONE), _scratch() as scratch:
        with _uninterrupted(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a port that another study listens at, which nobody looks at
            cluster = LocalCluster(local_directory=scratch, **settings)
        with cluster, Client(cluster) as client:
            yield client


def _scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder that Dask may litter; what a worker that is being stopped puts there is no matter."""
    return tempfile.TemporaryDirectory(prefix="pdsolve-", ignore_cleanup_errors=True)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that begin meanwhile hear no Ctrl-C, which a terminal sends to all: who began them stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
