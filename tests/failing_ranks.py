"""A program of many ranks whose work fails on some of them: mpiexec -n 3 python -m failing_ranks HOW RANK ..."""

from __future__ import annotations

import resource
import sys
import time

import numpy as np

from pdmesh import commandline
from pdsolve.__main__ import _exits
from pdsolve.model import ModelError
from pdsolve.numerics.team import Team
from pdsolve.ranks import launch


def fail(team: Team, how: str, ranks: list[int]) -> None:
    """Raise an error on these ranks; the others wait for them, if not `between` two such waits."""
    if team.rank in ranks:
        if how == "memory":
            resource.setrlimit(resource.RLIMIT_AS, (1 << 33, resource.RLIM_INFINITY))
            np.ones(1 << 31)
        raise ModelError("plate.json: $.nodes: found 1, expected 2")
    if how != "between":
        team.comm.allgather(team.rank)


def main() -> int:
    """Let work fail as the words of the command line say."""
    how, *ranks = sys.argv[1:]
    if how == "slowly":  # a rank that has told its error takes its time to end the others
        silence = launch._silence
        launch._silence = lambda place: time.sleep(0.6) or silence(place)  # type: ignore[func-returns-value]

    def command(team: Team | None) -> int:
        assert team is not None
        team.everywhere(fail, how, [int(rank) for rank in ranks])
        return 0

    return launch.together(lambda team: commandline.run("pdsolve", lambda: command(team), _exits), _exits)


if __name__ == "__main__":
    sys.exit(main())
