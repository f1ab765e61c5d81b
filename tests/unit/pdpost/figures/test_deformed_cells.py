"""Cells of displaced nodes: no seam between bonded cells, a gap between parted ones."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from prescribed_results import plate, results_of

from pdpost.figures.sheets import Shape, shape

BEND = 40.0  # 1/m


def bent(broken: list[tuple[int, int, int]]) -> Shape:
    """A square of 13 mm, each of whose nodes is displaced by a different gradient."""
    nodes, families = plate()
    x, y = nodes.position.T
    u = np.column_stack([BEND * x * y, -BEND * x**2 / 2])
    return shape(results_of(nodes, families, u, broken), 10, 1.0)


def polygons(shown: Shape) -> list[shapely.Polygon]:
    """The cells as they are drawn."""
    assert shown.cells is not None
    assert shown.corners is not None
    places = shown.corners + shown.position[shown.cells.node_rows]
    ends = np.flatnonzero(shown.cells.is_last_of_ring) + 1
    return [shapely.Polygon(ring) for ring in np.split(places, ends[:-1])]


def test_bonded_cells_leave_no_seam() -> None:
    """The cells cover the deformed square without a hole; each by itself, they leave seams of 1 % of its area."""
    cells = polygons(bent([]))
    union = shapely.union_all(cells)
    assert union.geom_type == "Polygon"
    assert sum(ring.length for ring in union.interiors) == pytest.approx(0.0, abs=1e-9)
    assert union.area == pytest.approx(sum(cell.area for cell in cells), rel=1e-6)


def test_cells_without_a_bond_part() -> None:
    """A crack through the middle of the square, all of whose bonds are broken, opens between the cells."""
    nodes, families = plate()
    middle = nodes.position[:, 1].mean()
    starts = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    below = nodes.position[:, 1] < middle - 1e-6
    crossing = below[starts] != below[families.neighbour]
    ends = nodes.ids[np.column_stack([starts, families.neighbour])[crossing]]
    broken = [(5, int(a), int(b)) for a, b in ends]
    u = np.column_stack([np.zeros(len(nodes.ids)), np.where(below, 0.0, 3e-4)])
    cells = polygons(shape(results_of(nodes, families, u, broken), 10, 1.0))
    halves = shapely.union_all(cells)
    assert halves.geom_type == "MultiPolygon"
    assert shapely.distance(*halves.geoms) == pytest.approx(3e-4, rel=1e-6)
