"""The start and the end of the ranks of a run: one of them talks, and all end together."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable

from pdmesh import commandline
from pdmesh.commandline import BAD_INPUT, FAILURE
from pdmesh.printing import remark
from pdsolve.numerics.team import NUMBERS, Team, team

MISSING = "found ranks but no MPI for Python, expected it: pip install 'pdsuite[mpi]'"


def together(command: Callable[[Team | None], int]) -> int:
    """Run a command on rank 0, with the other ranks at its service; returns its exit code on all.

    An error on any rank ends all of them.
    """
    try:
        ranks = team()
    except (ImportError, RuntimeError):  # the library is looked for when the package is imported
        if all(os.environ.get(name, "0") == "0" for name in NUMBERS):
            remark(f"pdsolve: {MISSING}")
        return BAD_INPUT
    if ranks is None:
        return command(None)
    if ranks.rank > 0:
        return _served(ranks)
    code = FAILURE
    try:
        code = command(ranks)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else FAILURE
        raise
    finally:
        sys.stdout.flush()
        ranks.end(code)
    return code


def _served(ranks: Team) -> int:
    """Serve rank 0, which is the one that hears signals; an error here ends all ranks."""
    for number in commandline.STOPS:
        signal.signal(number, signal.SIG_IGN)
    warnings.simplefilter("ignore")  # rank 0 has the whole model to warn of
    try:
        return ranks.serve()
    except BaseException as error:
        said = "found too little memory" if isinstance(error, MemoryError) else f"{type(error).__name__}: {error}"
        remark(f"pdsolve: rank {ranks.rank}: {' '.join(said.split())}")
        sys.stderr.flush()
        ranks.comm.Abort(FAILURE)
        raise
