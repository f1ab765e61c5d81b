"""The pre-cracked Duran plate, whole: what the thesis claims, in the mode that reproduces it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pdmesh.grid import grid_of, read_file
from pdpost.cracks import growth
from pdsolve.results import Results


def test_the_grid(duran_json: Path) -> None:
    """2732 nodes: 101 x 22 of 1 mm, 51 x 10 of 2 mm; 204 loaded nodes a side."""
    document = read_file(duran_json)
    grid = grid_of(document, "duran50.json")
    fine, coarse = (np.unique(grid.position[grid.delta == delta, 1]) for delta in (1e-3, 2e-3))
    assert (len(grid), (grid.delta == 1e-3).sum(), (grid.delta == 2e-3).sum()) == (2732, 101 * 22, 51 * 10)
    assert fine == pytest.approx(1e-3 * np.arange(-10.5, 11), abs=1e-12)
    assert coarse == pytest.approx([-0.02, -0.018, -0.016, -0.014, -0.012, 0.012, 0.014, 0.016, 0.018, 0.02], abs=1e-12)
    assert [len(load.nodes or ()) for load in document.conditions] == [204, 204]
    assert grid.areas is not None
    assert grid.areas.sum() == pytest.approx(4e-3, rel=1e-12)  # measured 4e-16


def test_the_thesis_mode_does_what_the_thesis_says(solved: Callable[[str], Path]) -> None:
    """Starts at about 10 us, branches at about 29 us, 68 mm from the left edge."""
    with Results.open(solved("thesis")) as results:
        crack = growth(results)
    assert crack.start is not None
    assert crack.start.time == pytest.approx(10e-6, abs=1.5e-6)
    assert crack.branching is not None
    assert crack.branching.time == pytest.approx(29e-6, abs=3e-6)
    assert crack.branching.along == pytest.approx(70e-3, abs=5e-3)
    # measured, and to stay so
    assert (crack.start.step, crack.branching.step) == pytest.approx((378, 1162), abs=4)
    assert crack.branching.along == pytest.approx(73e-3, abs=1e-9)


def test_the_conservative_mode_branches_too(solved: Callable[[str], Path]) -> None:
    with Results.open(solved("conservative")) as results:
        crack = growth(results)
    assert crack.start is not None
    assert crack.branching is not None
    assert (crack.start.step, crack.branching.step) == pytest.approx((362, 1106), abs=4)  # measured: 9.1 and 27.7 us
    assert crack.branching.along == pytest.approx(71e-3, abs=1e-9)


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_the_crack_is_symmetric(solved: Callable[[str], Path], mode: str) -> None:
    with Results.open(solved(mode)) as results:
        nodes, damage, uy = results.nodes(), results.field("damage", 1600), results.field("uy", 1600)
    key = np.round(nodes.position * 1e6)
    order, mirrored = np.lexsort(key.T), np.lexsort((-key[:, 1], key[:, 0]))
    mirror = np.empty(len(order), dtype=int)
    mirror[np.lexsort((key[:, 1], key[:, 0]))] = mirrored
    assert np.array_equal(key[mirror], key * [1, -1])
    assert len(order) == len(damage)
    assert np.array_equal(damage, damage[mirror])
    assert np.abs(uy + uy[mirror]).max() <= 1e-6 * np.abs(uy).max()  # single precision; measured 0
