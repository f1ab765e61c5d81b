"""Grids of all nodes of a lattice, and parts of them that take no arrays of all nodes."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import tracemalloc

import numpy as np
import pytest

from pdmesh.model.document import Lattice
from pdmesh.model.node_grid import Grid, whole_lattice

PLANE = Lattice((-0.01, 0.02), 1e-3, 41, 21)
SPACE = Lattice((0.0, 0.0, 0.0), 1e-3, 7, 6, 5)
ARRAYS = {"ids", "position", "border", "areas"}  # of all nodes


def grid_of(lattice: Lattice) -> Grid:
    """All nodes of a lattice without cracks."""
    return whole_lattice(lattice, cracks=np.zeros((0, 4 if lattice.layers is None else 9)))


@pytest.mark.parametrize("lattice", [PLANE, SPACE])
def test_a_part_is_that_of_the_arrays(lattice: Lattice) -> None:
    listed, grid = grid_of(lattice), grid_of(lattice)
    listed.part(np.zeros(1, dtype=np.int64))
    assert len(listed.position) == len(listed.ids) == len(grid)
    rows = np.random.default_rng(1).permutation(len(grid))[:50]
    ours, theirs = grid.part(rows), listed.part(rows)
    for name in (*ARRAYS, "delta", "hole_id"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name


@pytest.mark.parametrize("lattice", [PLANE, SPACE])
def test_nodes_are_chosen_as_from_the_arrays(lattice: Lattice) -> None:
    listed, grid = grid_of(lattice), grid_of(lattice)
    assert len(listed.ids) == len(listed.position)
    low, high = np.array(lattice.origin) + 1e-3, np.array(lattice.origin) + 3.5e-3
    for ids, box in (([3, 7, 7, 1], None), (None, [*low, *high]), (None, [*high, *low])):
        assert np.array_equal(grid.chosen(ids, box), listed.chosen(ids, box))
    asked = np.array([0, 1, len(grid), len(grid) + 1])
    assert grid.missing(asked).tolist() == listed.missing(asked).tolist() == [0, len(grid) + 1]
    assert ARRAYS.isdisjoint(vars(grid))


def test_a_lattice_with_its_nodes_moved_lists_them() -> None:
    grid = grid_of(PLANE)
    moved = dataclasses.replace(grid, position=grid.position + 1e-5, lattice=None)
    assert type(moved) is Grid
    assert np.array_equal(moved.part(np.array([5])).position, grid.position[[5]] + 1e-5)


def test_a_part_of_a_large_plate_takes_little() -> None:
    grid = grid_of(Lattice((0.0, 0.0), 1e-3, 4001, 1001))
    tracemalloc.start()
    try:
        part = grid.part(grid.chosen(None, [0.0, 0.0, 0.1, 0.1]))
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(part) == 101**2
    assert most < 0.5 * len(grid)  # bytes a node; measured: 0.25


def test_copies_and_other_processes_have_the_same_nodes() -> None:
    grid = grid_of(Lattice((0.0, 0.0), 1e-3, 41, 11))
    for again in (pickle.loads(pickle.dumps(grid)), copy.copy(grid), copy.deepcopy(grid)):
        assert type(again) is type(grid)
        assert np.array_equal(again.position, grid.position)
        assert again.lattice == grid.lattice


@pytest.mark.parametrize("lattice", [PLANE, SPACE])
def test_windows_and_nearest_nodes_are_those_of_the_arrays(lattice: Lattice) -> None:
    listed, grid = grid_of(lattice), grid_of(lattice)
    assert len(listed.ids) == len(listed.position)
    ours, theirs = grid.window(20, 90), listed.window(20, 90)
    for name in (*ARRAYS, "delta", "hole_id"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    assert ours.lattice is None
    numbers = np.random.default_rng(1)
    apart = numbers.integers(-3, 4, (60, grid.dimension)) * lattice.spacing / 2  # many as near to several nodes
    places = listed.position[numbers.integers(0, len(grid), 60)] + apart
    places = np.vstack([places, places + numbers.uniform(-2, 2, places.shape) * lattice.spacing])
    for known, found in zip(listed.nearest(places), grid.nearest(places), strict=True):
        assert found.tolist() == pytest.approx(known.tolist(), rel=1e-12, abs=1e-15)
    assert not ARRAYS & set(grid.__dict__)
