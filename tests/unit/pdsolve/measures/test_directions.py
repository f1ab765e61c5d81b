"""Which way cracks leave their notches, on cracks drawn by hand."""

from __future__ import annotations

import numpy as np
import pytest
from damaged_results import lattice, run

from pdsolve.measures.directions import InitialCrackDirection, measure_initial_directions
from pdsolve.measures.tips import crack_branches
from pdsolve.results import Nodes, Results


def left(results: Results, step: int = 1000) -> list[InitialCrackDirection]:
    return measure_initial_directions(results, crack_branches(results, step))


@pytest.mark.parametrize(("up", "angle"), [(1, 45.0), (1, -45.0), (2, 63.434948822922)])
def test_the_direction_of_a_straight_crack(up: int, angle: float) -> None:
    """Cracked nodes on a straight line from the tip of the notch: within the band, which is narrow."""
    side = int(np.sign(angle))
    line = [(5 + k, 4 + k, side * up * k) for k in range(1, 14)]
    line += [(5 + k, 4 + k, side * (2 * k - 1)) for k in range(1, 14)] if up == 2 else []
    (found,) = left(run(lattice(40, 61), line))
    assert found.pre_crack_tip == (4.5e-3, 0.0)
    assert found.angle_from_pre_crack == pytest.approx(angle, abs=0.5)  # measured 45.00 and 63.4
    assert found.angle_lower_bound < angle < found.angle_upper_bound < found.angle_lower_bound + 10
    assert found.overall_angle == pytest.approx(angle, abs=0.5)


def test_a_crack_that_runs_straight_and_forks_later_went_straight() -> None:
    """23 mm along the line of its notch, then two arms at 45 or at 90 degrees: 0, over those 23 mm."""
    trunk = [(x, x, 0) for x in range(5, 28)]
    for rise, ahead in ((1, 1), (1, 0)):
        arms = [(30 + k, 27 + ahead * k, side * rise * k) for k in range(1, 20) for side in (-1, 1)]
        (found,) = left(run(lattice(60, 60), trunk + arms))
        assert found.angle_from_pre_crack == pytest.approx(0, abs=1e-6)
        assert -3 < found.angle_lower_bound < 0 < found.angle_upper_bound < 3
        assert found.fitted_length == pytest.approx(22.5e-3, abs=2e-3)
        assert found.overall_angle == pytest.approx(0, abs=1e-6)


def test_a_crack_that_turns_later_left_as_it_left() -> None:
    """23 mm straight on, then 23 mm upwards: 0 at the notch, in between as a whole."""
    legs = [(x, x, 0) for x in range(5, 28)] + [(28 + k, 27, k) for k in range(1, 24)]
    (found,) = left(run(lattice(60, 60), legs))
    assert found.angle_from_pre_crack == pytest.approx(0, abs=2)  # measured 1.5
    assert found.angle_lower_bound < 0 < found.angle_upper_bound
    assert found.fitted_length == pytest.approx(23e-3, abs=3e-3)
    assert 40 < found.overall_angle < 65


def test_the_band_is_as_wide_as_the_path_is_rough() -> None:
    """Steps of two spacings up and down: wider than that of the straight line, and 0 within it."""
    straight = [(x, x, 0) for x in range(5, 35)]
    rough = [(x, x, 2 * (x // 3 % 2)) for x in range(5, 35)] + [(x, x, 1) for x in range(6, 35, 3)]
    (one,), (other,) = (left(run(lattice(60, 60), steps)) for steps in (straight, rough))
    assert other.angle_lower_bound < 0 < other.angle_upper_bound
    assert other.angle_upper_bound - other.angle_lower_bound > one.angle_upper_bound - one.angle_lower_bound


def test_a_crack_that_forks_at_the_notch_leaves_it_both_ways() -> None:
    trunk = [(5, 5, 0), (6, 6, 0)]
    arms = [(6 + k, 6 + k, side * k) for k in range(1, 20) for side in (-1, 1)]
    found = left(run(lattice(40, 60), trunk + arms))
    assert sorted(way.angle_from_pre_crack for way in found) == pytest.approx([-45, 45], abs=1)


def test_a_crack_that_comes_to_a_notch_did_not_leave_it() -> None:
    """From below, to the tip and beyond."""
    assert left(run(lattice(40, 60, below=30), [(30 + y, 5, y) for y in range(-20, 12)])) == []


def test_directions_are_those_of_the_crack_at_the_notch() -> None:
    """Another crack, which joins the first one late, is not taken for its other side."""
    first = [(5 + k, 4 + k, k) for k in range(1, 14)]
    other = [(5 + k, 12 + k, -8) for k in range(20)] + [(60, 10, y) for y in range(-8, 6)] + [(60, 11, -8)]
    (found,) = left(run(lattice(40, 40, below=20), first + other))
    assert found.angle_from_pre_crack == pytest.approx(45, abs=1)


def test_angles_are_from_the_line_of_the_notch() -> None:
    """The plate turned by a right angle: the same angle; mirrored: the other sign."""
    line = [(5 + k, 4 + k, k // 2) for k in range(1, 30)]

    def turned(matrix: list[list[float]]) -> float:
        nodes: Nodes = lattice(40, 41)
        results = run(nodes, line)
        whole = results.nodes()._replace(position=nodes.position @ np.array(matrix).T)
        notch = (results.cracks().reshape(-1, 2) @ np.array(matrix).T).reshape(-1, 4)
        steps = [(step, *np.round(np.array(matrix) @ (x, y)).astype(int).tolist()) for step, x, y in line]
        (found,) = left(run(whole, steps, notch))
        return found.angle_from_pre_crack

    angle = turned([[1, 0], [0, 1]])
    assert angle == pytest.approx(26.6, abs=2)
    assert turned([[0, -1], [1, 0]]) == pytest.approx(angle, abs=1e-6)
    assert turned([[1, 0], [0, -1]]) == pytest.approx(-angle, abs=1e-6)


def test_a_crack_that_is_too_short_has_no_direction() -> None:
    assert left(run(lattice(), [(x, x, 0) for x in range(5, 8)])) == []
