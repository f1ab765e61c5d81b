"""Zones of drawings in which no group names one, and groups of every kind that others draw."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from messages import mentions, naming

pytest.importorskip("gmsh", exc_type=OSError)

import gmsh

from pdmesh import Scene, SceneError
from pdmesh.drawing.file_reading import build_file
from pdmesh.drawing.geo import read_geo
from pdmesh.drawing.sandbox.zone_groups import add_zones, dimension_of, with_names
from pdmesh.scene.body import Body

MATERIAL = [("Material/E", "2e11"), ("Material/rho", "7850"), ("Material/G0", "1e3")]


@pytest.fixture
def drawing() -> Iterator[Any]:
    """Two rectangles and a line in Gmsh."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for x in (0, 1):
            gmsh.model.occ.addRectangle(x, 0, 0, 1, 1, x + 1)
        gmsh.model.occ.synchronize()
        yield gmsh
    finally:
        gmsh.finalize()


def groups(drawing: Any) -> dict[str, list[int]]:
    """Shapes of the groups by name."""
    return {
        drawing.model.getPhysicalName(*group): sorted(drawing.model.getEntitiesForPhysicalGroup(*group).tolist())
        for group in drawing.model.getPhysicalGroups()
    }


def test_without_groups_all_shapes_are_a_zone(drawing: Any) -> None:
    assert dimension_of(drawing) == 2
    assert add_zones(drawing, 2, []) == [{"name": "plate", "groups": []}]
    assert groups(drawing) == {"zone:plate": [1, 2]}


def test_groups_without_a_kind_are_a_zone_under_the_name_of_its_parameter(drawing: Any) -> None:
    drawing.model.addPhysicalGroup(2, [2], 7, "My surface")
    drawing.model.addPhysicalGroup(1, [1], 5)
    assert add_zones(drawing, 2, ["p"]) == [{"name": "p", "groups": [7]}]
    assert groups(drawing) == {"": [1], "My surface": [2], "zone:p": [2]}


def test_parameters_name_the_groups_that_are_zones(drawing: Any) -> None:
    for tag, name in ((1, "left half"), (2, "rechte Hälfte")):
        drawing.model.addPhysicalGroup(2, [tag], tag, name)
    assert [zone["name"] for zone in add_zones(drawing, 2, ["rechte Hälfte"])] == ["rechte Hälfte"]
    assert groups(drawing)["zone:rechte Hälfte"] == [2]
    assert "zone:left half" not in groups(drawing)


def test_zones_with_a_name_stay_the_only_ones(drawing: Any) -> None:
    drawing.model.addPhysicalGroup(2, [1], 1, "zone:p")
    drawing.model.addPhysicalGroup(2, [2], 2, "other")
    assert add_zones(drawing, 2, ["p", "q"]) == []
    assert dimension_of(drawing) == 2


def test_bodies_beside_are_in_no_zone(drawing: Any) -> None:
    drawing.model.addPhysicalGroup(2, [2], 1, "body:ram")
    assert add_zones(drawing, 2, ["p"]) == [{"name": "p", "groups": []}]
    assert groups(drawing) == {"body:ram": [2], "zone:p": [1]}


def test_bodies_of_parameters_are_in_no_zone(drawing: Any) -> None:
    for tag, name in ((1, "plate"), (2, "ram")):
        drawing.model.addPhysicalGroup(2, [tag], tag, name)
    assert add_zones(drawing, 2, ["p"], ["ram"]) == [{"name": "p", "groups": [1]}]
    assert groups(drawing)["zone:p"] == [1]


def test_several_names_without_groups_make_no_zone(drawing: Any) -> None:
    assert add_zones(drawing, 2, ["p", "q"]) == []
    assert groups(drawing) == {}


def test_what_gmsh_says_of_a_group_names_it(drawing: Any) -> None:
    """Shapes that are not there matter in groups of ours alone."""
    drawing.model.addPhysicalGroup(1, [1], 3, "load:top")
    drawing.model.addPhysicalGroup(2, [1], 3, "Inlet")
    missing = "Warning: Skipping unknown {0} 99 in physical {0} 3"
    ours, others = with_names(drawing, ["Error: a", missing.format("curve"), missing.format("surface")])
    assert ours == ["Error: a", missing.format("curve") + ' ("load:top")']
    assert others == [missing.format("surface") + ' ("Inlet")']


def test_volumes_are_a_body_unless_a_surface_is_a_zone(drawing: Any) -> None:
    drawing.model.occ.addBox(0, 0, 0, 1, 1, 1)
    drawing.model.occ.synchronize()
    assert dimension_of(drawing) == 3
    drawing.model.addPhysicalGroup(2, [1], 1, "zone:p")
    assert dimension_of(drawing) == 2
    drawing.model.addPhysicalGroup(3, [1], 1, "zone:b")
    assert dimension_of(drawing) == 3


PLATE = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 40, 20};
Rectangle(2) = {40, 0, 0, 10, 20};
Coherence;
Physical Point(3) = {1};
Physical Curve(5) = {1, 2};
Physical Curve("Öffnung oben") = {3};
Physical Curve("same") = {1};
Physical Surface("same") = {1};
Physical Surface("in two, one") = {1, 2};
"""


@pytest.mark.process
def test_a_plate_with_groups_of_others(tmp_path: Path) -> None:
    """In mm, with points, curves and surfaces in groups, a surface in two of them, and a curve loaded by its name."""
    (tmp_path / "plate.geo").write_text(PLATE, encoding="utf-8")
    words = [("Units", "mm"), ("Zones/p/Spacing", "1"), ("Loads/Öffnung oben/Traction y", "1e6"), *MATERIAL]
    built = build_file(tmp_path / "plate.geo", words)
    assert built.grid.cells.sum() == pytest.approx(1e-3, rel=1e-12)
    assert len(built.grid.position) == 51 * 21
    (load,) = built.settings.conditions
    assert load.name == "Öffnung oben"
    whole, unused = (note for note in built.notes if mentions(note, "zone 'p'") or mentions(note, "not used"))
    assert mentions(whole, 'Surface("in two, one")')
    assert mentions(unused, "Physical Point(3)", "Physical Curve(5)", 'Curve("same")')
    assert not mentions(unused, "oben")


@pytest.mark.slow
def test_a_bare_drawing_builds_with_parameters_alone(tmp_path: Path) -> None:
    path = tmp_path / "bare.geo"
    path.write_text('SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 0.04, 0.02};\n', encoding="utf-8")
    scene = read_geo(path, [("Zones/plate/Spacing", "1e-3"), ("Fixes/l/Edge", "left"), *MATERIAL])
    assert isinstance(scene, Scene)
    assert scene.shape.area == pytest.approx(8e-4, rel=1e-12)
    with pytest.raises(SceneError, match=naming("zones", found="none", expected="Zones/plate/Spacing=")):
        read_geo(path)


@pytest.mark.slow
def test_a_body_of_unnamed_volumes(tmp_path: Path) -> None:
    """Only what is in a group, as in a mesh of Gmsh; the groups of surfaces say nothing."""
    path = tmp_path / "body.geo"
    path.write_text(
        'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\nBox(2) = {1, 0, 0, 1, 1, 1};\n'
        "Box(3) = {5, 0, 0, 1, 1, 1};\nCoherence;\nPhysical Volume(1) = {1};\nPhysical Volume(2) = {2};\n"
        'Physical Surface("body") = Surface{:};\nPhysical Surface("gone") = {99};\n',
        encoding="utf-8",
    )
    body = read_geo(path, [("Zones/body/Spacing", "0.1"), *MATERIAL])
    assert isinstance(body, Body)
    assert body.shell.volume == pytest.approx(2.0, rel=1e-9)
    assert mentions(body.notes, "zone 'body'", "Physical Volume(1)", "Physical Volume(2)")
    assert mentions(body.notes, "not used", 'Surface("body")')
    assert mentions(body.notes, "Gmsh says", 99, '"gone"')
