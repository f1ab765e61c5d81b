"""Paths of cracks drawn by hand: straight, oblique, round a corner, forked; distances of lines known by geometry."""

from __future__ import annotations

import numpy as np
import pytest
from drawn import lattice, run

from pdpost.paths import PathError, branches, distance, forks, heading, path
from pdsolve.results import Nodes


def near(line: np.ndarray, ends: tuple[tuple[float, float], tuple[float, float]]) -> float:
    """The largest distance of a line's points from the straight line through two `ends`, m."""
    start, end = np.array(ends)
    way = (end - start) / np.hypot(*(end - start))
    return float(np.abs((line - start) @ np.array([-way[1], way[0]])).max())


def strip(slope: float, first: int, last: int, rows: int = 2) -> list[tuple[int, int, int]]:
    """Nodes (step, x, y) in a band around y = slope (x - first + 1/2), one column a step."""
    middle = {x: slope * (x - first + 0.5) for x in range(first, last)}
    return [(5 + x, x, y) for x, m in middle.items() for y in range(-50, 80) if abs(y - m) <= rows / 2]


def test_a_straight_crack_from_its_notch() -> None:
    """From the tip of the pre-crack to the last cracked node, along y = 0."""
    (line,) = path(run(lattice(), [(x, x, y) for x in range(5, 16) for y in (-1, 0, 1)]), 100)
    assert line[0].tolist() == [4.5e-3, 0.0]
    assert line[-1] == pytest.approx([15e-3, 0.0], abs=1e-15)
    assert np.abs(line[:, 1]).max() < 1e-15
    assert (np.diff(line[:, 0]) > 0).all()


def test_a_step_ends_a_path() -> None:
    results = run(lattice(), [(x, x, 0) for x in range(5, 18)])
    assert path(results, 12)[0][-1] == pytest.approx([12e-3, 0.0], abs=1e-15)
    assert path(results, 8) == []  # four nodes are too few for a path
    assert path(results, 0) == []


@pytest.mark.parametrize("slope", [0.25, 0.5, 1.0, 1.7])
def test_an_oblique_crack_is_known_to_half_a_spacing(slope: float) -> None:
    nodes = lattice(40, 70, below=3)
    (line,) = path(run(nodes, strip(slope, 5, 35)), 100)
    ends = (4.5e-3, 0.0), (34.5e-3, slope * 30e-3)
    assert near(line, ends) < 0.5e-3  # measured 0.36, 0.22, 0.12, 0.43 mm
    assert np.hypot(*(line[-1] - ends[1])) < 1.5e-3


def test_a_crack_round_a_corner() -> None:
    """Along x to 20 mm, then up: as long as both legs, through the corner."""
    nodes = lattice(40, 40, below=3)
    legs = [(x, x, 0) for x in range(5, 21)] + [(20 + y, 20, y) for y in range(1, 31)]
    (branch,) = branches(run(nodes, legs), 100)
    assert branch.length == pytest.approx(15.5e-3 + 30e-3, abs=1.5e-3)  # measured 44.9 mm
    corner = np.array([20e-3, 0.0])
    assert np.hypot(*(branch.points - corner).T).min() < 1e-3


def fork(angle_of: int = 1) -> list[tuple[int, int, int]]:
    """A trunk from 5 to 15 mm, then two arms at 45 degrees."""
    trunk = [(x, x, 0) for x in range(5, 16)]
    return trunk + [(15 + k, 15 + k, side * angle_of * k) for k in range(1, 20) for side in (-1, 1)]


def test_a_fork_has_a_trunk_two_arms_and_an_angle() -> None:
    nodes = lattice(40, 60)
    found = branches(run(nodes, fork()), 100)
    assert len(found) == 3
    (place,) = forks(found, 1e-3)
    assert place.place == pytest.approx((15e-3, 0.0), abs=1e-3)  # measured 15.7 mm
    assert place.angle == pytest.approx(90.0, abs=0.1)
    assert place.arms == pytest.approx((-45.0, 45.0), abs=0.1)
    tips = sorted(tuple(branch.points[-1]) for branch in found)
    assert tips[1:] == [pytest.approx((34e-3, -19e-3), abs=1e-12), pytest.approx((34e-3, 19e-3), abs=1e-12)]
    trunk = min(found, key=lambda branch: branch.along[0])
    for arm in found:
        if arm is not trunk:
            assert arm.along[0] == pytest.approx(trunk.length)
            assert (np.diff(arm.since) >= 0).all()


def test_rough_edges_are_no_branches() -> None:
    """Spurs of three nodes on both sides, and crumbs away from the crack."""
    spurs = [(30, x, side * k) for x in (9, 14) for side in (-1, 1) for k in (1, 2, 3)]
    crumbs = [(31, 30, 6), (31, 31, 6), (32, 31, 5)]
    nodes = lattice(40, 21)
    found = branches(run(nodes, [(x, x, 0) for x in range(5, 25)] + spurs + crumbs), 100)
    assert len(found) == 1
    assert np.abs(found[0].points[:, 1]).max() < 1e-15


def test_a_ring_is_followed_both_ways() -> None:
    """A trunk that forks and meets again: all four stretches, whose ends meet."""
    nodes = lattice(40, 40)
    around = [(15 + k, 15 + k, side * min(k, 12 - k)) for k in range(1, 12) for side in (-1, 1)]
    after = [(x, x, 0) for x in range(27, 38)]
    found = branches(run(nodes, [(x, x, 0) for x in range(5, 16)] + around + after), 100)
    assert len(found) == 4
    assert sum(branch.length for branch in found) == pytest.approx((10.5 + 4 * 6 * 2**0.5 + 10) * 1e-3, rel=0.05)


def test_a_crack_without_a_pre_crack_runs_both_ways_from_where_it_began() -> None:
    nodes = lattice()._replace(cut=np.zeros(180, dtype=np.int64))
    found = branches(run(nodes, [(abs(x - 10) + 1, x, 0) for x in range(2, 19)], notch=np.empty((0, 4))), 100)
    assert len(found) == 2
    assert {branch.begin for branch in found} == {found[0].begin}
    assert forks(found, 1e-3) == []
    assert sorted(branch.points[-1][0] for branch in found) == pytest.approx([2e-3, 18e-3])


def test_coarse_nodes_are_followed_too() -> None:
    """A vertical crack from a lattice of 1 mm into one of 2 mm."""
    fine, coarse = lattice(21, 21, below=0), lattice(11, 11, below=0)
    position = np.concatenate([fine.position, 2 * coarse.position + [0, 22e-3]])
    count = len(position)
    delta = np.repeat([1e-3, 2e-3], [441, 121])
    nodes = Nodes(np.arange(1, count + 1), position, delta, delta**2, np.full(count, 10), np.zeros(count, dtype=int))
    line = [(1 + y, 10, y) for y in range(21)] + [(22 + y, 10, 22 + 2 * y) for y in range(11)]
    (found,) = path(run(nodes, line, notch=np.empty((0, 4))), 100)
    assert found[:, 0] == pytest.approx(10e-3)
    assert found[[0, -1], 1] == pytest.approx([0, 42e-3], abs=1e-12)


@pytest.mark.parametrize(
    ("lines", "way"),
    [
        ([], "right"),
        ([[[0, 0], [1, 9]]], "up"),
        ([[[0, 0], [0, 9]], [[0, 0], [0, -9.5]]], "up"),  # alike: the first of right, left, up, down
        ([[[0, 0], [0, 9]], [[0, 0], [0, -10.5]]], "down"),
        ([[[0, 0], [-9, 0]], *[[[0, 0], [3, 0]]] * 9], "left"),  # crumbs do not count
    ],
)
def test_where_a_crack_runs(lines: list, way: str) -> None:
    assert heading([np.array(line, dtype=float) for line in lines]) == way


LINE = np.array([[0.0, 0.0], [10.0, 0.0]])


@pytest.mark.parametrize(
    ("other", "mean", "hausdorff"),
    [
        ([LINE], 0.0, 0.0),
        ([LINE[::-1] + np.array([0, 3.0])], 3.0, 3.0),  # parallel
        ([np.array([[0.0, 0.0], [3.0, 0.0], [10.0, 0.0]])], 0.0, 0.0),  # other corners
        ([LINE[:, ::-1]], 5.0, 10.0),  # at right angles: the mean of 0 to 10, and the far ends
        ([np.array([[0.0, 0.0], [5.0, 0.0]])], 0.625, 5.0),  # half: (5 / 2 * 1 / 2 + 0) / 2
        (
            [LINE[:1] + np.array([0, 4.0])],
            (4 + np.mean(np.hypot(np.linspace(0, 10, 100001), 4))) / 2,
            np.hypot(10, 4),
        ),  # a point
        ([LINE + np.array([0, 1.0]), LINE + np.array([0, -2.0])], 1.25, 2.0),  # two lines: 1 there, (1 + 2) / 2 back
    ],
)
def test_distances_of_lines(other: list[np.ndarray], mean: float, hausdorff: float) -> None:
    assert distance([LINE], other) == pytest.approx((mean, hausdorff), rel=1e-6, abs=1e-12)
    assert distance(other, [LINE]) == pytest.approx((mean, hausdorff), rel=1e-6, abs=1e-12)


def test_no_line_has_no_distance() -> None:
    with pytest.raises(PathError, match="found no path"):
        distance([], [LINE])
