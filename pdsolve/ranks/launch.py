"""The start and the end of the ranks of a run: one of them talks, and all end together."""

from __future__ import annotations

import os
import platform
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress

from pdmesh import commandline, stopping
from pdmesh.commandline import BAD_INPUT, FAILURE
from pdmesh.plain_text import print_to_stderr
from pdsolve.numerics.team import NUMBERS, Floor, Team, is_first, is_one_of_many, team

MISSING = "ranks need MPI for Python; install it: pip install 'pdsuite[mpi]'"


ROOM = 1 << 29  # bytes of addresses: with less, OpenBLAS asks the system for more for ever
OF_A_RANK = 3 << 28  # likewise, of a process that has loaded MPI
Exits = Callable[[], dict[type[Exception], int]]  # the exit codes of expected errors
KILLED = "pdsolve: a rank was killed (too little memory?); --resume goes on from the checkpoint"
DISMISSAL = b"all is said"
WITNESS = "import sys; sys.stdin.read() or print(sys.argv[1], file=sys.stderr)"


def together(command: Callable[[Team | None], int], exits: Exits) -> int:
    """Run a command on rank 0, with the other ranks at its service; returns its exit code on all.

    An error on any rank ends all of them, with one line.
    """
    try:
        ranks = team()
    except (ImportError, RuntimeError):  # the library is looked for when the package is imported
        if is_first():
            print_to_stderr(f"pdsolve: {MISSING}")
        return BAD_INPUT
    if ranks is None:
        return command(None)
    witness = Witness() if ranks.rank == 0 else None
    place = ranks.comm.bcast(None if witness is None else witness.place)
    ranks.floor = Floor(ranks.comm)
    if witness is None:
        return _served(ranks, exits, place)
    with stopping.last_words(witness.handle, DISMISSAL):
        try:
            code = command(ranks)
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else FAILURE
        except BaseException:
            traceback.print_exc()
            code = FAILURE
    sys.stdout.flush()
    witness.dismiss()
    ranks.end(code)
    return code


class Witness:
    """A process that says KILLED if this one ends without dismissing it: a launcher that finds a rank killed kills all
    others too, which can say nothing then."""

    def __init__(self) -> None:
        command = [sys.executable, "-S", "-E", "-c", WITNESS, KILLED]
        of_no_rank = {name: value for name, value in os.environ.items() if name not in NUMBERS}
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=of_no_rank, start_new_session=True
        )
        assert self._process.stdin is not None
        self.handle = self._process.stdin.fileno()
        self.place = platform.node(), self._process.pid

    def dismiss(self) -> None:
        """Let the witness end in silence."""
        with suppress(BrokenPipeError):
            self._process.communicate(DISMISSAL)


def _silence(place: tuple[str, int]) -> None:
    """End the witness, if it is on this machine: what went wrong is said."""
    if place[0] == platform.node():
        with suppress(OSError):
            os.kill(place[1], signal.SIGTERM)


def alone(name: str, command: Callable[[], int]) -> int:
    """Run a command that is of one process; returns its exit code. Many ranks are refused."""
    if not is_one_of_many():
        return command()
    if is_first():
        print_to_stderr(f"{name} runs on many ranks; use one process: pdsolve alone is for mpiexec")
    return BAD_INPUT


def expect_room(ranks: Team | None) -> None:
    """Raise MemoryError if a process of the run may use too few bytes of addresses."""
    if ranks is None:
        commandline.expect_memory(ROOM)
    else:
        ranks.everywhere(_expect_room)


def _expect_room(ranks: Team) -> None:
    commandline.expect_memory(OF_A_RANK)


def _served(ranks: Team, exits: Exits, witness: tuple[str, int]) -> int:
    """Serve rank 0, which is the one that hears signals; an error that rank 0 does not hear of ends all ranks.

    `witness` is the place of rank 0's.
    """
    for number in commandline.STOPS:
        signal.signal(number, signal.SIG_IGN)
    warnings.simplefilter("ignore")  # rank 0 has the whole model to warn of
    try:
        return ranks.serve()
    except BaseException as error:
        code, said = _said(error, exits)
        if ranks.tells():
            print_to_stderr(f"pdsolve: rank {ranks.rank}: {' '.join(said.split())}")
            sys.stderr.flush()
            _silence(witness)
            ranks.comm.Abort(code)
        os._exit(code)


def _said(error: BaseException, exits: Exits) -> tuple[int, str]:
    """The exit code and the words of an error."""
    try:
        if isinstance(error, Exception):
            return commandline.said(error, exits)
    except Exception as unexpected:
        error = unexpected
    return FAILURE, f"{type(error).__name__}: {error}"
