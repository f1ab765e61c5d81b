"""Cracks as they are in the plate: trimmed to its edge, put onto it, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from messages import mentions, naming

from pdmesh import Circle, Scene, SceneError, box
from pdmesh.grid.lattice import build_grid, place_nodes

DISC = Circle(0.0, 0.0, 0.01)  # m; its chords are off by up to 10 um where nodes are 1 mm apart
TURN = np.pi / 2 * 0.37  # to a place of the circle that is no corner of its polygon


def ends_on_edge(scene: Scene) -> list[float]:
    """How far both ends of the only crack are from the plate's edge, m."""
    ends = shapely.get_coordinates(scene.slits[0].line)[[0, -1]]
    return shapely.distance(shapely.points(ends), scene.shape.boundary).tolist()


def radial(scene: Scene, start: float, end: float) -> Scene:
    """With a crack along a radius, between two distances from the middle, m."""
    way = np.array([np.cos(TURN), np.sin(TURN)])
    return scene.crack([tuple(start * way), tuple(end * way)], "ray")


@pytest.mark.slow
@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("spacing", [1e-3, 1e-4])
@pytest.mark.parametrize("start", [0.01, 0.0102, 0.0109])
def test_a_crack_that_overshoots_a_curved_edge_is_trimmed_and_said_so(start: float, spacing: float) -> None:
    scene = radial(Scene(DISC, spacing), start, 0.004)
    ((name, line, notes),) = scene.slits
    assert name == "ray"
    assert ends_on_edge(scene)[0] < 1e-12
    assert ends_on_edge(scene)[1] == pytest.approx(0.006, abs=1e-5)
    assert line.length == pytest.approx(0.006, abs=1.1e-5)  # but for the chord
    (note,) = notes
    assert note.startswith("crack 'ray': its end at (")
    assert mentions(note, "onto", "plate's edge")
    assert build_grid(scene)[0].cracks == pytest.approx(shapely.get_coordinates(line).reshape(1, 4))


def test_a_crack_that_starts_on_a_hole_is_put_onto_its_chords() -> None:
    """The chords of a hole are inside it, so that a crack from the circle starts beside the edge."""
    scene = radial(Scene(box(-0.02, -0.02, 0.02, 0.02), 1e-3).hole(DISC), 0.01, 0.015)
    ((_, line, notes),) = scene.slits
    assert len(notes) == 1
    assert ends_on_edge(scene)[0] < 1e-12
    assert line.length > 0.005
    x, y = shapely.get_coordinates(line)[0]
    assert np.arctan2(y, x) == pytest.approx(TURN, abs=1e-12)  # straight on


def test_a_crack_is_trimmed_at_both_ends_and_keeps_its_sense_and_kinks() -> None:
    scene = Scene(box(0, 0, 0.04, 0.02), 1e-3).crack([(0.0405, 0.0105), (0.02, 0.0125), (-0.0005, 0.0105)], "cut")
    line = shapely.get_coordinates(scene.slits[0].line)
    assert line[:, 0].tolist() == pytest.approx([0.04, 0.02, 0])
    assert len(scene.slits[0].notes) == 2


def test_a_crack_in_the_plate_stays_as_it_is() -> None:
    points = [(0, 0.0105), (0.01, 0.0105), (0.015, 0.012)]
    ((_, line, notes),) = Scene(box(0, 0, 0.04, 0.02), 1e-3).crack(points).slits
    assert list(line.coords) == points
    assert notes == ()


def test_a_hole_that_comes_after_the_crack_trims_it_too() -> None:
    scene = Scene(box(0, 0, 0.04, 0.02), 1e-3).crack([(0, 0.0105), (0.0157, 0.0105)])
    assert ends_on_edge(scene.hole(Circle(0.02, 0.0105, 0.005)))[1] < 1e-12


REFUSED = {
    "too far out": ([(0.01, 0.0105), (0.051, 0.0105)], r"\(0.051, 0.0105\) m outside.* at most 0.01025 m"),
    "out of it in the middle": ([(0.01, 0.0195), (0.02, 0.0203), (0.03, 0.0195)], "outside the plate"),
    "all of it outside": ([(0.0401, 0.01), (0.0405, 0.01)], "outside the plate"),
    "along the edge": ([(0, 0.02), (0.01, 0.02)], r"along the plate's edge from \(0, 0.02\) to \(0.01, 0.02\) m"),
    "as good as along it": ([(0.02, 0), (0.02, 1e-5), (0.03, 1e-5)], "along the plate's edge"),
    "along it in part": ([(0.01, 0.01), (0.01, 0), (0.02, 0)], "along the plate's edge"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    points, message = REFUSED[name]
    with pytest.raises(SceneError, match=f"crack 'a'.*{message}"):
        Scene(box(0, 0, 0.04, 0.02), 1e-3).crack(points, "a")


def test_along_a_curved_edge() -> None:
    turn = np.linspace(0, 1, 30)
    with pytest.raises(SceneError, match=naming("crack '1'", found="plate's edge")):
        Scene(DISC, 1e-3).crack(list(zip(0.01 * np.cos(turn), 0.01 * np.sin(turn), strict=True)))


def test_a_slanting_crack_from_the_edge_is_not_along_it() -> None:
    scene = Scene(box(0, 0, 0.04, 0.02), 1e-3).crack([(0, 0), (0.02, 0.002)])
    assert place_nodes(scene).position.size > 0


@pytest.mark.process
def test_an_arc_of_gmsh(tmp_path: Path) -> None:
    """A crack drawn from the middle of an arc, where the grid has a chord."""
    pytest.importorskip("gmsh", exc_type=OSError)
    from pdmesh.drawing.file_reading import build_file

    path = tmp_path / "disc.geo"
    path.write_text(
        """SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 10}; Point(9) = {10*Cos(0.37), 10*Sin(0.37), 0};
        Point(10) = {3*Cos(0.37), 3*Sin(0.37), 0}; Line(9) = {9, 10};
        Physical Surface("zone:disc") = {1}; Physical Curve("crack:ray") = {9};\n"""
    )
    built = build_file(path, [("Units", "mm"), ("Zones/disc/Spacing", "0.5")])
    assert any(mentions(note, "crack 'ray'", "end") for note in built.notes)
    ((x, y, _, _),) = built.grid.cracks
    assert np.hypot(x, y) == pytest.approx(0.01, abs=0.01 * 0.5e-3)
