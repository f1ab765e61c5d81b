"""Points with volumes become nodes, meshes of solids bodies, slits of double nodes pre-cracks."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.drawing.meshes import read_mesh
from pdmesh.drawing.point_cells import read_table
from pdmesh.grid.building import Built
from pdmesh.reports.report import info
from pdmesh.scene.body import Body

STEEL = [("Material/E", "2e11"), ("Material/rho", "7800"), ("Material/G0", "10"), ("Units", "mm")]


def bonds(built: Built) -> int:
    """Bonds that no crack cuts."""
    return int(info(built.document, "plate", "conservative")["bonds"])


# ---- points


def table(z: bool = True, header: str = "", thickness: float = 1.0, layers: int = 1) -> str:
    """12 x 8 nodes a layer, 1 apart, in blocks 1 and 7."""
    places = [(i, j, k) for k in range(layers) for j in range(8) for i in range(12)]
    rows = [
        " ".join(map(str, (*((x, y, k) if z else (x, y)), 1 if x < 6 else 7, thickness)))
        for x, y, k in places
    ]  # fmt: skip
    return "\n".join([*([header] if header else ["# made by hand"]), *rows]) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        table(),
        table(z=False),
        table(z=False, header="header: x y block_id volume"),
        table(header="header: x y z block_id volume").replace(" ", ", "),
        table(thickness=0.25),
    ],
)
def test_points_in_a_plane_are_nodes(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plate.txt"
    path.write_text(text)
    built = build_file(path, [*STEEL, ("Materials/block_7/E", "1e11")])
    grid = built.grid
    assert len(grid) == 96
    assert grid.position[:2] == pytest.approx(np.array([[0, 0], [1e-3, 0]]), abs=1e-12)
    assert grid.delta == pytest.approx(1e-3)
    assert grid.areas == pytest.approx(1e-6)
    assert grid.border.sum() == 36
    (region,) = built.settings.regions
    assert region.name == "block_7"
    assert region.nodes == tuple(np.flatnonzero(grid.position[:, 0] > 5.5e-3) + 1)
    assert mentions(built.notes, "thickness", "0.25") == ("0.25" in text)


def test_points_of_half_volume_at_the_edge_keep_it(tmp_path: Path) -> None:
    lines = [
        f"{x} {y} 0 1 {(0.5 if x in (0, 11) else 1) * (0.5 if y in (0, 7) else 1)}" for y in range(8) for x in range(12)
    ]
    (tmp_path / "plate.txt").write_text("\n".join(lines))
    grid = build_file(tmp_path / "plate.txt", STEEL).grid
    assert grid.areas.sum() == pytest.approx(77e-6)
    assert grid.delta == pytest.approx(1e-3)


def test_points_of_two_spacings_are_squares_side_by_side(tmp_path: Path) -> None:
    coarse = [(x + 1, y + 1, 4) for x in (0, 2, 4) for y in (0, 2, 4)]
    fine = [(6.5 + x, 0.5 + y, 1) for x in range(6) for y in range(6)]
    (tmp_path / "a.txt").write_text("\n".join(f"{x} {y} 0 1 {v}" for x, y, v in coarse + fine))
    grid = build_file(tmp_path / "a.txt", STEEL).grid
    assert sorted(set(grid.delta.round(9).tolist())) == [1e-3, 2e-3]
    assert grid.size == pytest.approx(72e-6)


def test_points_in_space_are_a_body(tmp_path: Path) -> None:
    (tmp_path / "block.txt").write_text(table(layers=3))
    grid = build_file(tmp_path / "block.txt", STEEL).grid
    assert grid.dimension == 3
    assert len(grid) == 12 * 8 * 3
    assert grid.areas == pytest.approx(1e-9)
    expected = [(i, j, k) for k in range(3) for j in range(8) for i in range(12)]
    assert grid.position == pytest.approx(np.array(expected) * 1e-3, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", naming("a.txt", found="no points")),
        ("1 2\n", naming("line 1", found="1 2", expected="x y z block volume")),
        ("0 0 0 1 1\n1 0 0 1 x\n", naming("line 2", found="1 0 0 1 x")),
        ("0 0 0 1.5 1\n1 0 0 1 1\n", naming("line 1", "block", found="1.5")),
        ("0 0 0 1 1\n1 0 0 1 -1\n", naming("point 1", "volume", found="-1")),
        ("0 0 0 1 1\n0 0 0 1 1\n", naming(found="(0, 0)")),
        ("header: x y z\n0 0 0\n", naming("line 1", expected="volume")),
        ("0 0 0 1 1\n1 0 0 1 1\n.3 .8 0 1 1\n", naming("points", expected="lattice")),
        ("0 0 0 1 1\n1 0 0 1 1\n.3 .8 1 1 1\n0 1 1 1 1\n", naming("points", found="4 on no lattice", expected="8")),
        ("0 0 0 1 1\n", naming("points", found="two")),
        ("# header: x y block_id volume\n", naming(found="no points")),
        ("0 0 0 1 1\nheader: x y block_id volume\n1 0 1 1\n", naming("line 2", found="header:", expected="before")),
        ("header: x y block volume\nheader: x y block volume\n", naming("line 2", found="header:")),
        ("0 0 0 1 1\n1 0 0 1e300 1\n", naming("line 2", "block", found="1e+300")),
        ("0 0 0 1 1\n1 0 0 9223372036854775808 1\n", naming("line 2", "block", found="9.22337e+18")),
        ("0 0 0 1 1\n1 0 0 1_0 1\n", naming("line 2", found="1 0 0 1_0 1")),
        ("0 0 0 1 1\n1 nan 0 1 1\n", naming("line 2", found="1 nan 0 1 1")),
        ("0 0 0 1 1\n1e200 0 0 1 1\n", naming("point 1", found="1e+200")),
        ("0 0 0 1 1\n1 0 0 1 1\n2 0 0 1 1\n1e20 0 0 1 1\n", naming("points", expected="lattice")),
        ("0 0 0 1 1\n1e-150 0 0 1 1\n0 0 1e-150 1 1\n", naming(found="(0, 0, 0)")),
        ("0 0 0 1 1e-320\n1 0 0 1 1e300\n", naming("point 0", "volume")),
    ],
)
@pytest.mark.filterwarnings("error")
def test_points_that_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(SceneError, match=message) as caught:
        read_mesh(path, STEEL)
    assert str(caught.value).startswith(f"{path}")


def test_letters_in_a_comment_and_many_blocks(tmp_path: Path) -> None:
    """The second byte of a letter, 0x85, ends no line."""
    rows = "".join(f"{x} {y} {x + 60 * y} 1\n" for y in range(60) for x in range(60))
    (tmp_path / "a.txt").write_text(f"# von Åsa \x0b\x1c bis Ende\n{rows}", encoding="utf-8")
    sets = read_table(tmp_path / "a.txt").cell_sets
    assert len(sets) == 3600
    assert sets["block_61"][0].tolist() == [61]


# ---- solids


def block(counts: tuple[int, int, int], kind: str = "hexahedron") -> meshio.Mesh:
    """A block of cells 1 wide, each cut into two wedges, six tetrahedra or six pyramids where asked."""
    nx, ny, nz = counts
    grid = np.array([(x, y, z) for z in range(nz + 1) for y in range(ny + 1) for x in range(nx + 1)], dtype=float)
    row, layer = nx + 1, (nx + 1) * (ny + 1)
    first = [x + y * row + z * layer for z in range(nz) for y in range(ny) for x in range(nx)]
    cells = np.array([[c, c + 1, c + 1 + row, c + row, *(c + layer + np.array([0, 1, 1 + row, row]))] for c in first])
    if kind == "wedge":
        cells = np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])
    elif kind == "tetra":
        halves = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
        cells = np.concatenate([cells[:, half] for half in halves])
    elif kind == "pyramid":
        middle = len(grid) + np.arange(len(cells))
        grid = np.concatenate([grid, grid[cells].mean(axis=1)])
        faces = [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
        cells = np.concatenate([np.column_stack([cells[:, face], middle]) for face in faces])
    return meshio.Mesh(grid, [(kind, cells)])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetra", "pyramid"])
def test_a_mesh_of_solids_is_a_body(kind: str, tmp_path: Path) -> None:
    meshio.write(tmp_path / "block.vtu", block((4, 3, 3), kind))
    built = build_file(tmp_path / "block.vtu", [*STEEL, ("Zones/body/Spacing", "1")])
    assert len(built.grid) == 36
    assert built.grid.size == pytest.approx(36e-9)
    assert built.grid.areas == pytest.approx(1e-9)
    assert built.grid.border.sum() == 34


def inp(mesh: meshio.Mesh, sets: str = "") -> str:
    """The Abaqus file of a mesh of hexahedra."""
    places = "".join(f"{n}, {x}, {y}, {z}\n" for n, (x, y, z) in enumerate(mesh.points, start=1))
    cells = "".join(f"{n}, {', '.join(map(str, c + 1))}\n" for n, c in enumerate(mesh.cells[0].data, start=1))
    return f"*NODE\n{places}*ELEMENT, TYPE=C3D8\n{cells}{sets}"


def test_regions_and_the_spacing_of_solids(tmp_path: Path) -> None:
    path = tmp_path / "block.inp"
    path.write_text(inp(block((4, 3, 3)), "*ELSET, ELSET=half, GENERATE\n1, 33, 4\n2, 34, 4\n"))
    built = build_file(path, [*STEEL, ("Materials/half/E", "1e11")])
    assert len(built.grid) == 36
    (region,) = built.settings.regions
    assert region.nodes == tuple(np.flatnonzero(built.grid.position[:, 0] < 2e-3) + 1)
    assert mentions(built.notes, "nodes are 1 mm apart", "Zones/body/Spacing")
    path.write_text(inp(block((2, 1, 1))))
    assert len(build_file(path, STEEL).grid) == 54  # three across


def slit_in(mesh: meshio.Mesh) -> meshio.Mesh:
    """The block with double nodes at z = 2 where x < 2, but for those at the tip."""
    low, high = mesh.points[:, 2] == 2, mesh.points[:, 0] < 2
    rows = np.flatnonzero(low & high)
    other = np.arange(len(mesh.points))
    other[rows] = len(mesh.points) + np.arange(len(rows))
    cells = mesh.cells[0].data.copy()
    upper = mesh.points[cells][:, :, 2].mean(axis=1) > 2
    cells[upper] = other[cells[upper]]
    return meshio.Mesh(np.concatenate([mesh.points, mesh.points[rows]]), [("hexahedron", cells)])


def test_a_slit_in_solids_is_a_pre_crack(tmp_path: Path) -> None:
    path = tmp_path / "block.inp"
    path.write_text(inp(slit_in(block((4, 3, 4)))))
    built = build_file(path, STEEL)
    assert mentions(built.notes, "double nodes", "6 faces", "pre-crack")
    assert len(built.grid.cracks) == 12
    corners = built.grid.cracks.reshape(-1, 3)
    assert corners[:, 2] == pytest.approx(2e-3)
    assert corners[:, 0].max() == pytest.approx(2e-3)
    assert built.grid.size == pytest.approx(48e-9)
    path.write_text(inp(block((4, 3, 4))))
    assert not len(build_file(path, STEEL).grid.cracks)


def test_solids_that_overlap_are_refused(tmp_path: Path) -> None:
    mesh = block((2, 3, 3))
    cells = np.concatenate([mesh.cells[0].data, mesh.cells[0].data[:1]])
    path = tmp_path / "block.inp"
    path.write_text(inp(meshio.Mesh(mesh.points, [("hexahedron", cells)])))
    with pytest.raises(SceneError, match=naming("block.inp", "cell", expected=("cells", "overlap"))):
        build_file(path, STEEL)


def test_options_of_plates_are_refused_of_solids(tmp_path: Path) -> None:
    path = tmp_path / "block.inp"
    path.write_text(inp(block((3, 3, 3))))
    with pytest.raises(SceneError, match=naming("--crack", found="body in space")):
        build_file(path, STEEL, cracks=["0,0,1,1"])
    assert isinstance(read_mesh(path, STEEL), Body)
    assert build_file(path, [*STEEL, ("--adapt", "none")]).grid.dimension == 3


def test_the_scene_of_a_mesh(tmp_path: Path) -> None:
    """As `pdmesh plan` reads it: of solids it is a body; a plate has its nodes."""
    path = tmp_path / "block.inp"
    path.write_text(inp(block((3, 3, 3))))
    assert isinstance(read_scene(path, STEEL), Body)
    path.write_text(plate(False))
    with pytest.raises(SceneError, match=naming("block.inp", found="mesh of a plate", expected="drawing")):
        read_scene(path, STEEL)


# ---- slits


def plate(slit: bool, columns: int = 12, rows: int = 8) -> str:
    """The Abaqus file of 12 x 8 quads, with double nodes at y = 4 from x = 0 to 6 where asked."""
    places = [(float(x), float(y)) for y in range(rows + 1) for x in range(columns + 1)]
    number = {place: at for at, place in enumerate(places, start=1)}
    upper = dict(number)
    if slit:
        for x in range(6):
            upper[float(x), 4.0] = len(places) + 1
            places.append((float(x), 4.0))
    text = "*NODE\n" + "".join(f"{n}, {x}, {y}\n" for n, (x, y) in enumerate(places, start=1)) + "*ELEMENT, TYPE=CPS4\n"
    for at in range(columns * rows):
        x, y = float(at % columns), float(at // columns)
        of = upper if y >= 4 else number
        corners = [of[corner] for corner in ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))]
        text += f"{at + 1}, {', '.join(map(str, corners))}\n"
    return text


@pytest.mark.parametrize("slit", [False, True])
def test_a_slit_of_double_nodes_is_a_pre_crack(slit: bool, tmp_path: Path) -> None:
    path = tmp_path / "plate.inp"
    path.write_text(plate(slit))
    built = build_file(path, STEEL)
    said = [note for note in built.notes if "double nodes" in note]
    assert len(said) == slit
    assert mentions(said, "(0, 4)", "(6, 4)", "6 mm") == slit
    cracks = built.grid.cracks
    assert np.hypot(*(cracks[:, 2:] - cracks[:, :2]).T).sum() == pytest.approx(6e-3 * slit)
    assert np.abs(cracks[:, [0, 2]]).max(initial=0) == pytest.approx(6e-3 * slit)


@pytest.mark.process
def test_a_slit_of_double_nodes_is_one_as_gmsh_writes_it(tmp_path: Path) -> None:
    """In MSH 2, which Gmsh reads; nodes at one place stay two."""
    nodes, cells = (part.splitlines() for part in plate(True).removeprefix("*NODE\n").split("*ELEMENT, TYPE=CPS4\n"))
    points = [line.replace(",", "") + " 0" for line in nodes]
    quads = [line.replace(",", " 3 2 0 1", 1).replace(",", "") for line in cells]
    head = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    body = ["$Nodes", str(len(points)), *points, "$EndNodes", "$Elements", str(len(quads)), *quads, "$EndElements", ""]
    path = tmp_path / "plate.msh"
    path.write_text("\n".join([*head, *body]))
    built = build_file(path, STEEL)
    assert mentions(built.notes, "double nodes", "(0, 4)", "(6, 4)", "6 mm")
    cracks = built.grid.cracks
    assert np.hypot(*(cracks[:, 2:] - cracks[:, :2]).T).sum() == pytest.approx(6e-3)


@pytest.mark.slow
def test_a_slit_of_double_nodes_cuts_bonds(tmp_path: Path) -> None:
    path = tmp_path / "plate.inp"
    counts = []
    for slit in (False, True):
        path.write_text(plate(slit))
        counts.append(bonds(build_file(path, STEEL)))
    assert counts == [870, 786]


def test_a_slit_that_ends_inside(tmp_path: Path) -> None:
    """Two of its double nodes, at the edge, are one again."""
    path = tmp_path / "plate.inp"
    path.write_text(plate(True).replace(", 118, 119,", ", 53, 54,").replace(", 119,", ", 54,"))
    cracks = build_file(path, STEEL).grid.cracks
    assert np.hypot(*(cracks[:, 2:] - cracks[:, :2]).T).sum() == pytest.approx(5e-3)
    assert np.abs(cracks[:, [0, 2]]).min() == pytest.approx(1e-3)


def test_cells_all_of_whose_nodes_are_their_own(tmp_path: Path) -> None:
    """Four cells in the middle: a pre-crack around them."""
    lines = plate(False).splitlines()
    nodes, cells = lines[1:118], lines[119:]
    own = {str(13 * y + x + 1): str(1000 + 13 * y + x) for x in (4, 5, 6) for y in (3, 4, 5)}
    copies = [
        line.replace(f"{old},", f"{own[old]},", 1) for line in nodes for old in [line.split(",")[0]] if old in own
    ]
    for at in (12 * 3 + 4, 12 * 3 + 5, 12 * 4 + 4, 12 * 4 + 5):
        number, *corners = cells[at].split(", ")
        cells[at] = ", ".join([number, *(own[corner] for corner in corners)])
    path = tmp_path / "plate.inp"
    path.write_text("\n".join(["*NODE", *nodes, *copies, "*ELEMENT, TYPE=CPS4", *cells]))
    cracks = build_file(path, STEEL).grid.cracks
    assert np.hypot(*(cracks[:, 2:] - cracks[:, :2]).T).sum() == pytest.approx(8e-3)


@pytest.mark.slow
def test_cells_without_any_common_node_are_joined(tmp_path: Path) -> None:
    corner = np.array([(x, y, 0.0) for y in range(3) for x in range(4)])
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    points = (corner[:, None] + square).reshape(-1, 3)
    mesh = meshio.Mesh(points, [("quad", np.arange(48).reshape(-1, 4))])
    meshio.write(tmp_path / "a.vtu", mesh)
    built = build_file(tmp_path / "a.vtu", STEEL)
    assert not len(built.grid.cracks)
    assert mentions(built.notes, "no two cells", "joined")
