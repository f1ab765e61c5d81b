"""The shipped scenes whose cracks are particles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plates import GEOMETRIES

from pdmesh.drawing.sources import build
from pdmesh.model.domain_integrals import kink
from pdmesh.model.particles import Particles
from pdsolve.model import Model, ModelWarning
from pdsolve.simulation import Options, simulate


def grown(name: str, **parameters: str) -> tuple[Particles, dict[str, Any]]:
    made = build(Path(GEOMETRIES / name), list(parameters.items()))
    with simulate(Model(made.grid, made.settings), options=Options(threads=1)) as results:
        return results.particles(), results.summary()


@pytest.mark.slow
@pytest.mark.parametrize("angle", [30, 45, 60])
def test_an_inclined_crack_kinks_as_the_hoop_stress_says(angle: int) -> None:
    """To the angle of an infinite plate: measured 0.49, 0.43 and 0.35 degrees less; both ends alike."""
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
    with pytest.warns(ModelWarning, match="found another tip or crack"):
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
    """After 16 to 20 mm, once, into mirror images; found 69 mm from the edge."""
    particles, summary = grown("forked_crack.py")
    (fork,) = np.flatnonzero(np.bincount(particles.parent[1:]) > 1)
    assert 0.064 < particles.place[fork, 0] < 0.071
    assert particles.place[fork, 1] == 0
    upper, lower = particles.place[fork + 2 :: 2], particles.place[fork + 1 :: 2]
    assert upper == pytest.approx(lower * [1, -1], abs=1e-9)
    assert abs(summary["balance"]) < 1e-3
