"""Where the nodes are: off the cracks, on the edges, out of the holes."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from messages import naming

from pdmesh import Circle, Scene, SceneError, box
from pdmesh.grid.building import build
from pdmesh.grid.lattice import build_grid, place_nodes

TURN = np.linspace(0, np.pi, 40)
CRACKS = {
    "on a row": [[(0, 0.01), (0.02, 0.01)]],
    "on a column": [[(0.02, 0), (0.02, 0.01)]],
    "diagonal through nodes": [[(0.01, 0.005), (0.02, 0.015)]],
    "kinked": [[(0, 0.01), (0.01, 0.01), (0.018, 0.014), (0.018, 0.02)]],
    "curved": [list(zip(0.02 + 0.007 * np.cos(TURN), 0.008 + 0.007 * np.sin(TURN), strict=True))],
    "several": [[(0, 0.005), (0.01, 0.005)], [(0.03, 0.015), (0.04, 0.015)], [(0.02, 0.003), (0.02, 0.012)]],
}


def clearance(scene: Scene) -> float:
    """The least distance of a node to a crack, in its spacing."""
    nodes = place_nodes(scene)
    cracks = shapely.union_all([crack.line for crack in scene.cracks])
    return float((shapely.distance(shapely.points(nodes.position), cracks) / nodes.delta).min())


@pytest.mark.quick_cases(8)
@pytest.mark.parametrize("name", CRACKS)
@pytest.mark.parametrize("zoned", [False, True])
def test_no_crack_meets_a_node(name: str, zoned: bool, plate: Scene) -> None:
    scene = plate.zone(box(0.005, 0.002, 0.022, 0.016), 5e-4, grown=False) if zoned else plate
    for line in CRACKS[name]:
        scene = scene.crack(line)
    assert clearance(scene) > 1e-3
    for shift in place_nodes(scene).shifts:
        assert max(map(abs, shift.offset)) <= shift.spacing / 2
        assert any(shift.offset)


def test_a_crack_between_rows_moves_nothing(plate: Scene) -> None:
    scene = plate.crack([(0, 0.0105), (0.02, 0.0105)])
    assert place_nodes(scene).shifts == ()
    assert clearance(scene) == pytest.approx(0.5, abs=1e-9)


def test_a_row_is_cleared_by_half_a_spacing_and_said_so(plate: Scene) -> None:
    (shift,) = place_nodes(plate.crack([(0, 0.01), (0.02, 0.01)])).shifts
    assert (shift.spacing, shift.offset) == (1e-3, (0.0, 5e-4))


@pytest.mark.slow
def test_cracks_that_leave_no_room(plate: Scene) -> None:
    for number in range(17):
        plate = plate.crack([(0.001, 0.005 + number * 6.25e-5), (0.039, 0.005 + number * 6.25e-5)])
        plate = plate.crack([(0.005 + number * 6.25e-5, 0.001), (0.005 + number * 6.25e-5, 0.019)])
    with pytest.raises(SceneError, match=naming(expected=("cracks", "nodes"))):
        place_nodes(plate)


def test_nodes_on_edges_stay_and_inside_holes_go(plate: Scene) -> None:
    scene = plate.hole(box(0.01, 0.005, 0.015, 0.01)).notch([(0.02, 0.02), (0.025, 0.015), (0.03, 0.02)])
    position = place_nodes(scene).position
    assert len(position) == 41 * 21 - 4 * 4 - 25  # inside a square of 5; above the flanks of a notch of 5
    edge = shapely.LinearRing([(0.01, 0.005), (0.015, 0.005), (0.015, 0.01), (0.01, 0.01)])
    assert (shapely.distance(edge, shapely.points(position)) < 1e-12).sum() == 20


def test_coarse_nodes_own_the_shared_edge(plate: Scene) -> None:
    scene = plate.zone(box(0.01, 0, 0.03, 0.02), 5e-4, grown=False)
    nodes = place_nodes(scene)
    x = np.round(nodes.position[:, 0] * 1e3, 9)
    assert x[nodes.delta == 1e-3].tolist().count(10) == 21
    assert x[nodes.delta == 5e-4].min() == 10.5
    assert x[nodes.delta == 5e-4].max() == 29.5


def test_no_fine_node_is_left_beside_a_coarse_one(plate: Scene) -> None:
    scene = plate.zone(box(0, 0.005, 0.04, 0.015), 5e-4, grown=False).crack([(0.01, 0.01), (0.02, 0.01)])
    nodes = place_nodes(scene)
    fine = nodes.position[nodes.delta == 5e-4]
    assert fine[:, 1].min() == pytest.approx(0.00575)  # the row at 5.25 mm would be a quarter off the coarse one
    gaps = shapely.distance(shapely.points(fine), shapely.multipoints(nodes.position[nodes.delta == 1e-3]))
    assert gaps.min() >= 0.75 * 5e-4


def test_border_and_holes(plate: Scene) -> None:
    scene = plate.hole(Circle(0.03, 0.01, 0.003)).hole(Circle(0.01, 0.01, 0.002))
    grid, _, _ = build_grid(scene)
    x, y = grid.position.T
    left, right = np.hypot(x - 0.01, y - 0.01), np.hypot(x - 0.03, y - 0.01)
    assert (grid.hole_id == 0).tolist() == (left < 0.003 * (1 - 1e-6)).tolist()  # holes count from left to right
    assert (grid.hole_id == 1).tolist() == (right < 0.004 * (1 - 1e-6)).tolist()
    edge = (x < 9e-4) | (x > 0.0391) | (y < 9e-4) | (y > 0.0191)
    assert grid.border.tolist() == (edge | (grid.hole_id >= 0)).tolist()


def test_mirrored_nodes_have_mirrored_bits() -> None:
    scene = Scene(box(-0.0137, -0.0071, 0.0137, 0.0071), 1e-4)
    position = place_nodes(scene).position
    points = set(map(tuple, position.tolist()))
    assert {(-x, -y) for x, y in points} == points


@pytest.mark.parametrize("shape", ["plate", "holes", "zones"])
def test_cells_are_exact(shape: str, plate: Scene) -> None:
    scene = {
        "plate": plate,
        "holes": plate.hole(Circle(0.0123, 0.0087, 0.0041)).notch([(0.03, 0), (0.033, 0.0083), (0.037, 0)]),
        "zones": plate.zone(Circle(0.02, 0.01, 0.003), 2.5e-4).crack([(0, 0.01), (0.02, 0.01)]),
    }[shape]
    grid, _, _ = build_grid(scene)
    assert grid.areas is not None
    assert abs(grid.areas.sum() / scene.shape.area - 1) < 1e-10  # measured: 4e-16
    cells = shapely.get_parts(
        shapely.voronoi_polygons(shapely.multipoints(grid.position), extend_to=scene.shape.envelope, ordered=True)
    )
    whole = shapely.area(shapely.intersection(shapely.make_valid(cells), scene.shape))
    assert np.abs(grid.areas - whole).max() < 1e-12 * scene.spacing  # m^2; measured: 1e-19


def test_a_zone_too_small_for_its_nodes(plate: Scene) -> None:
    scene = plate.zone(box(0.0201, 0.0101, 0.0209, 0.0104), 5e-4, grown=False)
    with pytest.raises(SceneError, match=naming("zone '1'", found="node")):
        place_nodes(scene)


@pytest.mark.endurance
@pytest.mark.timeout(200)  # 22 s; over 400 s when segments overlapped and each node was measured to each of them
def test_a_crack_of_a_million_points(plate: Scene) -> None:
    """Moves the same nodes as the same crack of two points does."""
    ends = np.array([[0.01, 0.0102], [0.03, 0.0098]])
    points = ends[0] + np.linspace(0, 1, 1_000_000)[:, None] * (ends[1] - ends[0])
    many, few = (build(plate.crack(line)) for line in (points, ends))
    assert many.grid.cracks.shape == (999_999, 4)
    assert np.array_equal(many.grid.position, few.grid.position)
    assert many.notes == few.notes
