"""Families by offsets and by trees, against all distances."""

from __future__ import annotations

import numpy as np
import pytest
from plates import square_grid, two_scale_grid

from pdmesh.model.neighbours import Neighbours


def scattered() -> tuple[np.ndarray, np.ndarray]:
    """Nodes without a lattice, of three spacings."""
    random = np.random.default_rng(2)
    return 1e-2 * random.random((300, 2)), random.choice([4e-4, 5e-4, 8e-4], 300)


def mixed() -> tuple[np.ndarray, np.ndarray]:
    """A lattice, a second one beside it, half a spacing higher, and some nodes on none."""
    one, two = square_grid(12, 11), square_grid(13, 9, x0=12e-3, y0=0.5e-3)
    loose = 1e-3 * np.random.default_rng(4).random((20, 2)) + [25e-3, 3e-3]
    position = np.concatenate([one.position, two.position, loose])
    return position, np.full(len(position), 1e-3)


def shuffled() -> tuple[np.ndarray, np.ndarray]:
    """Two scales, numbered at random."""
    grid = two_scale_grid()
    order = np.random.default_rng(0).permutation(len(grid))
    return grid.position[order], grid.delta[order]


def drifting() -> tuple[np.ndarray, np.ndarray]:
    """Two lattices whose spacings are not quite what is said of them: far out, nodes are off their places."""
    coarse = square_grid(8, 12, 1e-3 * (1 - 1e-8), y0=0.5e-3 * (400 + 1e-7))
    fine = square_grid(8, 400, 0.5e-3 * (1 + 9e-10))
    return np.concatenate([coarse.position, fine.position]), np.repeat([1e-3 * (1 - 1e-8), 0.5e-3], [96, 3200])


def all_different() -> tuple[np.ndarray, np.ndarray]:
    """A lattice, and nodes each with a spacing of its own, one of them of a thousand of the lattice's."""
    grid, random = square_grid(15, 12), np.random.default_rng(7)
    position = np.concatenate([grid.position, 20e-3 * random.random((80, 2))])
    return position, np.concatenate([grid.delta, 10 ** random.uniform(-3.5, -2.5, 79), [1.0]])


NODES = {
    "one scale": (square_grid(21, 12).position, square_grid(21, 12).delta),
    "two scales": (two_scale_grid().position, two_scale_grid().delta),
    "shuffled": shuffled(),
    "scattered": scattered(),
    "mixed": mixed(),
    "drifting": drifting(),
    "all different": all_different(),
    "a handful": (1e-3 * np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 1.0]]), np.full(3, 1e-3)),
}


@pytest.mark.quick_cases(6)
@pytest.mark.parametrize("mutual", [False, True])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 4.5])
@pytest.mark.parametrize("name", NODES)
def test_all_pairs_are_found_once_and_in_order(name: str, ratio: float, mutual: bool) -> None:
    position, delta = NODES[name]
    reach = ratio * delta
    distance = np.hypot(*(position[:, None] - position[None]).T).T
    seen = (reach[:, None] * (1 + 1e-9) >= distance) & ~np.eye(len(position), dtype=bool)
    seen |= seen.T & mutual
    neighbours = Neighbours(position, delta, reach, mutual)
    parts = [neighbours.pairs(rows) for rows in np.array_split(np.arange(len(position)), 3)]
    source, target, length = (np.concatenate(column) for column in zip(*parts, strict=True))
    assert np.array_equal(np.stack([source, target]), np.stack(np.nonzero(seen)))
    assert np.array_equal(length, distance[seen])


def test_any_rows_may_be_asked_for() -> None:
    position, delta = NODES["two scales"]
    neighbours = Neighbours(position, delta, 3 * delta)
    rows = np.array([0, 5, 77])
    every, some = neighbours.pairs(np.arange(len(position))), neighbours.pairs(rows)
    assert np.array_equal(some.target, every.target[np.isin(every.source, rows)])
