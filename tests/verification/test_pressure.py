"""Pressure in a thick-walled cylinder (G. Lame) and in cracks (I. N. Sneddon)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pressure_cracks import MATERIAL, A, E, P, exact_of_penny, line_crack, opening_of_line, penny, solved

from pdmesh import Circle, Run, Scene, build
from pdsolve.measures.intensities_3d import compute_front_intensities
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.simulation import simulate


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "inner", "outer"), [(10, 0.012, -0.026), (20, -0.008, -0.029)])
def test_a_thick_cylinder_has_lames_displacements(fineness: int, inner: float, outer: float) -> None:
    """b = 2 a: u E / (p a) is 2 at the inner edge and 4/3 at the outer one; free edges of bonds are too stiff."""
    ring = Scene(Circle(0, 0, 2 * A), A / fineness, MATERIAL, run=Run(solver="static")).hole(Circle(0, 0, A))
    ring = ring.load("hole nearest 0,0", pressure=P)
    ring = ring.roller(0, 2 * A, "y").roller(0, -2 * A, "y").roller(2 * A, 0, "x")
    position, u = solved(ring)
    r = np.hypot(*position.T)
    moved = (u * position).sum(axis=1) / r

    def off(at: float) -> float:
        near = np.abs(r - at) < 0.5 * A / fineness
        exact = P * (r[near] * 2 / 3 + 16 / 3 * A**2 / r[near]) / (3 * E)
        return float((moved[near] / exact).mean() - 1)

    assert off(A) == pytest.approx(inner, abs=3e-3)
    assert off(2 * A) == pytest.approx(outer, abs=3e-3)
    assert off(1.5 * A) == pytest.approx(0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "middle", "area"), [(10, -0.006, 0.021), (20, -0.011, 0.003)])
def test_a_line_crack_opens_as_sneddons(fineness: int, middle: float, area: float) -> None:
    """w(0) = 4 p a / E and area 2 pi p a^2 / E of plane stress, at the nodes beside the crack, within 2 %; outer
    nodes move as in an infinite plate."""
    position, u = solved(line_crack(fineness))
    x, exact = opening_of_line(position)

    def opening(of: NDArray[np.float64]) -> NDArray[np.float64]:
        across = np.sort(np.unique(np.abs(position[:, 1])))[0]
        above, below = (np.isclose(position[:, 1], side * across) & (np.abs(x) < A) for side in (1, -1))
        return np.asarray(of[above, 1] - of[below, 1])

    wide, wide_exact = opening(u), opening(exact)
    assert wide.max() / wide_exact.max() - 1 == pytest.approx(middle, abs=2e-3)
    assert wide.sum() / wide_exact.sum() - 1 == pytest.approx(area, abs=2e-3)
    assert wide_exact.max() == pytest.approx(4 * P * A / E, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "K_off", "J_off"), [(10, -0.0014, -0.028), (20, 0.001, -0.014)])
def test_a_line_crack_has_sneddons_intensity(fineness: int, K_off: float, J_off: float) -> None:
    """K = p sqrt(pi a), whatever the ring: the pressure on the faces within it counts."""
    built = build(line_crack(fineness))
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        tips = follow_tip_intensities(results, [1])
    K = P * np.sqrt(np.pi * A)
    for tip in tips:
        assert tip.value["K1"][0] / K - 1 == pytest.approx(K_off, abs=1e-3)
        assert tip.value["J"][0] * E / K**2 - 1 == pytest.approx(J_off, abs=2e-3)
        assert tip.high["J"][0] / tip.low["J"][0] < 1.005
        assert abs(tip.value["K2"][0]) < 1e-3 * K
        assert abs(tip.value["T"][0]) < 0.02 * P


@pytest.mark.slow
def test_a_penny_has_sneddons_opening_volume_and_intensity() -> None:
    """w(0) = 8 p a / (pi E'), V = 16 p a^3 / (3 E') and K = 2 p sqrt(a / pi) within 2 %, at 8 spacings in the radius;
    outer nodes move as in an infinite body."""
    built = build(penny(8, 2.5))
    with simulate(Model(built.grid, built.settings), None, Options(threads=2)) as results:
        (front,) = compute_front_intensities(results, 1)
        uz = results.field("uz", 1)
    position, exact = built.grid.position, exact_of_penny(built.grid.position)[:, 2]
    inside, near = np.hypot(*position[:, :2].T) < A, np.abs(position[:, 2]).min()
    above, below = (inside & np.isclose(position[:, 2], side * near) for side in (1, -1))
    wide, wide_exact = (of[above] - of[below] for of in (uz, exact))
    assert wide.max() / wide_exact.max() - 1 == pytest.approx(-0.0163, abs=2e-3)
    assert wide.sum() / wide_exact.sum() - 1 == pytest.approx(0.018, abs=2e-3)
    K = 2 * P * np.sqrt(A / np.pi)
    known = front.points_with_values
    assert len(known) == len(front.points)
    assert front.value["K1"][known].mean() / K - 1 == pytest.approx(0.0148, abs=2e-3)
    assert np.ptp(front.value["K1"][known]) < 0.005 * K
    assert front.value["J"][known].mean() * E / (1 - 1 / 16) / K**2 - 1 == pytest.approx(-0.015, abs=3e-3)
