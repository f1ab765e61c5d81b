"""Gmsh drawings, read by Gmsh: both kernels, parameters, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from messages import naming
from plates import GEOMETRIES

pytest.importorskip("gmsh", exc_type=OSError)

from pdmesh import SceneError
from pdmesh.drawing import geo
from pdmesh.drawing.geo import read_geo, read_parameters
from pdmesh.grid.lattice import build_grid

DURAN = GEOMETRIES / "duran50.geo"
HEAD = """
DefineConstant[
  spacing = {1e-3, Min 1e-5, Max 0.1, Name "Peridynamics/Zones/plate/Spacing", Units "m", Help "Between nodes"},
  pull = {1e6, Name "Peridynamics/Loads/top/Traction y", Units "Pa"},
  law = {"brittle", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law"},
  E = {65e9, Name "Peridynamics/Material/E"}, rho = {2235, Name "Peridynamics/Material/rho"},
  G0 = {204, Name "Peridynamics/Material/G0"}
];
"""
BUILT_IN = (
    HEAD
    + """
Point(1) = {0, 0, 0}; Point(2) = {0.04, 0, 0}; Point(3) = {0.04, 0.02, 0}; Point(4) = {0, 0.02, 0};
Point(5) = {0.02, 0.01, 0}; Point(6) = {0.025, 0.01, 0}; Point(7) = {0.015, 0.01, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Circle(5) = {6, 5, 7}; Circle(6) = {7, 5, 6};
Curve Loop(1) = {1, 2, 3, 4}; Curve Loop(2) = {5, 6}; Plane Surface(1) = {1, 2};
Physical Surface("zone:plate") = {1};
Physical Curve("load:top") = {3};
"""
)
OPEN_CASCADE = (
    HEAD
    + """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.04, 0.02}; Disk(2) = {0.02, 0.01, 0, 0.005};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("zone:plate") = {3};
Physical Curve("load:top") = Curve In BoundingBox{-0.001, 0.019, -1, 0.041, 0.021, 1};
"""
)


def written(folder: Path, text: str, name: str = "plate.geo") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.slow
def test_the_duran_drawing() -> None:
    scene = read_geo(DURAN)
    assert {zone.name: zone.spacing for zone in scene.zones} == {"fine": 1e-3, "coarse": 2e-3}
    assert scene.shape.area == pytest.approx(4e-3, rel=1e-12)  # measured 0
    assert [list(crack.line.coords) for crack in scene.cracks] == [[(0, 0), (0.05, 0)]]
    assert (scene.run.time_step, scene.run.steps) == (25e-9, 1700)
    assert dict(scene.parameters)["Peridynamics/Horizon ratio"] == 4


@pytest.mark.slow
def test_both_kernels_draw_the_same_plate(tmp_path: Path) -> None:
    built_in = read_geo(written(tmp_path, BUILT_IN))
    open_cascade = read_geo(written(tmp_path, OPEN_CASCADE))
    assert len(built_in.holes) == len(open_cascade.holes) == 1
    area = 0.04 * 0.02 - np.pi * 0.005**2
    for scene in (built_in, open_cascade):
        assert scene.shape.area == pytest.approx(area, rel=2e-4)  # measured: 1.3e-4 and 1.4e-4, of the chords
        hole, centre = scene.holes[0].exterior, (0.02, 0.01)
        assert 0 < 0.005 - shapely.distance(hole, shapely.Point(centre)) <= 0.01 * 1e-3
        assert np.hypot(*(shapely.get_coordinates(hole) - centre).T).max() - 0.005 <= 0.01 * 1e-3
    first, second = (build_grid(scene)[0].position for scene in (built_in, open_cascade))
    assert np.array_equal(first, second)


@pytest.mark.slow
def test_chords_follow_the_spacing(tmp_path: Path) -> None:
    path = written(tmp_path, BUILT_IN)
    for value in (1e-3, 1e-4):
        hole = read_geo(path, [("Zones/plate/Spacing", str(value))]).holes[0]
        corners = shapely.get_coordinates(hole.exterior) - (0.02, 0.01)
        sagitta = 0.005 - np.hypot(*((corners[1:] + corners[:-1]) / 2).T).min()
        assert 0.1 * 0.01 * value < sagitta <= 0.01 * value  # halving overshoots by up to 4


@pytest.mark.slow
def test_splines_and_several_loops(tmp_path: Path) -> None:
    text = BUILT_IN.replace("Circle(5) = {6, 5, 7};", "Point(8) = {0.02, 0.017, 0}; Spline(5) = {6, 8, 7};")
    scene = read_geo(written(tmp_path, text))
    assert scene.shape.area < 0.04 * 0.02 - np.pi * 0.005**2
    assert scene.holes[0].bounds[3] == pytest.approx(0.017, abs=1e-4)


@pytest.mark.process
def test_assignments_reach_the_drawing(tmp_path: Path) -> None:
    path = written(tmp_path, BUILT_IN)
    scene = read_geo(path, [("Peridynamics/Zones/plate/Spacing", "5e-4"), ("Material/Force law", "bilinear")])
    assert scene.spacing == 5e-4
    assert scene.material is not None
    assert scene.material.law == "bilinear"
    assert dict(scene.parameters)["Peridynamics/Zones/plate/Spacing"] == 5e-4
    assert scene.drawing == path.read_text(encoding="utf-8")


OWN = """
  kink = {10, Name "Peridynamics/Plate/Kink", Units "degree"}, size = {4, Name "Peridynamics/Plate/Size", Units "cm"},
"""


@pytest.mark.process
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_assignments_take_units(unit: str, tmp_path: Path) -> None:
    """The unit of lengths is the drawing's, or the assigned one; of the drawing's own numbers the one it declares."""
    path = written(tmp_path, BUILT_IN.replace("  law =", f"{OWN}  law ="))
    named = [("Zones/plate/Spacing", "0.05mm"), ("Loads/top/Traction y", "2MPa"), ("material.E", "70GPa")]
    named += [("run.duration", "5us"), ("Plate/Size", "30mm"), ("Plate/Kink", "5degree"), ("Material/rho", "2e3")]
    found = {entry.name: entry.value for entry in read_parameters(path, [*named, ("Units", unit)])}
    spacing = found.pop("Peridynamics/Zones/plate/Spacing")
    assert spacing == (5e-5 if unit == "m" else 0.05)
    assert found == {
        "Peridynamics/Loads/top/Traction y": 2e6,
        "Peridynamics/Material/E": 70e9,
        "Peridynamics/Material/Force law": "brittle",
        "Peridynamics/Material/G0": 204,
        "Peridynamics/Material/rho": 2000,
        "Peridynamics/Plate/Kink": 5,
        "Peridynamics/Plate/Size": 3,
        "Peridynamics/Run/Duration": 5e-6,
        "Peridynamics/Units": unit,
    }


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        (("Plate/Kink", "5mm"), naming("Plate/Kink", "'5mm'", expected="in degree")),
        (("Material/nu", "5mm"), naming("Material/nu", "'5mm'", expected="a number")),
        (("Run/Duration", "5mm"), naming("Run/Duration", "'5mm'", expected="a number")),
    ],
)
@pytest.mark.process
def test_other_units_are_refused(assignment: tuple[str, str], message: str, tmp_path: Path) -> None:
    path = written(tmp_path, BUILT_IN.replace("  law =", f"{OWN}  law ="))
    with pytest.raises(SceneError, match=message):
        read_geo(path, [assignment])


@pytest.mark.slow
def test_parameters_are_set_by_name_with_or_without_the_prefix() -> None:
    assignments = [("Plate/Length", "0.2"), ("Peridynamics/Material/Micromodulus", "constant")]
    scene = read_geo(DURAN, assignments)
    assert scene.shape.area == pytest.approx(8e-3, rel=1e-12)  # measured 2e-16
    assert scene.material.micromodulus == "constant"


@pytest.mark.slow
def test_parameters_with_unit_and_meaning(tmp_path: Path) -> None:
    found = {entry.name: entry for entry in read_parameters(written(tmp_path, BUILT_IN))}
    spacing = found["Peridynamics/Zones/plate/Spacing"]
    assert (spacing.value, spacing.unit, spacing.meaning) == (1e-3, "m", "Between nodes")
    assert found["Peridynamics/Material/Force law"].value == "brittle"
    assert len(found) == 6


@pytest.mark.slow
def test_assignments_may_supply_what_the_drawing_leaves_out(tmp_path: Path) -> None:
    path = written(tmp_path, BUILT_IN)
    given = [("Fixes/foot/Box", "0 0 0.04 0.0005"), ("Fixes/foot/Components", "y"), ("Horizon ratio", "4")]
    scene = read_geo(path, [*given, ("Material/nu", "0.2"), ("Loads/top/Rows", "2")])
    _, found, _ = build_grid(scene)
    load, fix = found.conditions
    assert (len(load.nodes or ()), len(fix.nodes or ())) == (82, 41)
    assert (found.horizon.ratio, found.material.nu if found.material else 0) == (4, 0.2)
    assert dict(scene.parameters)["Peridynamics/Fixes/foot/Box"] == "0 0 0.04 0.0005"
    with pytest.raises(
        SceneError, match=naming("'Peridynamics/Fixs/foot/Box'", expected="'Peridynamics/Fixes/foot/Box'")
    ):
        read_geo(path, [("Fixs/foot/Box", "0 0 1 1")])
    with pytest.raises(SceneError, match=naming("'Peridynamics/Plate/Size'")):
        read_geo(path, [("Plate/Size", "2")])


@pytest.mark.slow
def test_chords_follow_a_spacing_that_was_supplied(tmp_path: Path) -> None:
    text = BUILT_IN.replace('Name "Peridynamics/Zones/plate/Spacing"', 'Name "Peridynamics/Plate/Spacing"')
    hole = read_geo(written(tmp_path, text), [("Zones/plate/Spacing", "1e-4")]).holes[0]
    corners = shapely.get_coordinates(hole.exterior) - (0.02, 0.01)
    assert 0 < 0.005 - np.hypot(*((corners[1:] + corners[:-1]) / 2).T).min() <= 0.01 * 1e-4


@pytest.mark.slow
def test_a_drawing_may_include_a_drawing_of_its_folder(tmp_path: Path) -> None:
    written(tmp_path, HEAD, "head.geo")
    scene = read_geo(written(tmp_path, 'Include "head.geo";\n' + BUILT_IN.removeprefix(HEAD)))
    assert scene.spacing == 1e-3


@pytest.mark.slow
def test_words_in_comments_and_strings_are_no_commands(tmp_path: Path) -> None:
    text = BUILT_IN + '// SystemCall "x";\n/* Save "y"; */\nname = "Merge z;\nExit;";\nPrintf("done");\n'
    assert read_geo(written(tmp_path, text)).spacing == 1e-3


@pytest.mark.slow
def test_trust_reads_it_all_the_same(tmp_path: Path) -> None:
    path = written(tmp_path, BUILT_IN + f'SystemCall "touch {tmp_path}/touched";\n')
    assert read_geo(path, trust=True).spacing == 1e-3
    assert (tmp_path / "touched").exists()


@pytest.mark.slow
def test_a_drawing_that_ends_the_process_leaves_this_one_alone(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=naming("Gmsh", "stopped")):
        read_geo(written(tmp_path, BUILT_IN + "Exit;\n"), trust=True)


MILLIMETRES = (
    HEAD
    + """
SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 40, 20};
Physical Surface("zone:plate") = {1}; Physical Curve("load:top") = {3};
"""
)
CROSSING = ("{0.04, 0.02, 0}; Point(4) = {0, 0.02, 0}", "{0, 0.02, 0}; Point(4) = {0.04, 0.02, 0}")
BAD = {
    "no line end": (BUILT_IN.rstrip("\n"), naming("plate.geo", "line", found=("line", "end"))),
    "syntax": (
        BUILT_IN + "Pont(1) = {0};\n",
        rf"plate\.geo: Gmsh says: .*plate\.geo', line {BUILT_IN.count(chr(10)) + 1}: syntax error",
    ),
    "vanished group": (BUILT_IN.replace('"load:top") = {3}', '"load:top") = {33}'), "Gmsh says: .*unknown curve 33"),
    "vanished surface": (BUILT_IN.replace('plate") = {1}', 'plate") = {9}'), "Gmsh says: .*Skipping unknown surface 9"),
    "unknown group": (BUILT_IN.replace("load:top", "laod:top"), naming('Curve("laod:top")')),
    "unknown zone": (
        BUILT_IN.replace("zone:plate", "zon:plate"),
        naming('Surface("zon:plate")', expected='Surface("zone:plate")'),
    ),
    "half a material": (
        BUILT_IN.replace(', rho = {2235, Name "Peridynamics/Material/rho"}', ""),
        naming("'Peridynamics/Material/rho'", found="missing", expected="number"),
    ),
    "a name that means nothing": (
        BUILT_IN.replace("Material/rho", "material/rhoo"),
        naming("'Peridynamics/material/rhoo'", expected="'Peridynamics/Material/rho'"),
    ),
    "empty": ("\n", naming("zones", found="none", expected=("'zone:NAME'", "Zones/plate/Spacing="))),
    "negative spacing": (
        BUILT_IN.replace("{1e-3, Min 1e-5, Max 0.1,", "{-1e-3,"),
        naming("spacing", "zone 'plate'", found="-0.001 m", expected="0 m"),
    ),
    "spacing below its least": (BUILT_IN.replace("{1e-3,", "{1e-6,"), naming(found="1e-06", expected="1e-05")),
    "smallest spacing there is": (
        BUILT_IN.replace("{1e-3, Min 1e-5, Max 0.1,", "{5e-324,"),
        naming("spacing", found=("4.94066e-324 m", "0.04 x 0.02 m"), expected="2e+07"),
    ),
    "absurd spacing": (BUILT_IN.replace("{1e-3,", "{0.09,"), naming(found="0.09 m", expected="less")),
    "open outline": (BUILT_IN.replace("{1, 2, 3, 4}; Curve", "{1, 2, 3}; Curve"), naming(found=("outline", "open"))),
    "crossing": (BUILT_IN.replace(*CROSSING), naming("zone 'plate'", expected=("outline", "itself"))),
    "tilted": (BUILT_IN.replace("0.04, 0.02, 0}", "0.04, 0.02, 0.01}"), "z goes from 0 to 0.01"),
    "millimetres": (MILLIMETRES, naming(expected=("metres", "millimetres"))),
    "gets stuck": (BUILT_IN + "For i In {1:1e9}\nx = i;\nEndFor\n", "Gmsh was still reading after 1 s"),
    "a warning": (BUILT_IN + 'Warning("thin");\n', "Gmsh says: Warning: thin"),
    "a name of its own": (BUILT_IN + "If(0)\nwide = 1;\nEndIf\na = wide;\n", "Gmsh says: .*line 20: .*'wide'"),
}  # fmt: skip


@pytest.mark.process
@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("name", BAD)
def test_bad_drawings(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, message = BAD[name]
    monkeypatch.setattr(geo, "TIME_LIMIT", 1.0 if name == "gets stuck" else 60.0)
    path = written(tmp_path, text)
    with pytest.raises(SceneError, match=message) as caught:
        build_grid(read_geo(path))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        (
            ("Zones/plat/Spacing", "1"),
            naming('Surface("zone:plat")', found="missing", expected="Peridynamics/Zones/plate"),
        ),
        (("Zones/plate/Spacing", "wide"), naming("Spacing'", found="'wide'", expected="number")),
        (("Zones/plate/Spacing", "nan"), naming("Spacing'", found="nan", expected="number")),
        (("Zones/plate/Spacing", "-1"), naming("Spacing'", found="-1", expected=("1e-05", "0.1"))),
        (("Material/E", "nan"), "Material/E' is nan"),
    ],
)
def test_bad_assignments(assignment: tuple[str, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read_geo(written(tmp_path, BUILT_IN), [assignment])


def test_files_that_are_no_drawings(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=naming("missing.geo", "there is no such file")):
        read_geo(tmp_path / "missing.geo")
    (tmp_path / "binary.geo").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match=naming("text")):
        read_geo(tmp_path / "binary.geo")


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_damage_to_a_drawing_is_one_error(tmp_path: Path, data: st.DataObject) -> None:
    """Lines swapped, cut, doubled or with a character changed: a scene, or one line that says what is wrong."""
    lines = BUILT_IN.splitlines()
    at = data.draw(st.integers(0, len(lines) - 1))
    kind = data.draw(st.sampled_from(["cut", "double", "swap", "replace", "end"]))
    if kind == "cut":
        lines[at] = lines[at][: data.draw(st.integers(0, len(lines[at])))]
    elif kind == "double":
        lines.insert(at, lines[at])
    elif kind == "swap":
        lines[at], lines[-1] = lines[-1], lines[at]
    elif kind == "end":
        lines = lines[:at]
    else:
        place = data.draw(st.integers(0, len(lines[at])))
        lines[at] = lines[at][:place] + data.draw(st.sampled_from('0-{}[];"=/e\t#%')) + lines[at][place + 1 :]
    path = written(tmp_path, "\n".join(lines) + "\n", "damaged.geo")
    try:
        scene = read_geo(path)
    except SceneError as error:
        message = str(error)
    else:
        message = str(path) if scene.shape.area > 0 else ""
    assert message.startswith(str(path))
    assert "\n" not in message
