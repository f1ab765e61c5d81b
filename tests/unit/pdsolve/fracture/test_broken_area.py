"""The area of broken bonds is that of the cuts they make, whichever way, of plates and blocks, at edges too."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from plates import GLASS, square_grid

from pdmesh.model.document import Material
from pdmesh.model.material_constants import micromodulus
from pdmesh.model.neighbours import Neighbours
from pdmesh.model.node_grid import Grid
from pdsolve.fracture import broken_area as module
from pdsolve.fracture.broken_area import broken_area


def block(side: int) -> Grid:
    place = np.arange(side) + 0.5
    position = np.stack(np.meshgrid(place, place, place, indexing="ij"), axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    return Grid(np.arange(len(position)), position, np.ones(len(position)), nowhere >= 0, nowhere, np.zeros((0, 9)))


def cut(grid: Grid, way: tuple[float, ...], ratio: float, material: Material = GLASS) -> float:
    """The area of a cut through the middle of a grid across `way`, over that of the cut itself."""
    reach = ratio + 0.5 * (material.micromodulus == "constant")
    pairs = Neighbours(grid.position, grid.delta, reach * grid.delta).pairs(np.arange(len(grid)))
    side = (grid.position - grid.position.mean(axis=0)) @ np.array(way) > 0
    some = side[pairs.source] != side[pairs.target]
    number = np.zeros(len(grid), dtype=np.int64)
    found = broken_area(grid, ratio, (material,), number, pairs.source[some], pairs.target[some])
    assert found.cost == pytest.approx(material.G0 * found.area)
    return found.area


@pytest.mark.parametrize(
    ("profile", "ratio", "row", "diagonal"),
    [
        ("conical", 2.0, 1.032, 0.973),
        ("conical", 3.0, 1.003, 0.998),
        ("constant", 3.0, 0.999, 1.004),
        ("constant", 4.0, 1.004, 0.999),
    ],
)
def test_a_cut_of_a_plate_has_its_length(profile: str, ratio: float, row: float, diagonal: float) -> None:
    """Right is 1: both directions differ by what the lattice's own energy differs by, in the mean they are right."""
    material = msgspec.structs.replace(GLASS, micromodulus=profile)
    grid = square_grid(60, 60, 1e-3)
    along, across = cut(grid, (0.0, 1.0), ratio, material), cut(grid, (1.0, 1.0 + 1e-9), ratio, material)
    assert along / 60e-3 == pytest.approx(row, abs=0.001)  # measured
    assert across / (60e-3 * np.sqrt(2)) == pytest.approx(diagonal, abs=0.001)  # measured


def test_a_cut_of_a_block_has_its_area() -> None:
    assert cut(block(12), (0.0, 0.0, 1.0), 3.0) / 144 == pytest.approx(1.012, abs=0.001)  # measured


def test_of_two_materials_half_of_each_counts() -> None:
    grid, tough = square_grid(20, 20, 1e-3), msgspec.structs.replace(GLASS, G0=3 * GLASS.G0)
    pairs = Neighbours(grid.position, grid.delta, 3 * grid.delta).pairs(np.arange(len(grid)))
    upper = (grid.position[:, 1] > grid.position[:, 1].mean()).astype(np.int64)
    some = upper[pairs.source] != upper[pairs.target]
    found = broken_area(grid, 3.0, (GLASS, tough), upper, pairs.source[some], pairs.target[some])
    assert found.cost == pytest.approx(2 * GLASS.G0 * found.area)


def test_a_material_for_each_node_costs_no_more_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Materials that differ in E and G0 alone share the sums of one lattice; the cost is that of their mean G0."""
    grid = square_grid(20, 20, 1e-3)
    pairs = Neighbours(grid.position, grid.delta, 3 * grid.delta).pairs(np.arange(len(grid)))
    upper = grid.position[:, 1] > grid.position[:, 1].mean()
    some = upper[pairs.source] != upper[pairs.target]
    calls: list[int] = []

    def counted(*words: Any) -> Any:
        calls.append(1)
        return micromodulus(*words)

    monkeypatch.setattr(module, "micromodulus", counted)
    one = broken_area(grid, 3.0, (GLASS,), np.zeros(400, dtype=np.int64), pairs.source[some], pairs.target[some])
    of_one, own = len(calls), np.arange(400)
    materials = tuple(msgspec.structs.replace(GLASS, E=60e9 + 1e7 * node, G0=100.0 + node) for node in range(400))
    many = broken_area(grid, 3.0, materials, own, pairs.source[some], pairs.target[some])
    assert len(calls) == 2 * of_one
    assert many.area == pytest.approx(one.area)
    assert many.cost == pytest.approx(one.area * 299.5, rel=1e-3)
