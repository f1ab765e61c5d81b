"""Nodes by their ids or in a box, and conditions and regions that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from plates import GLASS, square_grid

from pdmesh import GridError
from pdmesh.model.document import AnyCondition, Displacement, InitialVelocity, Load, Region, Settings
from pdmesh.model.node_arrays import in_box, rows_of, selected
from pdmesh.model.selection import check

GRID = replace(square_grid(3, 2), ids=np.array([7, 5, 3, 6, 4, 2]))  # spacing 1 mm, the first at the origin


def test_a_box_takes_the_nodes_on_its_edge() -> None:
    assert np.flatnonzero(in_box(GRID, (0.001, 0, 0.002, 0))).tolist() == [1, 2]
    assert np.flatnonzero(in_box(GRID, (0.001 + 1e-13, 0, 0.002 - 1e-13, 0))).tolist() == [1, 2]  # round-off
    assert not in_box(GRID, (0.001 + 1e-11, 0, 0.002 - 1e-11, 0)).any()


def test_ids_in_any_order() -> None:
    assert rows_of(GRID, np.array([2, 7, 3])).tolist() == [5, 0, 2]
    assert np.flatnonzero(selected(GRID, (2, 7, 3), None)).tolist() == [0, 2, 5]
    assert np.flatnonzero(selected(GRID, None, (0, 0.001, 1, 1))).tolist() == [3, 4, 5]


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (InitialVelocity(), r".*neither or both of nodes and box"),
        (InitialVelocity(nodes=(7,), box=(0, 0, 1, 1)), r".*neither or both of nodes and box"),
        (InitialVelocity(nodes=(7, 1)), r"\.nodes.*id 1"),
        (InitialVelocity(nodes=()), r"\.nodes is empty"),
        (InitialVelocity(box=(1, 1, 2, 2)), r"\.box.*\[1.*\]"),
        (Load(nodes=(7,), body_force=(0, 1), traction=(0, 1)), r".*body_force and traction"),
        (Displacement(nodes=(7,)), r".*neither x nor y"),
        (Displacement(nodes=(7,), x=0.0, profile=((0, 1), (0, 2))), r"\.profile.*times .*"),
    ],
)
def test_conditions_that_cannot_be(condition: AnyCondition, message: str) -> None:
    with pytest.raises(GridError, match=r"^plate\.json: \$\.conditions\[1\]" + message):
        check(Settings(conditions=(InitialVelocity(nodes=(2,)), condition)), GRID, "plate.json")


def test_a_region_without_nodes() -> None:
    with pytest.raises(GridError, match=naming("plate.json", "$.regions[0].nodes", found="8")):
        check(Settings(regions=(Region(material=GLASS, nodes=(8,)),)), GRID, "plate.json")
