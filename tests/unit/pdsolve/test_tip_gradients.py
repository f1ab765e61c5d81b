"""Nodes and bonds around a place of a plate that is not at the origin."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from plates import plate, square_grid

from pdsolve.crack_growth.tip_gradients import Surroundings

COLUMNS, ROWS, DELTA = 9, 7, 1e-3
PLACE = np.array([24.4e-3, -36.6e-3])  # nearest to the fifth node of the fourth row
NODE = 3 * COLUMNS + 4


@pytest.fixture
def around() -> Surroundings:
    """Of a plate each of whose nodes is bonded to those beside it."""
    model = plate(square_grid(COLUMNS, ROWS, DELTA, x0=20e-3, y0=-40e-3))
    position = model.grid.position
    apart = np.hypot(*(position[:, None] - position).transpose(2, 0, 1))
    source, target = np.nonzero((apart > 0) & (apart < 1.1 * DELTA))
    operator = SimpleNamespace(bonds=lambda at_start: (source, target))
    return Surroundings(model, operator, np.full(len(position), DELTA**2), rest=False)  # type: ignore[arg-type]


def test_the_nearest_node_and_those_within_a_radius(around: Surroundings) -> None:
    assert around.nearest(PLACE) == NODE
    beside = [NODE - COLUMNS, NODE - 1, NODE, NODE + 1, NODE + COLUMNS]
    assert around.rows(around.model.grid.position[NODE], 1.1 * DELTA).tolist() == beside


def test_bonds_of_nodes_are_those_that_no_crack_has_cut(around: Surroundings) -> None:
    rows = np.array([NODE, NODE + 1])
    pairs = around.pairs(around.bonds(rows))
    assert pairs.source.tolist() == [NODE] * 4 + [NODE + 1] * 4
    assert pairs.target[:4].tolist() == [NODE - COLUMNS, NODE - 1, NODE + 1, NODE + COLUMNS]
    assert pairs.length == pytest.approx(DELTA, rel=1e-12)
    around.intact[around.bonds(rows)[2]] = False
    assert around.pairs(around.bonds(rows)).target[:3].tolist() == [NODE - COLUMNS, NODE - 1, NODE + COLUMNS]
