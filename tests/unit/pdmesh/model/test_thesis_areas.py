"""Equation 19 of the thesis, by hand, and exact cells."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from plates import GEOMETRIES, square_grid, two_scale_grid

from pdmesh.drawing.file_reading import build_file
from pdmesh.grid.lattice import cell_areas
from pdsolve.bonds.assembly import thesis_areas


def test_equation_19_on_one_scale_is_the_spacing_squared_everywhere() -> None:
    grid = square_grid(7, 6)
    assert thesis_areas(grid.position, grid.delta, 3 * grid.delta) == pytest.approx(1e-6, rel=1e-14)


def test_equation_19_of_a_node_alone() -> None:
    grid = square_grid(1, 1)
    assert thesis_areas(grid.position, grid.delta, 3 * grid.delta).tolist() == [1e-6]


@pytest.mark.parametrize("ratio", [3, 4])
def test_equation_19_at_an_interface(ratio: int) -> None:
    """A fine node below it: (2 + 1)/2 * 1; a coarse one above: (2 + 1)/2 * 2; all others the spacing squared."""
    grid = two_scale_grid()
    areas = thesis_areas(grid.position, grid.delta, ratio * grid.delta)
    expected = grid.delta**2
    expected[np.isclose(grid.position[:, 1], 7e-3)] = 1.5e-6
    expected[np.isclose(grid.position[:, 1], 8.5e-3)] = 3e-6
    assert areas == pytest.approx(expected, rel=1e-14)


@pytest.mark.slow
def test_an_interface_with_a_gap_of_one_fine_spacing_is_a_tenth_short() -> None:
    """Nodes on the diagonals are the nearest on both sides: a coarse node's left and right are fine ones."""
    grid = build_file(GEOMETRIES / "kalthoff_winkler.geo").grid
    areas = thesis_areas(grid.position, grid.delta, 3 * grid.delta)
    x, y = np.round(grid.position.T * 1e3, 6)
    for height in (46, 47):  # (2 + 1)/2 * 1 and (2 + 1)/2
        assert areas[(x == 50) & (y == height)].tolist() == pytest.approx([1.5e-6])
    rows = (x >= 20) & (x < 80) & ((y == 46) | (y == 47))
    assert grid.areas is not None
    assert areas[rows].sum() / grid.areas[rows].sum() == pytest.approx((30 * 1.5 + 60 * 1.5) / (60 * 2.5), rel=1e-9)


def test_cells_fill_a_plate_with_a_hole() -> None:
    shape = shapely.box(0, 0, 12e-3, 7e-3).difference(shapely.Point(6e-3, 3e-3).buffer(1.4e-3))
    grid = square_grid(13, 8)
    position = grid.position[shapely.intersects_xy(shape, grid.position)]
    areas = cell_areas(position, shape, np.full(len(position), 1e-3))
    assert areas.sum() == pytest.approx(shape.area, rel=1e-12)  # measured 4e-16
    assert areas[0] == pytest.approx(0.25e-6, rel=1e-12)  # a corner has a quarter of a cell
    assert areas.min() > 0
