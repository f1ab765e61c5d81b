"""What the tests of the mesher share."""

from __future__ import annotations

import pytest

from pdmesh.scene import Material, Scene, box

GLASS = Material(E=65e9, rho=2235, G0=204)


@pytest.fixture
def plate() -> Scene:
    """A plate of 40 x 20 mm, nodes 1 mm apart."""
    return Scene(box(0, 0, 0.04, 0.02), 1e-3, GLASS)


@pytest.fixture
def glass() -> Material:
    return GLASS
