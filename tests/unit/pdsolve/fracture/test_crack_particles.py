"""Cracks as particles with arms to their neighbours (pdsolve.fracture.crack_particles)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from plates import lattice

from pdmesh.model.neighbours import Neighbours
from pdmesh.model.visibility import Sight
from pdsolve.fracture.crack_particles import arms, grown, nobody, of_segments, polylines, until


@pytest.mark.parametrize(("count", "leaks", "wrong"), [(12, 128, 120), (24, 0, 16)])
def test_arms_on_a_circle_leak_nothing_and_cut_nothing_beside(count: int, leaks: int, wrong: int) -> None:
    """Of 1400 directed bonds between inside and outside: 0 left, 0 others cut; single straight segments of the same
    length leave and cut what an independent computation has."""
    angle = 2 * np.pi * np.arange(count + 1) / count + 0.13
    place = 6 * np.column_stack([np.cos(angle), np.sin(angle)])
    place[-1] = place[0]
    ring = nobody()
    for number, at in enumerate(place):
        ring = grown(ring, at, number - 1, number)
    grid = lattice([], half=12)
    pairs = Neighbours(grid.position, grid.delta, 3 * grid.delta).pairs(np.arange(len(grid)))
    inside = shapely.contains_xy(shapely.Polygon(place), grid.position)
    joins = inside[pairs.source] != inside[pairs.target]
    cut = Sight(dataclasses.replace(grid, cracks=arms(ring))).cut(pairs)
    assert (joins.sum(), (joins & ~cut).sum(), (cut & ~joins).sum()) == (1400, 0, 0)
    assert np.array_equal(Sight(grid).parted(pairs, arms(ring)), cut)
    along = np.pi * 6 / count * np.column_stack([-np.sin(angle), np.cos(angle)])[:-1]
    straight = np.hstack([place[:-1] - along, place[:-1] + along])
    single = Sight(grid).parted(pairs, straight)
    assert ((joins & ~single).sum(), (single & ~joins).sum()) == (leaks, wrong)


def test_a_straight_crack_of_particles_cuts_what_one_segment_does() -> None:
    whole, grid = np.array([[-9.5, 0.0, 0.25, 0.0]]), lattice([])
    place = np.column_stack([np.linspace(-9.5, 0.25, 14), np.zeros(14)])
    pieces = of_segments(np.hstack([place[:-1], place[1:]]), 1e-9)
    pairs = Neighbours(grid.position, grid.delta, 3 * grid.delta).pairs(np.arange(len(grid)))
    assert len(pieces.place) == 14
    assert np.array_equal(Sight(grid).parted(pairs, arms(pieces)), Sight(grid).parted(pairs, whole))


def test_a_fork_is_three_lines_and_normals_point_to_the_left() -> None:
    crack = of_segments(np.array([[0.0, 0, 1, 0], [1, 0, 2, 0]]), 1e-9)
    crack = grown(grown(crack, np.array([3.0, 1.0]), 2, 7), np.array([3.0, -1.0]), 2, 7)
    crack = grown(crack, np.array([4.0, 1.0]), 3, 9)
    lines = polylines(crack)
    assert [line.tolist() for line in lines] == [
        [[0, 0], [1, 0], [2, 0]],
        [[2, 0], [3, 1], [4, 1]],
        [[2, 0], [3, -1]],
    ]
    assert crack.normal[[0, 2, 5]].tolist() == [[0, 1], [0, 1], [0, 1]]
    assert crack.normal[4] == pytest.approx(np.sqrt([0.5, 0.5]))
    assert arms(until(crack, 7), after=0).tolist() == [[2, 0, 3, 1], [2, 0, 3, -1]]
    assert [len(line) for line in polylines(until(crack, 0))] == [3]


def test_a_closed_crack_is_one_line() -> None:
    square = np.array([[0.0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]])
    (line,) = polylines(of_segments(square, 1e-9), 1e-9)
    assert line.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]
