"""Statements about meshes, views and files are left out of drawings, and nothing else is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.drawing.geo import read_geo
from pdmesh.drawing.sandbox.copies import drawing_copies
from pdmesh.drawing.sandbox.scan import Drawing
from pdmesh.drawing.sandbox.skipped import without_skipped
from pdmesh.drawing.sandbox.tokens import tokens_of


def left(text: str) -> tuple[str, dict[str, int]]:
    """The drawing without what is left out, words and signs apart by blanks, and what that is."""
    tokens, skipped = without_skipped(Drawing(tokens_of(text)))
    return " ".join(token.text for token in tokens), skipped


@pytest.mark.parametrize(
    ("statement", "what"),
    [
        ("Mesh 2;", "Mesh"),
        ("Mesh dimension;", "Mesh"),
        ("RefineMesh;", "RefineMesh"),
        ('OptimizeMesh "Netgen";', "OptimizeMesh"),
        ("PartitionMesh n + 1;", "PartitionMesh"),
        ('Save "a.msh";', "Save"),
        ('Save View[0] "a.pos";', "Save"),
        ('Print Sprintf("a-%g.png", i);', "Print"),
        ("Print.Background = 1;", "Print"),
        ("Draw;", "Draw"),
        ("Sleep 0.1;", "Sleep"),
        ("Homology {{1}, {70, 71; }};".replace("; ", ""), "Homology"),
        ("Plugin(CutPlane).Run;", "Plugin"),
        ('View "a" { SP(0, 0, 0){1}; T2(10, 10, 0){ "b" }; };', "View"),
        ("View[v + 1].RaiseZ += 1 / View[v].Max;", "View"),
        ("t = (View[0].TimeStep < 3) ? t + 1 : 0;", "View"),
        ("PostProcessing.Link = 1;", "PostProcessing"),
        ("Delete View[0];", "Delete View"),
        ("Background Mesh View[0];", "Background Mesh"),
        ('Geometry.DoubleClickedCurveCommand = "a";', "Geometry.DoubleClickedCurveCommand"),
        ('Merge "sizes.pos";', 'Merge "sizes.pos"'),
        ('Include "view.pos";', 'Include "view.pos"'),
    ],
)
def test_a_statement_that_says_nothing_of_shapes_is_left_out(statement: str, what: str) -> None:
    """At the beginning, in a loop, in a test and behind brackets."""
    around = "x = 1 ;\nFor i In { 1 : 2 }\n{0}\nEndFor\nIf ( x )\n{0} y = 2 ;\nElse\n{0}\nEndIf\n{0}"
    text, skipped = left(f"{statement}\n" + around.replace("{0}", statement))
    assert text == " ".join(around.replace("{0}", "").split())
    assert skipped == {what: 1}


@pytest.mark.parametrize(
    "text",
    [
        "Mesh . Algorithm = 6 ;",
        "Coherence Mesh ;",
        "Save = 1 ;",  # a name
        "Background Field = 1 ;",
        "Geometry . Tolerance = 1e-6 ;",
        "v0 = PostProcessing . NbViews - 4 ;",
        "Delete { Surface { 1 } ; }",
        'Merge "a.geo" ;',
        "Recombine Surface { 1 } ;",
        'Physical Surface ( "View" ) = { 1 } ;',
        "Mesh 2",  # without its end it is no statement
        "Save If ( 1 ) EndIf",
    ],
)
def test_all_else_stays(text: str) -> None:
    assert left(text) == (text, {})


def test_layers_of_an_extrusion_are_left_out() -> None:
    plain = "e ( ) = Extrude { 0 , 0 , 1 } { Surface { 1 } ; } ;"
    layers = "Layers { { 2 , 3 } , { 0.5 , 1 } } ;"
    behind, before = plain.replace("1 } ; }", f"1 }} ; {layers} Recombine ; }}"), plain.replace("Su", f"{layers} Su")
    text, skipped = left(f"{behind}\n{before}")
    assert text == f"{plain} {plain}"
    assert skipped == {"Layers": 1, "Recombine": 1}


@pytest.mark.process
def test_a_drawing_that_meshes_and_saves_is_a_plate(tmp_path: Path) -> None:
    """No file is written, and a note says what was left out and where."""
    (tmp_path / "plate.geo").write_text(
        'SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 4, 2};\nMesh 2;\nSave "plate.msh";\n'
        'View "a" { SP(0, 0, 0){1}; };\nGeneral.MenuWidth = 3 + PostProcessing.NbViews;\n',
        encoding="utf-8",
    )
    scene = read_geo(tmp_path / "plate.geo", [("Zones/plate/Spacing", "0.5")])
    assert scene.notes[-1].startswith(
        f"{tmp_path / 'plate.geo'}: left out: Mesh (line 3), Save (line 4), View (line 5)"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["plate.geo"]


@pytest.mark.process
def test_a_drawing_of_any_suffix_is_included(tmp_path: Path) -> None:
    """Each time anew, and looked at as any drawing."""
    (tmp_path / "plate.geo").write_text(
        'SetFactory("OpenCASCADE");\nx = 0; Include "part.i1";\nx = 1; Include "part.i1";\n', encoding="utf-8"
    )
    (tmp_path / "part.i1").write_text("Rectangle(newreg) = {x, 0, 0, 1, 1};\n", encoding="utf-8")
    scene = read_geo(tmp_path / "plate.geo", [("Zones/plate/Spacing", "0.1")])
    assert scene.shape.area == pytest.approx(2.0)  # type: ignore[union-attr]
    (tmp_path / "part.i1").write_text("\nSystemCall 'a';\n", encoding="utf-8")
    with pytest.raises(SceneError, match=naming(re.compile("part.i1: line 2"), found="'SystemCall'")):
        drawing_copies(tmp_path / "plate.geo")


TETRAHEDRON = [[(0, 0, 0), (0, 1, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0), (0, 0, 1)]]
TETRAHEDRON += [[(0, 0, 0), (0, 0, 1), (0, 1, 0)], [(1, 0, 0), (0, 1, 0), (0, 0, 1)]]


def of_letters(last: str = "endsolid a\n", size: float = 1.0) -> bytes:
    """An STL file."""
    lines = ["solid a"]
    for triangle in TETRAHEDRON:
        corners = "".join(f"vertex {x * size} {y * size} {z * size}\n" for x, y, z in triangle)
        lines += [f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet"]
    return ("\n".join(lines) + f"\n{last}").encode()


@pytest.mark.process
def test_an_stl_file_is_merged_as_a_body(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(of_letters())
    (tmp_path / "body.geo").write_text(
        'Merge "a.stl";\nClassifySurfaces{40 * Pi / 180, 1, 0, Pi};\nCreateGeometry;\nSurface Loop(1) = Surface{:};\n'
        "Volume(1) = {1};\n",
        encoding="utf-8",
    )
    body = read_geo(tmp_path / "body.geo", [("Zones/body/Spacing", "0.05")])
    assert body.shell.volume == pytest.approx(1 / 6, rel=1e-6)  # type: ignore[union-attr]
    assert mentions(body.notes, "zone 'body'", "all volumes")


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (of_letters(last=""), "no end"),
        (of_letters(size=float("nan")), "not finite"),
        (b"SystemCall 'a';\n", "another content"),
        (bytes(80) + (2).to_bytes(4, "little") + bytes(50), "no end"),
        (bytes(80) + (1).to_bytes(4, "little") + b"\xff" * 50, "not finite"),
    ],
)
def test_an_stl_file_is_looked_at_first(data: bytes, found: str, tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(data)
    (tmp_path / "body.geo").write_text('Merge "a.stl";\n', encoding="utf-8")
    with pytest.raises(SceneError, match=naming("a.stl", found=found.split()[-1])):
        drawing_copies(tmp_path / "body.geo")
