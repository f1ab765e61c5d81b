"""What a plate of 16 million fine nodes takes: python -m benchmarks.metre [SPACING].

Builds geometries/duran_metre.py, 0.25 mm between nodes if not said otherwise, and solves it, each in a process of its
own, as from the command line; prints wall and user time and the largest memory of each, and how far the crack has come.

Bars: 1.5 GB and 120 s on two cores. Measured on cores that others used too: built in 0.4 GB and 1.1 s of user time;
solved in 1.48 GB at its peak and 159 s of user time of both threads. It was 226 s, and 152 s on two quiet cores, with
1.9 GB, when each part of the initial nodes copied lists of all, and old nodes stood beside new ones until these were
recorded. The peak comes by the last records.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

SCENE = Path(__file__).parent.parent / "geometries" / "duran_metre.py"
NOTCH = 0.25  # m
CRACKED = 0.35  # damage of a node on the path


class Taken(NamedTuple):
    """What a command takes."""

    wall: float  # s
    user: float  # s, of all threads
    memory: float  # GB, the largest of any process so far


def timed(*words: str) -> Taken:
    """Run a command, and measure."""
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", *words], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Taken(time.perf_counter() - began, used.ru_utime - before.ru_utime, used.ru_maxrss / 1e6)


def main(spacing: str = "2.5e-4") -> None:
    """Measure, and say so."""
    from pdsolve.results import Results

    with tempfile.TemporaryDirectory() as folder:
        model, output = (str(Path(folder) / name) for name in ("metre.json", "metre.sqlite"))
        built = timed("pdmesh", "build", str(SCENE), "--trust", "--set", f"spacing={spacing}", "-o", model)
        solved = timed("pdsolve", model, "-o", output)
        with Results.open(Path(output)) as results:
            last = int(results.frames()[0][-1])
            tip = results.nodes(last).position[results.field("damage", last) > CRACKED, 0].max()
    for what, one in (("built", built), ("solved", solved)):
        print(f"{what} in {one.wall:.1f} s, of which users' {one.user:.1f} s of all threads; {one.memory:.2f} GB")
    print(f"together {built.wall + solved.wall:.0f} s; the crack has come {tip - NOTCH:.3f} m")


if __name__ == "__main__":
    main(*sys.argv[1:])
