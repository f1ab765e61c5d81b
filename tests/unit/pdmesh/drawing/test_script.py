"""Scenes written in Python files."""

from __future__ import annotations

from pathlib import Path

import pytest
from messages import naming

from pdmesh import SceneError
from pdmesh.drawing.script import read_script, script_parameters

TEXT = """
from pdmesh import Scene, box

spacing = 1e-3  # m: between nodes
rows = 2  # of loaded nodes
kind = "top"
shift: float = -1e-3  # m: down
twice = spacing * 2
both = (1, 2)

scene = Scene(box(0, 0, 0.04, 0.02 + shift), spacing).load(kind, traction=(0, 1e6), rows=rows)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "plate.py"
    path.write_text(TEXT, encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_file_that_defines_scene(path: Path) -> None:
    scene = read_script(path, trust=True)
    assert (scene.spacing, scene.shape.area) == (1e-3, pytest.approx(0.04 * 0.019))
    assert (scene.source, scene.drawing) == ("plate.py", TEXT)


def test_constants_are_parameters(path: Path) -> None:
    assert [(it.name, it.value, it.unit, it.meaning) for it in script_parameters(path, trust=True)] == [
        ("spacing", 1e-3, "m", "between nodes"),
        ("rows", 2, "", "of loaded nodes"),
        ("kind", "top", "", ""),
        ("shift", -1e-3, "m", "down"),
    ]


def test_constants_take_the_unit_of_their_comment(tmp_path: Path) -> None:
    path = tmp_path / "plate.py"
    path.write_text("length = 0.1  # m\nwidth = 20.0  # mm: of the plate\nlifted = 2.0  # by a crane\n")
    named = [("length", "90mm"), ("width", "3cm")]
    assert [(it.name, it.value, it.unit, it.meaning) for it in script_parameters(path, named, trust=True)] == [
        ("length", 0.09, "m", ""),
        ("width", 30.0, "mm", "of the plate"),
        ("lifted", 2.0, "", "by a crane"),
    ]


def test_constants_of_one_line_are_parameters(tmp_path: Path) -> None:
    """Each has its unit, or all have the same."""
    path = tmp_path / "plate.py"
    path.write_text(
        "mass, damping = 4.0, 1e3  # -, 1/s: calibrated\nlength, width = 0.1, 20.0  # m\na, b = 1, len('ab')\n"
    )
    given = [("damping", "2e3"), ("width", "30mm")]
    assert [(it.name, it.value, it.unit, it.meaning) for it in script_parameters(path, given, trust=True)] == [
        ("mass", 4.0, "-", "calibrated"),
        ("damping", 2e3, "1/s", "calibrated"),
        ("length", 0.1, "m", ""),
        ("width", 0.03, "m", ""),
        ("a", 1, "", ""),
    ]


@pytest.mark.slow
def test_constants_of_one_line_can_be_set(path: Path) -> None:
    text = TEXT.replace("rows = 2", "rows, shape_of_grip = 2, 'none'")
    assert text != TEXT
    path.write_text(text)
    scene = read_script(path, [("rows", "3")], trust=True)
    assert scene.conditions[0].place.rows == 3
    assert dict(scene.parameters)["shape_of_grip"] == "none"


@pytest.mark.slow
def test_constants_can_be_set(path: Path) -> None:
    scene = read_script(path, [("spacing", "5e-4"), ("rows", "3"), ("kind", "left"), ("shift", "0")], trust=True)
    assert scene.spacing == 5e-4
    assert scene.shape.area == pytest.approx(0.04 * 0.02)
    assert scene.conditions[0].place.rows == 3
    assert scene.conditions[0].place.shape.length == pytest.approx(0.02)
    assert dict(scene.parameters) == {"spacing": 5e-4, "rows": 3, "kind": "left", "shift": 0}


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scene = 5\n", naming("scene", found="int", expected=("define", "scene"))),
        ("x = 1\n", "scene is missing"),
        ("scene = (\n", "line 1: '\\(' was never closed"),
        ("import nowhere_at_all\n", "line 1: ModuleNotFoundError"),
        ("x = 1\nraise SystemExit(0)\n", "line 2: SystemExit"),
        (TEXT.replace("0.04, 0.02", "40, 20"), naming("outline", "line 11", found="40 x 19.999 m", expected="metres")),
        (
            TEXT.replace("rows=rows", "row=rows"),
            naming("line 11", "TypeError", "'row'", expected="traction"),
        ),
        (
            TEXT.replace(".load(", ".laod("),
            naming("line 11", "attribute 'laod'", expected="'load'"),
        ),
        (
            "from pdmesh import Material as M\nM(E=1, rho=1, G=1)\n",
            naming("line 2", "'G'", expected=("E", "G0")),
        ),
    ],
)
def test_bad_files(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=message) as caught:
        read_script(path, trust=True)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        (("spacin", "1"), naming("parameter 'spacin'", expected="'spacing'")),
        (("spacing", "x"), naming("parameter 'spacing'", found="'x'", expected=("number", "in m"))),
        (("spacing", "nan"), naming(found="'nan'", expected=("finite", "number"))),
        (("spacing", "1MPa"), naming(found="'1MPa'", expected=("in m", "mm"))),
        (("rows", "1mm"), naming(found="'1mm'", expected=("whole", "number"))),
        (("rows", "1.5"), naming(found="'1.5'", expected=("whole", "number"))),
    ],
)
def test_bad_assignments(assignment: tuple[str, str], message: str, path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read_script(path, [assignment], trust=True)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=naming("missing.py")):
        read_script(tmp_path / "missing.py", trust=True)
    (tmp_path / "binary.py").write_bytes(b"\xff\x00")
    with pytest.raises(SceneError, match=naming("binary.py", expected="Python")):
        read_script(tmp_path / "binary.py", trust=True)
