"""Parts from CAD programs: the drawing that `pdmesh init` writes, its marks, and the picture of its numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from messages import naming

pytest.importorskip("gmsh", exc_type=OSError)

from pdmesh import SceneError, build_file, file_parameters
from pdmesh.__main__ import main
from pdmesh.drawing.part import CadPart, Shape, read_part
from pdmesh.drawing.part_model import MARK, drawing_text, proposed_spacing, refuse_marks
from pdmesh.reports import part_picture

BRACKET = 6400 + 4800 - 1280 - 72 * np.pi + (1 - np.pi / 4) * 320  # mm^3: foot, back, their overlap, hole, fillet
VALUES = {"E": "65e9", "rho": "2235", "G0": "204", "force_x": "1e3", "force_y": "0", "force_z": "0"}


@pytest.fixture(scope="module")
def cad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plate with a hole (also upright, and as BREP), a bracket with a fillet, a box of triangles, a
    sphere without a volume, and a circle."""
    import gmsh

    folder = tmp_path_factory.mktemp("parts")

    def save(*names: str) -> None:
        gmsh.model.occ.synchronize()
        for name in names:
            gmsh.write(str(folder / name))
        gmsh.clear()

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    for turned in (False, True):
        plate, disc = occ.addRectangle(0, 0, 0, 40, 20), occ.addDisk(20, 10, 0, 5, 5)
        occ.cut([(2, plate)], [(2, disc)])
        if turned:
            occ.rotate([(2, plate)], 0, 0, 0, 1, 0, 0, np.pi / 2)
        save(*(("upright.step",) if turned else ("plate.step", "plate.brep")))
    foot, back, bolt = (
        occ.addBox(0, 0, 0, 40, 20, 8),
        occ.addBox(0, 0, 0, 8, 20, 30),
        occ.addCylinder(25, 10, -1, 0, 0, 10, 3),
    )
    bracket = occ.cut(occ.fuse([(3, foot)], [(3, back)])[0], [(3, bolt)])[0]
    inner = [tag for _, tag in occ.getEntitiesInBoundingBox(7.9, -1, 7.9, 8.1, 21, 8.1, 1)]
    occ.fillet([bracket[0][1]], inner, [4])
    save("bracket.step")
    occ.addBox(0, 0, 0, 4, 1, 1.5)
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1)
    gmsh.model.mesh.generate(2)
    save("box.stl")
    occ.addSphere(0, 0, 0, 10)
    occ.synchronize()
    occ.remove([(3, 1)])
    save("shell.step")
    occ.addCircle(0, 0, 0, 10)
    save("wire.step")
    gmsh.finalize()
    return folder


def filled(text: str, *groups: int) -> str:
    """The drawing with a number in place of each mark: of constants by their name, of groups one after the other."""
    numbers, lines = iter(groups), []
    for line in text.splitlines():
        code, slashes, comment = line.partition("//")
        while MARK in code:
            name = code.split()[0]
            code = code.replace(MARK, VALUES[name] if name in VALUES else str(next(numbers)), 1)
        lines.append(code + slashes + comment)
    return "\n".join(lines) + "\n"


def init(path: Path, *words: str) -> str:
    """The drawing that `pdmesh init` writes."""
    assert main(["init", str(path), "--force", "-q", *words]) == 0
    assert path.with_name(f"{path.stem}_numbers.png").read_bytes().startswith(b"\x89PNG")
    return path.with_suffix(".geo").read_text()


def at(part: CadPart, *centre: float) -> Shape:
    """The face or edge around a place."""
    (shape,) = [shape for shape in part.shapes if np.allclose(shape.centre, centre, atol=0.05)]
    return shape


@pytest.mark.process
def test_what_init_writes_builds_as_soon_as_it_is_filled_in(cad: Path) -> None:
    part, text = read_part(cad / "plate.step"), init(cad / "plate.step")
    left, right, hole = at(part, 0, 10, 0), at(part, 40, 10, 0), at(part, 20, 10, 0)
    assert hole.size == pytest.approx(10 * np.pi, rel=2e-3)
    drawing = cad / "plate.geo"
    with pytest.raises(SceneError, match=naming(drawing, MARK, expected=re.compile("lines .*, .* and 1 more"))):
        build_file(drawing)
    with pytest.raises(SceneError, match=naming(drawing, MARK)):
        file_parameters(drawing)
    drawing.write_text(filled(text, left.number, right.number))
    built = build_file(drawing, [("Zones/part/Spacing", "1")])
    fix, load = ({entry.name: entry for entry in built.settings.conditions}[name] for name in ("support", "pull"))
    assert built.grid.size == pytest.approx(0.04 * 0.02 - np.pi * 0.005**2, rel=2e-4)
    assert built.grid.position[np.array(fix.nodes) - 1][:, 0] == pytest.approx(0)
    assert built.grid.position[np.array(load.nodes) - 1][:, 0] == pytest.approx(0.04)
    assert load.force == (1e3, 0)
    assert built.settings.material.E == 65e9
    assert built.settings.run.solver == "static"


@pytest.mark.slow
def test_a_part_that_is_filled_in_solves(cad: Path) -> None:
    """The bracket: its foot is held, its bolt hole is pulled up."""
    from pdsolve import Model, Options, simulate

    part, text = read_part(cad / "bracket.step"), init(cad / "bracket.step")
    fillet, bolt, back = at(part, 9.45, 10, 9.45), at(part, 25, 10, 4), at(part, 0, 10, 15)
    assert (fillet.kind, bolt.kind, back.kind) == ("cylinder", "cylinder", "plane")
    assert back.normal == pytest.approx((-1, 0, 0), abs=1e-6)
    assert back.size == pytest.approx(600, rel=1e-6)
    path = cad / "bracket.geo"
    path.write_text(filled(text, back.number, bolt.number))
    built = build_file(path, [("Zones/part/Spacing", "2.5"), ("Run/Load steps", "5")])
    results = simulate(Model(built.grid, built.settings, "bracket"), options=Options(threads=1))
    steps, _ = results.frames()
    assert steps.tolist() == [0, 1, 2, 3, 4, 5]
    assert not results.field("damage", 5).any()
    assert results.field("ux", 5).max() > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words", "size", "count"),
    [
        ("upright.step", (), 40 * 20 - np.pi * 25, 5),
        ("plate.brep", ("--unit", "mm"), 40 * 20 - np.pi * 25, 5),
        ("box.stl", ("--unit", "cm"), 6.0, 6),
        ("bracket.step", ("--unit", "in"), BRACKET / 25.4**3, 10),
    ],
)
def test_parts_of_every_kind(name: str, words: tuple[str, ...], size: float, count: int, cad: Path) -> None:
    part = read_part(cad / name, words[1] if words else None)
    assert (part.size, len(part.shapes)) == (pytest.approx(size, rel=2e-3), count)
    first, second = part.shapes[0].number, part.shapes[1].number
    path = cad / "other.geo"
    path.write_text(filled(init(cad / name, *words), first, second))
    built = build_file(path)
    metres = {"in": 0.0254, "cm": 0.01}.get(words[1] if words else "mm", 1e-3)
    assert built.grid.size == pytest.approx(size * metres**part.dimension, rel=2e-3)
    assert 0.3 < len(built.grid) / {2: 5000, 3: 8000}[part.dimension] < 3


@pytest.mark.process
@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("plate.brep", naming("plate.brep", found="40 x 20", expected="--unit mm")),
        ("shell.step", naming("shell.step", found="no volume", expected="solid")),
        ("box.stl", naming("box.stl", found="4 x 1 x 1.5", expected="--unit mm")),
        ("wire.step", naming("wire.step", found="no surface", expected="solid")),
    ],
)
def test_parts_that_cannot_be(name: str, message: str, cad: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read_part(cad / name)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("part.dxf", naming("part.dxf", expected="STEP")),
        ("part.geo", naming("part.geo", expected=(".step", ".brep", ".stl"))),
        ('a"; b.step', naming("letters and digits")),
        ("a\nb.step", naming("letters and digits")),
    ],
)
def test_names_that_cannot_be(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        read_part(tmp_path / name)


@pytest.mark.process
def test_init_overwrites_nothing_and_writes_beside_the_part(
    cad: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "part.step"
    path.write_bytes((cad / "plate.step").read_bytes())
    assert main(["init", str(path), "-o", str(cad / "elsewhere.geo")]) == 2
    assert main(["init", str(path), "-o", str(tmp_path / "part.txt")]) == 2
    assert [entry.name for entry in tmp_path.iterdir()] == ["part.step"]
    (tmp_path / "part.geo").write_text("mine")
    assert main(["init", str(path)]) == 2
    assert (tmp_path / "part.geo").read_text() == "mine"
    assert re.search("already exists.*--force", capsys.readouterr().err)


def test_a_mark_in_a_comment_is_none() -> None:
    refuse_marks("part.geo", f"// {MARK}\nx = 1; // {MARK}\n")
    with pytest.raises(SceneError, match=naming("part.geo", "line 2", MARK)):
        refuse_marks("part.geo", f"x = 1;\ny = {{{MARK}}};\n")


BOX = np.array([[x, y, z] for x in (0, 4.0) for y in (0, 2.0) for z in (0, 1.0)])
QUADS = {1: (0, 1, 3, 2), 2: (4, 5, 7, 6), 3: (0, 1, 5, 4), 4: (2, 3, 7, 6), 5: (0, 2, 6, 4), 6: (1, 3, 7, 5)}


def box(**more: object) -> CadPart:
    """A box of 4 x 2 x 1 mm, and a face that lies within it."""
    shapes = []
    for number, (a, b, c, d) in QUADS.items():
        triangles = BOX[[[a, b, c], [a, c, d]]]
        shapes.append(Shape(number, "plane", 1.0, triangles.mean(axis=(0, 1)), None, triangles))
    inner = shapes[0].points * 0.5 + 0.5
    shapes.append(Shape(7, "plane", 1.0, inner.mean(axis=(0, 1)), None, inner))
    part = CadPart(
        Path("box.step"), 3, "mm", ('Merge "box.step";',), tuple(shapes), 8.0, 1, BOX.min(axis=0), BOX.max(axis=0)
    )
    return replace(part, **more)  # type: ignore[arg-type]


def test_every_face_that_can_be_seen_has_its_number_in_the_picture() -> None:
    figure = part_picture.draw(box())
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert {text for text in texts if text.isdigit()} == set("123456")
    assert all(texts.count(number) == 2 for number in "123456")  # of the four views, two show a face
    assert "not seen: 7" in figure.get_suptitle()


def test_the_spacing_that_is_proposed_has_few_digits() -> None:
    assert proposed_spacing(box()) == 0.1  # 8 mm^3 in 8000 nodes
    assert proposed_spacing(box(dimension=2, size=0.5)) == 0.01
    assert proposed_spacing(box(size=8e9 * 1.4**3)) == 150  # of 140: 1.5 is nearer than 1
    assert 'Name "Peridynamics/Zones/part/Spacing", Help "gives about 8000 nodes"' in drawing_text(box(), "box.png")


@pytest.mark.process
def test_the_parameters_of_a_mesh_are_those_of_its_groups(tmp_path: Path) -> None:
    import meshio

    cells = [("triangle", [[0, 1, 2], [0, 2, 3]]), ("line", [[1, 2]])]
    sets = {"steel": [np.array([0]), np.array([], int)], "load:right": [np.array([], int), np.array([0])]}
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    meshio.Mesh(points, cells, cell_sets=sets).write(tmp_path / "plate.inp")
    found = {entry.name.removeprefix("Peridynamics/"): entry for entry in file_parameters(tmp_path / "plate.inp")}
    assert {"Material/E", "Materials/steel/E", "Units"} <= found.keys()
    assert "Zones/body/Spacing" not in found
    assert found["Material/E"].unit == "Pa"
