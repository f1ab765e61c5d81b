"""What the first run of each kind costs, whose kernels are not compiled yet: python -m benchmarks.cold [NAME ...].

Each small run is a process with an empty cache of kernels, then another one with that cache. CPU time is user time of
the process, imports included, on one thread but where the name says otherwise. All kinds are written into
docs/guide/speed.md. Those that are named are printed alone, with their kernels and the seconds that each took.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

from numba.core import event

from benchmarks.kinds_of_run import ALONE, KINDS, _of
from benchmarks.pages import put_section
from benchmarks.processes import environment
from pdsolve.options import Options
from pdsolve.run.simulation import simulate

PAGE = Path(__file__).parent.parent / "docs/guide/speed.md"
BODY = {"counts": (16, 16, 16), "ratio": 3.0, "run": {"adapt": "hybrid"}}
MORE = {
    "cohesive": partial(_of, {"law": "cohesive", "f_t": 1e7}),
    "correspondence, float32": partial(_of, KINDS["correspondence"].args[0], Options(precision="float32", threads=1)),  # type: ignore[attr-defined]
    "body, correspondence": partial(_of, {"model": "correspondence", "nu": 0.22}, counts=(10, 10, 6)),
    "body, hybrid": partial(_of, {}, ALONE, **BODY),
}
EVERY = KINDS | MORE
TEXT = """
## The first run of a kind

Kernels are compiled when a run first needs them, and kept. A small run of each kind is solved twice: by a process with
an empty cache of kernels, and by a process that finds them there. All times are CPU seconds, measured on two busy
cores. That of a run is the user time of its process, imports included. That of compiling also includes system time, so
that it may be longer. Functions are those that were compiled. `python -m benchmarks.cold` measures it; with the name of
a kind it lists what each function took.

| kind of run | functions | compiling, s | CPU time of the first run, s | of the second, s |
|---|---|---|---|---|
"""


class Kernels(event.Listener):
    """Listens to numba: CPU time, s, of the compilation of each function, without what it calls, and how often."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.times: Counter[str] = Counter()
        self._begun: list[float] = []  # of those that are compiled now, the innermost last

    def on_start(self, event: Any) -> None:
        self._begun.append(time.thread_time())

    def on_end(self, event: Any) -> None:
        took = time.thread_time() - self._begun.pop()
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('pdsolve.')}.{function.__qualname__}"
        self.seconds[name] += took
        self.times[name] += 1
        self._begun = [begun + took for begun in self._begun]


def alone(name: str) -> None:
    """Solve a kind of run in this process, and print what it took."""
    kernels = Kernels()
    model, options = EVERY[name]()
    with tempfile.TemporaryDirectory() as folder, event.install_listener("numba:compile", kernels):
        simulate(model, Path(folder) / "run.sqlite", options).close()
    user = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    print(json.dumps({"user": user, "seconds": kernels.seconds, "times": kernels.times}))


def measured(name: str) -> list[dict[str, Any]]:
    """What the first and the second run of a kind took."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-W", "ignore", "-m", "benchmarks.cold", "--alone", name]
        own = environment(NUMBA_CACHE_DIR=folder)
        took = [subprocess.run(words, check=True, stdout=subprocess.PIPE, env=own, text=True) for _ in range(2)]
    return [json.loads(one.stdout.splitlines()[-1]) for one in took]


def main(names: list[str]) -> None:
    """Measure, and print or write it."""
    rows = []
    for name in names or EVERY:
        first, second = measured(name)
        compiling, functions = sum(first["seconds"].values()), sum(first["times"].values())
        rows.append(f"| {name} | {functions} | {compiling:.1f} | {first['user']:.1f} | {second['user']:.1f} |")
        print(rows[-1], f"load {os.getloadavg()[0]:.1f}", flush=True)
        for kernel, seconds in sorted(first["seconds"].items(), key=lambda each: -each[1])[: 40 if names else 0]:
            print(f"  {seconds:6.2f} s, {first['times'][kernel]} times: {kernel}")
    if not names:
        put_section(PAGE, TEXT.lstrip("\n") + "\n".join(rows))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        alone(sys.argv[2])
    else:
        main(sys.argv[1:])
