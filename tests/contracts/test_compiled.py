"""What is compiled once is found by the next process: for every law, with every operator that takes it."""

from __future__ import annotations

import os
import subprocess
import sys

from clouds import CASES, SLOW

SCRIPT = """
import sys
from numba.core import event


class Compiled(event.Listener):
    names = []

    def on_start(self, happened):
        self.names.append(happened.data["dispatcher"].__name__)

    def on_end(self, happened):
        pass


event.register("numba:compile", Compiled())

from clouds import CASES, SLOW, cloud

for case in (case for case in CASES if case not in SLOW):
    Compiled.names.clear()
    made = cloud(case, 6)
    made.march(1, 3)
    made.energy()
    if not case.single:
        made.operator.tangent(made.state)
    print(case, *Compiled.names)
"""


def compiled() -> dict[str, list[str]]:
    """What a new process compiles for each case."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ran = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, env=environment)
    lines = [line.split() for line in ran.stdout.splitlines()]
    return {case: names for case, *names in lines}


def test_a_second_process_compiles_nothing() -> None:
    compiled()
    assert compiled() == {str(case): [] for case in CASES if case not in SLOW}
