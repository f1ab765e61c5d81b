"""Tips of cracks drawn by hand: straight, oblique, round a corner, forked, meeting, in rubble; speeds; mirrors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from damaged_results import at_steps, lattice, run
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from mirror_images import mirrored

from pdpost.figures.charts import look
from pdpost.figures.crack_figure import crack
from pdsolve.measures import crack_summary
from pdsolve.measures.tip_surroundings import tip_histories
from pdsolve.measures.tips import CrackBranch, crack_branches, find_forks
from pdsolve.results import Nodes


def bare(columns: int = 40, rows: int = 60, below: int | None = None) -> Nodes:
    """A lattice without a pre-crack."""
    nodes = lattice(columns, rows, below)
    return nodes._replace(cut=np.zeros(len(nodes.ids), dtype=np.int64))


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
    """From the tip of the pre-crack to the last cracked node, along y = 0; each place with its time and direction."""
    (branch,) = crack_branches(run(lattice(), [(x, x, y) for x in range(5, 16) for y in (-1, 0, 1)]))
    assert branch.points[0].tolist() == [4.5e-3, 0.0]
    assert branch.points[-1] == pytest.approx([15e-3, 0.0], abs=1e-15)
    assert np.abs(branch.points[:, 1]).max() < 1e-15
    assert (np.diff(branch.points[:, 0]) > 0).all()
    assert branch.direction == pytest.approx(np.tile([1.0, 0.0], (len(branch.points), 1)))
    assert branch.passing_time[[0, -1]] == pytest.approx([5e-6, 15e-6])
    assert branch.passing_time[1:-1] * 1e3 == pytest.approx(branch.points[1:-1, 0], abs=0.6e-3)
    assert branch.is_narrow.all()


def test_a_step_ends_a_path() -> None:
    results = run(lattice(), [(x, x, 0) for x in range(5, 18)])
    assert crack_branches(results, 12)[0].points[-1] == pytest.approx([12e-3, 0.0], abs=1e-15)
    assert crack_branches(results, 8) == []  # four nodes are too few for a path
    assert crack_branches(results, 0) == []


@pytest.mark.parametrize("slope", [0.25, 0.5, 1.0, 1.7])
def test_an_oblique_crack_is_known_to_half_a_spacing(slope: float) -> None:
    nodes = lattice(40, 70, below=3)
    (branch,) = crack_branches(run(nodes, strip(slope, 5, 35)))
    ends = (4.5e-3, 0.0), (34.5e-3, slope * 30e-3)
    assert near(branch.points, ends) < 0.5e-3  # measured 0.36, 0.22, 0.12, 0.43 mm
    assert np.hypot(*(branch.points[-1] - ends[1])) < 1.5e-3
    angle = np.degrees(np.arctan2(branch.direction[:, 1], branch.direction[:, 0]))
    assert angle == pytest.approx(np.degrees(np.arctan(slope)), abs=4)  # measured 2.7, 1.5, 0.5, 3.1


def test_a_crack_round_a_corner() -> None:
    """Along x to 20 mm, then up: as long as both legs, through the corner, and its direction with it."""
    nodes = lattice(40, 40, below=3)
    legs = [(x, x, 0) for x in range(5, 21)] + [(20 + y, 20, y) for y in range(1, 31)]
    (branch,) = crack_branches(run(nodes, legs))
    assert branch.length == pytest.approx(15.5e-3 + 30e-3, abs=1.5e-3)
    corner = np.array([20e-3, 0.0])
    assert np.hypot(*(branch.points - corner).T).min() < 1e-3
    assert branch.direction[0] == pytest.approx([1, 0], abs=1e-9)
    assert branch.direction[-1] == pytest.approx([0, 1], abs=1e-9)


def fork() -> list[tuple[int, int, int]]:
    """A trunk from 5 to 15 mm, then two arms at 45 degrees."""
    trunk = [(x, x, 0) for x in range(5, 16)]
    return trunk + [(15 + k, 15 + k, side * k) for k in range(1, 20) for side in (-1, 1)]


def test_a_fork_has_a_trunk_two_arms_and_an_angle() -> None:
    found = crack_branches(run(lattice(40, 60), fork()))
    assert len(found) == 3
    (place,) = find_forks(found)
    assert place.place == pytest.approx((15e-3, 0.0), abs=1e-3)  # measured 15.7 mm
    assert place.angle_between_outer_arms == pytest.approx(90.0, abs=0.1)
    assert place.arm_angles == pytest.approx((-45.0, 45.0), abs=0.1)
    ends = sorted(tuple(branch.points[-1]) for branch in found)
    assert ends[1:] == [pytest.approx((34e-3, -19e-3), abs=1e-12), pytest.approx((34e-3, 19e-3), abs=1e-12)]
    trunk = min(found, key=lambda branch: branch.length_along_crack[0])
    assert place.time == trunk.passing_time[-1]
    for arm in found:
        if arm is not trunk:
            assert arm.length_along_crack[0] == pytest.approx(trunk.length)
            assert (arm.passing_time >= trunk.passing_time[-1]).all()


@pytest.mark.parametrize(("came", "left"), [((1, 0), (0, 1)), ((0, 1), (-1, 0)), ((-1, 0), (0, -1)), ((0, -1), (1, 0))])
def test_arms_to_the_left_are_positive(came: tuple[int, int], left: tuple[int, int]) -> None:
    """One arm straight on, one at 45 degrees to the left, whichever way the crack came."""
    way, side = np.array(came), np.array(left)
    trunk = [(k + 1, *(k * way)) for k in range(12)]
    arms = [(12 + k, *((11 + k) * way + turn * k * side)) for k in range(1, 14) for turn in (0, 1)]
    nodes = bare(61, 61)._replace()
    nodes = nodes._replace(position=nodes.position - [30e-3, 0.0])
    (found,) = find_forks(crack_branches(run(nodes, trunk + arms, notch=np.empty((0, 4)))))
    assert found.arm_angles == pytest.approx((0.0, 45.0), abs=4)  # measured -2.2 to 2.2 and 45.0


def test_rough_edges_are_no_branches() -> None:
    """Spurs of three nodes on both sides, and crumbs away from the crack."""
    spurs = [(30, x, side * k) for x in (9, 14) for side in (-1, 1) for k in (1, 2, 3)]
    crumbs = [(31, 30, 6), (31, 31, 6), (32, 31, 5)]
    (branch,) = crack_branches(run(lattice(40, 21), [(x, x, 0) for x in range(5, 25)] + spurs + crumbs))
    assert np.abs(branch.points[:, 1]).max() < 1e-15


def test_a_ring_is_followed_both_ways() -> None:
    """A trunk that forks and meets again: all four stretches, whose ends meet."""
    nodes = lattice(40, 40)
    around = [(15 + k, 15 + k, side * min(k, 12 - k)) for k in range(1, 12) for side in (-1, 1)]
    after = [(x, x, 0) for x in range(27, 38)]
    found = crack_branches(run(nodes, [(x, x, 0) for x in range(5, 16)] + around + after))
    assert len(found) == 4
    assert sum(branch.length for branch in found) == pytest.approx((10.5 + 4 * 6 * 2**0.5 + 10) * 1e-3, rel=0.05)
    assert len({branch.begin_joint for branch in found}) == len({branch.end_joint for branch in found}) == 3


def test_a_small_hole_in_a_crack_is_no_fork() -> None:
    nodes = lattice(40, 21)
    hole = [(x, x, y) for x in range(5, 30) for y in (-1, 0, 1) if not (x in (14, 15) and y == 0)]
    (branch,) = crack_branches(run(nodes, hole))
    assert np.abs(branch.points[:, 1]).max() < 1e-15


def test_a_crack_without_a_pre_crack_runs_both_ways_from_where_it_began() -> None:
    found = crack_branches(run(bare(20, 9), [(abs(x - 10) + 1, x, 0) for x in range(2, 19)], notch=np.empty((0, 4))))
    assert len(found) == 2
    assert {branch.begin_joint for branch in found} == {found[0].begin_joint}
    assert find_forks(found) == []
    assert sorted(branch.points[-1][0] for branch in found) == pytest.approx([2e-3, 18e-3])
    assert sorted(branch.direction[-1][0] for branch in found) == pytest.approx([-1, 1])


def test_coarse_nodes_are_followed_too() -> None:
    """A vertical crack from a lattice of 1 mm into one of 2 mm."""
    fine, coarse = lattice(21, 21, below=0), lattice(11, 11, below=0)
    position = np.concatenate([fine.position, 2 * coarse.position + [0, 22e-3]])
    count = len(position)
    delta = np.repeat([1e-3, 2e-3], [441, 121])
    nodes = Nodes(np.arange(1, count + 1), position, delta, delta**2, np.full(count, 10), np.zeros(count, dtype=int))
    line = [(1 + y, 10, y) for y in range(21)] + [(22 + y, 10, 22 + 2 * y) for y in range(11)]
    (found,) = crack_branches(run(nodes, line, notch=np.empty((0, 4))))
    assert found.points[:, 0] == pytest.approx(10e-3)
    assert found.points[[0, -1], 1] == pytest.approx([0, 42e-3], abs=1e-12)
    assert found.node_spacing[[0, -1]] == pytest.approx([1e-3, 2e-3])


@pytest.mark.parametrize("late", [0, 7, 40])
def test_two_cracks_that_meet_stay_two(late: int) -> None:
    """From both sides towards each other, the second later: neither runs backwards in time into the other's way."""
    left, right = [(1 + x, x, 0) for x in range(40)], [(1 + late + (79 - x), x, 0) for x in range(40, 80)]
    when = {x: step for step, x, _ in left + right}
    when |= {x: min(1 + x, 1 + late + 79 - x) for x in range(80)}
    found = crack_branches(run(bare(80, 5), [(step, x, 0) for x, step in when.items()], notch=np.empty((0, 4))))
    assert len(found) == 2
    meet = (79 + late) / 2
    for branch in found:
        from_left = branch.direction[0][0] > 0
        assert branch.points[0][0] == pytest.approx(0.0 if from_left else 79e-3, abs=1e-12)
        assert branch.points[-1][0] == pytest.approx(min(meet, 79) * 1e-3, abs=1.6e-3)
        assert branch.passing_time[0] == pytest.approx((1 if from_left else 1 + late) * 1e-6)
        assert (np.diff(branch.passing_time) >= 0).all()


@pytest.mark.parametrize("between", [False, True])
def test_two_cracks_become_one(between: bool) -> None:
    """From above and below to the axis, a row of nodes or between two, and on along it: two stems, one trunk."""
    nodes = bare(60, 40 + (not between), 20)
    ends = (-1, 0) if between else (0, 0)
    stems = [(1 + k, k, side) for k in range(13) for side in (ends[0] - 12 + k, ends[1] + 12 - k)]
    trunk = [(2 + x, x, y) for x in range(13, 50) for y in set(ends)]
    found = crack_branches(run(nodes, stems + trunk, notch=np.empty((0, 4))))
    assert len(found) == 3
    mirrored(found, found, np.array([1.0, -1.0]), (0.0, sum(ends) * 1e-3))
    joint = found[0].begin_joint
    assert found[0].points[-1] == pytest.approx([49e-3, np.mean(ends) * 1e-3])
    assert [branch.end_joint for branch in found[1:]] == [joint, joint]


def test_nodes_that_crack_ahead_wait_for_the_crack() -> None:
    """A patch of three nodes 6 mm ahead cracks long before: the crack reaches it in its own time."""
    steps = [(100 + 2 * x, x, 0) for x in range(5, 38) if x not in (20, 21, 22)] + [(3, x, 0) for x in (20, 21, 22)]
    (branch,) = crack_branches(run(lattice(40, 9), steps))
    assert branch.points[0] == pytest.approx([4.5e-3, 0])
    assert (np.diff(branch.passing_time) >= 0).all()
    assert np.nanmax(np.abs(branch.speed.value / 500 - 1)) < 0.3  # measured 0.22, where it was helped


def test_a_stretch_that_breaks_at_once_has_a_path_and_no_speed() -> None:
    """33 mm in one step: both halves from its ends; after a first stretch of 6 mm it begins at its far end."""
    found = crack_branches(run(bare(40, 9), [(7, x, y) for x in range(5, 38) for y in (0, 1)], notch=np.empty((0, 4))))
    assert sum(branch.length for branch in found) == pytest.approx(32e-3, abs=0.1e-3)
    assert all(np.isnan(branch.speed.value).all() and branch.mean_speed is None for branch in found)
    steps = [(7 if x < 11 else x, x, y) for x in range(5, 38) for y in (0, 1)]
    (branch,) = crack_branches(run(bare(40, 9), steps, notch=np.empty((0, 4))))
    assert branch.points[[0, -1], 0] == pytest.approx([5e-3, 37e-3])


@pytest.mark.slow
def test_what_is_crushed_is_no_line_and_has_no_speed() -> None:
    """A crack into a block of rubble 16 spacings high, which cracks as a whole."""
    nodes = bare(60, 41)
    rubble = [(30 + x // 8, x, y) for x in range(30, 60) for y in range(-8, 8)]
    found = crack_branches(run(nodes, [(1 + x, x, 0) for x in range(30)] + rubble, notch=np.empty((0, 4))))
    main = max(found, key=lambda branch: branch.is_narrow.sum())
    inside = main.points[:, 0] > 33e-3
    assert inside.any()
    assert main.is_narrow[inside].mean() < 0.2  # a corner of the block is narrow; measured 0.14
    assert np.isnan(main.speed.value[inside]).all()
    assert np.isfinite(main.speed.value[main.points[:, 0] < 20e-3]).all()
    assert main.mean_speed is None


def drawn(angle: float, jitter: float, seed: int = 0) -> CrackBranch:
    """The longest branch of a crack of 1000 m/s at an angle (degrees), two nodes wide, times off by some spacings."""
    nodes, rng = bare(80, 90, below=5), np.random.default_rng(seed)
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    start = np.array([2e-3, 0.3e-3 * seed])
    along, across = (nodes.position - start) @ way, (nodes.position - start) @ [-way[1], way[0]]
    cracked = (np.abs(across) <= 1e-3) & (along >= 0) & (along < 60e-3)
    steps = np.maximum(np.round(along / 1e-4 + 10 * jitter * rng.uniform(-1, 1, len(along))), 1)
    return crack_branches(at_steps(nodes, np.where(cracked, steps, -1), time_step=1e-7))[0]


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("angle", [0, 10, 30, 45, 60])
def test_a_known_speed(angle: float) -> None:
    """Within 6 % everywhere, 2 % as a whole, at any angle to the lattice; the band holds it."""
    branch = drawn(angle, 0.0)
    assert branch.speed.value == pytest.approx(1000.0, rel=0.06)  # measured 0.7, 3.9, 3.4, 2.9, 3.6 %
    assert branch.mean_speed == pytest.approx(1000.0, rel=0.02)  # measured 0.2, 0.7, 0.2, 0.1, 0.3 %
    within = (branch.speed.low <= 1000) & (branch.speed.high >= 1000)
    assert within.mean() > 0.85
    assert branch.length == pytest.approx(60e-3, rel=0.03)


def test_a_mean_speed_ends_where_the_crack_reaches_the_edge() -> None:
    """The last nodes come off 30 us after the tip passed; a crack that stops inside has all of its points."""
    nodes = bare(60, 40, below=5)
    along, across = nodes.position.T - nodes.position.min(axis=0)[:, None]
    steps = np.maximum(np.round(along / 1e-4), 1)
    right = along.max()
    late = np.where(along > right - 1.5e-3, steps + 300, steps)
    line = np.abs(across - np.median(across)) < 1e-3
    through = crack_branches(at_steps(nodes, np.where(line, late, -1), time_step=1e-7))[0]
    assert through.mean_speed == pytest.approx(1000.0, rel=0.02)  # measured 1001.8
    whole = replace(through, point_count_before_edge=None).mean_speed
    assert whole == pytest.approx(660, abs=20)  # measured 663.7
    short = crack_branches(at_steps(nodes, np.where(line & (along < right - 10e-3), steps, -1), time_step=1e-7))[0]
    assert short.point_count_before_edge is None


@pytest.mark.slow
def test_noise_widens_the_band() -> None:
    """Nodes crack up to two spacings too early or too late: time never falls, nine speeds in ten are in their bands."""
    branches = [drawn(angle, 2.0, seed) for angle in (0, 20, 45) for seed in range(4)]
    speeds = [
        np.concatenate([column[np.isfinite(column)] for column in every])
        for every in zip(*(b.speed for b in branches), strict=True)
    ]
    value, low, high = speeds
    assert all((np.diff(branch.passing_time) >= 0).all() for branch in branches)
    assert ((low <= 1000) & (high >= 1000)).mean() > 0.85  # measured 0.93
    assert np.sqrt(np.mean((value / 1000 - 1) ** 2)) < 0.12  # measured 0.077
    assert np.median(high - low) > 100
    assert abs(np.mean(value) / 1000 - 1) < 0.03  # measured 0.004


def rubble(seed: int, half: bool = False) -> tuple[Nodes, np.ndarray]:
    """A lattice and steps (n,): two cracks that fork and meet at random, specks, a crushed corner."""
    nodes, rng = bare(60, 61), np.random.default_rng(seed)
    steps = np.full((61, 60), -1.0)
    for row in rng.integers(8, 53, 5):
        y = row + np.cumsum(rng.integers(-1, 2, 60))
        first = rng.integers(1, 40)
        for x in range(60):
            for side in (0, 1):
                at = (int(np.clip(y[x] + side, 0, 60)), x)
                when = first + 3 * x + rng.integers(0, 6)
                steps[at] = when if steps[at] < 0 else min(steps[at], when)
    specks = rng.random(steps.shape) < 0.06
    steps[specks & (steps < 0)] = rng.integers(1, 200)
    steps[:14, 44:] = rng.integers(60, 90, (14, 16))
    if half:  # mirrored on itself, y -> -y
        steps[31:] = steps[:30][::-1]
    return nodes, steps.ravel()


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("mirror", [(1, -1), (-1, 1)])
def test_mirrored_cracks_have_mirrored_branches(seed: int, mirror: tuple[int, int]) -> None:
    """Many cracks, forks, specks and rubble, and the same seen in a mirror: the order of the nodes does not matter."""
    nodes, steps = rubble(seed)
    turned = nodes._replace(position=nodes.position * mirror)
    one, other = crack_branches(at_steps(nodes, steps)), crack_branches(at_steps(turned, steps))
    shuffled = np.random.default_rng(9).permutation(len(steps))
    again = Nodes(*(column[shuffled] for column in turned))._replace(ids=nodes.ids)
    assert len(one) > 10
    mirrored(one, other, np.array(mirror))
    mirrored(one, crack_branches(at_steps(again, steps[shuffled])), np.array(mirror))


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("seed", range(6))
def test_what_is_symmetric_has_symmetric_branches(seed: int) -> None:
    """Cracks and their mirror images at once, which meet on the axis in one and the same step."""
    nodes, steps = rubble(seed, half=True)
    found = crack_branches(at_steps(nodes, steps))
    assert len(found) > 10
    mirrored(found, found, np.array([1.0, -1.0]))


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("seed", range(6))
def test_time_never_falls_along_a_branch(seed: int) -> None:
    """Nor from a branch to those it forks into."""
    found = crack_branches(at_steps(*rubble(seed)))
    for branch in found:
        assert (np.diff(branch.passing_time) >= 0).all()
        assert (np.diff(branch.length_along_crack) >= 0).all()
        stems = [other for other in found if other.end_joint == branch.begin_joint]
        if stems:
            assert branch.passing_time[0] >= min(stem.passing_time[-1] for stem in stems) - 1e-15
        assert np.hypot(*branch.direction.T) == pytest.approx(1.0)


def test_branches_have_one_order_of_colours() -> None:
    """Those of `crack` and `sif` with one number have one colour, which the legend of `crack` names."""
    glass = '{"material": {"E": 65e9, "rho": 2235, "G0": 204}, "horizon": {"ratio": 3}}'
    results = run(lattice(40, 40), fork(), model=glass)
    last = int(results.breaks().step.max())
    branches, tips = crack_branches(results), tip_histories(results, last)
    assert len(branches) == 3
    assert [(tip.name, tip.branch_number) for tip in tips[:3]] == [(f"branch {number}", number) for number in range(3)]
    assert all(np.array_equal(tip.branch.points, branch.points) for tip, branch in zip(tips, branches, strict=False))
    figure = crack(results, crack_summary.crack(results, last))
    (legend,) = figure.legends
    colour_of = {
        str(key.get_label()): key.get_color() for key in legend.legend_handles if "branch" in str(key.get_label())
    }
    assert colour_of == {f"branch {number}": look(number)["color"] for number in range(3)}
    ends = {tuple(np.round(branch.points[-1] * 1e3, 6)): number for number, branch in enumerate(branches)}
    drawn_ways = [way for way in figure.axes[0].collections if isinstance(way, LineCollection) and way.get_segments()]
    colours = {tuple(np.round(way.get_segments()[-1][-1], 6)): to_hex(way.get_color()[0]) for way in drawn_ways}
    assert {ends[end]: colour for end, colour in colours.items() if end in ends} == {
        number: to_hex(look(number)["color"]) for number in range(3)
    }
