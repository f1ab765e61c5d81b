"""Layout rules: who owns an edge, what a crack shifts, who carries a load."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plates import GLASS
from shapely import LineString, Point, box

from pdmesh.grid import Horizon, Run
from pdmesh.lattice import build_grid
from pdmesh.scene import Crack, Scene, SceneError, Traction, Zone


def scene(**changes: object) -> Scene:
    """8 x 4 mm in one zone of 1 mm."""
    plain = Scene(
        zones=(Zone("all", box(0, 0, 8e-3, 4e-3), 1e-3),),
        cracks=(),
        tractions=(),
        material=GLASS,
        horizon=Horizon(3),
        run=Run(),
    )
    return dataclasses.replace(plain, **changes)  # type: ignore[arg-type]


def test_nodes_on_the_edge_stay_and_are_border() -> None:
    grid, _, shifts = build_grid(scene())
    assert (len(grid), shifts) == (9 * 5, ())
    on_edge = (grid.position == 0).any(axis=1) | (grid.position == [8e-3, 4e-3]).any(axis=1)
    assert (grid.border == on_edge).all()
    assert grid.areas is not None
    assert grid.areas.sum() == pytest.approx(32e-6, rel=1e-12)  # measured 2e-16


def test_the_coarse_zone_owns_a_shared_edge() -> None:
    zones = (Zone("fine", box(0, 0, 8e-3, 4e-3), 1e-3), Zone("coarse", box(0, 4e-3, 8e-3, 8e-3), 2e-3))
    grid, _, _ = build_grid(scene(zones=zones))
    assert (grid.delta[grid.position[:, 1] == 4e-3] == 2e-3).all()
    assert np.unique(grid.position[grid.delta == 1e-3, 1]).tolist() == [0, 1e-3, 2e-3, 3e-3]


def test_a_crack_through_nodes_shifts_the_lattice_by_half_a_spacing() -> None:
    grid, _, shifts = build_grid(scene(cracks=(Crack("c", LineString([(0, 2e-3), (4e-3, 2e-3)])),)))
    assert [(shift.zone, shift.offset) for shift in shifts] == [("all", (0.0, 0.5e-3))]
    assert np.abs(grid.position[:, 1] - 2e-3).min() == pytest.approx(0.5e-3)


def test_mirrored_rows_have_mirrored_bits() -> None:
    zones = (Zone("all", box(0, -20e-3, 10e-3, 20e-3), 1e-3),)
    grid, _, _ = build_grid(scene(zones=zones, cracks=(Crack("c", LineString([(0, 0), (4e-3, 0)])),)))
    rows = np.unique(grid.position[:, 1])
    assert (rows == -rows[::-1]).all()


def test_holes_are_numbered_and_empty() -> None:
    shape = (
        box(0, 0, 20e-3, 10e-3).difference(Point(5e-3, 5e-3).buffer(2.2e-3)).difference(box(12e-3, 3e-3, 16e-3, 7e-3))
    )
    grid, _, _ = build_grid(scene(zones=(Zone("all", shape, 1e-3),)))
    inside = np.hypot(*(grid.position - 5e-3).T) < 2.2e-3 * 0.99
    assert not inside.any()
    first, second = (np.abs(grid.position - centre).max(axis=1) < 4e-3 for centre in ([5e-3, 5e-3], [14e-3, 5e-3]))
    assert set(grid.hole_id[first]) - {-1} == {
        grid.hole_id[np.isclose(grid.position, [5e-3, 3e-3 - 1e-3]).all(axis=1)].item()
    }
    assert set(grid.hole_id[first | second].tolist()) == {-1, 0, 1}
    assert grid.border[grid.hole_id >= 0].all()
    assert (grid.position == [12e-3, 5e-3]).all(axis=1).sum() == 1  # on the edge of the square hole: stays


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_traction_is_carried_by_its_rows(rows: int) -> None:
    _, settings, _ = build_grid(
        scene(tractions=(Traction("top", LineString([(0, 4e-3), (8e-3, 4e-3)]), (0, 1e6), rows),))
    )
    (load,) = settings.conditions
    assert len(load.nodes or ()) == 9 * rows
    assert load.length == pytest.approx(8e-3)


def test_a_zone_too_small_for_its_spacing_is_named() -> None:
    with pytest.raises(SceneError, match=r"zone 'all': spacing: found 0.01 m, expected less than its size 0.008 m"):
        scene(zones=(Zone("all", box(0, 0, 8e-3, 4e-3), 1e-2),))


def test_a_crack_outside_is_named() -> None:
    with pytest.raises(SceneError, match=r"crack 'c': found LINESTRING .* expected it inside the plate"):
        scene(cracks=(Crack("c", LineString([(0, 5e-3), (4e-3, 5e-3)])),))
