"""Meshes of Abaqus: element types, the grammar of keywords, parts and their instances, sets at both levels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from abaqus_files import written
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.drawing.abaqus import read_abaqus
from pdmesh.drawing.abaqus_model import element_type
from pdmesh.drawing.meshes import read_mesh
from pdmesh.model.document import Load
from pdmesh.scene.body import Body

STEEL = [("Material/E", "2e11"), ("Material/rho", "7800"), ("Material/G0", "10"), ("Units", "mm")]


def nodes(columns: int, rows: int, step: float = 2.0) -> str:
    """Nodes of a plate of so many cells, numbered from 1 along x."""
    places = [(i * step, j * step) for j in range(rows + 1) for i in range(columns + 1)]
    return "*NODE\n" + "".join(f"{number}, {x:g}, {y:g}\n" for number, (x, y) in enumerate(places, start=1))


def quads(columns: int, rows: int, options: str = "TYPE=CPS4") -> str:
    """Elements of that plate."""
    first = [i + j * (columns + 1) + 1 for j in range(rows) for i in range(columns)]
    cells = [(c, c + 1, c + columns + 2, c + columns + 1) for c in first]
    lines = [f"{number}, {', '.join(map(str, cell))}\n" for number, cell in enumerate(cells, start=1)]
    return f"*ELEMENT, {options}\n" + "".join(lines)


def plate(columns: int = 4, rows: int = 4, options: str = "TYPE=CPS4") -> str:
    """A plate without parts."""
    return nodes(columns, rows) + quads(columns, rows, options)


@pytest.mark.parametrize(
    ("names", "cell", "kind"),
    [
        ("CPE4 CPE4R CPE4H CPE4I CPE4RH CPE4IH CPE4T CPE4P CPEG4", "quad", "strain"),
        ("CPE3 CPE3H CPE3T", "triangle", "strain"),
        ("CPE6 CPE6M CPE6MH", "triangle6", "strain"),
        ("CPE8 CPE8R CPE8RH", "quad8", "strain"),
        ("CPS4 CPS4R CPS4I M3D4 M3D4R S4 S4R S4RS S4R5", "quad", "stress"),
        ("CPS3 M3D3 S3 S3R STRI3", "triangle", "stress"),
        ("CPS6 CPS6M M3D6 STRI65", "triangle6", "stress"),
        ("CPS8 CPS8R S8R S8R5", "quad8", "stress"),
        ("CAX4 CAX4R CAX4RH CGAX4 DCAX4", "quad", "axisymmetric"),
        ("DC2D4 AC2D4 DCC2D4 R3D4", "quad", ""),
        ("C3D4 C3D4H DC3D4", "tetra", "space"),
        ("C3D10 C3D10M C3D10MH C3D10HS DC3D10", "tetra10", "space"),
        ("C3D8 C3D8R C3D8I C3D8RH C3D8RT DC3D8 SC8R", "hexahedron", "space"),
        ("C3D20 C3D20R", "hexahedron20", "space"),
        ("C3D6 SC6R", "wedge", "space"),
        ("C3D15", "wedge15", "space"),
        ("C3D5", "pyramid", "space"),
        ("T2D2 T3D2 B21 B31 B31H", "line", "line"),
    ],
)
def test_element_types(names: str, cell: str, kind: str) -> None:
    for name in names.split():
        found = element_type(name.lower())
        assert found is not None, name
        assert (found.cell, found.kind) == (cell, kind), name


@pytest.mark.parametrize("name", ["CPE5", "CPX4", "COH2D4", "CONN3D2", "MASS", "SPRINGA", "C3D7", "CPE", "CPE4X"])
def test_unknown_types_are_refused_by_name(name: str, tmp_path: Path) -> None:
    assert element_type(name) is None
    with pytest.raises(SceneError, match=naming("part.inp", "line 27", found=f"TYPE={name}", expected="CPS4")):
        read_abaqus(written(tmp_path, plate(options=f"TYPE={name}")))


def test_plane_strain_is_that_of_the_elements(tmp_path: Path) -> None:
    path = written(tmp_path, plate(20, 10, "TYPE=CPE4, ELSET=steel"))
    grid, settings, notes = read_mesh(path, STEEL)
    assert len(grid) == 200
    assert grid.size == pytest.approx(8e-4, rel=1e-12)
    assert settings.material.plane == "strain"
    assert mentions(notes, "plane strain")
    _, settings, notes = read_mesh(path, [*STEEL, ("Material/Plane", "stress")])
    assert settings.material.plane == "stress"
    assert mentions(notes, "warning", "plane strain", "stress")


def test_axisymmetric_elements_and_lines_are_said(tmp_path: Path) -> None:
    truss = "*ELEMENT, TYPE=T2D2\n100, 1, 2\n"
    mesh = read_abaqus(written(tmp_path, plate(options="TYPE=CAX4R") + truss))
    assert mentions(mesh.notes, "warning", "CAX4R", "axisymmetric")
    assert mentions(mesh.notes, "1 elements T2D2")


PARTS = f"""*Heading
two plates
** a comment
*Preprint, echo=NO
*Part, name=Plate
{plate()}*Elset, elset=left, generate
1, 13, 4
*Nset, nset=foot, generate
1, 5
*End Part
*Assembly, name=A
*Instance, name=one, part=PLATE
*End Instance
*Instance, name=two, part=Plate
ROW
*End Instance
*Elset, elset=both, instance=one
left
*Elset, elset=both, instance=two
1, 2,
*Elset, elset=named
two.left, one.16
*End Assembly
*Material, name=Steel
*Elastic
2e11, .3
"""


@pytest.mark.parametrize(
    ("row", "x", "y"),
    [
        ("20., 0.", (20, 28), (0, 8)),
        ("0, 20, 0", (0, 8), (20, 28)),
        ("20., 0., 0.\n20., 0., 0., 20., 0., 1., 90.", (12, 20), (0, 8)),  # moved, then turned about where it is
        ("0,0,0\n0,0,0, 0,0,-1, 90", (0, 8), (-8, 0)),
        ("0,0,0\n0,0,0, 1,0,0, 180", (0, 8), (-8, 0)),
    ],
)
def test_instances_are_moved_and_turned(row: str, x: tuple[int, int], y: tuple[int, int], tmp_path: Path) -> None:
    mesh = read_abaqus(written(tmp_path, PARTS.replace("ROW", row)))
    assert [len(block.data) for block in mesh.cells] == [16, 16]
    for block, (wide, high) in zip(mesh.cells, [((0, 8), (0, 8)), (x, y)], strict=True):
        places = mesh.points[block.data].reshape(-1, 3)
        low, high_end = places.min(axis=0), places.max(axis=0)
        assert [low[0], high_end[0]] == pytest.approx(wide, abs=1e-12)
        assert [low[1], high_end[1]] == pytest.approx(high, abs=1e-12)


def test_sets_of_parts_and_of_the_assembly(tmp_path: Path) -> None:
    mesh = read_abaqus(written(tmp_path, PARTS.replace("ROW", "20, 0")))
    sets = {name: [rows.tolist() for rows in members] for name, members in mesh.cell_sets.items()}
    column = [0, 4, 8, 12]
    assert sets == {
        "left": [column, column],
        "one.left": [column, []],
        "two.left": [[], column],
        "both": [column, [0, 1]],
        "named": [[15], column],
        "one": [list(range(16)), []],
        "two": [[], list(range(16))],
    }
    assert mesh.point_sets["foot"].tolist() == [*range(5), *range(25, 30)]
    assert mentions(mesh.notes, "not used", "*Material", "*Elastic")


def test_a_range_of_numbers_costs_what_is_in_it(tmp_path: Path) -> None:
    text = plate() + "*ELSET, ELSET=a, GENERATE\n2, 1000000000000, 3\n16, 13, -1\n"
    assert read_abaqus(written(tmp_path, text)).cell_sets["a"][0].tolist() == [1, 4, 7, 10, 12, 13, 14, 15]


def test_cells_whose_sides_cross_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, plate().replace("1, 1, 2, 7, 6\n", "1, 1, 7, 2, 6\n").replace("2, 2.0", "2, 2.5"))
    with pytest.raises(SceneError, match=naming("part.inp", "cell 0")):
        read_mesh(path, STEEL)


def test_a_surface_of_the_assembly_as_cae_writes_it(tmp_path: Path) -> None:
    surface = "*Elset, elset=_end_S2, internal, instance=two, generate\n4, 16, 4\n"
    surface += "*Surface, type=ELEMENT, name=end\n_end_S2, S2\n*End Assembly"
    mesh = read_abaqus(written(tmp_path, PARTS.replace("ROW", "20, 0").replace("*End Assembly", surface)))
    assert "_end_S2" not in mesh.cell_sets
    (edges,) = (block.data for block in mesh.cells if block.type == "line")
    assert len(mesh.cell_sets["end"][-1]) == 4
    assert mesh.points[edges][..., 0] == pytest.approx(28)


def test_parts_that_touch_are_two_plates(tmp_path: Path) -> None:
    grid, _, notes = read_mesh(written(tmp_path, PARTS.replace("ROW", "8, 0")), STEEL)
    assert grid.cracks == pytest.approx(np.array([[8, 0, 8, 2], [8, 2, 8, 4], [8, 4, 8, 6], [8, 6, 8, 8]]) * 1e-3)
    assert mentions(notes, "double nodes", "(8, 0)", "(8, 8)")


def test_parts_of_other_nodes_that_touch_are_two_plates(tmp_path: Path) -> None:
    text = PARTS.replace("*Assembly", f"*Part, name=fine\n{nodes(4, 5, 1.6)}{quads(4, 5)}*End Part\n*Assembly")
    text = text.replace("name=two, part=Plate", "name=two, part=fine").replace("two.left, ", "").replace("ROW", "8, 0")
    grid, _, _ = read_mesh(written(tmp_path, text), STEEL)
    lengths = np.hypot(*(grid.cracks[:, 2:] - grid.cracks[:, :2]).T)
    assert lengths.sum() == pytest.approx(8e-3)
    assert grid.cracks[:, [0, 2]] == pytest.approx(8e-3)


def test_no_part_is_dropped_in_silence(tmp_path: Path) -> None:
    spare = PARTS.replace("ROW", "20,0").replace("*Assembly", f"*Part, name=spare\n{plate()}*End Part\n*Assembly")
    assert mentions(read_abaqus(written(tmp_path, spare)).notes, "part 'spare'", "no instance")
    with pytest.raises(SceneError, match=naming("part.inp", found="parts", expected="assembly")):
        read_abaqus(written(tmp_path, f"*Part, name=a\n{plate()}*End Part\n"))


def test_conditions_on_node_sets_and_surfaces(tmp_path: Path) -> None:
    text = plate() + "*NSET, NSET=foot, GENERATE\n1, 5\n*NSET, NSET=corner\n25\n*ELSET, ELSET=high, GENERATE\n13, 16\n"
    text += "*SURFACE, NAME=roof\nhigh, S3\n"
    load = [("Loads/roof/Traction y", "1e6"), ("Fixes/foot/Components", "xy"), ("Fixes/corner/Components", "x")]
    _, settings, _ = read_mesh(written(tmp_path, text), [*STEEL, *load])
    by_name = {condition.name: condition for condition in settings.conditions}
    assert isinstance(by_name["roof"], Load)
    assert by_name["roof"].length == pytest.approx(8e-3)
    assert by_name["roof"].nodes == (9, 10, 11, 12, 13, 14, 15, 16)  # rows that reach as deep as bonds go
    assert by_name["foot"].nodes == (1, 2, 3, 4)
    assert by_name["corner"].nodes == (16,)


def test_lines_that_go_on(tmp_path: Path) -> None:
    text = nodes(2, 2) + "*ELEMENT,\n TYPE = CPS8 ,\n elset=a\n7, 1, 3, 9, 7,\n2, 6, 8, 4\n"
    mesh = read_abaqus(written(tmp_path, text))
    assert mesh.cells[0].data.tolist() == [[0, 2, 8, 6, 1, 5, 7, 3]]
    assert list(mesh.cell_sets) == ["a"]


def test_nodes_in_cylindrical_coordinates(tmp_path: Path) -> None:
    text = "*NODE, SYSTEM=C\n1, 1, 0\n2, 2, 0\n3, 2, 90\n4, 1, 90\n*ELEMENT, TYPE=CPS4\n1, 1, 2, 3, 4\n"
    assert read_abaqus(written(tmp_path, text)).points[2:] == pytest.approx(np.array([[0, 2, 0], [0, 1, 0.0]]))


def test_solids_become_a_body(tmp_path: Path) -> None:
    corners = "".join(f"{z * 4 + y * 2 + x + 1}, {x}, {y}, {z}\n" for z in (0, 1) for y in (0, 1) for x in (0, 1))
    text = (
        f"*NODE\n{corners}*ELEMENT, TYPE=C3D8R, ELSET=cube\n1, 1, 2, 4, 3, 5, 6, 8, 7\n*SURFACE, NAME=top\ncube, S2\n"
    )
    body = read_mesh(written(tmp_path, text), [*STEEL, ("Loads/top/Traction z", "1")])
    assert isinstance(body, Body)
    assert body.shell.volume == pytest.approx(1e-9)
    assert body.conditions[0].where.triangles[..., 2] == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("*NODE", "*INCLUDE, INPUT=a\n*NODE"), naming("line 1", found="*INCLUDE")),
        (("*NODE", "*SYSTEM\n1,0,0\n*NODE"), naming("line 1", found="*SYSTEM")),
        (("*NODE", "*NODE, INPUT=a.txt"), naming("line 1", found="INPUT=")),
        (("*ELEMENT", "*NGEN\n1,2\n*ELEMENT"), naming("line 27", found="*NGEN")),
        (("1, 0, 0\n", "1, 0, x\n"), naming("line 2", found="1, 0, x", expected="numbers")),
        (("1, 1, 2, 7, 6\n", "1, 1, 2, 7, 99\n"), naming("*ELEMENT", found="99")),
        (("1, 1, 2, 7, 6\n", "1, 1, 2, 7, 6, 8\n"), naming(found="5 nodes", expected="CPS4 has 4")),
        (("2, 2, 3, 8, 7\n", "1, 2, 3, 8, 7\n"), naming("element 1", found="2 times")),
        (("*ELEMENT, TYPE=CPS4", "*ELEMENT"), naming("*ELEMENT", found="TYPE")),
        (("*ELEMENT", "*ELSET, ELSET=a\nb\n*ELEMENT"), naming("*ELSET", found="'b'")),
        (("*ELEMENT", "*ELSET, ELSET=a\na\n*ELEMENT"), naming("*ELSET", found="'a'")),
        (("*ELEMENT", "*INSTANCE, NAME=i, PART=p\n*ELEMENT"), naming("*INSTANCE", found="PART=p")),
    ],
)
def test_what_is_refused(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    text = plate()
    assert change[0] in text
    with pytest.raises(SceneError, match=message) as caught:
        read_abaqus(written(tmp_path, text.replace(*change, 1)))
    assert str(caught.value).startswith(str(tmp_path / "part.inp"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("rows", ["1, 2, 3, 4, 5", "0,0,0\n1,2,3", "0,0,0\n0,0,0,0,0,0,90"])
def test_an_instance_that_is_badly_placed(rows: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=naming("part.inp", "*INSTANCE")):
        read_abaqus(written(tmp_path, PARTS.replace("ROW", rows)))
