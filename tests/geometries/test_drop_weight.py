"""The drop weight on a beam, beside a mass on a spring."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from plates import shipped

from pdsolve import simulate
from pdsolve.model import Model
from pdsolve.options import Options


@pytest.mark.slow
def test_a_drop_weight_bounces_from_its_beam() -> None:
    """The beam vibrates, so that the force comes in pulses; it acts for as long as that of the spring."""
    built = shipped("drop_weight.py")
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        rows = results.reactions()
    mine = rows[rows["condition"] == 0]
    mass, E, nu, span, h = 100.0, 3.3e9, 1 / 3, 0.16, 0.03
    G, beam = E / (2 * (1 + nu)), 1180 * 0.2 * h
    k = 1 / (span**3 / (4 * E * h**3) + span / (4 * 5 / 6 * G * h))
    lasts = pi * sqrt((mass + 17 / 35 * beam) / k)
    end = mine["time"][mine["force_y"] < -1e2].max()
    assert end == pytest.approx(lasts, rel=0.06)  # 3.46 and 3.61 ms
    free = mine[mine["time"] > end + 1e-4]
    rebound = np.polyfit(free["time"], free["displacement_y"], 1)[0]
    assert rebound == pytest.approx(0.976, abs=0.02)
    pushed = -np.trapezoid(mine["force_y"], mine["time"])
    assert pushed == pytest.approx(mass * (1 + rebound), rel=0.02)
