"""Planes through bodies."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pdsolve.measures.slices import default_slice_point, slice_field_values_by_plane


def of(x: list[float]) -> Any:
    """Results of a row of nodes 0.1 m apart or further, along x."""
    position = np.column_stack([x, np.full((len(x), 2), 0.05)])
    nodes = SimpleNamespace(position=position, delta=np.full(len(x), 0.1))
    return SimpleNamespace(name="row", nodes=lambda step: nodes)


@pytest.mark.parametrize(
    ("x", "at", "rows"),
    [
        ([0.05, 0.15, 0.25], 0.15, [1]),
        ([0.05, 0.15, 0.25, 0.35], 0.2, [2]),  # between two layers the upper one, whatever 0.2 is rounded to
        ([-0.15, -0.05, 0.05, 0.15], 0.0, [2]),
        ([0.05, 0.15, 1.05, 1.15], 0.15, [1]),  # in two parts: of the nearest
    ],
)
def test_the_middle_has_nodes(x: list[float], at: float, rows: list[int]) -> None:
    found = default_slice_point(of(x))
    assert found == pytest.approx([at, 0.05, 0.05])
    assert slice_field_values_by_plane(of(x), np.arange(len(x)), 0, "x", float(found[0])).node_rows.tolist() == rows
