"""Tips through a run, of cracks drawn by hand, and the room around them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from damaged_results import lattice, run

from pdsolve.measures.tip_surroundings import TipObstacles, TipPosition, tip_histories

US = 1e-6
MODEL = {"nodes": [], "notch": [], "material": {"E": 1e9, "rho": 1e3, "G0": 1.0}}


def test_a_tip_is_that_of_its_pre_crack_until_the_crack_leaves_it() -> None:
    results = run(lattice(), [(x + 5, x, y) for x in range(5, 16) for y in (-1, 0, 1)])
    (front,) = tip_histories(results, 100)
    for time in (0.0, 9 * US):
        tip = front.tip_at(time)
        assert tip is not None
        assert (tip.place.tolist(), tip.direction.tolist()) == ([4.5e-3, 0.0], [1.0, 0.0])
    tip = front.tip_at(15 * US)
    assert tip is not None
    assert tip.place == pytest.approx([10e-3, 0.0], abs=1e-3)
    assert tip.direction == pytest.approx([1.0, 0.0])
    last = front.tip_at(90 * US)
    assert last is not None
    assert last.place == pytest.approx([15e-3, 0.0], abs=1e-12)


def test_arms_have_tips_of_their_own_from_the_fork_on() -> None:
    arms = [(15 + x, x, side * (x - 10) + dy) for x in range(11, 20) for side in (-1, 1) for dy in (0, -side)]
    results = run(lattice(rows=25), [*[(x + 5, x, 0) for x in range(5, 11)], *arms])
    found = tip_histories(results, 100)
    before = [front for front in found if front.tip_at(14 * US) is not None]
    after = [front.tip_at(40 * US) for front in found]
    assert len(before) == 1
    tips = [tip for tip in after if tip is not None]
    assert len(tips) == 2
    assert sorted(np.sign(tip.direction[1]) for tip in tips) == [-1, 1]
    for tip in tips:
        assert abs(np.degrees(np.arctan2(tip.direction[1], tip.direction[0]))) == pytest.approx(45, abs=12)


def test_tips_of_particles_are_where_the_particles_are() -> None:
    """With the way of the last arm; not asked is which nodes are cracked. A fork has two from its step on, and one that
    has come to the edge of the plate is none any more."""
    grown = [(0, -1, 0.0, 0.0), (0, 0, 4.5, 0.0), (10, 1, 6.0, 0.0), (20, 2, 7.0, 1.0)]
    grown += [(30, 3, 8.5, 0.5), (30, 3, 8.0, 2.5), (40, 5, 8.0, 4.5)]
    results = run(lattice(), [(x + 5, x, 0) for x in range(5, 16)], particles=grown)
    every, sharp = tip_histories(results, 100), np.sqrt([0.5, 0.5])
    lower, upper = ([8.5, 0.5], np.array([3.0, -1.0]) / np.sqrt(10)), ([8.0, 2.5], np.array([2.0, 3.0]) / np.sqrt(13))
    for steps, expected in (
        ((0, 9), [([4.5, 0.0], [1.0, 0.0])]),
        ((10, 19), [([6.0, 0.0], [1.0, 0.0])]),
        ((20, 29), [([7.0, 1.0], sharp)]),
        ((30, 39), [lower, upper]),
        ((40, 100), [lower]),
    ):
        for step in steps:
            tips = sorted(filter(None, (front.tip_at(step * US) for front in every)), key=lambda tip: tip.place[1])
            assert len(tips) == len(expected)
            for tip, (place, way) in zip(tips, expected, strict=True):
                assert tip.place == pytest.approx(1e-3 * np.array(place))
                assert tip.direction == pytest.approx(way)


def test_a_crack_of_particles_that_ends_on_another_has_no_tip() -> None:
    notch = np.array([[0.0, 0.0, 4.5e-3, 0.0], [12e-3, -3e-3, 12e-3, 3e-3]])
    grown = [(0, -1, 0, 0), (0, 0, 4.5, 0), (0, -1, 12, -3), (0, 2, 12, 3), (10, 1, 8, 0.5), (20, 4, 12, 0.5)]
    every = tip_histories(run(lattice(), [], notch, particles=grown), 100)
    there = [sum(front.tip_at(step * US) is not None for front in every) for step in (0, 10, 19, 20, 100)]
    assert there == [3, 3, 3, 2, 2]  # two are of the other crack


def test_mouths_of_pre_cracks_are_no_tips() -> None:
    through = np.array([[-1.0, 0.0, 1.0, 0.0]])
    assert tip_histories(run(lattice(), [], through), 100) == []
    (front,) = tip_histories(run(lattice(), []), 100)
    assert (front.name, front.branch) == ("pre-crack 0", None)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("notch", "more", "radius", "limit"),
    [
        ([[0.0, 0.0, 9.5e-3, 0.0]], {}, 9.5e-3, "the edge of the plate"),
        ([[5e-3, 0.0, 9.5e-3, 0.0]], {}, 4.5e-3, "another tip"),
        ([[0, 0, 9.5e-3, 0], [0, 5e-3, 12e-3, 5e-3]], {}, 5e-3, "another crack or a bend of this one"),
        ([[0, -4e-3, 6.5e-3, 0], [6.5e-3, 0, 9.5e-3, 0]], {}, 5.64e-3, "another crack or a bend of this one"),
        (
            [[0.0, 0.0, 9.5e-3, 0.0]],
            {"conditions": [{"kind": "load", "box": [0.0155, -1.0, 1.0, 1.0], "body_force": [0, 1]}]},
            6.5e-3,
            "nodes of a load or grip",
        ),
        (
            [[0.0, 0.0, 9.5e-3, 0.0]],
            {"regions": [{"material": {"E": 2e9, "rho": 1e3, "G0": 1.0}, "box": [0, 6.5e-3, 1, 1]}]},
            np.hypot(0.5e-3, 7e-3),
            "another material",
        ),
    ],
)
def test_room_ends_at_whatever_is_nearest(
    notch: list[list[float]], more: dict[str, object], radius: float, limit: str
) -> None:
    """Of the tip at (9.5, 0) mm in a plate of 20 x 25 mm: distances are those to what is drawn."""
    results = run(lattice(20, 25), [], np.array(notch), json.dumps(MODEL | more))
    tip = TipPosition(np.array([9.5e-3, 0.0]), np.array([1.0, 0.0]))
    room = TipObstacles(results, tip_histories(results, 100)).find_undisturbed_room(tip, 100, 1e-4)
    assert room.nearest_obstacle == limit
    assert room.radius == pytest.approx(radius, abs=0.51e-3)
