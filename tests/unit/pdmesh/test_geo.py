"""Drawings that Gmsh reads, and those that get one clear sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from plates import ROOT
from shapely import Point

pytest.importorskip("gmsh", exc_type=OSError)

from pdmesh import geo
from pdmesh.geo import read_geo
from pdmesh.scene import SceneError

DURAN = ROOT / "geometries" / "duran50.geo"
PLATE = """
DefineConstant[
  h = {1e-3, Name "Peridynamics/Zones/all/Spacing"}, E = {1e9, Name "Peridynamics/Material/E"},
  rho = {1e3, Name "Peridynamics/Material/rho"}, G0 = {100, Name "Peridynamics/Material/G0"},
  dt = {1e-8, Name "Peridynamics/Run/Time step"}, T = {1e-6, Name "Peridynamics/Run/Duration"}
];
Point(1) = {0, 0, 0}; Point(2) = {0.02, 0, 0}; Point(3) = {0.02, 0.01, 0}; Point(4) = {0, 0.01, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Point(5) = {0.01, 0.005, 0}; Point(6) = {0.013, 0.005, 0}; Point(7) = {0.007, 0.005, 0};
Circle(5) = {6, 5, 7}; Circle(6) = {7, 5, 6};
Curve Loop(1) = {1, 2, 3, 4}; Curve Loop(2) = {5, 6};
Plane Surface(1) = {1, 2};
Physical Surface("zone:all") = {1};
"""


def drawing(folder: Path, text: str) -> Path:
    """A file with this text."""
    path = folder / "plate.geo"
    path.write_text(text)
    return path


def test_the_duran_drawing() -> None:
    scene = read_geo(DURAN)
    assert {zone.name: zone.spacing for zone in scene.zones} == {"fine": 1e-3, "coarse": 2e-3}
    assert scene.shape.area == pytest.approx(4e-3, rel=1e-12)  # measured 0
    assert [list(crack.line.coords) for crack in scene.cracks] == [[(0, 0), (0.05, 0)]]
    assert (scene.run.time_step, scene.run.steps) == (25e-9, 1700)
    assert dict(scene.parameters)["Peridynamics/Horizon ratio"] == 4


def test_parameters_are_set_by_name_with_or_without_the_prefix() -> None:
    assignments = [("Plate/Length", "0.2"), ("Peridynamics/Material/Micromodulus", "constant")]
    scene = read_geo(DURAN, assignments)
    assert scene.shape.area == pytest.approx(8e-3, rel=1e-12)  # measured 2e-16
    assert scene.material.micromodulus == "constant"


def test_a_round_hole_keeps_to_the_chord_tolerance(tmp_path: Path) -> None:
    (hole,) = read_geo(drawing(tmp_path, PLATE)).holes
    off = [
        abs(Point(0.01, 0.005).distance(hole.exterior.interpolate(s / 997, normalized=True)) - 3e-3) for s in range(997)
    ]
    assert max(off) <= geo.CHORD_TOLERANCE * 1e-3  # measured 3.6e-6 of 1e-5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("= {1};\n", "= {1};", "last line: found no line end, expected one"),
        ('"zone:all"', '"zon:all"', r'Physical Surface\("zon:all"\): expected Physical Surface\("zone:NAME"\)'),
        (
            'Surface("zone:all") = {1}',
            'Surface("zone:all") = {9}',
            "Gmsh says: Warning: Skipping unknown surface 9",
        ),
        ('"zone:all"', '"zone:fine"', r'Physical Surface\("zone:all"\): found none, expected one for'),
        ("1e-3, Name", "-1e-3, Name", "zone 'all': spacing: found -0.001 m, expected more than 0 m"),
        ("Material/rho", "Material/rhoo", "parameter 'Peridynamics/Material/rho': found none, expected a number"),
        ("G0 = {100", "G0 = {-100", "Peridynamics/Material: Expected `float` > 0"),
        ("Line(1) = {1, 2}", "Line(1) = {1, 2", r"plate\.geo', line 8: syntax error"),
        ("{1, 2};\nPhysical", "{1, 2};\nExit;\nPhysical", "line 13: found 'Exit'"),
        ("Physical S", 'SystemCall "touch /tmp/pdmesh-was-here";\nPhysical S', "line 13: found 'SystemCall'"),
        ("Physical S", 'Printf("x") > "/tmp/pdmesh-was-here";\nPhysical S', "line 13: found 'Printf'"),
    ],
)
def test_bad_drawings_get_one_sentence(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in PLATE
    path = drawing(tmp_path, PLATE.replace(old, new))
    with pytest.raises(SceneError, match=message) as error:
        read_geo(path)
    assert str(error.value).startswith(f"{path}: ")


def test_commands_in_comments_and_strings_are_no_commands(tmp_path: Path) -> None:
    path = drawing(tmp_path, PLATE + '// SystemCall\n/* Exit; */ name = "Save";\n')
    assert len(read_geo(path).holes) == 1


def test_an_unknown_parameter_is_answered_with_a_known_one() -> None:
    with pytest.raises(
        SceneError, match=r"'Peridynamics/Zones/fin/Spacing' is not in .* 'Peridynamics/Zones/fine/Spacing'"
    ):
        read_geo(DURAN, [("Zones/fin/Spacing", "1e-3")])


def test_a_number_is_asked_for_where_a_word_was_given() -> None:
    with pytest.raises(SceneError, match="Zones/fine/Spacing': found 'wide', expected a number"):
        read_geo(DURAN, [("Zones/fine/Spacing", "wide")])


def test_a_drawing_that_ends_the_process_leaves_this_one_alone(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="Gmsh stopped before the end of the drawing"):
        read_geo(drawing(tmp_path, PLATE + "Exit;\n"), trust=True)


def test_a_drawing_without_end_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geo, "TIME_LIMIT", 2.0)
    with pytest.raises(SceneError, match="still reading after 2 s"):
        read_geo(drawing(tmp_path, PLATE + "For i In {1:1e12}\n  a = i;\nEndFor\n"))


def test_a_missing_drawing_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.geo: cannot be read: No such file"):
        read_geo(tmp_path / "none.geo")
