"""The ranks of a run: processes that MPI started together, which share the nodes.

Rank 0 runs the program and asks all ranks, itself included, to do the same work on their parts; the others do what they
are asked. Work is a function at the top level of a module, as it travels by its name.
"""

from __future__ import annotations

import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from pdmesh import trust

if TYPE_CHECKING:
    from mpi4py import MPI

BYTES = 8  # of a number in memory that ranks share
ORDER, ANSWER, PASSED, HEARD = 1, 2, 3, 4  # tags of messages
SPIN, NAP = 1e-3, 5e-5  # s of looking before a nap; s of a nap, as ranks may be more than cores
NUMBERS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "MPI_LOCALRANKID")  # set by what starts ranks
SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")  # likewise
PATIENCE = 1.5  # s that rank 0 waits for the others at the end
GRACE = 0.5  # s that a rank in error waits for rank 0 to end it
SILENCE = 10.0  # s that a rank in error waits for the one that tells an error to end it


class Failed(NamedTuple):
    """The answer of a rank whose work raised an error."""

    error: Exception


class Floor:
    """The right to tell an error, which one rank gets: the first that takes it. All ranks make it together."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        from mpi4py import MPI

        self._share = MPI.LOCK_SHARED
        self._window = MPI.Win.Allocate(BYTES if comm.Get_rank() == 0 else 0, BYTES, comm=comm)

    def take(self) -> bool:
        """Whether this rank is the first. It waits for rank 0 to wait for a message."""
        import numpy as np  # here, as every start of the program reads this module

        new_value, zero, before = (np.array([value], np.int64) for value in (1, 0, 0))
        self._window.Lock(0, self._share)
        self._window.Compare_and_swap(new_value, zero, before, 0)
        self._window.Unlock(0)
        return bool(before[0] == 0)

    def free(self) -> None:
        """Give it back, on all ranks together."""
        self._window.Free()


class Team:
    """All ranks, as one of them sees them; usually one process, which needs no MPI."""

    def __init__(self, comm: MPI.Intracomm | None = None) -> None:
        """`comm` connects the processes; None: this one is alone."""
        self.comm: Any = comm
        self.rank: int = 0 if comm is None else comm.Get_rank()
        self.size: int = 1 if comm is None else comm.Get_size()
        self.part: Any = None  # the bonds that this rank works on, one of many
        self.subdomain: Any = None  # and what runs know of its nodes
        self.floor: Floor | None = None  # None: who tells an error is not decided
        self._asking = threading.Lock()  # the thread that writes results asks too

    def everywhere(self, work: Callable[..., Any], *common: Any, items: Sequence[Any] | None = None) -> list[Any]:
        """What `work(team, *common)` returns on every rank, in the order of ranks; asked by rank 0.

        With `items`, an item a rank, the rank's item is the last argument. Raises what the first rank in error raised.
        """
        with self._asking:
            for rank in range(1, self.size):
                arguments = common if items is None else (*common, items[rank])
                self.comm.send((work, arguments), rank, ORDER)
            try:
                answers = [work(self, *(common if items is None else (*common, items[0])))]
            except Exception:
                self._hear_first()
                raise
            answers += [self.received(rank, ANSWER) for rank in range(1, self.size)]
            errors = [answer.error for answer in answers if isinstance(answer, Failed)]
            if errors:
                self._hear_first()
                raise errors[0]
        return answers

    def serve(self) -> int:
        """Do what rank 0 asks for until it ends; returns its exit code.

        An error is rank 0's to tell. It is raised here if rank 0 does not hear of it, as it waits for this rank's part
        of a sum or an exchange.
        """
        while True:
            work, arguments = self.received(0, ORDER)
            if work is None:
                while self.comm.Iprobe(0, HEARD):
                    self.comm.recv(source=0, tag=HEARD)
                self.comm.send(None, 0, ANSWER)
                if _is_ended_at_once(arguments):
                    time.sleep(PATIENCE)
                else:
                    self._part()
                return int(arguments)
            try:
                self.comm.send(work(self, *arguments), 0, ANSWER)
            except Exception as error:
                self.comm.send(Failed(_portable(error)), 0, ANSWER)
                if self.received(0, HEARD, time.monotonic() + GRACE) is None:
                    raise

    def tells(self) -> bool:
        """Whether this rank, which has an error, is the one that tells it and ends all.

        If not, it returns only if it has not been ended in SILENCE.
        """
        if self.floor is None or self.floor.take():
            return True
        time.sleep(SILENCE)
        return False

    def _hear_first(self) -> None:
        """Hear of an error, unless another rank tells one, which ends this one."""
        self.tells()
        self._hear()

    def _hear(self) -> None:
        """Let all other ranks know that rank 0 knows of an error."""
        for rank in range(1, self.size):
            self.comm.isend(True, rank, HEARD)

    def end(self, code: int) -> None:
        """Let all other ranks end with this exit code; end them if they do not answer. Returns where all may end by
        themselves."""
        self._hear()
        for rank in range(1, self.size):
            self.comm.isend((None, code), rank, ORDER)
        until = time.monotonic() + PATIENCE
        for rank in range(1, self.size):
            while self.received(rank, ANSWER, until) is not None:  # answers to what was asked before an error
                pass
            if time.monotonic() > until:
                self.comm.Abort(code)
                return
        if _is_ended_at_once(code):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())  # nothing went wrong with MPI
            self.comm.Abort(code)
        else:
            self._part()

    def _part(self) -> None:
        """Give back what all ranks made together."""
        if self.floor is not None:
            self.floor.free()

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


def _portable(error: Exception) -> Exception:
    """The error, or its words if it cannot travel."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _is_ended_at_once(code: int) -> bool:
    """Whether rank 0 ends all processes with this exit code, instead of each itself.

    Hydra, MPICH's launcher, kills the others when the first has ended, and then tells either's code.
    """
    return code != 0 or "HYDI_CONTROL_FD" in os.environ


def is_one_of_many() -> bool:
    """Whether this process is one of several that mpiexec, mpirun or srun started."""
    return is_started_by_mpi() and any(os.environ.get(name, "1") not in ("", "0", "1") for name in SIZES)


def is_first() -> bool:
    """Whether no rank before this process is known of."""
    return all(os.environ.get(name, "0") == "0" for name in NUMBERS)


def is_started_by_mpi() -> bool:
    """Whether this process is one of those that mpiexec, mpirun or srun started."""
    return any(name in os.environ for name in NUMBERS)


def team() -> Team | None:
    """The ranks of this run; None if it is one process. Raises ImportError without mpi4py or an MPI library."""
    if not is_started_by_mpi():
        return None
    trust.settle_variables("mpi4py")
    from mpi4py import MPI

    return Team(MPI.COMM_WORLD) if MPI.COMM_WORLD.Get_size() > 1 else None
