"""What is compiled once is found by the next process: for every law, with every operator that takes it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence

import pytest
from node_clouds import CASES, SLOW, Case, all_kernels

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

from node_clouds import CASES, all_kernels

for case in (case for case in CASES if str(case) in sys.argv[1:]):
    Compiled.names.clear()
    all_kernels(case)
    print(case, *Compiled.names)
"""
FEW = [case for case in CASES if str(case) in ("brittle-listed-2D-float64", "bilinear-blocks-2D-float32")]
SOON = [case for case in CASES if case not in SLOW]


def compiled(cases: Sequence[Case]) -> dict[str, list[str]]:
    """What a new process compiles for each of these cases."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, *map(str, cases)], capture_output=True, text=True, check=True, env=environment
    )
    lines = [line.split() for line in ran.stdout.splitlines()]
    return {case: names for case, *names in lines}


@pytest.mark.slow
def test_a_second_process_compiles_nothing() -> None:
    for case in FEW:
        all_kernels(case)
    assert compiled(FEW) == {str(case): [] for case in FEW}


@pytest.mark.slow
def test_a_second_process_compiles_nothing_of_any_case() -> None:
    compiled(SOON)
    assert compiled(SOON) == {str(case): [] for case in SOON}
