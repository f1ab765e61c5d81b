"""Speeds of cracks that run as they are told, and the speed of Rayleigh waves from tables."""

from __future__ import annotations

import json

import numpy as np
import pytest
from drawn import lattice, run

from pdpost.paths import branches
from pdpost.speed import mean_speed, speeds
from pdpost.waves import rayleigh_of, rayleigh_ratio, rayleigh_speed


@pytest.mark.parametrize(("nu", "ratio"), [(0.0, 0.8740), (0.25, 0.9194), (1 / 3, 0.9325), (0.5, 0.9553)])
def test_rayleigh_waves_as_in_tables(nu: float, ratio: float) -> None:
    """K. F. Graff, Wave Motion in Elastic Solids, 1975; nu = 1/4: sqrt(2 - 2 / sqrt(3)) exactly."""
    assert rayleigh_ratio(nu) == pytest.approx(ratio, abs=1e-4)
    assert rayleigh_ratio(0.25) == pytest.approx(np.sqrt(2 - 2 / np.sqrt(3)), rel=1e-12)


def test_plane_stress_and_strain_have_the_same_ratio_and_other_shear_waves() -> None:
    """nu = 1/3 in plane stress is 1/4 in plane strain; mu is 3/8 and 2/5 of E. Duran 50: 3036 m/s."""
    assert rayleigh_speed(65e9, 2235.0, "stress") == pytest.approx(0.9194 * np.sqrt(3 / 8 * 65e9 / 2235), rel=1e-4)
    assert rayleigh_speed(65e9, 2235.0, "strain") == pytest.approx(0.9194 * np.sqrt(2 / 5 * 65e9 / 2235), rel=1e-4)
    model = json.dumps({"material": {"E": 65e9, "rho": 2235.0, "G0": 204.0}})
    assert rayleigh_of(run(lattice(), [], model=model)) == pytest.approx(3036, abs=1)


def test_the_speed_of_a_steady_crack() -> None:
    """A millimetre each 2 us is 500 m/s, everywhere."""
    (branch,) = branches(run(lattice(40), [(2 * (x - 4), x, 0) for x in range(5, 38)]), 100)
    found = speeds(branch, 1e-6)
    assert np.isnan(found[0])  # the tip of the pre-crack was there from the start
    assert found[5:-5] == pytest.approx(500.0, rel=1e-9)
    assert np.nanmax(np.abs(found - 500)) < 1e-6
    assert mean_speed(branch, 1e-6) == pytest.approx(500.0, rel=0.03)


def test_a_crack_that_changes_its_speed() -> None:
    """1000 m/s to 25 mm, then 250 m/s."""
    when = {x: x - 4 if x <= 25 else 21 + 4 * (x - 25) for x in range(5, 44)}
    (branch,) = branches(run(lattice(46), [(step, x, 0) for x, step in when.items()]), 100)
    found, x = speeds(branch, 1e-6), branch.points[:, 0]
    assert found[(x > 10e-3) & (x < 18e-3)] == pytest.approx(1000.0, rel=1e-9)
    assert found[(x > 32e-3) & (x < 36e-3)] == pytest.approx(250.0, rel=1e-9)


def test_a_jump_has_no_speed() -> None:
    (branch,) = branches(run(lattice(40), [(7, x, 0) for x in range(5, 38)]), 100)
    assert np.isnan(speeds(branch, 1e-6)).all()
    assert mean_speed(branch, 1e-6) is None
