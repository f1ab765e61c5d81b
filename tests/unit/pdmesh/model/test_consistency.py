"""Nodes and shapes of a grid that do not fit together."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh import Body, Circle, Material, Scene, box
from pdmesh.grid.building import build
from pdmesh.model.consistency import examine
from pdmesh.model.document import GridError, GridWarning, Lattice, Settings
from pdmesh.model.node_grid import Grid, document_of, grid_of, whole_lattice
from pdmesh.scene.solids import brick

GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
H = 1e-3


@pytest.fixture(scope="module")
def plate() -> Grid:
    scene = Scene(box(0, 0, 0.02, 0.012), H, GLASS).hole(Circle(0.014, 0.006, 0.002))
    return build(scene.crack([(0, 0.0055), (0.006, 0.0055)])).grid


@pytest.fixture(scope="module")
def body() -> Grid:
    return build(Body(brick((0, 0, 0), (0.008, 0.006, 0.006)), H, GLASS)).grid


def moved(grid: Grid, row: int, by: Any) -> Grid:
    position = grid.position.copy()
    position[row] += by
    return replace(grid, position=position)


def test_what_was_built_fits(plate: Grid, body: Grid) -> None:
    examine(plate)
    examine(body)


@pytest.mark.parametrize("by", [(0.05, 0.0), (0.0, -2e-3)])
def test_a_node_outside_is_named(plate: Grid, by: tuple[float, float]) -> None:
    with pytest.warns(GridWarning, match=naming("grid", "$.nodes", found=("1", "first 5"))):
        examine(moved(plate, 4, by))


def test_a_node_in_a_hole_is_named(plate: Grid) -> None:
    with pytest.warns(GridWarning, match=naming("$.nodes", found=("1", "first 1", "(0.014, 0.006) m"))):
        examine(moved(plate, 0, (0.014, 0.006) - plate.position[0]))


def test_a_node_outside_a_body_is_named(body: Grid) -> None:
    with pytest.warns(GridWarning, match=naming("$.nodes", found=("2", "first 4"))):
        examine(moved(moved(body, 3, (0, 0, 0.02)), 9, (-0.01, 0, 0)))


def test_shapes_of_other_nodes_are_refused(plate: Grid, body: Grid) -> None:
    with pytest.raises(GridError, match=naming("$.nodes", found=re.compile(r"\d+"))):
        examine(replace(plate, outline=(plate.outline[0] + 0.05,), areas=None))
    with pytest.raises(GridError, match=naming("$.nodes", found=re.compile(r"\d+"))):
        examine(replace(plate, holes=(np.array([(-1, -1), (0.0199, -1), (0.0199, 1), (-1, 1)]),), areas=None))
    with pytest.raises(GridError, match=naming("$.nodes", found=re.compile(r"\d+"))):
        examine(replace(body, outline=tuple(face + 0.05 for face in body.outline)))


def test_areas_that_do_not_add_up_are_said(plate: Grid, body: Grid) -> None:
    assert plate.areas is not None
    areas = plate.areas.copy()
    areas[17] *= 1.5
    with pytest.warns(GridWarning, match=naming("$.areas", expected=re.compile(r"0\.000227\d* m\^2"))):
        examine(replace(plate, areas=areas))
    with pytest.warns(GridWarning, match=naming("$.areas", expected="2.88e-07 m^3")):
        examine(replace(body, areas=1.1 * body.cells))


@pytest.mark.parametrize("name", ["plate", "body"])
def test_an_area_of_many_cells_is_refused(name: str, request: pytest.FixtureRequest) -> None:
    grid: Grid = request.getfixturevalue(name)
    document = document_of(replace(grid, areas=grid.cells), Settings(material=GLASS))
    areas = (*grid.cells.tolist()[:-1], 0.1)
    with pytest.raises(GridError, match=naming(f"$.areas[{len(grid) - 1}]", found=0.1)):
        grid_of(msgspec.structs.replace(document, areas=areas), "grid")


def test_a_lattice_beside_its_outline_is_said() -> None:
    outline = (np.array([(0, 0), (0.02, 0), (0.02, 0.01), (0, 0.01)]),)
    examine(whole_lattice(Lattice((0.0, 0.0), H, 21, 11), cracks=np.zeros((0, 4)), outline=outline))
    with pytest.warns(GridWarning, match=r"\$\.lattice"):
        examine(whole_lattice(Lattice((0.0, 0.0), H, 21, 12), cracks=np.zeros((0, 4)), outline=outline))
    box = tuple(brick((0, 0, 0), (4 * H, 3 * H, 2 * H)).triangles)
    first = (H / 2, H / 2, H / 2)
    examine(whole_lattice(Lattice(first, H, 4, 3, 2), cracks=np.zeros((0, 9)), outline=box))
    with pytest.warns(GridWarning, match=r"\$\.lattice"):
        examine(whole_lattice(Lattice(first, H, 4, 3, 3), cracks=np.zeros((0, 9)), outline=box))


@pytest.mark.parametrize(
    "crack",
    [
        (0.03, 0.005, 0.04, 0.005),  # outside
        (0.0, 0.0, 0.02, 0.0),  # along the edge
        (0.0125, 0.006, 0.0155, 0.006),  # in the hole
        (0.0, 1.0, 0.006, 1.0),
    ],
)
def test_a_crack_that_parts_nothing_is_said(plate: Grid, crack: tuple[float, ...]) -> None:
    cracks = np.vstack([plate.cracks, crack])
    with pytest.warns(GridWarning, match=rf"\$\.notch\[{len(plate.cracks)}\]"):
        examine(replace(plate, cracks=cracks))


def test_a_crack_in_a_body_parts_neighbours(body: Grid) -> None:
    triangle = np.array([[0, 0, 3e-3, 8e-3, 0, 3e-3, 0, 6e-3, 3e-3]])
    examine(replace(body, cracks=triangle))
    with pytest.warns(GridWarning, match=r"\$\.notch\[0\]"):
        examine(replace(body, cracks=triangle + [0, 0, 0.01] * 3))
