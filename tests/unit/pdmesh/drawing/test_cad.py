"""STEP and BREP files, read by Gmsh, alone and merged into a drawing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from messages import naming

pytest.importorskip("gmsh", exc_type=OSError)

from pdmesh import SceneError
from pdmesh.drawing.geo import read_cad, read_geo, read_outline
from pdmesh.grid.lattice import build_grid
from pdmesh.model.load_resultants import resultants
from pdmesh.model.node_grid import document_of

MERGING = """
DefineConstant[
  spacing = {1e-3, Name "Peridynamics/Zones/plate/Spacing"}, pull = {1e6, Name "Peridynamics/Loads/top/Traction y"}
];
Merge "plate.step";
Physical Surface("zone:plate") = {1}; Physical Curve("load:top") = {3};
"""
IN_MM = 'DefineConstant[ unit = {"mm", Name "Peridynamics/Units"} ];\n'


@pytest.fixture(scope="module")
def cad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plate of 40 x 20 mm with a hole, as STEP in millimetres and as BREP in metres."""
    import gmsh

    folder = tmp_path_factory.mktemp("cad")
    for name, unit in (("plate.step", 1.0), ("plate.brep", 1e-3), ("mm.brep", 1.0)):
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        plate = gmsh.model.occ.addRectangle(0, 0, 0, 40 * unit, 20 * unit)
        disc = gmsh.model.occ.addDisk(20 * unit, 10 * unit, 0, 5 * unit, 5 * unit)
        gmsh.model.occ.cut([(2, plate)], [(2, disc)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(folder / name))
        gmsh.finalize()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plate.step", "plate.brep"])
def test_cad_files(name: str, cad: Path) -> None:
    area = 0.04 * 0.02 - np.pi * 0.005**2
    scene = read_cad(cad / name, [("Zones/plate/Spacing", "1e-3"), ("Fixes/foot/Box", "0 0 0.04 0.0005")])
    assert scene.shape.area == pytest.approx(area, rel=2e-4)  # measured: 1.4e-4, of the chords
    assert len(scene.holes) == 1
    assert len(build_grid(scene)[1].conditions[0].nodes or ()) == 41
    assert scene.units is None
    in_mm = [("Units", "mm"), ("Zones/plate/Spacing", "1"), ("Fixes/foot/Box", "0 0 40 0.5")]
    again = read_cad(cad / name, in_mm) if name == "plate.step" else read_cad(cad / "mm.brep", in_mm)
    assert shapely.get_coordinates(again.shape) == pytest.approx(shapely.get_coordinates(scene.shape), abs=1e-15)
    assert build_grid(again)[1].conditions[0].nodes == build_grid(scene)[1].conditions[0].nodes
    with_units = [("Zones/plate/Spacing", "1mm"), ("Fixes/foot/Box", "0 0 0.04 0.0005")]
    assert dict(read_cad(cad / name, with_units).parameters) == dict(scene.parameters)
    outline = read_outline(cad / name, 1e-4)
    assert outline.area == pytest.approx(area, rel=2e-5)  # measured: 8.7e-6
    assert read_outline(cad / "mm.brep", 1e-4, unit="mm").area == pytest.approx(outline.area, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("spacing", ["5e-324", "1e-300", "1e-12", "1e308", "nan", "inf", "-1"])
@pytest.mark.parametrize("name", ["plate.step", "plate.brep"])
def test_absurd_spacings_of_a_cad_file(name: str, spacing: str, cad: Path) -> None:
    with pytest.raises(SceneError, match=rf"{name}: .*[Ss]pacing'?.*\S+"):
        read_cad(cad / name, [("Zones/plate/Spacing", spacing)])


def test_a_name_that_means_nothing_is_refused_for_a_cad_file_too(cad: Path) -> None:
    for name in ("Fixs/foot/Box", "Plate/Length"):
        with pytest.raises(SceneError, match=naming("plate.step", f"parameter 'Peridynamics/{name}'")):
            read_cad(cad / "plate.step", [("Zones/plate/Spacing", "1e-3"), (name, "0 0 1 1")])


@pytest.mark.slow
@pytest.mark.parametrize("where", ["in the drawing", "on the command line"])
def test_a_drawing_may_merge_a_cad_file_of_its_folder(where: str, cad: Path) -> None:
    """Its coordinates are those that Gmsh's window shows, 40 x 20, and the drawing says what they are."""
    path = cad / "merging.geo"
    path.write_text((IN_MM if where == "in the drawing" else "") + MERGING)
    assignments = [("Zones/plate/Spacing", "0.1"), *([("Units", "mm")] if where == "on the command line" else [])]
    scene = read_geo(path, assignments)
    assert scene.shape.area == pytest.approx(0.000721, abs=1e-6)
    assert scene.shape.bounds == pytest.approx((0, 0, 0.04, 0.02))
    assert scene.spacing == 1e-4
    path.write_text(MERGING)
    with pytest.raises(SceneError, match=naming(found="40 x 20 m", expected=("metres", "Units"))):
        read_geo(path)


@pytest.mark.process
def test_files_that_are_no_plates(tmp_path: Path, cad: Path) -> None:
    with pytest.raises(SceneError, match=naming("missing.step")):
        read_cad(tmp_path / "missing.step")
    (tmp_path / "text.step").write_text("no step\n")
    with pytest.raises(SceneError, match=naming("text.step", found="content", expected="STEP")):
        read_cad(tmp_path / "text.step", [("Zones/plate/Spacing", "1e-3")])
    with pytest.raises(SceneError, match=naming("Zones/plate/Spacing'", found="missing")):
        read_cad(cad / "plate.step")


@pytest.mark.slow
def test_conditions_without_groups(cad: Path) -> None:
    """Edges and nodes of a part from outside, with forces whose sums are exact."""
    given = {
        "Units": "mm",
        "Zones/plate/Spacing": "0.5",
        "Fixes/foot/Edge": "left",
        "Loads/bolt/Edge": "bearing 20,10 toward 1,0",
        "Loads/bolt/Force x": "3e4",
        "Loads/side/Edge": "along 30,0 40,0",
        "Loads/side/Traction y": "1e6",
        "Loads/tip/Node": "40,20",
        "Loads/tip/Force y": "-2e3",
    }
    grid, settings, _ = build_grid(read_cad(cad / "plate.step", list(given.items())))
    document = document_of(grid, settings)
    found = {each.name: each.force for each in resultants(document, grid)}
    assert found["bolt"] == pytest.approx([3e4, 0])
    assert found["side"] == pytest.approx([0, 1e4])
    assert found["tip"] == pytest.approx([0, -2e3])
    bolt = settings.conditions[[condition.name for condition in settings.conditions].index("bolt")]
    pressed = grid.position[np.array(bolt.nodes) - 1] - [0.02, 0.01]
    assert (np.hypot(*pressed.T) < 5.5e-3).all()
    assert pressed[:, 0].min() > -5e-4


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"Fixes/a/Edge": "lef"}, naming("Fixes/a/Edge'", found="'lef'", expected="left")),
        ({"Fixes/a/Edge": "left", "Fixes/a/Box": "0 0 1 1"}, naming("Fixes/a/Edge'", found="Box")),
        ({"Fixes/a/Node": "1,2,3"}, naming("Fixes/a/Node'", found="'1,2,3'", expected="X,Y")),
        ({"Fixes/a/Face": "left"}, naming("Fixes/a/Face'", expected="plate")),
        ({"Loads/a/Node": "0,0", "Loads/a/Traction x": "1"}, naming("load 'a'", found="traction", expected="force")),
        ({"Loads/a/Edge": "top", "Loads/a/Traction x": "1", "Loads/a/Force x": "1"}, naming("a'", found="force")),
    ],
)
def test_places_that_cannot_be(given: dict[str, str], message: str, cad: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read_cad(cad / "plate.step", [("Zones/plate/Spacing", "1e-3"), *given.items()])
