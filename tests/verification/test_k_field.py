"""The K field on the rim of a plate: J of a still crack, and of one that follows a moving tip ("surfing")."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from plates import shipped

from pdmesh import Material, Run, Scene, box, build, k_field
from pdsolve import simulate
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.model import Model
from pdsolve.results import Results

E, G0, HALF = 65e9, 204.0, 0.02


def j_over_toughness(results: Results) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """J over G0 at frames (t,), and places of the tip (t, 2), m, where it can be computed."""
    steps = [int(step) for step in results.frames()[0]][1:]
    (tip,) = follow_tip_intensities(results, steps)
    there = np.isfinite(tip.value["J"])
    return tip.value["J"][there] / G0, tip.tip_place[there]


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "J"), [(20, 0.9716), (60, 0.9926)])
def test_j_at_the_critical_intensity_is_the_fracture_energy(fineness: int, J: float) -> None:
    """Within 1 % on 60 spacings in half a side; the error falls with the spacing."""
    spacing = HALF / fineness
    depth, y = 3 * spacing, spacing / 2
    glass = Material(E=E, rho=2235, G0=1e4 * G0)  # no bond breaks
    square = box(-HALF, -HALF, HALF, HALF)
    rim = square.difference(box(-HALF + depth, -HALF + depth, HALF - depth, HALF - depth))
    scene = Scene(square, spacing, glass, run=Run(solver="static")).crack([(-HALF, y), (0, y)])
    built = build(scene.fix(rim, *k_field(glass, sqrt(E * G0), tip=(0, y))))
    with simulate(Model(built.grid, built.settings), None) as results:
        assert j_over_toughness(results)[0][-1] == pytest.approx(J, abs=5e-4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*run.damping took:pdsolve.model.ModelWarning")
@pytest.mark.parametrize(("spacing", "mean", "scatter"), [("1e-3", 0.994, 0.02), ("5e-4", 0.993, 0.006)])
def test_a_crack_follows_a_moving_tip_at_its_fracture_energy(spacing: str, mean: float, scatter: float) -> None:
    built = shipped("surfing_crack.py", [("spacing", spacing)])
    with simulate(Model(built.grid, built.settings), None) as results:
        J, place = j_over_toughness(results)
    grown = place[:, 0] > -0.006
    assert grown.sum() > 20
    assert J[grown].mean() == pytest.approx(mean, abs=4e-3)
    assert J[grown].std() < scatter
