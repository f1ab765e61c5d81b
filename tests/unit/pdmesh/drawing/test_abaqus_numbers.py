"""Numbers, names and lines of Abaqus files: what is no number, names used twice, ends of lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from abaqus_files import NO_NUMBER, PARTS, PLATE, refusal, written
from messages import naming

from pdmesh import SceneError
from pdmesh.drawing.abaqus import read_abaqus
from pdmesh.drawing.meshes import read_mesh
from pdmesh.drawing.text_fields import finite_number, text_lines, whole_number

# ---- numbers


def test_numbers() -> None:
    assert [whole_number(word) for word in ("1", "+2", "-3", "0" * 17 + "4", "9" * 18)] == [1, 2, -3, 4, 10**18 - 1]
    assert [finite_number(word) for word in ("1", "2.", "-.5", "1e3", "1.5D-3")] == [1, 2, -0.5, 1e3, 1.5e-3]
    assert {whole_number(word) for word in NO_NUMBER} == {None}
    assert {finite_number(word) for word in ("inf", "nan", "1e999", "1_0", "\u0663", "", ".", "1e", "0x1")} == {None}


@pytest.mark.parametrize(
    ("lines", "place"),
    [
        ("*NODE\nWORD,0,0", "*NODE"),
        ("*NODE, NSET=a\nWORD,0,0", "*NODE"),
        ("*ELEMENT, TYPE=CPS4\nWORD,1,2,3,4", "*ELEMENT"),
        ("*ELEMENT, TYPE=CPS4\n8,1,WORD,3,4", "*ELEMENT"),
        ("*ELSET, ELSET=a, GENERATE\nWORD,5,1", "*ELSET"),
        ("*NSET, NSET=a, GENERATE\n1,WORD,1", "*NSET"),
    ],
)
def test_what_is_no_number(lines: str, place: str, tmp_path: Path) -> None:
    for word in NO_NUMBER:
        message = refusal(tmp_path, PLATE + lines.replace("WORD", word))
        assert f": line 9: {place}: '{word[:60]}'" in message


@pytest.mark.parametrize("options", ["", ", SYSTEM=C", ", SYSTEM=S"])
def test_coordinates_that_are_not_finite(options: str, tmp_path: Path) -> None:
    for row in ("nan,0", "0,inf", "0,1e999", "0,0,0,0,0,inf", "0,1_0"):
        message = refusal(tmp_path, f"{PLATE}*NODE{options}\n9,{row}\n")
        assert f": line 9: *NODE: '9,{row}'" in message


@pytest.mark.parametrize("row", ["nan,0", "0,0,0,0,0,inf,90", "1e308,0\n-1e308,0,0,1e308,0,0,30"])
def test_instances_that_are_moved_out_of_all_numbers(row: str, tmp_path: Path) -> None:
    assert "*INSTANCE" in refusal(tmp_path, PARTS.replace("ROW", row))


def test_an_axis_of_two_points_close_together(tmp_path: Path) -> None:
    mesh = read_abaqus(written(tmp_path, PARTS.replace("ROW", "0,0,0,0,0,1e-300,90")))
    assert mesh.points[2].tolist() == [-1, 1, 0]


def test_coordinates_too_large_for_an_area(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=naming("point 2", found="1e+200")):
        read_mesh(written(tmp_path, PLATE.replace("3,1,1", "3,1e200,1")), [])


@pytest.mark.parametrize("row", ["5", "1,2,3,4", "1,5,0", "5,1,1", "1,,5"])
def test_a_range_that_is_none(row: str, tmp_path: Path) -> None:
    assert "line 9: *ELSET: '" in refusal(tmp_path, f"{PLATE}*ELSET, ELSET=a, GENERATE\n{row}\n")


# ---- parts and instances


@pytest.mark.parametrize("row", ["\n0,0,0, 0,0,1, 90", "0,0,0, 0,0,1, 90", "0,0,0\n0,0,0, 0,0,1, 90"])
def test_an_instance_that_is_turned_and_not_moved(row: str, tmp_path: Path) -> None:
    points = read_abaqus(written(tmp_path, PARTS.replace("ROW", row))).points
    assert points.tolist() == [[0, 0, 0], [0, 1, 0], [-1, 1, 0], [-1, 0, 0]]


@pytest.mark.parametrize("row", ["0,0,0, 0,0,1, 90\n1,2", "0,0,0, 0,0,1, 90\n0,0,0, 0,0,1, 90"])
def test_an_instance_that_is_turned_first(row: str, tmp_path: Path) -> None:
    assert "line 13: *INSTANCE" in refusal(tmp_path, PARTS.replace("ROW", row))


def test_names_used_twice(tmp_path: Path) -> None:
    again = PARTS.replace("ROW\n", "").replace("*ASSEMBLY", "*PART, NAME=p\n*END PART\n*ASSEMBLY")
    assert "line 10: *PART: NAME=p is used twice" in refusal(tmp_path, again)
    again = PARTS.replace("ROW\n", "").replace("*END ASSEMBLY", "*INSTANCE, NAME=ONE, PART=p\n")
    assert "line 13: *INSTANCE: NAME=ONE is used twice" in refusal(tmp_path, again)


# ---- lines


@pytest.mark.parametrize("code", ["utf-8", "latin-1"])
def test_letters_that_text_would_end_a_line_at(code: str, tmp_path: Path) -> None:
    """The second byte of Å in UTF-8 is 0x85, which ends a line of text, as 0x0b and 0x1c do."""
    text = f"** Åsa \x0b b \x1c c \x85 d\n{PLATE}*ELSET, ELSET=Å\n7\n"
    path = written(tmp_path, text.encode(code))
    assert list(read_abaqus(path).cell_sets) == ["Å"]
    assert len(text_lines(path)) == 10


@pytest.mark.parametrize(("begin", "end"), [("", "\r"), ("", "\r\n"), ("\ufeff", "\n")])
def test_ends_of_lines_and_the_mark_of_utf_8(begin: str, end: str, tmp_path: Path) -> None:
    mesh = read_abaqus(written(tmp_path, begin + PLATE.replace("\n", end)))
    assert np.array_equal(mesh.points[:, :2], [[0, 0], [1, 0], [1, 1], [0, 1]])
