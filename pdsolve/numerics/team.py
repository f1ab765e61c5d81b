"""The ranks of a run: processes that MPI started together, which share the nodes.

Rank 0 runs the program and asks all ranks, itself included, to do the same work on their parts; the others do what they
are asked. Work is a function at the top level of a module, as it travels by its name.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpi4py import MPI

ORDER, ANSWER, PASSED = 1, 2, 3  # tags of messages
SPIN, NAP = 1e-3, 5e-5  # s of looking before a nap; s of a nap, as ranks may be more than cores
NUMBERS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "MPI_LOCALRANKID")  # set by what starts ranks
PATIENCE = 1.5  # s that rank 0 waits for the others at the end


class Team:
    """All ranks, as one of them sees them."""

    def __init__(self, comm: MPI.Comm) -> None:
        self.comm, self.rank, self.size = comm, comm.Get_rank(), comm.Get_size()
        self.part: Any = None  # what this rank works on
        self._asking = threading.Lock()  # the thread that writes results asks too

    def everywhere(self, work: Callable[..., Any], *common: Any, each: Sequence[Any] | None = None) -> list[Any]:
        """What `work(team, *common)` returns on every rank, in the order of ranks; asked by rank 0.

        With `each`, an item a rank, the rank's item is the last argument.
        """
        with self._asking:
            for rank in range(1, self.size):
                own = common if each is None else (*common, each[rank])
                self.comm.send((work, own), rank, ORDER)
            found = [work(self, *(common if each is None else (*common, each[0])))]
            return found + [self.received(rank, ANSWER) for rank in range(1, self.size)]

    def serve(self) -> int:
        """Do what rank 0 asks for until it ends; returns its exit code."""
        while True:
            work, arguments = self.received(0, ORDER)
            if work is None:
                self.comm.send(None, 0, ANSWER)
                return int(arguments)
            self.comm.send(work(self, *arguments), 0, ANSWER)

    def end(self, code: int) -> None:
        """Let all other ranks end with this exit code; end them if they do not answer."""
        for rank in range(1, self.size):
            self.comm.isend((None, code), rank, ORDER)
        until = time.monotonic() + PATIENCE
        for rank in range(1, self.size):
            while self.received(rank, ANSWER, until) is not None:  # answers to what was asked before an error
                pass
            if time.monotonic() > until:
                self.comm.Abort(code)

    def received(self, source: int, tag: int, until: float = float("inf")) -> Any:
        """The next message of this tag from a rank, waited for without taking the processor from others.

        After the time `until`, s of time.monotonic(), it is None.
        """
        began = time.monotonic()
        while not self.comm.Iprobe(source, tag):
            now = time.monotonic()
            if now > until:
                return None
            if now > began + SPIN:
                time.sleep(NAP)
        return self.comm.recv(source=source, tag=tag)


def is_started_by_mpi() -> bool:
    """Whether this process is one of those that mpiexec, mpirun or srun started."""
    return any(name in os.environ for name in NUMBERS)


def team() -> Team | None:
    """The ranks of this run; None if it is one process. Raises ImportError without mpi4py or an MPI library."""
    if not is_started_by_mpi():
        return None
    from mpi4py import MPI

    return Team(MPI.COMM_WORLD) if MPI.COMM_WORLD.Get_size() > 1 else None
