"""Options of how to solve a model."""

from __future__ import annotations

from typing import NamedTuple

from pdsolve.numerics.team import Team
from pdsolve.numerics.thread_team import useful_threads

# Nodes in blocks that are worth a thread. On two cores all shipped scenes, of 2700 to 13 000 nodes, took 1.0 to 2 times
# as long on two threads, which wait for each other at each step and leave no core to what writes their frames.
WORTH = 10_000


class Options(NamedTuple):
    """Options of a run, chosen by the caller."""

    mode: str = "conservative"
    precision: str = "float64"
    threads: int | None = None  # None: as many as there are and the nodes are worth
    kernel: str | None = None  # "blocks" or "listed"; None: blocks where nodes are a lattice and the law can
    team: Team | None = None  # the ranks of the run; None: it is one process
    one_file: int = 10_000_000  # nodes up to which ranks write one database; each one of its own, if there are more


def threads_of(options: Options, nodes: int, fast: bool) -> int:
    """Number of threads for so many nodes; `fast`: for the block kernel, whose steps are shorter."""
    if options.team is not None:
        return options.threads or 1
    return options.threads or (useful_threads(nodes, WORTH) if fast else useful_threads(nodes))
