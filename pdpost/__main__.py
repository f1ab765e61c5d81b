"""The command `pdpost`: pictures and figures from a database of results."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import suppress

from pdmesh import commandline
from pdpost.commands import (
    bodies,
    crack,
    curves,
    export,
    line,
    moving,
    notch,
    pictures,
    report,
    sif,
    sql,
    study,
    tradeoff,
)

OF_PLATES = ("bonds", "crack", "line", "nodes", "notch", "sif", "strain", "tradeoff")
OF_BODIES = "damage and other fields, animate, slice, render, history, balance, reaction, report, export and study"


def parser() -> argparse.ArgumentParser:
    """The command line of pdpost."""
    program = commandline.program("pdpost", "Show what a peridynamic run has found.")
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for group in (pictures, moving, bodies, curves, line, crack, sif, study, tradeoff, report, export, notch, sql):
        group.add(commands)
    return program


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdpost; returns its exit code."""
    args = parser().parse_args(argv)

    def command() -> int:
        if args.command in OF_PLATES:
            _refuse_bodies(args)
        return int(args.run(args))

    return commandline.run("pdpost", command, _exits)


def _refuse_bodies(args: argparse.Namespace) -> None:
    """Raises ResultsError for results of bodies in space; what cannot be opened is the command's to say."""
    from pdpost.reading.studies import StudyError, stands_for
    from pdsolve.results import Results, ResultsError

    found = getattr(args, "results", ())
    for path in found if isinstance(found, list) else [found] if found else []:
        dimension = 2
        with suppress(ResultsError, StudyError, OSError), Results.open(stands_for([path])[0].path) as results:
            dimension = results.dimension
        if dimension == 3:
            raise ResultsError(f"{path}: found a body in space, expected a plate; {OF_BODIES} show bodies")


def _exits() -> dict[type[Exception], int]:
    from pdpost.exports.frame_files import ExportError
    from pdpost.figures.style import FigureError
    from pdpost.measures.fields import FieldError
    from pdpost.measures.paths import PathError
    from pdpost.reading.watching import SilentError
    from pdsolve.results import ResultsError
    from pdsolve.study.description import StudyError

    exits: dict[type[Exception], int] = {SilentError: commandline.FAILURE}  # before ResultsError, which it is as well
    kinds = (ExportError, FieldError, FigureError, PathError, ResultsError, StudyError)
    return exits | dict.fromkeys(kinds, commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
