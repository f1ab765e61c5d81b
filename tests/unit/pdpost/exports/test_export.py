"""What is exported, read back by meshio, and by VTK where it is installed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from messages import naming
from tampered_databases import tampered

from pdpost.__main__ import main
from pdpost.exports import frame_files
from pdpost.exports.frame_files import ExportError
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.results import Results, ResultsError


def moved(results: Results, step: int) -> np.ndarray:
    """The displacement (n, 3) of a frame."""
    u = [results.field(name, step) for name in ("ux", "uy")]
    return np.column_stack([*u, np.zeros_like(u[0])])


def test_a_frame_as_vtu(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        frame_files.vtu(results, 40, tmp_path / "a.vtu", also=("strain", "stress"))
        nodes = results.nodes()
        u, damage = moved(results, 40), damage_without_pre_cracks_at(results, 40).astype(np.float32)
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
        frame_files.vtu(results, 60, tmp_path / "a.vtu", squares=True)
        nodes = results.nodes()
    mesh = meshio.read(tmp_path / "a.vtu")
    corners = mesh.points[mesh.cells_dict["quad"]]
    assert corners.mean(axis=1)[:, :2] == pytest.approx(nodes.position, abs=1e-15)
    assert np.array_equal(mesh.point_data["node"].reshape(-1, 4), np.repeat(nodes.ids[:, None], 4, axis=1))


def test_a_series_as_pvd(small_results: Path, tmp_path: Path) -> None:
    """Each frame with its time, the files beside the list."""
    with Results.open(small_results) as results:
        frame_files.pvd(results, tmp_path / "a.pvd", [0, 20, 60])
        u = moved(results, 20)
    entries = ElementTree.parse(tmp_path / "a.pvd").getroot().findall("Collection/DataSet")
    assert [float(entry.attrib["timestep"]) for entry in entries] == pytest.approx([0.0, 1e-6, 3e-6])
    mesh = meshio.read(tmp_path / entries[1].attrib["file"])
    assert np.array_equal(mesh.point_data["displacement"], u)


def number_of(item: ElementTree.Element, folder: Path) -> np.ndarray:
    """What an item of XDMF points at, read as the format says: so many numbers of a kind from a place of a file."""
    kind = {"Float": "f", "Int": "i"}[item.attrib["NumberType"]]
    dtype = np.dtype(f"<{kind}{item.attrib['Precision']}")
    shape = [int(size) for size in item.attrib["Dimensions"].split()]
    assert (item.attrib["Format"], item.attrib["Endian"]) == ("Binary", "Little")
    data = (folder / str(item.text)).read_bytes()
    return np.frombuffer(data, dtype, int(np.prod(shape)), int(item.attrib["Seek"])).reshape(shape)


def test_a_series_as_xdmf(small_results: Path, tmp_path: Path) -> None:
    """Each frame with its time, places, cells and fields, bit for bit; what stays is written once."""
    with Results.open(small_results) as results:
        frame_files.xdmf(results, tmp_path / "a.xdmf", [0, 40, 60], also=("stress",))
        u, nodes = moved(results, 60), results.nodes()
    names = sorted(path.name for path in tmp_path.iterdir() if path.name.startswith(("a.", ".")))
    assert names == ["a.bin", "a.xdmf"]
    frames = ElementTree.parse(tmp_path / "a.xdmf").getroot().findall("Domain/Grid/Grid")
    assert [float(frame.find("Time").attrib["Value"]) for frame in frames] == pytest.approx([0.0, 2e-6, 3e-6])  # type: ignore[union-attr]
    places = {frame.findtext("Geometry/DataItem", "") for frame in frames}
    assert places == {"a.bin"}
    items = {one.attrib["Name"]: one.find("DataItem") for one in frames[2].findall("Attribute")}
    found = {name: number_of(item, tmp_path) for name, item in items.items() if item is not None}
    assert np.array_equal(found["displacement"], u)
    assert np.array_equal(found["node"].ravel(), nodes.ids)
    assert found["stress"].shape == (252, 9)
    for path, expected in (("Geometry", nodes.position), ("Topology", np.arange(252)[:, None])):
        seeks = {item.attrib["Seek"] for frame in frames for item in frame.findall(f"{path}/DataItem")}
        (item,) = frames[0].findall(f"{path}/DataItem")
        assert len(seeks) == 1
        assert np.array_equal(number_of(item, tmp_path)[:, : expected.shape[1]], expected)
    each = 3 * 252 * (3 * 3 * 4 + 2 * 4 + 9 * 8)  # displacement, velocity, acceleration, energy, damage, stress
    assert (tmp_path / "a.bin").stat().st_size == each + 252 * (3 * 8 + 8 + 8 + 8 + 8 + 2 * 4)  # and two conditions


def test_a_series_as_text_is_read_by_meshio(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        frame_files.xdmf(results, tmp_path / "a.xdmf", [0, 60], inline=True)
        u, nodes = moved(results, 60), results.nodes()
    assert [path.name for path in tmp_path.glob("a*")] == ["a.xdmf"]
    with meshio.xdmf.TimeSeriesReader(tmp_path / "a.xdmf") as series:
        points, cells = series.read_points_cells()
        time, data, _ = series.read_data(1)
    assert series.num_steps == 2
    assert time == pytest.approx(3e-6)
    assert np.array_equal(points[:, :2], nodes.position)
    assert cells[0].type == "vertex"
    assert np.array_equal(data["displacement"], u)
    assert np.array_equal(data["node"].ravel(), nodes.ids)


@pytest.mark.slow
def test_a_series_is_about_as_large_as_its_pvd(solved: Callable[[str], Path], tmp_path: Path) -> None:
    """As text it was six times as large."""
    with Results.open(solved("conservative")) as results:
        steps = results.frames()[0].tolist()
        frame_files.pvd(results, tmp_path / "a.pvd", steps)
        frame_files.xdmf(results, tmp_path / "b.xdmf", steps)
    sizes = [sum(file.stat().st_size for file in tmp_path.rglob(name)) for name in ("a*", "b.*")]
    assert 0.5 < sizes[1] / sizes[0] < 1.5  # measured 1.15


def test_what_fails_leaves_no_half_of_a_series(small_results: Path, tmp_path: Path) -> None:
    with tampered(small_results) as connection:
        connection.execute("DELETE FROM field_chunk WHERE field = 'ux' AND step = 40")
        connection.execute("UPDATE frame SET fields = replace(fields, 'ux ', '') WHERE step = 40")
    with (
        Results.open(small_results) as results,
        pytest.raises(ResultsError, match=naming(found="field 'ux'")),
    ):
        frame_files.xdmf(results, tmp_path / "a.xdmf", [0, 20, 40], also=("strain",))
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(("a.", "."))] == []


def test_a_frame_as_csv(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        frame_files.table(results, 60, tmp_path / "a.csv")
        nodes, uy = results.nodes(), results.field("uy", 60)
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["node"]) for row in rows] == nodes.ids.tolist()
    assert np.array_equal(np.array([row["uy"] for row in rows], dtype=np.float32), uy)
    fields = ["ux", "uy", "vx", "vy", "ax", "ay", "energy", "damage"]
    assert list(rows[0]) == ["node", "x", "y", "delta", "area", *fields, "load 0", "load 1"]


@pytest.mark.parametrize("suffix", [".vtu", ".xdmf"])
def test_the_same_bytes_each_time(small_results: Path, tmp_path: Path, suffix: str) -> None:
    written = []
    for name in ("one", "two"):
        with Results.open(small_results) as results:
            (tmp_path / name).mkdir()
            path = tmp_path / name / f"a{suffix}"
            frame_files.vtu(results, 60, path) if suffix == ".vtu" else frame_files.xdmf(results, path, [0, 60])
            written.append([file.read_bytes() for file in sorted(path.parent.iterdir())])
    assert written[0] == written[1]


def test_formats_there_are_none_of() -> None:
    with pytest.raises(ExportError, match=naming("a.foo", found="suffix '.foo'")):
        frame_files.check_suffix(Path("a.foo"))


@pytest.mark.slow  # importing vtk alone takes a second
def test_vtk_reads_what_is_exported(small_results: Path, tmp_path: Path) -> None:
    """VTK is what ParaView is made of: vectors, tensors and numbers arrive where they were."""
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    with Results.open(small_results) as results:
        frame_files.vtu(results, 60, tmp_path / "a.vtu", also=("stress",))
        nodes, u, damage = (
            results.nodes(),
            moved(results, 60),
            damage_without_pre_cracks_at(results, 60).astype(np.float32),
        )
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


@pytest.mark.slow  # importing vtk alone takes a second
def test_vtk_reads_a_series(small_results: Path, tmp_path: Path) -> None:
    vtk = pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    with Results.open(small_results) as results:
        frame_files.xdmf(results, tmp_path / "a.xdmf", [0, 40, 60])
        u, nodes = moved(results, 60), results.nodes()
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(tmp_path / "a.xdmf"))
    reader.UpdateInformation()
    key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    information = reader.GetOutputInformation(0)
    times = [information.Get(key, number) for number in range(information.Length(key))]
    assert times == pytest.approx([0.0, 2e-6, 3e-6])
    reader.UpdateTimeStep(times[-1])
    grid = reader.GetOutputDataObject(0)
    data = grid.GetPointData()
    assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (252, 252)
    assert vtk_to_numpy(grid.GetPoints().GetData())[:, :2] == pytest.approx(nodes.position)
    assert np.array_equal(vtk_to_numpy(data.GetArray("displacement")), u)
    assert np.array_equal(vtk_to_numpy(data.GetArray("node")), nodes.ids)


def test_conditions_are_sets_of_nodes_by_their_names(
    small_results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.vtu"
    assert main(["export", str(small_results), "-o", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["conditions"]
    with Results.open(small_results) as results:
        named = json.loads(results.model())["conditions"]
        sets = frame_files.node_sets(results, 0)
    assert len(said) == len(named) > 1
    mesh = meshio.read(path)
    for number, (name, nodes) in enumerate(said.items()):
        assert name == f"{named[number]['kind']} {named[number].get('name') or number}"
        assert mesh.point_data[name].sum() == sets[name].sum() == nodes > 0
    assert main(["export", str(small_results), "-o", str(tmp_path / "a.csv")]) == 0
    header, *rows = csv.reader((tmp_path / "a.csv").read_text(encoding="utf-8").splitlines())
    inline = tmp_path / "a.xdmf"
    assert main(["export", str(small_results), "-o", str(inline), "--inline"]) == 0
    with meshio.xdmf.TimeSeriesReader(inline) as reader:
        reader.read_points_cells()
        data = [reader.read_data(step)[1] for step in range(reader.num_steps)]
    for name, nodes in said.items():
        assert sum(int(row[header.index(name)]) for row in rows) == nodes
        assert [int(each[name].sum()) for each in data] == [nodes] * len(data)
    capsys.readouterr()
    assert main(["export", str(small_results), "-o", str(path), "--force"]) == 0
    first = next(iter(said))
    assert f"conditions, with their nodes: {first} ({said[first]})" in capsys.readouterr().out
