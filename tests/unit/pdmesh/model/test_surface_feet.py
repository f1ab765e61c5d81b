"""Feet of points on triangles: above a face, above an edge between two, and beside a rim."""

from __future__ import annotations

import numpy as np
import pytest

from pdmesh.model.triangulated_surface import ways_to
from pdmesh.scene.solids import brick

SQUARE = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 0), (0, 1, 0)]], dtype=float)


def test_ways_end_on_the_surface() -> None:
    points = np.array([(0.3, 0.4, 0.2), (0.5, 0.5, -0.1), (0.0, 0.0, 0.3)])
    ways, above = ways_to(points, SQUARE, 1.0)
    assert ways == pytest.approx(np.array([(0, 0, -0.2), (0, 0, 0.1), (0, 0, -0.3)]))
    assert above.all()


def test_points_beside_a_rim_are_not_above() -> None:
    """0.1 beside it and as high; the same points beside an edge between two faces of a closed surface are."""
    points = np.array([(1.1, 0.5, 0.1), (1.01, 0.5, 0.1), (0.5, 0.5, 0.1)])
    ways, above = ways_to(points, SQUARE, 1.0)
    assert above.tolist() == [False, True, True]
    assert ways[0] == pytest.approx([-0.1, 0, -0.1])
    closed = brick((0, 0, -1), (1, 1, 0)).triangles
    assert ways_to(points, closed, 1.0)[1].all()


def test_points_out_of_reach_have_no_foot() -> None:
    ways, above = ways_to(np.array([(0.5, 0.5, 2.0)]), SQUARE, 1.0)
    assert np.isnan(ways).all()
    assert not above.any()


def test_triangles_without_an_area_have_no_feet() -> None:
    flat = np.zeros((1, 3, 3))
    ways, _ = ways_to(np.array([(0.5, 0.5, 0.5)]), np.concatenate([flat, SQUARE]), 1.0)
    assert ways[0] == pytest.approx([0, 0, -0.5])
