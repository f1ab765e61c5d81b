"""Equation 19 of the thesis, by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pdmesh.areas import thesis_areas
from pdmesh.grid import Grid
from pdmesh.lattice import build_grid
from pdmesh.scene import Scene
from pdmesh.sources import build

GEOMETRIES = Path(__file__).parents[3] / "geometries"


def at(grid: Grid, areas: np.ndarray, x: float, y: float) -> float:
    """The area of the node at (x, y) mm, in mm^2."""
    return float(areas[np.argmin(np.hypot(*(grid.position * 1e3 - (x, y)).T))] * 1e6)


def test_one_spacing(plate: Scene) -> None:
    grid, _, _ = build_grid(plate)
    assert thesis_areas(grid.position, grid.delta, 3 * grid.delta) == pytest.approx(1e-6)


def test_across_an_interface() -> None:
    """The four nearest deltas, (1 + 2)/2 on the side where the other spacing begins, 1 or 2 elsewhere."""
    grid = build(GEOMETRIES / "duran50.geo").grid
    areas = thesis_areas(grid.position, grid.delta, 4 * grid.delta)
    assert at(grid, areas, 50, 0.5) == pytest.approx(1)
    assert at(grid, areas, 50, 10.5) == pytest.approx((1 + 2) / 2)  # fine below, coarse above
    assert at(grid, areas, 50, 12) == pytest.approx((1 + 2) / 2 * 2)
    assert at(grid, areas, 50, 14) == pytest.approx(4)


def test_an_interface_with_a_gap_of_one_fine_spacing_is_a_tenth_short() -> None:
    """Nodes on the diagonals are the nearest on both sides: a coarse node's left and right are fine ones."""
    grid = build(GEOMETRIES / "kalthoff_winkler.geo").grid
    areas = thesis_areas(grid.position, grid.delta, 3 * grid.delta)
    assert at(grid, areas, 50, 46) == pytest.approx((2 + 1) / 2 * 1)
    assert at(grid, areas, 50, 47) == pytest.approx((2 + 1) / 2)
    x, y = np.round(grid.position.T * 1e3, 6)
    rows = (x >= 20) & (x < 80) & ((y == 46) | (y == 47))
    assert grid.areas is not None
    assert areas[rows].sum() / grid.areas[rows].sum() == pytest.approx((30 * 1.5 + 60 * 1.5) / (60 * 2.5), rel=1e-9)
