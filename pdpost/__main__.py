"""The command `pdpost`: pictures and figures from a database of results."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from pdmesh import commandline
from pdmesh.file_kinds import FileKind
from pdmesh.spelling import meant
from pdpost.commands import (
    animate_and_watch,
    bodies,
    boundary,
    compare,
    crack,
    curves,
    export,
    fatigue,
    line,
    notch,
    pictures,
    report,
    sif,
    sql,
    study,
    tradeoff,
    verify,
    view,
)

OF_PLATES = ("bonds", "compare", "nodes", "tradeoff")
OF_BODIES = (
    "damage and other fields, animate, slice, render, crack, sif, fatigue, line, history, balance, reaction, report,"
    " export, boundary, notch and study"
)


def parser() -> argparse.ArgumentParser:
    """The command line of pdpost."""
    program = commandline.program("pdpost", "Draw and measure the results of a peridynamic run.")
    program.set_by = _matplotlib
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for group in (
        pictures,
        compare,
        animate_and_watch,
        bodies,
        curves,
        line,
        boundary,
        crack,
        sif,
        fatigue,
        study,
        tradeoff,
        report,
        export,
        notch,
        sql,
        verify,
        view,
    ):
        group.add(commands)
    return program


def _matplotlib(word: str) -> str:
    """The setting of matplotlib that an unknown option may mean, as --style gives it; "" if there is none."""
    name = meant(word, ("savefig.dpi", "font.size", "figure.figsize", "image.cmap"), cutoff=1.0)
    return f"--style {name}=VALUE" if name else ""


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdpost; returns its exit code."""
    args = parser().parse_args(commandline.words(argv))

    def command() -> int:
        commandline.expect_other_outputs(args)
        for name in ("results", "reference", "compare"):
            for path in commandline.paths_of(args, name):
                commandline.expect(path, FileKind.RESULTS)
        from pdsolve.results import Results, ResultsError, state_of

        for path in commandline.paths_of(args, "results"):
            with suppress(ResultsError, OSError):  # what cannot be opened is left to the command to report
                if Path(f"{os.path.realpath(path)}-wal").exists() and (warning := state_of(path).warning):
                    commandline.warn(f"pdpost: warning: {path}: {warning}")  # how far a killed run's log can be read
        if args.command in OF_PLATES:
            # a file that cannot be opened is left to the command to report
            from pdpost.reading.studies import StudyError, stands_for

            for path in commandline.paths_of(args, "results"):
                dimension = 2
                with suppress(ResultsError, StudyError, OSError), Results.open(stands_for([path])[0].path) as results:
                    dimension = results.dimension
                if dimension == 3:
                    raise ResultsError(
                        f"{path} is a body in space, and this command draws plates; {OF_BODIES} show bodies"
                    )
        return int(args.run(args))

    return commandline.run("pdpost", command, _exits)


def _exits() -> dict[type[Exception], int]:
    from pdmesh.model.document import GridError
    from pdmesh.plain_figure import FigureError
    from pdpost.exports.frame_files import ExportError
    from pdpost.reading.watching import SilentError
    from pdsolve.measures.fields import FieldError
    from pdsolve.measures.measured_curve import MeasuredCurveError
    from pdsolve.measures.paths import PathError
    from pdsolve.results import ResultsError
    from pdsolve.study.description import StudyError

    exits: dict[type[Exception], int] = {SilentError: commandline.FAILURE}  # before ResultsError, which it is as well
    kinds = (GridError, ExportError, FieldError, FigureError, MeasuredCurveError, PathError, ResultsError, StudyError)
    return exits | dict.fromkeys(kinds, commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
