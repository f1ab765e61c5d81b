"""Arrows of loads and marks of supports, measured in the picture."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from plates import square_grid

from pdmesh import Scene
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Displacement, Load
from pdmesh.model.node_arrays import selected
from pdmesh.model.node_grid import Grid
from pdmesh.reports.load_arrows import symbols, total

GRID = square_grid(21, 11)  # 20 x 10 mm
RIGHT = np.flatnonzero(GRID.position[:, 0] > 19.5e-3)
EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)


def outlines(force: tuple[float, float], rows: np.ndarray) -> np.ndarray:
    """The corners (k, 7, 2), mm, of the arrows that are drawn."""
    axes = Figure().add_subplot()
    symbols(axes, Load(box=EVERYWHERE, body_force=force), GRID, rows, "#d55e00")
    (arrows,) = (each for each in axes.collections if isinstance(each, PolyCollection))
    return np.array([path.vertices[:7] for path in arrows.get_paths()])


@pytest.mark.parametrize(("pull", "tip"), [(1e6, 20 + 1.6), (-1e6, 20.0)])
def test_arrows_of_a_pull_begin_at_its_nodes_and_those_of_a_push_end_there(pull: float, tip: float) -> None:
    """They are 0.08 of the larger side long, their head 0.3 and 0.2 of that long and wide, their shaft 0.05."""
    found = outlines((pull, 0.0), RIGHT)
    assert len(found) == 11
    assert found[:, 3, 0] == pytest.approx(tip)
    assert np.abs(found[:, 3, 0] - found[:, 0, 0]) == pytest.approx(1.6)
    assert np.abs(found[:, 3, 0] - found[:, 2, 0]) == pytest.approx(0.3 * 1.6)
    assert np.abs(found[:, 4, 1] - found[:, 2, 1]) == pytest.approx(0.2 * 1.6)
    assert np.abs(found[:, 5, 1] - found[:, 1, 1]) == pytest.approx(0.05 * 1.6)
    assert np.unique(found[:, 3, 1].round(9)) == pytest.approx(np.unique(GRID.position[RIGHT, 1]) * 1e3)


def test_arrows_of_one_traction_have_one_length_on_cells_of_several_sizes(plate: Scene) -> None:
    """An edge that a fine zone meets, and one whose traction grows along it."""
    plate = plate.crack([(0, 0.0105), (0.01, 0.0105)]).refine("crack", 2e-3).load("left", traction=(-1e6, 0))
    grid, settings, _ = build_grid(plate)
    (load,) = settings.conditions
    assert isinstance(load, Load)
    rows = np.flatnonzero(selected(grid, load.nodes, load.box))
    assert len(np.unique(grid.delta[rows])) == 2
    even, growing = (
        lengths(msgspec.structs.replace(load, traction=(pull, 0.0)), grid, rows) for pull in (-1e6, "1e8 * y")
    )
    assert even == pytest.approx(0.08 * 40)
    assert growing.max() == pytest.approx(0.08 * 40)
    assert growing.min() < 0.05 * growing.max()


def lengths(load: Load, grid: Grid, rows: np.ndarray) -> np.ndarray:
    """The lengths, mm, of the arrows of a load along x."""
    axes = Figure().add_subplot()
    symbols(axes, load, grid, rows, "#d55e00")
    (arrows,) = axes.collections
    corners = np.array([path.vertices[:7] for path in arrows.get_paths()])
    return np.abs(corners[:, 3, 0] - corners[:, 0, 0])


def test_at_most_twelve_arrows_evenly_along_an_edge() -> None:
    top = np.flatnonzero(GRID.position[:, 1] == GRID.position[:, 1].max())
    x = np.sort(outlines((0.0, 1e6), top)[:, 3, 0])
    assert len(x) == 12
    assert (x[0], x[-1]) == pytest.approx((0, 20))
    assert np.diff(x).max() <= 2.001


@pytest.mark.parametrize(("x", "y", "mark"), [(0.0, 0.0, "^"), (None, 0.0, "o"), (0.0, None, ">")])
def test_supports_are_marked_by_what_they_hold(x: float | None, y: float | None, mark: str) -> None:
    axes = Figure().add_subplot()
    symbols(axes, Displacement(box=EVERYWHERE, x=x, y=y), GRID, RIGHT, "#0072b2")
    (line,) = axes.lines
    assert line.get_marker() == mark
    assert np.asarray(line.get_xydata())[:, 0] == pytest.approx(20)


def test_totals_have_the_prefix_that_suits_them() -> None:
    """Each node of the edge acts on the area of its cell, 1 mm2."""
    for force, words in ((1e6, ", 11 N/m"), (1e9, ", 11 kN/m"), (2e12, ", 22 MN/m")):
        assert total(Load(box=EVERYWHERE, body_force=(force, 0.0)), GRID, RIGHT) == words
    assert total(Displacement(box=EVERYWHERE, x=0.0), GRID, RIGHT) == ""
