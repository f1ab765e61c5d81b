"""The visibility principle, pair by pair, and how levels are graded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from messages import naming
from scipy.spatial import cKDTree

from pdmesh import Circle, Scene, SceneError, box
from pdmesh.grid.lattice import place_nodes
from pdmesh.grid.zones import levels


def violations(scene: Scene) -> tuple[int, int, int]:
    """Over every pair (i, j) that i sees: pairs in all; spacings more than a step apart; coarse i, j to be finer."""
    nodes = place_nodes(scene)
    reach = scene.horizon * nodes.delta
    pairs = cKDTree(nodes.position).query_pairs(float(reach.max()) * (1 + 1e-9), output_type="ndarray")
    source, target = np.concatenate([pairs, pairs[:, ::-1]]).T
    length = np.hypot(*(nodes.position[source] - nodes.position[target]).T)
    seen = length <= reach[source] * (1 + 1e-9)
    source, target = source[seen], target[seen]
    ratio = nodes.delta[source] / nodes.delta[target]
    stepped = ((ratio > 2 * (1 + 1e-9)) | (ratio < 0.5 * (1 - 1e-9))).sum()
    wanted = np.full(len(nodes.delta), scene.spacing)
    for zone in scene.zones:
        inside = shapely.contains_xy(zone.shape.buffer(1e-6 * zone.spacing), nodes.position)
        wanted[inside] = np.minimum(wanted[inside], zone.spacing)
    unheeded = (nodes.delta[source] > wanted[target] * (1 + 1e-9)).sum()
    return len(source), int(stepped), int(unheeded)


def nested(plate: Scene) -> Scene:
    return replace(plate, spacing=2e-3).zone(box(0.01, 0, 0.03, 0.02), 1e-3).zone(box(0.018, 0.008, 0.022, 0.012), 5e-4)


SCENES = {
    "nested zones": nested,
    "three steps at once": lambda plate: replace(plate, spacing=2e-3).zone(box(0.02, 0.01, 0.0225, 0.0125), 2.5e-4),
    "round": lambda plate: plate.zone(Circle(0.02, 0.01, 0.003), 5e-4),
    "off the lattice": lambda plate: plate.zone(box(0.0203, 0.0077, 0.0241, 0.0109), 5e-4),
    "two apart": lambda plate: plate.zone(box(0, 0, 0.004, 0.004), 5e-4).zone(box(0.03, 0.01, 0.033, 0.012), 2.5e-4),
    "across a crack": lambda plate: plate.crack([(0, 0.01), (0.02, 0.01)]).zone(box(0.01, 0.005, 0.03, 0.015), 5e-4),
}


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("name", SCENES)
def test_no_node_sees_a_place_that_was_to_be_finer(name: str, plate: Scene) -> None:
    pairs, stepped, unheeded = violations(SCENES[name](plate))
    assert pairs > 20_000
    assert unheeded == 0
    assert stepped == 0


def test_zones_as_drawn_are_seen_from_outside(plate: Scene) -> None:
    drawn = plate.zone(box(0.015, 0.005, 0.025, 0.015), 5e-4, grown=False)
    _, stepped, unheeded = violations(drawn)
    assert stepped == 0
    assert unheeded > 1000


def test_zones_as_drawn_are_still_graded(plate: Scene) -> None:
    drawn = plate.zone(box(0.015, 0.005, 0.025, 0.015), 2.5e-4, grown=False)
    assert [level.spacing for level in levels(drawn)] == [1e-3, 5e-4, 2.5e-4]
    assert levels(drawn)[-1].shape.equals(box(0.015, 0.005, 0.025, 0.015))
    assert violations(drawn)[1] == 0


def test_a_zone_is_grown_by_the_old_horizon(plate: Scene) -> None:
    coarse, fine = levels(plate.zone(box(0.01, 0, 0.02, 0.02), 5e-4))
    assert fine.shape.bounds == pytest.approx((0.006, 0, 0.024, 0.02), abs=1e-12)  # 3 mm, and the cell that touches
    assert coarse.shape.area + fine.shape.area == pytest.approx(plate.shape.area, rel=1e-12)


def test_levels_are_the_plate(plate: Scene) -> None:
    scene = nested(plate).hole(Circle(0.02, 0.01, 0.001))
    found = levels(scene)
    assert sum(level.shape.area for level in found) == pytest.approx(scene.shape.area, rel=1e-12)
    assert all(a.shape.intersection(b.shape).area < 1e-15 for a in found for b in found if a is not b)


@pytest.mark.parametrize("target", ["crack", "notch", "hole"])
def test_refine_without_drawing(target: str, plate: Scene) -> None:
    scene = plate.crack([(0, 0.0105), (0.01, 0.0105)]).notch([(0.018, 0.02), (0.02, 0.016), (0.022, 0.02)])
    scene = scene.hole(Circle(0.033, 0.007, 0.003)).refine(target, 1.5e-3)  # type: ignore[arg-type]
    places = {
        "crack": shapely.LineString([(0, 0.0105), (0.01, 0.0105)]),
        "notch": shapely.Point(0.02, 0.016),
        "hole": shapely.Point(0.033, 0.007).buffer(0.003).exterior,
    }
    nodes = place_nodes(scene)
    distance = shapely.distance(shapely.points(nodes.position), places[target])
    assert set(nodes.delta[distance <= 1.5e-3 + 3e-3].tolist()) == {5e-4}  # the distance, then the old horizon
    assert set(nodes.delta[distance > 1.5e-3 + 3e-3 + 2e-3].tolist()) == {1e-3}


def test_refine_finds_nothing_to_refine(plate: Scene) -> None:
    with pytest.raises(SceneError, match=naming("refine hole")):
        levels(plate.refine("hole", 1e-3))


def test_the_given_spacing_of_a_refinement_is_kept(plate: Scene) -> None:
    scene = plate.crack([(0, 0.0105), (0.01, 0.0105)]).refine("crack", 1e-3, 2.5e-4)
    assert [level.spacing for level in levels(scene)] == [1e-3, 5e-4, 2.5e-4]
