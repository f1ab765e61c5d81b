"""What is exported, read back by meshio, and by VTK where it is installed."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from pdpost import export
from pdpost.export import ExportError
from pdsolve.results import Results


def moved(results: Results, step: int) -> np.ndarray:
    """The displacement (n, 3) of a frame."""
    u = [results.field(name, step) for name in ("ux", "uy")]
    return np.column_stack([*u, np.zeros_like(u[0])])


def test_a_frame_as_vtu(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        export.vtu(results, 40, tmp_path / "a.vtu", also=("strain", "stress"))
        nodes = results.nodes()
        u, damage = moved(results, 40), results.field("damage", 40)
    mesh = meshio.read(tmp_path / "a.vtu")
    assert mesh.points == pytest.approx(np.column_stack([nodes.position, 0 * nodes.delta]))
    (cells,) = mesh.cells
    assert (cells.type, cells.data.ravel().tolist()) == ("vertex", list(range(252)))
    assert np.array_equal(mesh.point_data["displacement"], u)
    assert np.array_equal(mesh.point_data["damage"], damage)
    assert np.array_equal(mesh.point_data["node"], nodes.ids)
    assert np.array_equal(mesh.point_data["delta"], nodes.delta)
    assert mesh.point_data["stress"].shape == (252, 9)
    assert list(tmp_path.glob(".*")) == []


def test_squares_carry_their_nodes_numbers(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        export.vtu(results, 60, tmp_path / "a.vtu", squares=True)
        nodes = results.nodes()
    mesh = meshio.read(tmp_path / "a.vtu")
    corners = mesh.points[mesh.cells_dict["quad"]]
    assert corners.mean(axis=1)[:, :2] == pytest.approx(nodes.position, abs=1e-15)
    assert np.array_equal(mesh.point_data["node"].reshape(-1, 4), np.repeat(nodes.ids[:, None], 4, axis=1))


def test_a_series_as_pvd(small_results: Path, tmp_path: Path) -> None:
    """Each frame with its time, the files beside the list."""
    with Results.open(small_results) as results:
        export.pvd(results, tmp_path / "a.pvd", [0, 20, 60])
        u = moved(results, 20)
    entries = ElementTree.parse(tmp_path / "a.pvd").getroot().findall("Collection/DataSet")
    assert [float(entry.attrib["timestep"]) for entry in entries] == pytest.approx([0.0, 1e-6, 3e-6])
    mesh = meshio.read(tmp_path / entries[1].attrib["file"])
    assert np.array_equal(mesh.point_data["displacement"], u)


def test_a_series_as_xdmf(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        export.xdmf(results, tmp_path / "a.xdmf", [0, 40, 60])
        u = moved(results, 60)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(("a.", "."))] == ["a.xdmf"]
    with meshio.xdmf.TimeSeriesReader(tmp_path / "a.xdmf") as series:
        points, _ = series.read_points_cells()
        read = [series.read_data(number) for number in range(series.num_steps)]
    assert points.shape == (252, 3)
    assert [time for time, _, _ in read] == pytest.approx([0.0, 2e-6, 3e-6])
    assert read[2][1]["displacement"] == pytest.approx(u, rel=1e-6)


def test_a_frame_as_csv(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        export.table(results, 60, tmp_path / "a.csv")
        nodes, uy = results.nodes(), results.field("uy", 60)
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["node"]) for row in rows] == nodes.ids.tolist()
    assert np.array_equal(np.array([row["uy"] for row in rows], dtype=np.float32), uy)
    assert list(rows[0]) == ["node", "x", "y", "delta", "area", "ux", "uy", "vx", "vy", "ax", "ay", "energy", "damage"]


@pytest.mark.parametrize("suffix", [".vtu", ".xdmf"])
def test_the_same_bytes_each_time(small_results: Path, tmp_path: Path, suffix: str) -> None:
    written = []
    for name in ("one", "two"):
        with Results.open(small_results) as results:
            path = tmp_path / f"{name}{suffix}"
            export.vtu(results, 60, path) if suffix == ".vtu" else export.xdmf(results, path, [0, 60])
            written.append(path.read_bytes())
    assert written[0] == written[1]


def test_formats_there_are_none_of() -> None:
    with pytest.raises(ExportError, match=r"a\.foo: found suffix '\.foo', expected one of \.vtu, \.pvd, \.xdmf, \.csv"):
        export.check_suffix(Path("a.foo"))


def test_vtk_reads_what_is_exported(small_results: Path, tmp_path: Path) -> None:
    """VTK is what ParaView is made of: vectors, tensors and numbers arrive where they were."""
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    with Results.open(small_results) as results:
        export.vtu(results, 60, tmp_path / "a.vtu", also=("stress",))
        nodes, u, damage = results.nodes(), moved(results, 60), results.field("damage", 60)
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "a.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    data = grid.GetPointData()
    assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells(), grid.GetCellType(0)) == (252, 252, 1)
    assert vtk_to_numpy(grid.GetPoints().GetData())[:, :2] == pytest.approx(nodes.position)
    assert np.array_equal(vtk_to_numpy(data.GetArray("displacement")), u)
    assert np.array_equal(vtk_to_numpy(data.GetArray("damage")), damage)
    assert data.GetArray("stress").GetNumberOfComponents() == 9


def test_vtk_reads_a_series(small_results: Path, tmp_path: Path) -> None:
    vtk = pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    with Results.open(small_results) as results:
        export.xdmf(results, tmp_path / "a.xdmf", [0, 40, 60])
        u = moved(results, 60)
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(tmp_path / "a.xdmf"))
    reader.UpdateInformation()
    key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    information = reader.GetOutputInformation(0)
    times = [information.Get(key, number) for number in range(information.Length(key))]
    assert times == pytest.approx([0.0, 2e-6, 3e-6])
    reader.UpdateTimeStep(times[-1])
    data = reader.GetOutputDataObject(0).GetBlock(0).GetPointData()
    assert vtk_to_numpy(data.GetArray("displacement")) == pytest.approx(u, rel=1e-6)
