"""Words about mesh sizes, which a grid of nodes does not use."""

from __future__ import annotations

import pytest

from pdmesh.drawing.sandbox.mesh_sizes import unused
from pdmesh.drawing.sandbox.scan import Drawing
from pdmesh.drawing.sandbox.tokens import tokens_of


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Point(1) = {0, 0, 0};", {}),
        ("Point(1) = {0, Max(0, 1), Min(0, 1)};", {}),  # commas of functions are not between coordinates
        ("\nPoint(1) = {0, 0, 0, 1e-3};", {"mesh sizes of points": 2}),
    ],
)
def test_a_fourth_number_of_a_point_is_a_mesh_size(text: str, found: dict[str, int]) -> None:
    assert unused(Drawing(tokens_of(text))) == found
