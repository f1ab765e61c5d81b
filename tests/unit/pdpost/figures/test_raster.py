"""Nodes painted into an image."""

from __future__ import annotations

import numpy as np
import pytest

from pdpost.figures.raster import averages


def test_squares_that_tile_a_plate_leave_no_gap_and_do_not_overlap() -> None:
    """Two columns of coarse nodes beside four of fine ones; edges fall on pixels' centres."""
    coarse = np.array([(1.0 + 2 * i, 1.0 + 2 * j) for i in range(2) for j in range(2)])
    fine = np.array([(4.5 + i, 0.5 + j) for i in range(4) for j in range(4)])
    position = np.concatenate([coarse, fine])
    size = np.array([2.0] * 4 + [1.0] * 16)
    for columns in (8, 12, 40, 100):
        image, there = averages(position, size, np.arange(20.0), (0.0, 0.0, 8.0, 4.0), columns)
        assert image.shape == (columns // 2, columns)
        assert there.all()
        y, x = (np.indices(image.shape) + 0.5) * 8.0 / columns
        expected = np.where(x < 4, 2 * (x // 2) + y // 2, 4 + 4 * np.floor(x.clip(4) - 4) + np.floor(y))
        clear = (np.abs(x - x.round()) > 1e-9) & (np.abs(y - y.round()) > 1e-9)
        assert np.array_equal(image[clear], expected[clear])


def test_several_nodes_on_a_pixel_are_averaged_and_unknown_ones_left_out() -> None:
    position = np.array([[0.2, 0.5], [0.7, 0.5], [0.3, 0.1], [1.5, 0.5]])
    image, there = averages(position, np.full(4, 1e-3), np.array([1.0, 3.0, np.nan, np.nan]), (0, 0, 3, 1), 3)
    assert image[0, 0] == 2.0
    assert np.isnan(image[0, 1:]).all()
    assert there.tolist() == [[True, True, False]]


def test_what_is_outside_is_clipped() -> None:
    position = np.array([[-0.5, 0.5], [-3.0, 0.5], [4.0, 9.0]])
    image, there = averages(position, np.array([2.0, 1.0, 1.0]), np.array([5.0, 6.0, 7.0]), (0, 0, 2, 1), 4)
    assert there.tolist() == [[True, False, False, False], [True, False, False, False]]
    assert image[0, 0] == pytest.approx(5.0)
