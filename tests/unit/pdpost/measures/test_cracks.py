"""Start and branching on cracks drawn by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawn import alone, at, lattice, run

from pdpost.measures.cracked import cracked_since, damage_at
from pdpost.measures.cracks import branch_place, clusters, directions, growth, is_split
from pdsolve.results import Breaks, Frame, Nodes, Results, Writer


def test_a_crack_starts_when_its_tip_is_one_and_a_half_spacings_on() -> None:
    found = growth(run(lattice(), [(3, 5, 0), (7, 6, 0), (9, 7, 0)]))
    assert found.initial_tip == pytest.approx(4e-3)
    assert found.start is not None
    assert (found.start.step, found.start.time, found.start.along) == pytest.approx((7, 7e-6, 6e-3))
    assert found.branching is None
    assert found.final_tip == pytest.approx(7e-3)


def test_a_crack_that_starts_elsewhere_has_started() -> None:
    """Below and behind the tip of the pre-crack, whichever direction is looked along."""
    steps = [(3, 2, -4), (5, 3, -4), (50, 5, 0), (60, 6, 0)]
    for direction in ((1.0, 0.0), (0.0, 1.0)):
        found = growth(run(lattice(), steps), direction)
        assert found.start is not None
        assert found.start.step == 3


def test_flanks_of_a_pre_crack_are_no_branch() -> None:
    """Nodes beside the pre-crack crack on both of its sides, linked around its tip."""
    flanks = [(10 + x, x, y) for x in range(6) for y in (-2, 2)] + [(9, 6, y) for y in (-1, 0, 1)]
    assert growth(run(lattice(), flanks)).branching is None


ARMS = [(10 + x, x, side * (x - 6)) for x in (7, 8, 9, 10) for side in (-1, 1)]


def test_it_branches_at_the_first_of_three_double_columns() -> None:
    """Arms at 45 degrees from (6, 0): those of column 7 are still too near to each other."""
    found = growth(run(lattice(rows=11), [(5, 5, 0), (6, 6, 0), *ARMS]))
    assert found.branching is not None
    assert (found.branching.step, found.branching.along) == (20, pytest.approx(8e-3))


def test_cracks_side_by_side_are_no_branch() -> None:
    """The same arms without the trunk that links them, and a branch behind the first tip."""
    assert growth(run(lattice(rows=11), [(5, 6, 3), *ARMS[2:]])).branching is None
    behind = [(5, 6, 0)] + [(10, x, y) for x in (1, 2, 3) for y in (1, 2, 3)]
    assert growth(run(lattice(rows=11), behind)).branching is None


def test_two_spacings_apart_are_no_branch() -> None:
    nodes = lattice()
    cracked = np.zeros(len(nodes.ids), dtype=bool)
    for x in (7, 8, 9):
        for y in (-1, 1):
            cracked[at(nodes, x, y) - 1] = True
    assert branch_place(*nodes.position[cracked].T, nodes.delta[cracked]) is None


def test_a_plate_that_does_not_break() -> None:
    found = growth(run(lattice(), []))
    assert (found.first_break, found.start, found.branching, found.split) == (None, None, None, None)
    assert (found.initial_tip, found.final_tip) == pytest.approx((4e-3, 4e-3))


def test_the_first_break_needs_no_cracked_node() -> None:
    nodes = lattice()
    writer = Writer.create(None, nodes, alone, np.empty((0, 4)), {"time_step": 1e-6})
    writer.write(Frame(9, 9e-6, None, Breaks(*np.array([[4], [50], [51]])), [], [], {}))
    found = growth(Results(writer.connection, "memory"))
    assert found.first_break is not None
    assert (found.first_break.step, found.start) == (4, None)


def test_a_crack_may_run_down() -> None:
    """Along -y, a plate without a crack at first: the first cracked node is the start."""
    nodes = lattice()._replace(cut=np.zeros(180, dtype=np.int64))
    found = growth(run(nodes, [(2, 9, 4), (3, 9, 3), (6, 9, 2)]), (0.0, -1.0))
    assert found.initial_tip is None
    assert found.start is not None
    assert (found.start.step, found.start.along) == (2, pytest.approx(-4e-3))
    assert found.final_tip == pytest.approx(-2e-3)


def test_a_chain_from_side_to_side_splits_the_plate_when_its_last_link_cracks() -> None:
    rest = [(3 + x, x, (x % 2)) for x in range(5, 19)]
    assert growth(run(lattice(), rest)).split is None
    found = growth(run(lattice(), [*rest, (30, 19, 0)])).split
    assert found is not None
    assert found.step == 30
    gap = [row for row in rest if row[1] != 12]
    assert growth(run(lattice(), [*gap, (30, 19, 0)])).split is None


def test_clusters_and_splits_of_nodes() -> None:
    nodes = lattice()
    marked = [at(nodes, x, 0) - 1 for x in (0, 1, 2, 5, 6)]
    cracked = np.isin(np.arange(180), marked)
    assert len(set(clusters(nodes.position[cracked], nodes.delta[cracked]).tolist())) == 2
    assert not is_split(nodes, cracked)
    assert is_split(nodes, nodes.position[:, 0] == nodes.position[3, 0])  # a column, top to bottom
    assert not is_split(nodes, np.zeros(180, dtype=bool))


def test_damage_between_frames() -> None:
    results = run(lattice(), [(3, 5, 0), (7, 6, 0)])
    assert [int((damage_at(results, step) > 0.35).sum()) for step in (0, 2, 3, 6, 7, 100)] == [5, 5, 6, 6, 7, 7]


def test_since_when_nodes_are_cracked(small_results: Path) -> None:
    """The same as damage step by step says, for thresholds that a share of the bonds meets exactly too."""
    with Results.open(small_results) as results:
        for threshold in (0.0, 0.25, 0.35, 0.5, 4 / 7):
            since = cracked_since(results, threshold)
            for step in (0, 20, 33, 60):
                cracked = damage_at(results, step) > threshold
                assert np.array_equal(cracked, (since >= 0) & (since <= step))
        assert (cracked_since(results) > 0).sum() > 10


@pytest.mark.parametrize("angle", [45.0, 63.434948822922])
def test_the_direction_of_a_crack_from_its_notch(angle: float) -> None:
    """Cracked nodes on a straight line from the tip of the notch, upwards."""
    y, x = np.mgrid[0:40, 0:40]
    position = 1e-3 * np.column_stack([x.ravel(), y.ravel() - 10.0])
    count = len(position)
    cut = np.where((position[:, 1] == 0) & (position[:, 0] < 4.5e-3), 4, 0)
    ids = np.arange(1, count + 1)
    nodes = Nodes(ids, position, np.full(count, 1e-3), np.full(count, 1e-6), np.full(count, 10), cut)
    rise = 1 if angle == 45 else 2
    line = [(5, 4 + k, rise * k) for k in range(1, 14)] + (
        [(5, 4 + k, 2 * k - 1) for k in range(1, 14)] if rise == 2 else []
    )
    (found,) = directions(run(nodes, line), 10)
    assert found.tip == (4.5e-3, 0.0)
    assert found.angle == pytest.approx(angle, abs=0.2)  # measured 45.00 and 63.37


def test_a_crack_that_comes_to_a_notch_did_not_leave_it() -> None:
    """From below, to the tip and beyond."""
    steps = [(30 + y, 5, y) for y in range(-20, 12)]
    assert directions(run(lattice(40, 60, below=30), steps), 100) == []


def test_directions_are_those_of_the_crack_at_the_notch() -> None:
    """Another crack, which joins the first one late, is not taken for its other side."""
    first = [(5 + k, 4 + k, k) for k in range(1, 14)]
    other = [(5 + k, 12 + k, -8) for k in range(20)] + [(60, 10, y) for y in range(-8, 6)] + [(60, 11, -8)]
    (found,) = directions(run(lattice(40, 40, below=20), first + other), 100)
    assert found.angle == pytest.approx(45, abs=0.5)


def test_a_crack_that_goes_straight_on_has_no_other_direction() -> None:
    assert directions(run(lattice(), [(5, x, 0) for x in range(5, 15)]), 10) == []
