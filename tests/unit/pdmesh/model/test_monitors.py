"""Openings, load cells and supports at one node, as a scene, a drawing, a file and settings say them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from messages import naming
from plates import GLASS

from pdmesh import Body, Box, Gap, LoadCell, Run, Scene, SceneError, Static, box, build
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.document import Displacement
from pdsolve.model import GridError, ModelError, read_model

ENDS = ((0.01, 0.0), (0.03, 0.0))


def plate(run: Run | None = None) -> Scene:
    return Scene(box(0, 0, 0.04, 0.02), 1e-3, GLASS, 3, run or Run())


def test_a_support_at_a_point_is_one_node() -> None:
    scene = plate().pin(0.0003, 0, "left").roller(0.04, 0, name="right").fix(shapely.Point(0.02, 0.02), y=-1e-6)
    built = build(scene)
    found = [condition for condition in built.settings.conditions if isinstance(condition, Displacement)]
    assert [(one.name, one.x, one.y) for one in found] == [
        ("left", 0, 0),
        ("right", None, 0),
        ("node at (0.02, 0.02) m", 0, -1e-6),
    ]
    places = [built.grid.position[np.array(one.nodes) - 1].tolist() for one in found]
    assert places == [[[0, 0]], [[0.04, 0]], [[0.02, 0.02]]]
    with pytest.raises(SceneError, match=naming("roller 'a'", found="z", expected="x or y")):
        plate().roller(0, 0, along="z", name="a")  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=naming("load", found="a point", expected="body force")):
        plate().load(shapely.Point(0, 0), traction=(0, 1))
    with pytest.raises(SceneError, match=naming("displacement 'far'", found="away")):
        plate().pin(1, 1, "far")


def test_gaps_and_load_cells_of_a_scene() -> None:
    scene = plate().pin(0, 0, "left").roller(0.04, 0, name="right")
    run = build(scene.gap("mouth", *ENDS).load_cell("supports", "left", "right")).settings.run
    assert run.gaps == (Gap("mouth", ENDS),)
    assert run.load_cells == (LoadCell("supports", ("left", "right")),)


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (Run(gaps=(Gap("a", ENDS), Gap("a", ENDS))), naming("gaps[0].name", found=("'a'", "2 times"))),
        (Run(gaps=(Gap("a", (ENDS[0], ENDS[0])),)), naming("gaps[0].ends")),
        (Run(load_cells=(LoadCell("c", ("lift",)),)), naming("load_cells[0].of", found="'lift'", expected="left")),
        (Run(load_cells=(LoadCell("c", ()),)), naming("load_cells[0].of")),
        (Run(static=Static(control="a", opening=1e-3)), naming("static.control", found="'a'", expected="gap")),
        (Run(static=Static(opening=1e-3)), naming("static.control", found="missing")),
        (Run(gaps=(Gap("a", ENDS),), static=Static(control="a")), naming("static.opening", found="missing")),
    ],
)
def test_monitors_that_contradict(run: Run, said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=said):
        build(plate(run).pin(0, 0, "left"))
    path = tmp_path / "plate.json"
    build(plate().pin(0, 0, "left")).write(path)
    words = {"gaps": run.gaps, "load_cells": run.load_cells, "static": run.static}
    text = {name: "{}" for name in words}
    text["gaps"] = str([{"name": g.name, "ends": [list(end) for end in g.ends]} for g in run.gaps])
    text["load_cells"] = str([{"name": c.name, "of": list(c.of)} for c in run.load_cells])
    static = [(f"run.static.{name}", str(getattr(run.static, name))) for name in ("control", "opening")]
    given = [(f"run.{name}", text[name].replace("': ", "' = ")) for name in ("gaps", "load_cells")]
    given += [(name, value) for name, value in static if value != "None"]
    with pytest.raises((ModelError, GridError), match=said):
        read_model(path, None, given)


@pytest.mark.slow
def test_a_gap_off_the_plate_is_refused() -> None:
    with pytest.raises(SceneError, match=naming("gap 'a'", found="away")):
        plate().gap("a", (0, 0), (0, 0.5))
    block = Body(Box((0, 0, 0), (4, 4, 4)), 1.0, GLASS)
    with pytest.raises(SceneError, match=naming("gap 'a'", found="away")):
        build(block.gap("a", (0, 0, 0), (0, 0, 9)))


@pytest.mark.slow
def test_a_gap_between_two_bodies() -> None:
    beside = plate().body(box(0.05, 0, 0.06, 0.02), "striker").gap("a", (0.04, 0.01), (0.05, 0.01))
    assert build(beside).settings.run.gaps[0].ends[1] == (0.05, 0.01)
    blocks = Body(Box((0, 0, 0), (4, 4, 4)), 1.0, GLASS).body(Box((6, 0, 0), (10, 4, 4)), "striker")
    assert build(blocks.gap("a", (4, 2, 2), (6, 2, 2))).settings.run.gaps[0].ends[1] == (6, 2, 2)


DRAWING = """
Point(1) = {0, 0, 0}; Point(2) = {0.04, 0, 0}; Point(3) = {0.04, 0.02, 0}; Point(4) = {0, 0.02, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Physical Surface("zone:plate") = {1};
Physical Point("fix:left") = {1};
Physical Point("fix:right") = {2};
Physical Point("gap:mouth") = {%s};
DefineConstant[
  h = {1e-3, Name "Peridynamics/Zones/plate/Spacing"}, E = {65e9, Name "Peridynamics/Material/E"},
  rho = {2235, Name "Peridynamics/Material/rho"}, G0 = {204, Name "Peridynamics/Material/G0"},
  held = {"y", Name "Peridynamics/Fixes/right/Components"},
  of = {"left, right", Name "Peridynamics/Load cells/supports/Of"}
];
"""


@pytest.mark.slow
def test_points_of_a_drawing(tmp_path: Path) -> None:
    pytest.importorskip("gmsh", exc_type=OSError)
    path = tmp_path / "beam.geo"
    path.write_text(DRAWING % "3, 4")
    run = build_file(path).settings.run
    assert run.gaps == (Gap("mouth", ((0.04, 0.02), (0.0, 0.02))),) or run.gaps == (
        Gap("mouth", ((0.0, 0.02), (0.04, 0.02))),
    )
    assert run.load_cells == (LoadCell("supports", ("left", "right")),)
    held = [c for c in build_file(path).settings.conditions if isinstance(c, Displacement)]
    assert [(len(c.nodes or ()), c.x, c.y) for c in held] == [(1, 0, 0), (1, None, 0)]
    path.write_text(DRAWING % "3")
    with pytest.raises(SceneError, match=naming("gap 'mouth'", found="1 points", expected="two")):
        build_file(path)


BLOCK = Body(Box((0, 0, 0), (0.04, 0.02, 0.01)), 2e-3, GLASS)


@pytest.mark.process
def test_supports_and_monitors_of_a_body() -> None:
    """Nodes are the middles of cubes of 2 mm."""
    body = (
        BLOCK.pin(0, 0, 0, "left").roller(0.04, 0, 0, "xy", "right").load(shapely.Point(0.02, 0.02, 0), force=(0, 1, 0))
    )
    built = build(body.gap("mouth", (0.01, 0, 0), (0.03, 0, 0)).load_cell("supports", "left", "right"))
    left, right, load = built.settings.conditions
    assert isinstance(left, Displacement)
    assert isinstance(right, Displacement)
    assert [(one.name, one.x, one.y, one.z) for one in (left, right)] == [("left", 0, 0, 0), ("right", None, None, 0)]
    places = [built.grid.position[np.array(one.nodes) - 1] for one in (left, right, load)]
    np.testing.assert_allclose(places, [[[1e-3] * 3], [[0.039, 1e-3, 1e-3]], [[0.019, 0.019, 1e-3]]], atol=1e-12)
    assert built.settings.run.gaps == (Gap("mouth", ((0.01, 0, 0), (0.03, 0, 0))),)
    assert built.settings.run.load_cells == (LoadCell("supports", ("left", "right")),)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: BLOCK.roller(0, 0, 0, "xyz", "a"), naming("roller 'a'", found="xyz", expected="one or two")),
        (lambda: build(BLOCK.pin(1, 1, 1, "far")), naming("displacement 'far'", found="away")),
        (lambda: build(BLOCK.load(shapely.Point(0, 0, 0), (1, 0, 0))), naming("load", found="at a point")),
        (lambda: BLOCK.fix(shapely.Point(0, 0)), naming("displacement", found="(0.0, 0.0)", expected="3")),
        (lambda: BLOCK.gap("a", (0, 0), (1, 1)), naming("gap 'a'", found="(0, 0)", expected="3")),
        (lambda: build(BLOCK.gap("a", (0, 0, 0), (1, 1, 1))), naming("gap 'a'", found="(1, 1, 1)")),
        (lambda: build(BLOCK.load_cell("c", "lift")), naming("load_cells[0].of", found="'lift'")),
    ],
)
def test_bad_supports_and_monitors_of_a_body(make: Callable[[], object], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        make()


DRAWN = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.04, 0.02, 0.01};
Point(101) = {0.01, 0, 0};
Point(102) = {0.03, 0, 0};
Physical Volume("zone:all") = {1};
Physical Point("gap:mouth") = {101, 102};
Physical Point("fix:pin") = {101};
DefineConstant[
  spacing = {2e-3, Name "Peridynamics/Zones/all/Spacing"}
  right = {"0.04,0,0", Name "Peridynamics/Fixes/right/Node"}
  held = {"yz", Name "Peridynamics/Fixes/right/Components"}
  cell = {"pin, right", Name "Peridynamics/Load cells/supports/Of"}
];
"""


@pytest.mark.slow
def test_supports_and_monitors_of_a_body_that_is_drawn(tmp_path: Path) -> None:
    path = tmp_path / "block.geo"
    path.write_text(DRAWN, encoding="utf-8")
    settings = build_file(path).settings
    pin, right = settings.conditions
    assert isinstance(pin, Displacement)
    assert isinstance(right, Displacement)
    assert [(one.name, one.x, one.y, one.z, len(one.nodes or ())) for one in (pin, right)] == [
        ("pin", 0, 0, 0, 1),
        ("right", None, 0, 0, 1),
    ]
    assert settings.run.gaps == (Gap("mouth", ((0.01, 0, 0), (0.03, 0, 0))),)
    assert settings.run.load_cells == (LoadCell("supports", ("pin", "right")),)
    path.write_text(DRAWN.replace("{101, 102}", "{101}"), encoding="utf-8")
    with pytest.raises(SceneError, match=naming("gap 'mouth'", found="1 points", expected="two")):
        build_file(path)
    path.write_text(DRAWN + 'Physical Curve("crack:a") = {1};\n', encoding="utf-8")
    with pytest.raises(SceneError, match=naming("crack:a", expected='Surface("crack:a")')):
        build_file(path)
