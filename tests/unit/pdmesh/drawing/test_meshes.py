"""Existing meshes as grids."""

from __future__ import annotations

import contextlib
import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.drawing import mesh_checks
from pdmesh.drawing.file_reading import MESHES
from pdmesh.drawing.meshes import read_mesh
from pdmesh.model.document import Load
from pdmesh.model.visibility import plate_of

NX, NY, STEP = 8, 4, 1e-3


def plate(solid: bool = False) -> meshio.Mesh:
    """8 x 4 mm: quads on the left half, triangles on the right, with groups and one hole of a cell."""
    x, y = np.meshgrid(np.arange(NX + 1) * STEP, np.arange(NY + 1) * STEP)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = [(i + j * (NX + 1)) for j in range(NY) for i in range(NX)]
    quads = [[c, c + 1, c + NX + 2, c + NX + 1] for c in corner if c % (NX + 1) < 4 and c != 1 + 1 * (NX + 1)]
    halves = [c for c in corner if c % (NX + 1) >= 4]
    triangles = [t for c in halves for t in ([c, c + 1, c + NX + 2], [c, c + NX + 2, c + NX + 1])]
    top = [[i + NY * (NX + 1), i + 1 + NY * (NX + 1)] for i in range(NX)]
    crack = [[4 + 2 * (NX + 1), 5 + 2 * (NX + 1)], [5 + 2 * (NX + 1), 6 + 2 * (NX + 1)]]
    cells = [("quad", quads), ("triangle", triangles), ("line", top), ("line", crack)]
    physical = [np.full(len(block), tag) for tag, (_, block) in zip((1, 2, 3, 4), cells, strict=True)]
    if solid:
        cells, physical = [*cells, ("tetra", [[0, 1, 2, 9]])], [*physical, np.array([1])]
    return meshio.Mesh(
        points,
        cells,
        cell_data={"gmsh:physical": physical, "gmsh:geometrical": physical},
        field_data={
            "steel": np.array([1, 2]),
            "glass": np.array([2, 2]),
            "load:top": np.array([3, 1]),
            "crack:slit": np.array([4, 1]),
        },
    )


def triangle(apex: tuple[float, float, float]) -> meshio.Mesh:
    return meshio.Mesh([[0, 0, 0], [1, 0, 0], apex], [("triangle", [[0, 1, 2]])])


SET = [("Loads/top/Traction y", "1e6"), ("Material/E", "1e9"), ("Material/rho", "1e3"), ("Material/G0", "10")]


@pytest.mark.slow
def test_cells_become_nodes(tmp_path: Path) -> None:
    path = tmp_path / "part.msh"
    meshio.write(path, plate(), file_format="gmsh22", binary=False)
    grid, settings, notes = read_mesh(path, [*SET, ("Materials/steel/E", "2e11")])
    assert len(grid) == 15 + 32
    assert grid.areas is not None
    assert grid.areas[:15] == pytest.approx(1e-6)
    assert grid.areas[15:] == pytest.approx(0.5e-6)
    assert grid.delta == pytest.approx(np.sqrt(grid.areas))
    assert grid.position[0] == pytest.approx((0.5e-3, 0.5e-3))
    outline = plate_of(grid)
    assert outline is not None
    assert grid.areas.sum() == pytest.approx(outline.area, rel=1e-12)
    assert len(grid.holes) == 1
    assert (grid.hole_id == 0).sum() == 8  # the cells around the missing one
    assert grid.cracks == pytest.approx(np.array([[4, 2, 5, 2], [5, 2, 6, 2]]) * 1e-3)
    (region,) = settings.regions
    assert (region.name, region.material.E, region.nodes) == ("steel", 2e11, tuple(range(1, 16)))
    (load,) = settings.conditions
    assert isinstance(load, Load)
    assert load.length == pytest.approx(8e-3)
    assert len(load.nodes or ()) == 20  # as deep as a horizon
    assert notes == ("group 'glass': no material of its own (--set Materials/glass/E=... gives one)",)


def named(face: str, line: str) -> meshio.Mesh:
    """The plate with other names for the triangles' group and the crack's."""
    mesh = plate()
    mesh.field_data = {
        "steel": np.array([1, 2]),
        face: np.array([2, 2]),
        "load:top": np.array([3, 1]),
        line: np.array([4, 1]),
    }
    return mesh


@pytest.mark.slow
def test_a_mesh_in_millimetres(tmp_path: Path) -> None:
    grids = []
    for scale, unit in ((1.0, []), (1e3, [("Units", "mm")])):
        mesh = plate()
        mesh.points *= scale
        meshio.write(tmp_path / "part.msh", mesh, file_format="gmsh22", binary=False)
        grids.append(read_mesh(tmp_path / "part.msh", [*SET, *unit]))
    (first, settings, _), (second, others, _) = grids
    for field in ("position", "delta", "areas", "cracks", "border", "hole_id"):
        assert getattr(second, field) == pytest.approx(getattr(first, field), rel=1e-12), field
    assert others.conditions[0].nodes == settings.conditions[0].nodes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("face", "line", "message"),
    [
        ("zones:fine", "crack:slit", naming('Surface("zones:fine")', expected='Surface("zone:fine")')),
        ("glass", "craks:a", naming('Curve("craks:a")', expected='Curve("crack:a")')),
        ("crack:a", "crack:slit", naming('Surface("crack:a")', expected='Curve("crack:a")')),
    ],
)
def test_groups_that_mean_nothing(face: str, line: str, message: str, tmp_path: Path) -> None:
    meshio.write(tmp_path / "part.msh", named(face, line), file_format="gmsh22", binary=False)
    with pytest.raises(SceneError, match=message):
        read_mesh(tmp_path / "part.msh", SET)


@pytest.mark.slow
def test_a_group_of_lines_without_a_kind_is_said_not_to_be_used(tmp_path: Path) -> None:
    meshio.write(tmp_path / "part.msh", named("glass", "slit"), file_format="gmsh22", binary=False)
    _, _, notes = read_mesh(tmp_path / "part.msh", SET)
    assert mentions(notes, "curve 'slit'", "not used")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Fixs/rim/Box", "Plate/Length", "Material/Rho"])
def test_a_parameter_that_means_nothing(name: str, tmp_path: Path) -> None:
    meshio.write(tmp_path / "part.msh", plate(), file_format="gmsh22", binary=False)
    with pytest.raises(SceneError, match=naming("part.msh", f"parameter 'Peridynamics/{name}' is")):
        read_mesh(tmp_path / "part.msh", [*SET, (name, "1")])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".vtu", ".inp", ".msh"])
def test_formats(suffix: str, tmp_path: Path) -> None:
    mesh = plate()
    bare = meshio.Mesh(mesh.points, [(block.type, block.data) for block in mesh.cells[:2]])
    path = tmp_path / f"part{suffix}"
    meshio.write(path, bare)
    grid, settings, _ = read_mesh(path)
    assert len(grid) == 47
    assert settings.material is None


@pytest.mark.process
def test_named_sets_of_abaqus(tmp_path: Path) -> None:
    mesh = plate()
    bare = meshio.Mesh(mesh.points, [(block.type, block.data) for block in mesh.cells[:2]])
    bare.cell_sets = {"core": [np.arange(15), np.array([], dtype=int)]}
    path = tmp_path / "part.inp"
    meshio.write(path, bare)
    _, settings, _ = read_mesh(path, [*SET[1:], ("Materials/core/E", "2e11")])
    assert settings.regions[0].nodes == tuple(range(1, 16))


@pytest.mark.slow
def test_meshes_of_gmsh(tmp_path: Path) -> None:
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addDisk(0, 0, 0, 0.01, 0.01)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], name="disc")
    gmsh.model.addPhysicalGroup(1, [1], name="fix:rim")
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 1e-3)
    gmsh.model.mesh.generate(2)
    gmsh.write(str(tmp_path / "disc.msh"))
    gmsh.finalize()
    grid, settings, _ = read_mesh(tmp_path / "disc.msh", [*SET[1:], ("Fixes/rim/Components", "y")])
    assert grid.areas is not None
    assert grid.areas.sum() == pytest.approx(np.pi * 1e-4, rel=0.01)  # measured: 0.64 % of the chords
    held = grid.position[np.array(settings.conditions[0].nodes) - 1]
    assert np.hypot(*held.T).min() > 0.0085


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("name", "mesh", "message"),
    [
        ("missing.msh", None, "cannot be read: there is no such file"),
        ("text.msh", b"no mesh\n", naming("text.msh", expected=("format", "suffix"))),
        ("empty.vtu", b"", naming("empty.vtu", expected="mesh")),
        ("solid.msh", plate(solid=True), naming("cell 0", found="volume")),
        ("tilted.vtu", triangle((0, 1, 1.0)), naming("points", found="z has several values", expected="plane mesh")),
        ("flat.vtu", triangle((2, 0, 0.0)), naming("cell 0", found="area")),
        ("nan.vtu", triangle((np.nan, 1, 0)), naming("point 2", found="nan", expected="finite")),
        ("lines.vtu", meshio.Mesh([[0, 0, 0], [1, 0, 0.0]], [("line", [[0, 1]])]), naming(found=("triangle", "quad"))),
        ("mm.vtu", triangle((0, 100, 0.0)), "not millimetres"),
    ],
)
def test_bad_meshes(name: str, mesh: object, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if isinstance(mesh, bytes):
        path.write_bytes(mesh)
    elif isinstance(mesh, meshio.Mesh):
        meshio.write(path, mesh, **({"file_format": "gmsh22"} if name.endswith(".msh") else {}))
    with pytest.raises(SceneError, match=message) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(str(path))


NEEDS = {".xdmf": "h5py", ".med": "h5py", **dict.fromkeys(mesh_checks.EXODUS, "netCDF4")}  # the extra pdsuite[meshes]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [suffix for suffix in MESHES if suffix not in (".unv", ".txt")])
def test_a_good_file_of_each_format_is_read_behind_the_walls(suffix: str, tmp_path: Path) -> None:
    if suffix in NEEDS:
        pytest.importorskip(NEEDS[suffix])
    points = np.array([[0.0, 0.0, 0.0], [0.004, 0.0, 0.0], [0.004, 0.003, 0.0], [0.0, 0.003, 0.0]])
    mesh = meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))])
    path = tmp_path / f"plate{suffix}"
    with warnings.catch_warnings(), contextlib.redirect_stdout(None):
        warnings.simplefilter("ignore")
        meshio.write(
            path, mesh, file_format={".msh": "gmsh22"}.get(suffix, "exodus" if suffix in mesh_checks.EXODUS else None)
        )
    found = mesh_checks.read(path)
    assert [(block.type, len(block.data)) for block in found.cells] == [("triangle", 2)]
    corners = np.unique(found.points[found.cells[0].data.ravel()].round(9), axis=0)
    assert corners.tolist() == np.unique(points[:, : corners.shape[1]], axis=0).tolist()
