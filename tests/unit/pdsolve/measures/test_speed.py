"""Speeds of cracks that run as they are told, and the speed of Rayleigh waves from tables."""

from __future__ import annotations

import json

import numpy as np
import pytest
from damaged_results import lattice, run

from pdmesh.model.material_constants import rayleigh_ratio, rayleigh_speed
from pdsolve.measures.speed import TipSpeeds, estimate_tip_speeds, limiting_speed, window_for_mean_speed


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
    assert limiting_speed(run(lattice(), [], model=model)).value == pytest.approx(3036, abs=1)


def test_plies_are_limited_by_their_least_shear_speed() -> None:
    """G12 in the plane: 1830 m/s, not the 9700 of E1 as of an isotropic solid. Rayleigh's ratio has no root at 1."""
    ply = {"E": 171.4e9, "E2": 9.08e9, "nu": 0.32, "G12": 5.29e9, "rho": 1580.0, "G0": 1e3}
    ply |= {"model": "correspondence", "solid": "orthotropic", "failure": "none", "G23": 3e9}
    for nu in (0.32, 0.999):
        found = limiting_speed(run(lattice(), [], model=json.dumps({"material": ply | {"nu": nu}})))
        assert found.value == pytest.approx(np.sqrt(5.29e9 / 1580), rel=1e-12)
        assert found.name == "least shear speed"


def told(along: np.ndarray, time: np.ndarray, line: np.ndarray | None = None, step: float = 0.0) -> TipSpeeds:
    """Speeds of a path on nodes 1 mm apart."""
    return estimate_tip_speeds(
        along, time, np.full(len(along), 1e-3), np.ones(len(along), dtype=bool) if line is None else line, step
    )


def test_the_speed_of_a_steady_crack() -> None:
    """A millimetre each 2 us is 500 m/s, everywhere, and as sure as a place is known: a tenth of a spacing."""
    along = np.arange(0, 40e-3, 2e-3)
    found = told(along, 2e-3 * along)
    assert found.value == pytest.approx(500.0)
    wide = 2.5706 * 0.1 / np.sqrt(4 * 28)  # Student's, of seven points 2 spacings apart
    assert found.low[5:-5] == pytest.approx(500 / (1 + wide), rel=1e-4)
    assert found.high[5:-5] == pytest.approx(500 / (1 - wide), rel=1e-4)


def test_a_crack_that_changes_its_speed() -> None:
    """1000 m/s to 20 mm, then 250 m/s: told apart as soon as ten spacings are on one side, with wide bands between."""
    along = np.arange(0, 42e-3, 2e-3)
    found = told(along, np.where(along <= 20e-3, 1e-3 * along, 20e-6 + 4e-3 * (along - 20e-3)))
    assert found.value[along <= 14.5e-3] == pytest.approx(1000.0)
    assert found.value[along >= 25.5e-3] == pytest.approx(250.0)
    width = found.high - found.low
    assert np.nan_to_num(width[9:12], nan=np.inf).min() > 2 * width[0]


@pytest.mark.slow
def test_student_says_how_sure_a_speed_is() -> None:
    """The band is that of scipy's regression, at 95 %."""
    from scipy.stats import linregress, t

    along = np.arange(0, 11e-3, 2e-3)
    time = 1e-3 * along + 1e-6 * np.array([0.3, -0.8, 0.5, 0.4, -0.6, 0.2])
    fit = linregress(along, time)
    found = told(along, time)
    assert found.value == pytest.approx(1 / fit.slope)
    assert found.low == pytest.approx(1 / (fit.slope + t.ppf(0.975, 4) * fit.stderr))
    assert found.high == pytest.approx(1 / (fit.slope - t.ppf(0.975, 4) * fit.stderr))


@pytest.mark.parametrize(
    ("along", "time"),
    [
        (np.arange(0, 9e-3, 2e-3), 1e-3 * np.arange(0, 9e-3, 2e-3)),  # 8 mm: too short
        (np.arange(0, 30e-3, 2e-3), np.full(15, 7e-6)),  # all at once
        (np.arange(0, 13e-3, 2e-3), np.array([0, 0, 0, 0, 0, 0, 30e-6])),  # a wait at the end
    ],
)
def test_what_cannot_be_told_is_left_out(along: np.ndarray, time: np.ndarray) -> None:
    for column in told(along, time):
        assert np.isnan(column).all()


def test_nothing_is_told_over_what_is_no_line() -> None:
    along = np.arange(0, 60e-3, 2e-3)
    found = told(along, 1e-3 * along, along != 30e-3)
    near = np.abs(along - 30e-3) < 6.5e-3
    assert np.isnan(found.value[near]).all()
    assert found.value[~near] == pytest.approx(1000.0)


@pytest.mark.parametrize("at", range(12))
def test_a_window_has_its_length_wherever_it_is(at: int) -> None:
    """At least as long as asked for, not much longer, the point within, at the ends of the path too."""
    along = np.array([0.0, 0.3, 2.0, 4.1, 6.0, 7.7, 10.2, 12.0, 14.1, 16.0, 17.9, 19.0])
    found = window_for_mean_speed(along, at, 10.0)
    assert found is not None
    inside = along[found]
    assert inside[0] <= along[at] <= inside[-1]
    assert 10.0 <= inside[-1] - inside[0] < 10 + 2 * 2.5
    assert window_for_mean_speed(along, at, 19.0) == slice(0, 12)
    assert window_for_mean_speed(along, at, 19.1) is None
