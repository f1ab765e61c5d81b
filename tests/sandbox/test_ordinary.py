"""What ordinary drawings hold is read, and what Gmsh makes of it is what it makes of the drawing itself."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from plates import GEOMETRIES

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh.drawing.geo import read_geo
from pdmesh.drawing.sandbox.copies import drawing_copies

ORDINARY = sorted((Path(__file__).parent / "ordinary").glob("*.geo"))
TUTORIALS = Path(sysconfig.get_path("data")) / "share/doc/gmsh/tutorials"  # of Gmsh's wheel
MESHED = {"t21"}  # and written to a file as the drawing says, where Gmsh reads it itself
NO_SHAPES = {"t9"}  # but views
READ = """
import json, os, sys, gmsh
gmsh.initialize(interruptible=False, readConfigFiles=False)
gmsh.option.setNumber("General.Terminal", 0)
defaults = {name: gmsh.option.getNumber(name) for name in ("Geometry.OldNewReg", "Geometry.Tolerance")}
for line in sys.stdin:
    path = line.strip()
    os.chdir(os.path.dirname(path))
    for reset in (gmsh.onelab.clear, gmsh.parser.clear, gmsh.clear):
        reset()
    for name, value in defaults.items():
        gmsh.option.setNumber(name, value)
    gmsh.logger.start()
    try:
        gmsh.open(path)
        error = ""
    except Exception as said:
        error = str(said)
    entities = [[*it, *(round(x, 9) for x in gmsh.model.getBoundingBox(*it))] for it in gmsh.model.getEntities()]
    groups = [
        [*it, gmsh.model.getPhysicalName(*it), gmsh.model.getEntitiesForPhysicalGroup(*it).tolist()]
        for it in gmsh.model.getPhysicalGroups()
    ]
    own = [name for name in gmsh.onelab.getNames() if not name.startswith(("Gmsh", "Solver", "0Modules"))]
    said = [line for line in gmsh.logger.get() if line.startswith(("Direct", "Warning"))]
    gmsh.logger.stop()
    print("FOUND", json.dumps([error, entities, groups, [gmsh.onelab.get(name) for name in own], said]))
"""


def as_gmsh_has_them(paths: Iterable[Path]) -> list[list[Any]]:
    """Error, entities, groups, parameters and messages of drawings, straight from Gmsh."""
    lines = "".join(f"{path}\n" for path in paths)
    ended = subprocess.run([sys.executable, "-P", "-c", READ], input=lines, capture_output=True, text=True, check=True)
    return [json.loads(line.removeprefix("FOUND ")) for line in ended.stdout.splitlines() if line.startswith("FOUND ")]


def compare(drawings: dict[str, Path], folder: Path) -> None:
    originals, anew = [], []
    for name, path in drawings.items():
        (folder / name).mkdir()
        for copy, content in drawing_copies(path).items():
            (folder / name / copy).write_bytes(content.data)
        originals.append(path)
        anew.append(folder / name / "0.geo")
    for name, expected, found in zip(drawings, as_gmsh_has_them(originals), as_gmsh_has_them(anew), strict=True):
        assert expected[0] == "", name  # an honest drawing
        assert expected[1], name
        assert found == expected, name


@pytest.mark.slow
def test_ordinary_drawings(tmp_path: Path) -> None:
    assert len(ORDINARY) == 24
    compare({path.stem: path for path in ORDINARY}, tmp_path)


@pytest.mark.slow
def test_shipped_drawings(tmp_path: Path) -> None:
    compare({path.stem: path for path in GEOMETRIES.glob("*.geo")}, tmp_path)


@pytest.mark.slow
def test_tutorials_of_gmsh(tmp_path: Path) -> None:
    drawings = {path.stem: path for path in sorted(TUTORIALS.glob("t*.geo")) if path.stem not in MESHED | NO_SHAPES}
    if not drawings:
        pytest.skip("this Gmsh brings no tutorials")
    assert len(drawings) == 19
    compare(drawings, tmp_path)


@pytest.mark.process
def test_latin_1_is_read(tmp_path: Path) -> None:
    text = (GEOMETRIES / "duran50.geo").read_text(encoding="utf-8").replace("// ", "// l\u00e4nger: ")
    text = text.replace("Young's modulus", "Elastizit\u00e4tsmodul")
    (tmp_path / "plate.geo").write_bytes(text.encode("latin-1"))
    scene = read_geo(tmp_path / "plate.geo")
    assert scene.drawing == text
    assert scene.shape.area == pytest.approx(4e-3, rel=1e-12)
