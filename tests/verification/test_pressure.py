"""Pressure in a thick-walled cylinder (G. Lame) and in cracks (I. N. Sneddon)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pressure_cracks import MATERIAL, A, E, P, line_crack, opening_of_line, solved

from pdmesh import Circle, Run, Scene


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
