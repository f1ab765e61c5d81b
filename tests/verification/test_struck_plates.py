"""A plate whose bonds have another law than brittle or bilinear, struck: its fine zone beside the fine lattice."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from curved_law import OWN
from plates import ROOT
from struck_plates import Struck, strike

pytestmark = pytest.mark.slow


def solved(law: str, folder: Path) -> Struck:
    """The plate of a law; of an own one in a process whose kernels nobody else loads."""
    if law not in OWN:
        return strike(law)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT / "tests", ROOT)))}
    environment["NUMBA_CACHE_DIR"] = str(folder / "compiled")
    command = [sys.executable, "-m", "struck_plates", law]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stderr
    return Struck(*json.loads(ran.stdout.splitlines()[-1]))


@pytest.mark.parametrize("law", ["cohesive", "unsoftened"])
def test_a_struck_plate_breaks_as_the_uniform_one(law: str, tmp_path: Path) -> None:
    """First broken bond, energies and books; a run that is restored goes on to the same bits."""
    found = solved(law, tmp_path)
    assert found.broken > 1000
    assert abs(found.first_steps[0] - found.first_steps[1]) <= 1
    assert found.dissipated == pytest.approx(1, abs=0.04)  # 0.003, 0.029 without softening
    assert found.work == pytest.approx(1, abs=0.01)  # 0.004
    assert abs(found.balance) < 0.02  # 0.002, 0.016: curved bonds lose 0.02 on the fine lattice too
    assert found.continues_alike


def test_curved_bonds_that_soften_go_on_to_the_same_bits(tmp_path: Path) -> None:
    """Their largest stretches are stored."""
    assert solved("curved", tmp_path).continues_alike
