"""What the tests of the mesher share."""

from __future__ import annotations

import pytest
from plates import GLASS

from pdmesh import Scene, box


@pytest.fixture
def plate() -> Scene:
    """A plate of 40 x 20 mm, nodes 1 mm apart."""
    return Scene(box(0, 0, 0.04, 0.02), 1e-3, GLASS)
