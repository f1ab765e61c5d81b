"""Sources that are not what they should be: one line, soon, and nothing left behind."""

from __future__ import annotations

import json
import os
import re
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
from hostile_drawings import model
from messages import mentions, naming

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh.__main__ import main
from pdmesh.drawing import mesh_checks
from pdmesh.model.document import read_file

HEAD = "from pdmesh import Scene, box\n"
SQUARE = """SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.01, 0.005};
Physical Surface("zone:plate") = {1};
DefineConstant[ spacing = {1e-3, Name "Peridynamics/Zones/plate/Spacing"} ];
"""
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
XDMF = """<Xdmf Version="3.0"><Domain><Grid Name="Grid"><Geometry GeometryType="XY">
<DataItem DataType="Float" Dimensions="3 2" Format="HDF" Precision="8">FILE:/data0</DataItem>
</Geometry></Grid></Domain></Xdmf>
"""

SOURCES = {  # name, content, what is said
    # programs
    "an error that is none of Python's": ("a.py", "class Odd(BaseException): pass\nraise Odd('x')\n", "line 2: Odd: x"),
    "an end": ("a.py", "raise SystemExit(0)\n", "line 1: SystemExit: 0"),
    "an interruption of its own": ("a.py", "x = 1\nraise KeyboardInterrupt\n", "line 2: KeyboardInterrupt"),
    "an end without words": (
        "a.py",
        "import os\nos._exit(0)\n",
        "the program ended with exit code 0",
    ),
    "an end in another program": ("a.py", "import os\nos.execv('/bin/true', ['true'])\n", "ended with exit code 0"),
    "a crash": ("a.py", "import os\nos.abort()\n", "the program was ended by SIGABRT"),
    "half of a character": (
        "a.py",
        HEAD + "name = '\\ud800'\nscene = Scene(box(0, 0, 1, 1), 0.1)\n",
        "half of a character",
    ),
    "half of a character in a name": (
        "a.py",
        HEAD + "scene = Scene(box(0, 0, 1, 1), 0.1).load('top', traction=(0, 1), name='\\udcff')\n",
        "'\\udcff', half of a character",
    ),
    "200 000 signs": ("a.py", "x = " + "-" * 200_000 + "1\n", "too long or nested too deep"),
    "a sum of 100 000": ("a.py", "x = " + "+".join(["1"] * 100_000) + "\n", "too long or nested too deep"),
    "200 000 brackets": ("a.py", "x = " + "(" * 200_000 + "\n", "line 1: too many nested parentheses"),
    "200 000 digits": ("a.py", "x = " + "1" * 200_000 + "\n", "line 1: Exceeds the limit"),
    "a run that is none": (
        "a.py",
        HEAD + "scene = Scene(box(0, 0, 1, 1), 0.1, run=3)\n",
        "line 2: run is 3",
    ),
    "the smallest spacing": ("a.py", HEAD + "scene = Scene(box(0, 0, 1, 1), 5e-324)\n", "line 2: spacing is 4.9"),
    "the smallest spacing of a zone": (
        "a.py",
        HEAD + "scene = Scene(box(0, 0, 1, 1), 0.1).zone(box(0, 0, 0.5, 0.5), 5e-324)\n",
        "line 2: zone '1': spacing is 4.9",
    ),
    "what cannot be handed over": (
        "a.py",
        HEAD + "scene = Scene(box(0, 0, 1, 1), 0.1)\nobject.__setattr__(scene, 'material', lambda: 0)\n",
        "cannot be handed over",
    ),
    # CAD files
    "a coordinate that is no number": (
        "a.step",
        "ISO-10303-21;\nDATA;\n#1 = CARTESIAN_POINT('nan', (NAN, 0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n",
        "a.step: line 3: 'NAN'",
    ),
    "a BREP coordinate that is no number": (
        "a.brep",
        "\nCASCADE Topology V1, (c) Matra-Datavision\n1 -inf 0\n+1 0\n",
        "a.brep: line 3: '-inf'",
    ),
    "a STEP file that is cut off": (
        "a.step",
        "ISO-10303-21;\nDATA;\n",
        "the shapes have no end",
    ),
    "a BREP file that is cut off": (
        "a.brep",
        "DBRep_DrawableShape\n\nCASCADE Topology V1, (c) Matra-Datavision\nLocations 0\nCurve2ds 6\n",
        "the shapes have no end",
    ),
    "nothing in a STEP file": ("a.step", "", "another content"),
    "no shapes in a STEP file": ("a.step", "ISO-10303-21;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n", "a.step: Gmsh says: "),
    # meshes
    **{
        f"an empty {suffix}": (f"a{suffix}", "", "a" + suffix)
        for suffix in (".inp", ".off", ".stl", ".msh", ".vtu", ".ply")
    },
    "an .off of nothing": ("a.off", "", "meshio cannot read"),
    "an .inp without points": ("a.inp", "*NODE\n", "no points"),
    "an .inp of words": ("a.inp", "hello\n", "line 1: 'hello'"),
    "an .inp with a hole": (
        "a.inp",
        "*NODE\n1, 0, 0\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n",
        "2 is not defined",
    ),
    "an .off that is cut off": ("a.off", "OFF\n3 1 0\n0 0 0\n", "a mesh in the format of its suffix"),
    "an .off of words": ("a.off", "OFF\nx y z\n", "invalid literal for int() with base 10: 'x'"),
    "an .stl that is cut off": ("a.stl", "solid\nfacet\n", "a mesh in the format of its suffix"),
    "an .stl of zeros": ("a.stl", "\0" * 90, "no points"),
    "a .ply without an end": ("a.ply", PLY, "the header has no end"),
    "cells of points that are not there": (
        "a.off",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
        "points that do not exist",
    ),
    "cells that overlap": (
        "a.off",
        "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n.5 .1 0\n3 0 1 2\n3 0 1 3\n",
        "a.off: cells overlap: ",
    ),
    "a mesh that includes another": (
        "a.inp",
        "** x\r *In*clude , INPUT=/etc/passwd\n",
        "'*INCLUDE'",
    ),
    "entities": ("a.xdmf", "<!DOCTYPE x [<!ENTITY a 'b'>]>\n<x/>\n", "defines entities"),
    "data in another folder": (
        "a.xdmf",
        XDMF.replace("FILE", "../b.h5"),
        "data are in '../b.h5'",
    ),
    "raw data of another folder": (
        "a.xdmf",
        XDMF.replace("HDF", "Binary").replace("FILE", "/etc/passwd"),
        "'/etc/passwd'",
    ),
    # models
    "a source that is no name": ("a.json", model("x", "a\nb.geo"), "$.source"),
    "a source with a zero": ("a.json", model("x", "a\0b.geo"), "$.source"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SOURCES)
def test_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    file, content, said = SOURCES[name]
    Path(file).write_text(content, encoding="utf-8", newline="")
    start = time.monotonic()
    spacing = ["--set", "Zones/plate/Spacing=1e-3"] if file.endswith((".step", ".brep")) else []
    trust = ["--trust"] * file.endswith(".py")
    assert main(["build", file, *spacing, *trust, "-o", "out.json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith((f"pdmesh: {file}: ", f"pdmesh: {file} "))
    assert said in err
    assert err.count("\n") == 1
    assert os.listdir() == [file]
    assert time.monotonic() - start < 50  # below Gmsh's limit of time


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("suffix", [".geo", ".py", ".json", ".step", ".brep", ".msh", ".inp"])
@pytest.mark.parametrize("command", ["build", "info", "params"])
def test_a_pipe_is_no_drawing(command: str, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"plate{suffix}"
    os.mkfifo(path)
    assert main([command, str(path)]) == 2
    err = capsys.readouterr().err
    assert mentions(err, found="pipe", expected="file") or (command == "params" and "suffix" in err)
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_reader_that_never_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As meshio's of .ply, where the end of the header is no line of its own."""
    path = tmp_path / "part.ply"
    path.write_text(PLY + "comment end_header\n", encoding="utf-8")
    monkeypatch.setattr(mesh_checks, "SECONDS", 2.0)
    with pytest.raises(
        mesh_checks.SceneError, match=naming("part.ply", re.compile(r"2\.\d* s of"), expected="the file is complete")
    ):
        mesh_checks.read(path)


@pytest.mark.slow
def test_a_mesh_may_be_trusted_to_include_another(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1e-2, 0, 0], [0, 1e-2, 0.0]])
    meshio.write(tmp_path / "part.inp", meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))]))
    (tmp_path / "whole.inp").write_text("*INCLUDE, INPUT=part.inp\n", encoding="utf-8")
    with pytest.raises(mesh_checks.SceneError, match=r"line 1: '\*INCLUDE'"):
        mesh_checks.read(tmp_path / "whole.inp")
    assert len(mesh_checks.read(tmp_path / "whole.inp", trust=True).points) == 3


# ---- what is not installed


def without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, raising: str) -> None:
    """A module that cannot be imported, in the readers' processes."""
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / f"{module}.py").write_text(f"raise {raising}\n", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(folder))


MISSING = {
    "Gmsh": (
        "gmsh",
        "plate.geo",
        "Gmsh is not installed: Python finds no module 'gmsh'; this installs it: pip install gmsh",
    ),
    "Gmsh, for CAD": ("gmsh", "plate.step", "Gmsh is not installed: "),
    "h5py": ("h5py", "part.med", "part.med: .med needs h5py; this installs it: pip install 'pdsuite[meshes]'"),
    "netCDF4": ("netCDF4", "part.exo", "part.exo: .exo needs netCDF4; this installs it: pip install 'pdsuite[meshes]'"),
    "h5py, for .xdmf": (
        "h5py",
        "part.xdmf",
        "part.xdmf: .xdmf needs h5py; this installs it: pip install 'pdsuite[meshes]'",
    ),
}


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_is_named(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, file, said = MISSING[name]
    without(tmp_path, monkeypatch, module, f"ModuleNotFoundError('No module named {module}', name={module!r})")
    path = tmp_path / file
    step = "ISO-10303-21;\nEND-ISO-10303-21;\n"
    path.write_text(
        {".geo": SQUARE, ".step": step, ".xdmf": XDMF.replace('HDF"', 'XML"')}.get(path.suffix, ""), encoding="utf-8"
    )
    assert main(["build", str(path)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_libraries_that_gmsh_needs_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without(tmp_path, monkeypatch, "gmsh", "OSError('libGLU.so.1: cannot open shared object file')")
    (tmp_path / "plate.geo").write_text(SQUARE, encoding="utf-8")
    assert main(["build", str(tmp_path / "plate.geo")]) == 2
    assert mentions(capsys.readouterr().err, "Gmsh", "libGLU.so.1", "Debian")


# ---- what is not used

SIZES = {
    "of points": ("Point(9) = {0, 0, 0, 1e-3};", "mesh sizes of points (line 4)"),
    "of all": ("MeshSize {:} = 1e-3;", "MeshSize (line 4)"),
    "in old words": ("Characteristic Length {:} = 1e-3;", "MeshSize (line 4)"),
    "of fields": ("Field[1] = Box; Field[1].VIn = 1; Background Field = 1;", "Field (line 4)"),
    "as options": ("Mesh.MeshSizeMax = 1e-3;", "Mesh.MeshSizeMax (line 4)"),
    "of curves": ("Transfinite Curve {1} = 5;", "Transfinite (line 4)"),
}


@pytest.fixture(scope="module")
def without_sizes(tmp_path_factory: pytest.TempPathFactory) -> object:
    """The nodes of the square."""
    folder = tmp_path_factory.mktemp("without")
    (folder / "plate.geo").write_text(SQUARE, encoding="utf-8")
    assert main(["build", str(folder / "plate.geo"), "-o", str(folder / "plate.json")]) == 0
    return read_file(folder / "plate.json").nodes


@pytest.mark.process
def test_that_mesh_sizes_are_not_used_is_not_said_where_it_is_quiet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plate.geo"
    path.write_text(SQUARE + SIZES["of all"][0] + "\n", encoding="utf-8")
    assert main(["build", str(path), "-o", str(tmp_path / "plate.json"), "-q"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_mesh_sizes_are_noted_as_not_used(
    name: str,
    without_sizes: object,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    line, noted = SIZES[name]
    Path("plate.geo").write_text(SQUARE + line + "\n", encoding="utf-8")
    assert main(["build", "plate.geo"]) == 0
    out, err = capsys.readouterr()
    note = f"not used: {noted}; nodes are as far apart as Zones/NAME/Spacing says\n"
    assert err == f"note: plate.geo: {note}"
    assert "not used" not in out
    assert main(["build", "plate.json", "-o", "again.json"]) == 0
    assert capsys.readouterr().err == f"note: plate.json: plate.geo: {note}"
    assert read_file(Path("plate.json")).nodes == without_sizes


@pytest.mark.slow
def test_what_a_program_prints_is_no_result(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "plate.py"
    path.write_text(HEAD + "print('hello')\nscene = Scene(box(0, 0, 0.01, 0.01), 1e-3)\n", encoding="utf-8")
    assert main(["info", str(path), "--trust", "--json"]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out)["nodes"] == 121
    assert "hello" in err


@pytest.mark.slow
def test_a_program_may_import_what_this_one_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "helper_of_a_plate.py").write_text("SIDE = 0.01\n", encoding="utf-8")
    path = tmp_path / "plate.py"
    path.write_text(
        HEAD + "from helper_of_a_plate import SIDE\nscene = Scene(box(0, 0, SIDE, SIDE), 1e-3)\n", encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["info", str(path), "--trust", "-q"]) == 0
