"""Every pair law has the forces of the list of bonds on every kernel: lattices, graded grids, devices, moving zones."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from devices import missing
from kernel_forces import KERNELS, Case, Difference, compare
from plates import ROOT

from pdsolve.laws import LAWS

OWN = "curved"  # a law that is added as users add theirs: in a process whose kernels nobody else loads
TOLERANCE = {"float64": 1e-14, "float32": 1e-6}  # measured 2e-15 and 3e-7
CASES = [
    Case(law, kernel, dimension, precision)
    for dimension, kernels in KERNELS.items()
    for law in (*LAWS, OWN)
    for kernel in kernels
    for precision in TOLERANCE
]
QUICK = {(2, "blocks"), (2, "graded")}  # of brittle bonds in double precision


def marked(case: Case) -> object:
    """A case for pytest; all but a few are slow, as kernels are compiled for each."""
    quick = case.law == "brittle" and case.precision == "float64" and (case.dimension, case.kernel) in QUICK
    reason = missing() if case.kernel == "device" else ""
    marks = [] if quick else [pytest.mark.slow]
    return pytest.param(case, marks=[*marks, pytest.mark.skipif(bool(reason), reason=reason or "nothing")])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the kernels of the own law are stored."""
    return tmp_path_factory.mktemp("own_law")


def differences(case: Case, folder: Path) -> Difference:
    """The differences of a case, of an own law in a process of its own."""
    if case.law != OWN:
        return compare(case)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT / "tests", ROOT)))}
    environment["NUMBA_CACHE_DIR"] = str(folder / "compiled")
    command = [sys.executable, "-m", "kernel_forces", *map(str, case)]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stderr
    return Difference(*json.loads(ran.stdout.splitlines()[-1]))


@pytest.mark.parametrize("case", [marked(case) for case in CASES], ids=str)
def test_forces_are_those_of_the_list(case: Case, folder: Path) -> None:
    """Of bonds stretched until some soften and break, and of what is left of them at half of these displacements."""
    found = differences(case, folder)
    assert found.nodes > 100
    assert found.broken > 50
    assert found.same_broken
    assert found.stretched < TOLERANCE[case.precision]
    assert found.released < TOLERANCE[case.precision]
