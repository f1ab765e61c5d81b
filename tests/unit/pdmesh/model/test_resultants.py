"""What loads add up to."""

from __future__ import annotations

import pytest
from shapely import Point

from pdmesh import Body, Material, Scene, box, build
from pdmesh.grid.bodies import build_body
from pdmesh.model.load_resultants import resultants
from pdmesh.model.node_grid import document_of
from pdmesh.scene.solids import brick

STEEL = Material(E=2e11, rho=7800, G0=1e4)


def test_of_a_plate() -> None:
    plate = Scene(box(0, 0, 0.1, 0.04), 1e-3, STEEL).load("right", traction=(1e6, 0), name="pull")
    plate = plate.load("normal 0,1", force=(0, -5e4), name="press", rows=2)
    plate = plate.load(Point(0.1, 0.04), force=(0, 1e3), name="lift")
    plate = plate.load(box(0, 0, 0.05, 0.04), force=(7.0, 0), name="half").fix("left")
    built = build(plate)
    found = {each.name: each for each in resultants(built.document, built.grid)}
    assert found["pull"].force == pytest.approx([4e4, 0])
    assert found["press"].force == pytest.approx([0, -5e4])
    assert found["press"].moment == pytest.approx(0, abs=1e-6)
    assert found["lift"].force == pytest.approx([0, 1e3])
    assert found["lift"].moment == pytest.approx([1e3 * 0.05])
    assert found["half"].force == pytest.approx([7, 0])


def test_of_a_body() -> None:
    shell = brick((0, 0, 0), (0.02, 0.01, 0.01))
    body = Body(shell, 1e-3, STEEL).load("top", force=(0, 0, 5.0), name="lift").fix("left")
    half = brick((0, 0, 0), (0.01, 0.01, 0.01))
    body = body.load("normal 1,0,0", force=(3.0, 0, 0), name="pull").load(half, force=(0, 1.0, 0), name="half")
    grid, settings, _ = build_body(body)
    found = {each.name: each for each in resultants(document_of(grid, settings), grid)}
    assert found["lift"].force == pytest.approx([0, 0, 5])
    assert found["pull"].force == pytest.approx([3, 0, 0])
    assert found["pull"].moment == pytest.approx([0, 0, 0], abs=1e-12)
    assert found["half"].moment == pytest.approx([0, 0, -5e-3])
