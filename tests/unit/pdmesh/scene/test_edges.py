"""Edges of plates and faces of bodies that words pick."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from messages import naming
from shapely import Polygon, box

from pdmesh.quantities import UNITS
from pdmesh.scene.edges import edge
from pdmesh.scene.faces import face
from pdmesh.scene.shapes import Circle, SceneError
from pdmesh.scene.solids import Sheet, Shell, brick

H = 1e-3
BRACKET = Polygon([(0, 0), (80, 0), (80, 20), (20, 20), (20, 60), (0, 60)])
HOLES = [shapely.Point(68, 10).buffer(5, quad_segs=32), shapely.Point(10, 48).buffer(4, quad_segs=32)]
SHAPE = shapely.transform(BRACKET - shapely.union_all(HOLES), lambda points: points * 1e-3)
LENGTHS = {  # mm
    "left": 60,
    "hole nearest 60,10": 2 * np.pi * 5,
    "hole nearest (1, 50)": 2 * np.pi * 4,
    "normal 0,1": 20 + 60,
    "normal 0,3": 20 + 60,
    "normal -1,0": 60,
    "nearest 50,21": 60,
    "nearest 20,40": 40,
    "nearest 69,14": 2 * np.pi * 5,
    "along 0,5 0,15": 10,
    "along (0,15) (0,5)": 10,
    "along 75,0 80,5": 10,
    "along 5,0 0,5": 10,  # over the first corner of the ring
    "along 5 ,0 0, 5": 10,
    "bearing 68,10 toward 0,-1": np.pi * 5,
    "bearing 68,10 toward 1,1": np.pi * 5,
    "along 0.005,0 0,0.005 m": 10,
    "along 0.5,0 0,0.5 cm": 10,
}


@pytest.mark.parametrize("words", LENGTHS)
def test_an_edge_has_its_length(words: str) -> None:
    assert edge(SHAPE, H, words, "edge", UNITS["mm"]).length == pytest.approx(LENGTHS[words] * 1e-3, rel=2e-3)


def test_the_bearing_half_lies_where_the_force_presses() -> None:
    half = edge(SHAPE, H, "bearing 68,10 toward 0,-1", "edge", UNITS["mm"])
    assert half.bounds == pytest.approx((0.063, 0.005, 0.073, 0.010), abs=1e-5)
    assert half.is_simple
    assert not half.is_closed


def test_the_shorter_way_is_taken() -> None:
    line = edge(SHAPE, H, "along 5,0 0,5", "edge", UNITS["mm"])
    assert line.distance(shapely.Point(0, 0)) == 0
    assert line.bounds[2] == pytest.approx(5e-3)


def test_a_tilted_plate_has_edges_that_face_its_direction() -> None:
    turned = shapely.affinity.rotate(box(0, 0, 0.1, 0.02), 30, origin=(0, 0))
    found = edge(turned, H, "normal 0.8660254,0.5", "edge")
    assert found.length == pytest.approx(0.02)
    with pytest.raises(SceneError, match=naming("edge", found="faces")):
        edge(turned, H, "normal 1,0", "edge")


BAD = {
    "": "hole nearest",
    "middle": "left",
    "hole nearest": "X,Y",
    "hole nearest 12": "X,Y",
    "hole nearest 1,2,3": "X,Y",
    "hole nearest 1,2 3,4": "X,Y",
    "hole nearest nan,2": "X,Y",
    "normal 0,0": "direction",
    "along 0,0": "X,Y",
    "along 30,30 0,5": "edge",
    "along 0,5 0,5": "apart",
    "bearing 1,2 toward 0,0": "direction",
    "nearest 12,5 parsec": "X,Y",
}


@pytest.mark.parametrize("words", BAD)
def test_words_that_pick_nothing(words: str) -> None:
    with pytest.raises(SceneError, match=naming("parameter", expected=BAD[words])):
        edge(SHAPE, H, words, "parameter", UNITS["mm"])


def test_a_hole_is_asked_of_a_plate_without_one() -> None:
    with pytest.raises(SceneError, match=naming("edge", found="hole")):
        edge(box(0, 0, 1, 1), H, "hole nearest 0,0", "edge")


def test_faces_of_a_brick() -> None:
    shell = brick((0, 0, 0), (0.08, 0.02, 0.01))
    assert face(shell, "left", "face") == "left"
    for words, area in {"nearest 40,10,11": 0.08 * 0.02, "nearest 81,10,5": 0.02 * 0.01, "normal 0,-1,0": 8e-4}.items():
        found = face(shell, words, "face", UNITS["mm"])
        assert isinstance(found, Sheet)
        assert found.area == pytest.approx(area)
    with pytest.raises(SceneError, match=naming("face", found="faces")):
        face(shell, "normal 1,1,0", "face")
    with pytest.raises(SceneError, match=naming("face", expected="X,Y,Z")):
        face(shell, "nearest 1,2", "face")


def test_a_hole_through_a_plate_is_one_face() -> None:
    ring = shapely.get_coordinates(Circle(0.0, 0.0, 1.0).polygon(0.05).exterior)
    low, high = (np.column_stack([ring, np.full(len(ring), z)]) for z in (0.0, 2.0))
    chords = range(len(ring) - 1)
    wall = [(low[i], low[i + 1], high[i]) for i in chords] + [(low[i + 1], high[i + 1], high[i]) for i in chords]
    top = [((0.0, 0.0, 2.0), high[i], high[i + 1]) for i in chords]
    bottom = [((0.0, 0.0, 0.0), low[i + 1], low[i]) for i in chords]
    cylinder = Shell(np.array([*wall, *top, *bottom], dtype=float), 2 * np.pi)
    found = face(cylinder, "nearest 2,0,1", "face")
    assert isinstance(found, Sheet)
    assert len(found.triangles) == len(wall)
    assert found.area == pytest.approx(2 * np.pi * 2, rel=5e-3)
