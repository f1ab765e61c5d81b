"""The lattice of a plate whose fine zone is to move: the finest spacing everywhere, cracks between its nodes."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from shapely import LineString, Point

from pdmesh import Circle, Material, Medium, Run, Scene, SceneError, box
from pdmesh.grid.adaptive_scene import nested
from pdmesh.grid.building import build
from pdmesh.grid.implicit_lattice import lattice_of
from pdmesh.reports.report import nodes_by_spacing

GLASS = Material(E=72e9, rho=2440, G0=135)
H = 1e-3


def plate() -> Scene:
    """A plate of 20 x 20 mm with a zone of 1 mm between its nodes."""
    return Scene(box(0, 0, 0.02, 0.02), 2 * H, GLASS).zone(box(0, 0.006, 0.02, 0.014), H, "fine").adapt()


@pytest.mark.parametrize(
    ("line", "way"),
    [
        ([(0, 0.01), (0.01, 0.01)], (0.0, H / 2)),  # from an edge, along it: across itself
        ([(0.01, 0), (0.01, 0.01)], (H / 2, 0.0)),
        ([(0, 0.0105), (0.01, 0.0105)], (0.0, 0.0)),  # between nodes
        ([(0, 0.01), (0.005, 0.01), (0.01, 0.015)], (0.0, H / 2)),
        ([(0.005, 0.005), (0.015, 0.015)], (0.0, H / 2)),
    ],
)
def test_a_crack_on_nodes_is_moved(line: list[tuple[float, float]], way: tuple[float, float]) -> None:
    """By half a spacing; the lattice stays on the plate's edges, and it is said."""
    built = build(plate().crack(line, "notch"))
    grid = built.grid
    assert np.unique(grid.delta).tolist() == [H]
    assert len(grid) == 21 * 21
    assert grid.position.min() == 0.0
    found = LineString([grid.cracks[0, :2], *grid.cracks[:, 2:]])
    assert np.allclose(np.array(found.coords), np.array(line) + way, atol=1e-12)
    assert min(found.distance(Point(place)) for place in grid.position) > 0.1 * H
    moved = [note for note in built.notes if "moved by" in note]
    assert moved == ([f"crack 'notch': moved by ({way[0]:g}, {way[1]:g}) m, off the nodes"] if any(way) else [])
    assert any("nodes of 0.001 m everywhere" in note for note in built.notes)
    assert not built.shifts


def test_a_crack_that_meets_nodes_everywhere_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were nodes as wide as cells."""
    monkeypatch.setattr("pdmesh.grid.adaptive_scene.CLEARANCE", 0.6)
    with pytest.raises(SceneError, match=naming(found=("node", "0.001 m"))):
        nested(plate().crack([(0, 0.01), (0.01, 0.01)], "notch"))


def test_a_rectangle_may_have_more_nodes_than_are_listed() -> None:
    """25 million, of which none is; with a hole they are refused, and so are 900 million."""
    run = Run(adapt="hybrid")
    large = Scene(box(0, 0, 5, 5), H, GLASS, 3, run)
    grid = build(large).grid
    assert len(grid) == 5001**2
    assert grid.size == pytest.approx(25.0, rel=1e-12)
    assert nodes_by_spacing(grid) == {"0.001": 5001**2}
    assert not {"areas", "position"} & set(grid.__dict__)
    with pytest.raises(SceneError, match=naming("spacing", found="0.001 m", expected="2e+07")):
        build(large.hole(Circle(2.5, 2.5, 0.5)))
    with pytest.raises(SceneError, match=naming("spacing", found="0.001 m", expected="2e+07")):
        Scene(box(0, 0, 5, 5), H, GLASS)
    with pytest.raises(SceneError, match=naming("spacing", found="0.001 m", expected="4e+08")):
        Scene(box(0, 0, 19, 30), H, GLASS, 3, run, units="m")


def test_a_large_plate_that_conducts_lists_its_nodes() -> None:
    """So its file has the medium, its physics and its conditions; one of mechanics alone holds the lattice."""
    heats = Material(E=70e9, rho=2500.0, G0=8.0, alpha=9e-6, T0=293.0)
    assert lattice_of(Scene(box(0, 0, 0.3, 0.2), H, GLASS).adapt()) is not None
    assert lattice_of(Scene(box(0, 0, 0.3, 0.2), H, heats, medium=Medium(D=1e-6)).adapt()) is None
