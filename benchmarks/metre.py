"""What a plate of 16 million fine nodes takes: python -m benchmarks.metre [SPACING [SIDE [DURATION]]].

Builds geometries/duran_metre.py, 0.25 mm between nodes and 1 m wide if not said otherwise, and solves it, each in a
process of its own, as from the command line; prints wall and user time and the largest memory of each, and how far the
crack has come.

Bars: 1.5 GB and 120 s on two cores. Measured on cores that others used too: built in 0.09 GB and 0.9 s of user time;
solved in 0.87 GB at its peak and 49 s of user time of both threads, in 38 to 93 s. Without cells of 4 h it was 129 s of
user time, 83 s on two quiet cores, with 1.50 GB; its first bond broke in the same step, and its crack came as far. The
peak comes by the last records. 200 steps of 4 x 4 m, 256 million fine nodes (2.5e-4 4 1.1124e-5), take 5.8 GB.
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


def main(spacing: str = "2.5e-4", side: str = "1", duration: str = "270e-6") -> None:
    """Measure, and say so."""
    from pdsolve.results import Results

    with tempfile.TemporaryDirectory() as folder:
        model, output = (str(Path(folder) / name) for name in ("metre.json", "metre.sqlite"))
        given = (f"{name}={value}" for name, value in (("spacing", spacing), ("side", side), ("duration", duration)))
        sets = [word for one in given for word in ("--set", one)]
        built = timed("pdmesh", "build", str(SCENE), "--trust", *sets, "-o", model)
        solved = timed("pdsolve", model, "-o", output)
        with Results.open(Path(output)) as results:
            last = int(results.frames()[0][-1])
            tip = results.nodes(last).position[results.field("damage", last) > CRACKED, 0].max()
    for what, one in (("built", built), ("solved", solved)):
        print(f"{what} in {one.wall:.1f} s, of which users' {one.user:.1f} s of all threads; {one.memory:.2f} GB")
    print(f"together {built.wall + solved.wall:.0f} s; the crack has come {tip - NOTCH:.3f} m")


if __name__ == "__main__":
    main(*sys.argv[1:])
