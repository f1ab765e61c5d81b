"""Meshes that Gmsh and netCDF4 read: all versions of MSH, Nastran, UNV, Exodus."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.drawing import mesh_checks
from pdmesh.drawing.file_reading import build_file
from pdmesh.drawing.mesh_arrays import Mesh
from pdmesh.drawing.nastran import checked_bulk

STEEL = [("Material/E", "2e11"), ("Material/rho", "7800"), ("Material/G0", "10"), ("Units", "mm")]
VERSIONS = [(1.0, 0), (2.2, 0), (2.2, 1), (3.0, 0), (3.0, 1), (4.0, 0), (4.1, 0), (4.1, 1)]


def written(path: Path, version: float = 4.1, binary: int = 0, **options: float) -> Path:
    """A plate of 6 x 2 mm in two halves as Gmsh writes it; both are in "all", the right one in "half" too."""
    import gmsh

    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for x in (0, 3):
            gmsh.model.occ.addRectangle(x, 0, 0, 3, 2)
        gmsh.model.occ.fragment([(2, 1)], [(2, 2)])
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1, 2], name="all")
        gmsh.model.addPhysicalGroup(2, [2], name="half")
        right = gmsh.model.getEntitiesInBoundingBox(5.9, -1, -1, 7, 3, 1, 1)
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in right], name="load:right")
        for curve in (tag for _, tag in gmsh.model.getEntities(1)):
            x0, _, _, x1, _, _ = gmsh.model.getBoundingBox(1, curve)
            gmsh.model.mesh.setTransfiniteCurve(curve, 4 if x1 - x0 > 1 else 3)
        for face in (1, 2):
            gmsh.model.mesh.setTransfiniteSurface(face)
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        for name, value in options.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def quads(mesh: Mesh) -> int:
    """The number of quads of a mesh."""
    return sum(len(block.data) for block in mesh.cells if block.type == "quad")


def members(mesh: Mesh, name: str, kind: str) -> int:
    """The number of cells of a kind in a set."""
    return sum(
        len(rows) for block, rows in zip(mesh.cells, mesh.cell_sets[name], strict=True) if block.type == kind
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("version", "binary"), VERSIONS)
def test_every_version_of_msh(version: float, binary: int, tmp_path: Path) -> None:
    mesh = mesh_checks.read(written(tmp_path / "plate.msh", version, binary))
    names = ("1", "2", "3") if version == 1 else ("all", "half", "load:right")  # which version 1 does not write
    if version == 1:
        assert set(mesh.cell_sets) <= set(names)
    else:
        assert [members(mesh, name, "quad") for name in names] == [12, 6, 0]
        assert members(mesh, "load:right", "line") == 2
    assert quads(mesh) == 12  # though versions 1 and 2 repeat those of the second group


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"SaveAll": 1.0}, {"SaveAll": 1.0, "SaveParametric": 1.0}])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_meshes_saved_with_all_their_cells(version: float, options: dict[str, float], tmp_path: Path) -> None:
    path = written(tmp_path / "plate.msh", version, **options)
    named = version == 4.1  # the older version has no groups then
    built = build_file(path, [*STEEL, *([("Loads/right/Traction x", "1e6")] * named)])
    assert len(built.grid) == 12
    assert built.grid.size == pytest.approx(12e-6)
    assert [len(condition.nodes or ()) for condition in built.settings.conditions] == [4] * named


@pytest.mark.slow
def test_parametric_nodes_of_version_2(tmp_path: Path) -> None:
    path = written(tmp_path / "plate.msh", 2.2, SaveParametric=1)
    assert b"$ParametricNodes" in path.read_bytes()
    built = build_file(path, [*STEEL, ("Loads/right/Traction x", "1e6"), ("Materials/half/E", "1e11")])
    assert len(built.grid) == 12
    assert len(built.settings.conditions[0].nodes or ()) == 4
    assert len(built.settings.regions[0].nodes or ()) == 6


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".bdf", ".nas", ".unv"])
def test_other_formats_of_gmsh(suffix: str, tmp_path: Path) -> None:
    written(tmp_path / "plate.bdf" if suffix == ".nas" else tmp_path / f"plate{suffix}")
    if suffix == ".nas":
        (tmp_path / "plate.bdf").rename(tmp_path / "plate.nas")
    mesh = mesh_checks.read(tmp_path / f"plate{suffix}")
    assert quads(mesh) == 12
    assert sorted(members(mesh, name, "quad") for name in mesh.cell_sets) == (
        [0, 6, 12] if suffix == ".unv" else [0, 6, 6]
    )


def test_only_meshes_reach_gmsh_as_msh(tmp_path: Path) -> None:
    """It takes text that it does not know for a script's."""
    path = tmp_path / "plate.msh"
    path.write_text("\n$MeshFormat\nPoint(1) = {0, 0, 0};\n")
    assert mesh_checks._reader(path, ".msh") == "meshio"
    path.write_text("$MeshFormat\n")
    assert mesh_checks._reader(path, ".msh") == "gmsh"


@pytest.mark.slow
@pytest.mark.parametrize("text", ["$MeshFormat\n4.1 0 8\n", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0\n"])
def test_a_mesh_that_is_cut_off(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plate.msh"
    path.write_text(text)
    with pytest.raises(SceneError) as caught:
        build_file(path, STEEL)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


# ---- Nastran

BULK = """BEGIN BULK
GRID    1               0.      0.      0.
GRID    2               4.      0.      0.
GRID    3               4.      3.      0.
GRID    4               0.      3.      0.
CQUAD4  7       PROP1       2       3       4
ENDDATA
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        BULK.replace("PROP", "3       "),
        BULK.replace("PROP", "        "),  # where Gmsh takes the first node for the property
        BULK.replace("PROP", "        ").replace("CQUAD4  ", "CQUADR  "),
        "GRID,1,,0.,0.,0.\nGRID,2,,4.,0.,0.\nGRID,3,,4.,3.,0.\nGRID,4,,0.,3.,0.\nCQUAD4,7,,1,2,3,4\n",
    ],
)
def test_properties_that_nastran_leaves_out(text: str, tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(text)
    mesh = mesh_checks.read(tmp_path / "plate.bdf")
    (block,) = mesh.cells
    assert mesh.points[block.data[0]].tolist() == [[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("GRID    1        ", "GRID    1       5"), naming("line 2", "GRID", found="coordinate system 5")),
        (("CQUAD4", "CSHEAR"), naming("line 6", found="CSHEAR", expected="CQUAD4")),
        (("BEGIN BULK", "INCLUDE 'a.bdf'"), naming("line 1", found="INCLUDE")),
        (("GRID    4   ", "GRID    4.7 "), naming("line 5", "GRID", found="4.7", expected="whole number")),
        (("GRID    4", "GRID    \u00b2"), naming("line 5", "GRID", expected="whole number")),
        (("GRID    1               0.      0.      0.", "GRID,99999999999,,0.,0.,0."), naming("line 2", "99999999999")),
        (("3       4\n", "3       4x\n"), naming("line 6", "CQUAD4", found="4x", expected="whole number")),
        (("4.      3. ", "nan     3. "), naming("line 4", "GRID", found="nan", expected="finite")),
        (("4.      3. ", "1.+400  3. "), naming("line 4", "GRID", found="1.+400", expected="finite")),
        (("4.      3. ", "4,5     3. "), naming("line 4", "GRID")),
        (("BEGIN BULK", "$ \u00c5 \x0b INCLUDE \x1c INCLUDE\nCSHEAR"), naming("line 2", found="CSHEAR")),
    ],
)
def test_what_gmsh_would_read_wrongly_is_refused(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    text = BULK.replace("PROP", "3       ").replace(*change)
    (tmp_path / "plate.bdf").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        mesh_checks.read(tmp_path / "plate.bdf")


@pytest.mark.parametrize(
    ("line", "bulk"),
    [
        ("GRID    3               +4.00000+3.-0   +.0", "GRID    3                4.00000 3.-0    .0"),
        ("GRID,3,,+4.,-3.,+0", "GRID,3,, 4.,-3., 0"),
        ("GRID*   3                               +4.             +3.             *1\n*1      +0.", None),
    ],
)
def test_signs_before_coordinates(line: str, bulk: str | None, tmp_path: Path) -> None:
    """Gmsh reads +4. as 0."""
    (tmp_path / "a.bdf").write_text(line)
    data = checked_bulk(tmp_path / "a.bdf")[0].decode()
    assert data == (bulk or line.replace("+", " ")) + "\n"


# ---- Exodus


def exodus(path: Path, kind: str, fill: Callable[[object], None] | None = None) -> Path:
    """A netCDF file of 3 x 2 cells of 2 mm, or of their middles as particles."""
    netcdf = pytest.importorskip("netCDF4")
    spheres = kind in ("SPHERE", "CIRCLE")
    columns, rows, first = (3, 2, 1.0) if spheres else (4, 3, 0.0)
    x, y = np.meshgrid(first + 2.0 * np.arange(columns), first + 2.0 * np.arange(rows))
    corner = np.array([i + 4 * j for j in range(2) for i in range(3)])
    cells = np.arange(6)[:, None] if spheres else corner[:, None] + np.array([0, 1, 5, 4])
    with netcdf.Dataset(str(path), "w", format="NETCDF3_64BIT_OFFSET") as file:
        for name, size in (("num_nodes", x.size), ("num_el_blk", 2), ("len_name", 33), ("one", 1), ("two", 2)):
            file.createDimension(name, size)
        for name, values in (("coordx", x), ("coordy", y)):
            file.createVariable(name, "f8", ("num_nodes",))[:] = values.ravel()
        file.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = [10, 20]
        for block, some in enumerate((cells[:4], cells[4:]), start=1):
            file.createDimension(f"el{block}", len(some))
            file.createDimension(f"nod{block}", some.shape[1])
            connect = file.createVariable(f"connect{block}", "i4", (f"el{block}", f"nod{block}"))
            connect[:] = some + 1
            connect.elem_type = kind
        if fill:
            fill(file)
    return path


def volumes(file: object) -> None:
    """Radius and volume of each particle."""
    for block in (1, 2):
        attribute = file.createVariable(f"attrib{block}", "f8", (f"el{block}", "two"))  # type: ignore[attr-defined]
        attribute[:] = np.tile([1.0, 4.0], (4 if block == 1 else 2, 1))


def sides(file: object) -> None:
    """The upper sides of the last two cells, and the nodes at the left, each in a set with a name."""
    file.createVariable("ss_prop1", "i4", ("one",))[:] = [5]  # type: ignore[attr-defined]
    file.createVariable("ns_prop1", "i4", ("one",))[:] = [6]  # type: ignore[attr-defined]
    file.createDimension("three", 3)  # type: ignore[attr-defined]
    names = file.createVariable("ss_names", "S1", ("one", "len_name"))  # type: ignore[attr-defined]
    names[0, :3] = np.array(list("top"), dtype="S1")
    file.createVariable("elem_ss1", "i4", ("two",))[:] = [5, 6]  # type: ignore[attr-defined]
    file.createVariable("side_ss1", "i4", ("two",))[:] = [3, 3]  # type: ignore[attr-defined]
    file.createVariable("node_ns1", "i4", ("three",))[:] = [1, 5, 9]  # type: ignore[attr-defined]


SUFFIXES = [pytest.param(suffix, "QUAD4", marks=pytest.mark.slow) for suffix in mesh_checks.EXODUS]
TYPES = [pytest.param(".g", kind, marks=pytest.mark.slow) for kind in ("QUAD", "SHELL4", "quad")]


@pytest.mark.process
@pytest.mark.parametrize(("suffix", "kind"), [(".g", "QUAD4"), *SUFFIXES, *TYPES])
def test_exodus(suffix: str, kind: str, tmp_path: Path) -> None:
    path = exodus(tmp_path / f"plate{suffix}", kind, sides)
    values = [("Loads/top/Traction y", "1e6"), ("Fixes/nodeset_6/Components", "xy"), ("Materials/block_20/E", "1e11")]
    built = build_file(path, [*STEEL, *values])
    assert len(built.grid) == 6
    assert built.grid.size == pytest.approx(24e-6)
    by_name = {condition.name: condition.nodes for condition in built.settings.conditions}
    assert by_name == {"top": (2, 3, 5, 6), "nodeset_6": (1, 4)}
    assert built.settings.regions[0].nodes == (5, 6)


@pytest.mark.process
@pytest.mark.parametrize("kind", ["SPHERE", pytest.param("CIRCLE", marks=pytest.mark.slow)])
def test_particles_of_exodus_are_nodes(kind: str, tmp_path: Path) -> None:
    built = build_file(exodus(tmp_path / "plate.e", kind, volumes), [*STEEL, ("Materials/block_20/E", "1e11")])
    assert built.grid.position[0] == pytest.approx([1e-3, 1e-3])
    assert built.grid.delta == pytest.approx(2e-3)
    assert built.grid.areas == pytest.approx(4e-6)
    assert built.settings.regions[0].nodes == (5, 6)


@pytest.mark.process
@pytest.mark.parametrize(("kind", "message"), [("SPHERE", "points have no volume"), ("NSIDED", "elements 'NSIDED'")])
def test_exodus_that_is_refused(kind: str, message: str, tmp_path: Path) -> None:
    path = exodus(tmp_path / "plate.g", kind)
    with pytest.raises(SceneError, match=naming("plate.g", found=message.replace("without", "6 points without"))):
        build_file(path, STEEL)
    (tmp_path / "text.g").write_text("no netCDF\n")
    with pytest.raises(SceneError) as caught:
        build_file(tmp_path / "text.g", STEEL)
    assert mentions(caught.value, "text.g", expected="Exodus")
