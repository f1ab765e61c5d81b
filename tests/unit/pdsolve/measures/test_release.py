"""Energy spent over crack advance, of branches and ledgers made up."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pdsolve.measures.release import energy_release_over_crack_length
from pdsolve.measures.speed import TipSpeeds
from pdsolve.measures.tips import CrackBranch


def branch(time: NDArray[np.float64], along: NDArray[np.float64]) -> CrackBranch:
    """A straight crack that comes to lengths (k,) at times (k,)."""
    none = np.full(len(time), np.nan)
    place = np.column_stack([along, 0 * along])
    direction = np.tile([1.0, 0.0], (len(time), 1))
    line = np.ones(len(time), dtype=bool)
    return CrackBranch(place, time, direction, along, TipSpeeds(none, none, none), np.full(len(time), 1e-3), line, 0, 1)


TIME = np.linspace(0, 10, 101)


def test_a_crack_that_spends_as_it_goes() -> None:
    """Nothing at first, then 200 J/m^2 all the way, at a speed that changes; unknown nearer to the ends than 5 mm."""
    times = np.linspace(2, 8, 31)
    one = branch(times, 0.05 * ((times - 2) / 6) ** 2)
    spent = 200 * np.interp(TIME, one.passing_time, one.length_along_crack)
    found = energy_release_over_crack_length(TIME, spent, [one], 100.0)
    known = np.isfinite(found.release_rate)
    assert found.release_rate[known] == pytest.approx(200.0, rel=1e-9)
    assert known.sum() > 20
    assert np.array_equal(known, (found.crack_length >= 5e-3 - 1e-12) & (found.crack_length <= 45e-3 + 1e-12))
    assert np.isnan(found.release_rate_at(np.array([0.0, 2.5, 9.0]))).all()
    assert found.release_rate_at(np.array([6.03])) == pytest.approx([200.0])


def test_two_cracks_share_what_is_spent() -> None:
    times = np.linspace(2, 8, 31)
    pair = [branch(times, 0.03 * (times - 2) / 6), branch(times, 0.02 * (times - 2) / 6)]
    spent = 150 * np.sum([np.interp(TIME, one.passing_time, one.length_along_crack) for one in pair], axis=0)
    found = energy_release_over_crack_length(TIME, spent, pair, 100.0)
    assert found.release_rate[np.isfinite(found.release_rate)] == pytest.approx(150.0, rel=1e-9)
    assert found.crack_length[-1] == pytest.approx(0.05)


def test_a_crack_that_jumps_from_load_step_to_load_step() -> None:
    """Several points of one time: the last of them counts; 120 J/m^2."""
    steps = np.arange(9.0)
    lengths = np.array([0, 0, 0, 6e-3, 13e-3, 20e-3, 28e-3, 28e-3, 28e-3])
    one = branch(np.repeat(steps[2:7], 3), np.sort(np.concatenate([lengths[2:7] - d for d in (0, 1e-9, 2e-9)])) + 2e-9)
    found = energy_release_over_crack_length(steps, 120 * lengths, [one], 100.0)
    assert found.release_rate[np.isfinite(found.release_rate)] == pytest.approx(120.0, rel=1e-5)
    assert np.isfinite(found.release_rate).sum() == 3


def test_without_a_crack_there_is_nothing() -> None:
    assert not len(energy_release_over_crack_length(TIME, 0 * TIME, [], 100.0).release_rate)
    assert np.isnan(energy_release_over_crack_length(TIME, 0 * TIME, [], 100.0).release_rate_at(TIME)).all()


def test_what_softens_ahead_of_a_crack_is_counted() -> None:
    """A crack that costs 100 J/m^2, ahead of which bonds have softened over 10 mm before it grows; when it is through
    they are none. Its advance spends 80 J/m^2, the whole 100."""
    times = np.linspace(2, 8, 31)
    one = branch(times, 0.05 * (times - 2) / 6)
    softened = 0.01 * (1 - np.interp(TIME, one.passing_time, one.length_along_crack) / 0.05) * (TIME > 1)
    found = energy_release_over_crack_length(
        TIME, 100 * (np.interp(TIME, one.passing_time, one.length_along_crack) + softened), [one], 100.0
    )
    assert found.release_rate[np.isfinite(found.release_rate)] == pytest.approx(80.0, rel=1e-9)
    assert (found.dissipated_before_growth, found.overall_release_rate) == pytest.approx((1.0, 100.0))
