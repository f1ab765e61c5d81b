"""Values of conditions from files of meshes: VTU and series of it, and results of CalculiX."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from pdmesh import Material, Run, Scene, box, build
from pdmesh.model.values_at_places import values_at
from pdmesh.model.values_of_place import PlaceError, Table
from pdmesh.scene.mesh_files import table_of_mesh
from pdmesh.scene.shapes import SceneError

PLATE = Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=65e9, rho=2235, G0=204), run=Run(solver="static"))
POINTS = np.array([[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0]], dtype=float)


def motion(time: float) -> np.ndarray:
    """Displacements of the points, m."""
    return np.column_stack([1e-3 * POINTS[:, 0] * time, 2e-3 * POINTS[:, 1] * time, np.zeros(4)])


def write_vtu(name: str, time: float) -> None:
    meshio.Mesh(POINTS, [("quad", [[0, 1, 2, 3]])], {"u": motion(time), "p": POINTS[:, 0]}).write(name)


def frd(digits: int = 10) -> str:
    """Two times of a plate of four nodes, in the format of CalculiX."""

    def rows(numbers: np.ndarray) -> list[str]:
        return [
            f" -1{node:{digits}d}" + "".join(f"{number:12.5E}" for number in row) for node, row in enumerate(numbers, 1)
        ]

    lines = ["    1C", f"    2C{4:30d}{1 if digits == 10 else 0:38d}", *rows(POINTS), " -3"]
    lines += [
        "    3C                             1                                     1",
        " -1         1    9    0    1",
    ]
    lines += [" -2         1         2         3         4", " -3"]
    for step, time in enumerate((0.5, 1.0), 1):
        lines += [f"    1PSTEP{step:26d}           1           1"]
        lines += [f"  100CL{step:5d}{time:12.5E}{4:12d}{'':20}{0:2d}{step:5d}{'':10}{1 if digits == 10 else 0:2d}"]
        lines += [" -4  DISP        4    1", *(f" -5  D{axis}          1    2    {axis}    0" for axis in (1, 2, 3))]
        lines += [" -5  ALL         1    2    0    0    1ALL", *rows(motion(time)), " -3"]
    return "\n".join([*lines, " 9999", ""])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check_series(table: Table, axis: int) -> None:
    """Linear in place and time, 0 at time 0."""
    assert table.times == (0.0, 0.5, 1.0)
    for time in (0.0, 0.25, 0.5, 1.0):
        assert values_at(table, POINTS[:, :2], time) == pytest.approx(motion(time)[:, axis], abs=1e-15)


def test_a_series_of_vtu_moves_the_rim_of_a_scene(here: Path) -> None:
    (here / "run").mkdir()
    for number, time in enumerate((0.5, 1.0)):
        write_vtu(f"run/{number}.vtu", time)
    parts = "".join(f'<DataSet timestep="{time}" part="0" file="run/{n}.vtu"/>' for n, time in enumerate((0.5, 1.0)))
    Path("run.pvd").write_text(f'<VTKFile type="Collection"><Collection>{parts}</Collection></VTKFile>')
    (condition,) = build(PLATE.fix("right", x="run.pvd:u_x", y="run.pvd:u_y")).settings.conditions
    check_series(condition.x, 0)
    check_series(condition.y, 1)


@pytest.mark.parametrize("digits", [5, 10])
def test_calculix_results_have_a_table_over_time(here: Path, digits: int) -> None:
    Path("job.frd").write_text(frd(digits))
    for axis in (0, 1):
        check_series(table_of_mesh(f"job.frd:D{axis + 1}", here, 2), axis)


def test_a_single_mesh_has_a_value_at_each_place(here: Path) -> None:
    write_vtu("u.vtu", 1.0)
    (condition,) = build(PLATE.move(PLATE.outline, initial_velocity=("u.vtu:u_x", None))).settings.conditions
    assert condition.x.times == ()
    assert values_at(condition.x, POINTS[:, :2]) == pytest.approx(motion(1.0)[:, 0])


def vtu_elsewhere() -> str:
    return '<VTKFile><Collection><DataSet timestep="0" file="{}"/></Collection></VTKFile>'


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.frd:U1", frd(), r"a.frd has the values D1, D2, D3; name one"),
        ("a.frd:D1", frd().replace(" -1         2 2", " -1         2 x"), "a.frd: line 4: no node"),
        ("a.frd:D1", frd().replace("0.00000E+00\n -3", "\n -3"), "a.frd: line .*: not 3 numbers"),
        ("a.pvd:u", "<a", "a.pvd: cannot be read"),
        ("a.pvd:u", "<VTKFile/>", "a.pvd has 0 files"),
        ("a.pvd:u", vtu_elsewhere().format("../b.vtu"), "use files beside it"),
        ("a.pvd:u", vtu_elsewhere().format("/etc/b.vtu"), "use files beside it"),
        ("a.pvd:u", vtu_elsewhere().format("b/c/b.vtu"), "use files beside it"),
    ],
)
def test_files_that_are_no_results_are_refused(here: Path, name: str, text: str, message: str) -> None:
    Path(name.partition(":")[0]).write_text(text)
    with pytest.raises(SceneError, match=f"displacement 'right': x: .*{message}"):
        build(PLATE.fix("right", x=name))


def test_points_that_move_from_time_to_time_are_refused(here: Path) -> None:
    text = frd()
    nodes = text.index("    2C"), text.index("    3C")
    Path("a.frd").write_text(text[: nodes[1]] + text[nodes[1] :].replace(" -1         4 0", " -1         9 0", 1))
    with pytest.raises(PlaceError, match="points differ from time to time"):
        table_of_mesh("a.frd:D1", here, 2)


def test_calculix_results_at_no_node_are_refused(here: Path) -> None:
    Path("job.frd").write_text("\n".join(line for line in frd().splitlines() if not line.startswith("    2C")))
    with pytest.raises(PlaceError, match=r"job\.frd.*D1"):
        table_of_mesh("job.frd:D1", here, 2)


def test_layers_of_a_body_are_no_values_of_a_plate(here: Path) -> None:
    """Points that coincide in the plane, with one value each and with two."""
    layers = np.vstack([POINTS, np.add(POINTS, [0, 0, 1e-3])])
    cells = [("hexahedron", [list(range(8))])]
    meshio.Mesh(layers, cells, {"alike": layers[:, 0], "apart": layers[:, 2]}).write("body.vtu")
    table = table_of_mesh("body.vtu:alike", here, 2)
    assert values_at(table, POINTS[:, :2]) == pytest.approx(POINTS[:, 0])
    with pytest.raises(PlaceError, match=r"body\.vtu.*apart"):
        table_of_mesh("body.vtu:apart", here, 2)
