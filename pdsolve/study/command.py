"""The command `pdsolve study`: solves many runs and writes a table of their results."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline, stopping
from pdmesh.file_kinds import FileKind
from pdmesh.plain_text import print_to_stderr

if TYPE_CHECKING:
    from pdsolve.study.description import Study
    from pdsolve.study.dispatch import StudyWorkers

LISTED = 10  # runs that failed, in lines


def parser() -> argparse.ArgumentParser:
    """The command line of pdsolve study."""
    program = commandline.program(
        "pdsolve study",
        "Solve a grid or a list of runs, each repeated with small disturbances, in several processes. Write one row"
        " for each run, with its parameters and the measures of its crack, to an SQLite table. After an interruption"
        " the same command continues: finished runs are not solved again.",
    )
    program.add_argument("study", type=Path, help="the study as a TOML file (drawing, set, vary, runs, repeat)")
    program.add_argument(
        "-o", "--output", type=Path, metavar="FILE",
        help="the table (default: the study's name with .sqlite, in the current folder); the runs' databases are in"
        " a folder beside it, with .runs",
    )  # fmt: skip
    add_run_options(program)
    program.add_argument("--json", action="store_true", help="print the rows as JSON on stdout")
    program.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors and warnings")
    return program


def add_run_options(program: commandline.Parser) -> None:
    """Put the options on a command line that say how runs of a study are solved; see `chosen_workers`."""
    program.add_argument("--force", action="store_true", help="remove existing runs and begin anew")
    program.add_argument("--again", action="store_true", help="solve failed runs once more")
    program.add_argument(
        "--workers",
        type=commandline.count,
        metavar="N",
        help="number of processes (default: cores divided by --threads)",
    )
    program.add_argument(
        "--threads", type=commandline.count, default=1, metavar="N", help="threads of each run (default: 1)"
    )
    program.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask scheduler whose workers share this folder, such as tls://x:8786",
    )
    commandline.add_trust(program)
    program.set_by = lambda word: "pdmesh plan STUDY, which solves nothing" if word == "--dry-run" else ""


def chosen_workers(args: argparse.Namespace) -> StudyWorkers:
    """The workers of the options of `add_run_options`. Raises UsageError for two kinds of them."""
    from pdsolve.study.dispatch import StudyWorkers

    if args.scheduler and args.workers:
        raise commandline.UsageError(
            "--workers cannot be combined with --scheduler, whose workers there are; use one of them"
        )
    return StudyWorkers(args.workers, args.threads, args.scheduler, args.trust)


def main(argv: Sequence[str]) -> int:
    """Run pdsolve study; returns its exit code."""
    args = parser().parse_args(argv)
    return commandline.run("pdsolve study", lambda: _study(args), exits)


def _study(args: argparse.Namespace) -> int:
    commandline.expect(args.study, FileKind.STUDY)
    from pdsolve.study.description import read_study
    from pdsolve.study.dispatch import StudyWatch, solve_study

    workers, study = chosen_workers(args), read_study(args.study)
    path = commandline.output_path(args.output, args.study, ".sqlite", force=True)  # what is there is gone on with
    price = partial(_price_line, study, path, args)
    with stopping.patience(stopping.WORKERS), StudyWatch(args.quiet, price) as watch:
        try:
            rows = solve_study(study, path, workers, watch, args.again, args.force)
        except KeyboardInterrupt:
            commandline.note("pdsolve study: interrupted; the same command goes on", args)
            raise
    failed = [row for row in rows if row.status == "failed"]
    lines = [f"{path}: {len(rows)} runs, {len(rows) - len(failed)} finished, {len(failed)} failed"]
    for row in failed[:LISTED]:  # said to who wants nothing but errors too
        print_to_stderr(f"pdsolve study: run {row.number} failed: {row.error}")
    if len(failed) > LISTED:
        more = "(SELECT number, error FROM run WHERE status = 'failed')"
        print_to_stderr(f"pdsolve study: and {len(failed) - LISTED} more runs failed {more}")
    runs = [
        {"number": row.number, "status": row.status, "error": row.error, "file": str(row.file)}
        | {"repetition": row.repetition, **row.values}
        for row in rows
    ]
    commandline.report({"output": str(path), "runs": runs}, lines, args)
    return commandline.FAILURE if failed else commandline.OK


def _price_line(study: Study, path: Path, args: argparse.Namespace) -> str:
    """What the runs will take that the table at `path` has as waiting; "" if none waits."""
    from pdsolve.numerics.thread_team import cores
    from pdsolve.study.plan import price_line, price_study
    from pdsolve.study.table import WAITING, Table

    if args.scheduler:  # whose workers are other machines
        return ""
    with Table.open(path) as table:
        over = {row.key for row in table.rows() if row.status != WAITING and not (args.again and row.error)}
    workers = args.workers or max(1, cores() // args.threads)
    price = price_study(study, over, workers, args.threads, args.trust)
    return "" if price is None else f"pdsolve study: {price_line(price)}"


def exits() -> dict[type[Exception], int]:
    """Exit codes of the expected errors of a study."""
    from pdmesh import GridError, SceneError
    from pdsolve.model import ModelError
    from pdsolve.results import ResultsError, WriteError
    from pdsolve.study.description import StudyError

    bad = commandline.BAD_INPUT
    return {WriteError: commandline.FAILURE} | dict.fromkeys(
        (GridError, SceneError, ModelError, ResultsError, StudyError), bad
    )
