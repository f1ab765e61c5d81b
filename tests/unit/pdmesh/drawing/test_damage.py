"""Damaged files of every kind: a grid, or one line that names the file. Seeded; more of it in the slow tests.

Each is built by a process of its own, so that five hundred take minutes a kind. Drawings are damaged by their lines
in test_geo.py too, and commands hidden in them in tests/sandbox/test_fuzz.py.
"""

from __future__ import annotations

import contextlib
import random
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import meshio
import numpy as np
import pytest

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh import SceneError
from pdmesh.drawing import geo
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.document import GridError

WORDS = (b"-1", b"0", b"99999999", b"nan", b"1e999", b"x", b"", b"3.5", b"-7", b"\xff\xfe", b"1e-320")
SIZE = 0.01
SPACINGS = {  # of STEP in mm, of BREP in m
    ".step": [("Zones/plate/Spacing", "1e-6")],
    ".brep": [("Zones/plate/Spacing", "1e-3")],
}
OCC = """SetFactory("OpenCASCADE");
Include "more.geo";
DefineConstant[spacing = {1e-3, Name "Peridynamics/Zones/plate/Spacing"}];
Rectangle(1) = {0, 0, 0, h, h/2};
Disk(2) = {h/2, h/4, 0, h/10, h/10};
BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }
Physical Surface("zone:plate") = {1};
"""
BUILT_IN = """DefineConstant[spacing = {1e-3, Name "Peridynamics/Zones/plate/Spacing"}];
w = 0.01; x[] = {0, w, w, 0}; y[] = {0, 0, w/2, w/2};
For i In {0:3}
  Point(i + 1) = {x[i], y[i], 0};
EndFor
For i In {1:3}
  Line(i) = {i, i + 1};
EndFor
Line(4) = {4, 1};
Line Loop(1) = {1:4};
Plane Surface(1) = {1};
Physical Surface("zone:plate") = {1};
"""
SCENE = b"""from pdmesh import Scene, box
spacing = 1e-3  # m: between nodes
scene = Scene(box(0, 0, 0.01, 0.005), spacing).crack([(0, 0.0025), (0.005, 0.0025)]).load("top", traction=(0, 1e6))
"""


def meshes(folder: Path) -> Iterator[Path]:
    """Small meshes in the formats that need no other package."""
    y, x = np.mgrid[0:3, 0:4] * 1e-3
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(12)])
    corners = [row * 4 + column for row in range(2) for column in range(3)]
    quads = np.array([[c, c + 1, c + 5, c + 4] for c in corners])
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    groups = {"gmsh:physical": [np.ones(6, dtype=int)], "gmsh:geometrical": [np.ones(6, dtype=int)]}
    of_quads = meshio.Mesh(points, [("quad", quads)], cell_data=groups, field_data={"steel": np.array([1, 2])})
    of_triangles = meshio.Mesh(points, [("triangle", triangles)])
    in_sets = meshio.Mesh(points, [("quad", quads)], cell_sets={"core": [np.array([0, 1])]})
    ways = [
        ("text.msh", of_quads, {"file_format": "gmsh22", "binary": False}),
        ("binary.msh", of_quads, {"file_format": "gmsh22", "binary": True}),
        ("sets.inp", in_sets, {}),
        *((f"{kind}{suffix}", of_triangles, {"binary": kind == "binary"}) for suffix in (".vtu", ".vtk", ".ply", ".stl")
          for kind in ("text", "binary")),
        *((f"text{suffix}", of_triangles, {}) for suffix in (".off", ".mesh", ".bdf")),
    ]  # fmt: skip
    for name, mesh, options in ways:
        with warnings.catch_warnings(), contextlib.redirect_stdout(None):
            warnings.simplefilter("ignore")
            meshio.write(folder / name, mesh, **options)
        yield folder / name


def drawings(folder: Path) -> Iterator[Path]:
    """Small drawings, one for each kernel of Gmsh, with a parameter, a loop and another file."""
    (folder / "more.geo").write_text(f"h = {SIZE};\n")
    for name, text in (("occ", OCC), ("built_in", BUILT_IN)):
        (folder / f"{name}.geo").write_text(text)
        yield folder / f"{name}.geo"


def cad(folder: Path) -> Iterator[Path]:
    """A plate with a hole as STEP and as BREP."""
    import gmsh

    for suffix in (".step", ".brep"):
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(0, 0, 0, 0.01, 0.005)
        gmsh.model.occ.addDisk(0.005, 0.0025, 0, 0.001, 0.001)
        gmsh.model.occ.cut([(2, 1)], [(2, 2)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(folder / f"plate{suffix}"))
        gmsh.finalize()
        yield folder / f"plate{suffix}"


def others(folder: Path) -> Iterator[Path]:
    """A scene in Python, and a model that was drawn."""
    from pdmesh.model.document import write_file

    (folder / "plate.py").write_bytes(SCENE)
    (folder / "drawn.geo").write_text(BUILT_IN)
    write_file(build_file(folder / "drawn.geo").document, folder / "plate.json")
    yield folder / "plate.py"
    yield folder / "plate.json"


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Cut, with lines lost, doubled or swapped, a word or a byte changed; one to three of these."""
    for _ in range(chance.randint(1, 3)):
        lines = data.split(b"\n")
        line = chance.randrange(len(lines))
        match chance.choice(("cut", "lose", "double", "swap", "word", "word", "word", "byte")):
            case "cut":
                lines = data[: chance.randrange(len(data) + 1)].split(b"\n")
            case "lose":
                del lines[line]
            case "double":
                lines.insert(line, lines[line])
            case "swap":
                other = chance.randrange(len(lines))
                lines[line], lines[other] = lines[other], lines[line]
            case "word":
                words = lines[line].split(b" ")
                words[chance.randrange(len(words))] = chance.choice(WORDS)
                lines[line] = b" ".join(words)
            case _ if data:
                place = chance.randrange(len(data))
                lines = (data[:place] + bytes([chance.randrange(256)]) + data[place + 1 :]).split(b"\n")
        data = b"\n".join(lines)
    return data


KINDS: dict[str, tuple[Callable[[Path], Iterator[Path]], int]] = {
    "drawings": (drawings, 20),
    "meshes": (meshes, 30),
    "CAD": (cad, 20),
    "others": (others, 30),
}


pytestmark = pytest.mark.filterwarnings("ignore::pdmesh.model.document.GridWarning")  # of grid files that are damaged


def check(kind: str, seed: int, count: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chance = random.Random(seed)
    made = {path: path.read_bytes() for path in KINDS[kind][0](folder)}
    refused = 0
    for path in made:  # without hurry: what is sound is read to its end
        build_file(path, SPACINGS.get(path.suffix, []), trust=path.suffix == ".py")
    monkeypatch.setattr(geo, "CAD_SECONDS", 2.0)  # a BREP file with a line less may keep OpenCASCADE busy for ever
    for _ in range(count):
        original = chance.choice(list(made))
        path = folder / f"damaged{original.suffix}"
        path.write_bytes(damaged(made[original], chance))
        try:
            build_file(path, SPACINGS.get(path.suffix, []), trust=path.suffix == ".py")
        except (SceneError, GridError) as error:
            refused += 1
            message = " ".join(str(error).split())
            assert message.startswith(str(path)), path.read_bytes()
            assert "Traceback" not in message
    assert refused > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_damage_is_a_grid_or_one_error(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is sound is a grid."""
    check(kind, 1, KINDS[kind][1], tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.endurance)])
@pytest.mark.parametrize("kind", KINDS)
def test_more_damage(kind: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check(kind, 2, count, tmp_path, monkeypatch)
