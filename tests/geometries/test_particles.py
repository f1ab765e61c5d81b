"""The shipped scenes whose cracks are particles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from messages import naming
from plates import ROOT, shipped

from benchmarks.forks import SPACINGS, STEPS, forked, table
from pdsolve.fracture.crack_particles import Particles
from pdsolve.fracture.domain_integrals import kink
from pdsolve.model import Model, ModelWarning
from pdsolve.run.simulation import Options, simulate


def grown(name: str, **parameters: str) -> tuple[Particles, dict[str, Any]]:
    made = shipped(name, list(parameters.items()))
    with simulate(Model(made.grid, made.settings), options=Options(threads=1)) as results:
        return results.particles(), results.summary()


@pytest.mark.slow
@pytest.mark.parametrize("angle", [30, 45, 60])
def test_an_inclined_crack_kinks_as_the_hoop_stress_says(angle: int) -> None:
    """To the angle of an infinite plate: measured 0.49, 0.43 and 0.35 degrees less; both ends alike."""
    with pytest.warns(ModelWarning, match=naming(found="2 particles", expected="run.particles.most")):
        particles, _ = grown("inclined_crack.py", angle=str(angle), most="2")
    radians = np.radians(angle)
    expected = angle + kink(np.cos(radians) ** 2, np.sin(radians) * np.cos(radians))
    ways = [
        particles.place[number] - particles.place[particles.parent[number]] for number in np.flatnonzero(particles.step)
    ]
    left, right = sorted(ways, key=lambda way: way[0])
    assert len(ways) == 2
    assert np.degrees(np.arctan2(right[1], right[0])) == pytest.approx(expected, abs=1)
    assert left == pytest.approx(-right, abs=1e-8 * np.hypot(*right))


@pytest.mark.slow
def test_two_edge_cracks_pass_and_turn_to_each_other() -> None:
    """First away from each other, then towards; mirrored through the middle: measured to 1e-9 m."""
    with pytest.warns(ModelWarning, match=naming(found=("tip", "cracks"))):
        particles, summary = grown("double_edge_notch.py")
    upper, lower = (particles.place[particles.place[:, 1] * side > 0.04 * side] for side in (1, -1))
    assert len(upper) == len(lower) > 15
    assert upper == pytest.approx([0.06, 0.08] - lower, abs=1e-7)
    assert upper[:, 1].max() > 0.0455
    assert upper[-1, 0] > 0.03
    assert upper[-1, 1] < 0.045
    assert abs(summary["balance"]) < 1e-6


@pytest.mark.slow
def test_a_crack_that_runs_forks() -> None:
    """Over time steps and grids, where published ones do, into mirror images; the page has a row for each measure."""
    found = {spacing: [forked(spacing, step) for step in STEPS] for spacing in SPACINGS}
    every = [run for runs in found.values() for run in runs]
    assert [run.place for run in every] == pytest.approx([67.5] * 6, abs=2.5)  # measured 69.0 to 69.6
    assert [run.time for run in every] == pytest.approx([27.5] * 6, rel=0.03)  # measured 27.3 to 27.8
    assert [run.speed for run in every] == pytest.approx([1010] * 6, rel=0.03)  # measured 998 to 1020
    assert max(run.off for run in every) < 1e-9
    assert max(abs(run.balance) for run in every) < 1e-3
    page = (ROOT / "docs" / "verification" / "crack_particles.md").read_text()
    assert all(line.split("|")[1] in page for line in table(found).splitlines() if line.startswith("|"))
