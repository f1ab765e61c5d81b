"""Stress intensities of bond-based plates against a crack in an infinite plate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from griffith import Lattice, on_lattice

RINGS = ((0.2, 0.8), (0.35, 0.8), (0.5, 0.95))  # of half the crack


def ratios(lattice: Lattice) -> tuple[float, float, float, float]:
    """K1, K2, the root of J over theirs, and the angle (degrees) beside its own; of the middle ring."""
    found, exact = lattice.feels(*RINGS[1]), lattice.exact.tip
    second = found.K2 / exact.K2 if lattice.exact.angle else found.K2 / found.K1
    return found.K1 / exact.K1, second, float(np.sqrt(found.J / exact.J)), found.angle - exact.angle


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0])
def test_the_integrals_of_the_exact_displacements(angle: float) -> None:
    """Twenty spacings for half a crack; steps of the lattice stand for its faces."""
    lattice = on_lattice(20, angle, solved=False)
    opened, slid, root, off = ratios(lattice)
    assert opened == pytest.approx(1.0, abs=0.002)  # measured 1.0007, 1.0007, 1.0004
    assert root == pytest.approx(1.0, abs=0.002)  # measured 0.9994, 0.9996, 0.9999
    if angle:
        assert slid == pytest.approx(1.0, abs=0.006)  # measured 1.0031, 1.0014
        assert abs(off) < 0.1  # measured 0.03, 0.01 degrees
    along = lattice.feels(*RINGS[1]).T
    assert along == pytest.approx(lattice.exact.tip.T, abs=0.02)  # measured 0.0012, 0.0001, 0.0093


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "material"),
    [(0.0, {}), (45.0, {}), (45.0, {"micromodulus": "conical"}), (45.0, {"plane": "strain"})],
    ids=["straight", "slanted", "conical", "plane strain"],
)
def test_a_plate_of_bonds(angle: float, material: dict[str, Any]) -> None:
    """Twenty spacings for half a crack, the classical displacements around it: within 1 % of K1 and J, 3 % of K2."""
    opened, slid, root, off = ratios(on_lattice(20, angle, **material))
    assert opened == pytest.approx(1.0, abs=0.01)  # measured 0.9988, 0.9975, 0.9991, 0.9975
    assert root**2 == pytest.approx(1.0, abs=0.01)  # measured 1.0052, 1.0035, 1.0042, 1.0035
    assert abs(off) < 0.5  # measured 0, 0.05, 0.02, 0.05 degrees
    if angle:
        assert slid == pytest.approx(1.0, abs=0.03)  # measured 0.9941, 0.9977, 0.9941
    else:
        assert abs(slid) < 1e-8  # measured 3e-17


@pytest.mark.slow
def test_a_plate_of_bonds_twice_as_fine() -> None:
    opened, slid, root, off = ratios(on_lattice(40, 45.0, 2.0))
    assert opened == pytest.approx(1.0, abs=0.006)  # measured 0.9973
    assert slid == pytest.approx(1.0, abs=0.015)  # measured 1.0009
    assert root**2 == pytest.approx(1.0, abs=0.01)  # measured 1.0028
    assert abs(off) < 0.25  # measured 0.05 degrees


@pytest.mark.slow
def test_all_rings_say_the_same() -> None:
    lattice = on_lattice(20, 45.0)
    found = np.array([lattice.feels(*ring)[:3] for ring in RINGS])
    assert np.ptp(found, axis=0) / found.mean(axis=0) == pytest.approx(0.0, abs=0.015)  # measured 0.004, 0.001, 0.006
