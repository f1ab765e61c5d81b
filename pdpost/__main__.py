"""The command `pdpost`: pictures and figures from a database of results."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from pdmesh import commandline
from pdpost.commands import crack, history, pictures, report, sql


def parser() -> argparse.ArgumentParser:
    """The command line of pdpost."""
    program = commandline.program("pdpost", "Show what a peridynamic run has found.")
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for group in (pictures, history, crack, report, sql):
        group.add(commands)
    return program


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdpost; returns its exit code."""
    args = parser().parse_args(argv)
    return commandline.run("pdpost", lambda: int(args.run(args)), _exits)


def _exits() -> dict[type[Exception], int]:
    from pdpost.figures import FigureError
    from pdpost.paths import PathError
    from pdsolve.results import ResultsError

    return dict.fromkeys((FigureError, PathError, ResultsError), commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
