"""Tutorials t1 to t21 of Gmsh, which its wheel brings: drawings of others, built with a spacing and a material alone.

Areas and volumes are those that Gmsh computes of the same shapes, from Open CASCADE or from the elements of its mesh.
"""

from __future__ import annotations

import sysconfig
from pathlib import Path

import numpy as np
import pytest
from messages import naming

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

import gmsh

from pdmesh import SceneError
from pdmesh.__main__ import main
from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.model.triangulated_surface import volume
from pdmesh.scene.body import Body

TUTORIALS = Path(sysconfig.get_path("data")) / "share/doc/gmsh/tutorials"
MATERIAL = {"Material/E": "2e11", "Material/rho": "7850", "Material/G0": "1e3"}
PLATES = {  # tutorial: spacing. What it shows beside:
    "t1": 0.005,  # points, lines, a plane surface, unnamed groups
    "t4": 0.002,  # arcs, holes, comments as views
    "t6": 0.02,  # transfinite meshes
    "t7": 0.005,  # a background mesh
    "t8": 0.005,  # views and animation
    "t10": 0.02,  # size fields
    "t11": 0.05,  # recombined quads
    "t17": 0.1,  # an anisotropic background mesh
    "t21": 0.05,  # partitions, a mesh that is written
}
BODIES = {
    "t2": 0.01,  # extrusion, transformations
    "t3": 0.01,  # layers, a twisted extrusion
    "t5": 0.05,  # holes in a volume, mesh sizes of points
    "t14": 0.5,  # homology
    "t15": 0.01,  # points, curves and surfaces embedded
    "t16": 0.05,  # Boolean operations, groups of volumes by number
    "t18": 0.1,  # periodic meshes
    "t19": 0.05,  # sweeps through sections and along pipes, fillets
    "t20": 2.0,  # a STEP file, cut in slices
}
REFUSED = {
    "t9": naming("zones", found=("none", "surface")),  # views alone
    "t12": naming(found=("z goes from 0",), expected="plane"),  # curved shells, for a compound mesh
    "t13": naming("spacing", found="thinner", expected="finer"),  # a shell of an STL file, 2 mm thick
}
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not TUTORIALS.is_dir(), reason="this Gmsh brings no tutorials"),
]


def parameters(zone: str, spacing: float) -> list[tuple[str, str]]:
    return [(f"Zones/{zone}/Spacing", str(spacing)), *MATERIAL.items()]


def measured(name: str, dimension: int) -> float:
    """Area or volume of the physical groups of a tutorial, of all shapes if there are none."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(TUTORIALS / f"{name}.geo"))
        groups = gmsh.model.getPhysicalGroups(dimension)
        shapes = {int(tag) for group in groups for tag in gmsh.model.getEntitiesForPhysicalGroup(*group)}
        shapes = shapes or {tag for _, tag in gmsh.model.getEntities(dimension)}
        if {(dimension, tag) for tag in shapes} <= set(gmsh.model.occ.getEntities(dimension)):
            return sum(gmsh.model.occ.getMass(dimension, tag) for tag in shapes)
        gmsh.model.mesh.generate(dimension)
        elements = [tags for tag in shapes for tags in gmsh.model.mesh.getElements(dimension, tag)[1]]
        return float(sum(gmsh.model.mesh.getElementQualities(tags, "volume").sum() for tags in elements))
    finally:
        gmsh.finalize()


def look_at(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    """`pdmesh` says what is in the grid, draws it and plans with the drawing."""
    monkeypatch.chdir(folder)
    assert main(["build", str(path), "-o", "grid.json", "-q", *words]) == 0
    assert main(["info", "grid.json"]) == 0
    assert main(["preview", "grid.json", "-o", "grid.png"]) == 0
    assert main(["plan", str(path), *words]) == 0


@pytest.mark.parametrize("name", PLATES)
def test_a_plate(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, spacing = TUTORIALS / f"{name}.geo", PLATES[name]
    built = build_file(path, parameters("plate", spacing))
    area = measured(name if name not in ("t7", "t8") else "t1", 2)  # which these two include
    assert built.grid.cells.sum() == pytest.approx(area, rel=1e-3)  # 3e-4 of t4, of the chords of its mesh
    assert len(built.grid.position) == pytest.approx(area / spacing**2, rel=0.15)  # and nodes on edges
    words = [word for name, value in parameters("plate", spacing) for word in ("--set", f"{name}={value}")]
    look_at(path, tmp_path, monkeypatch, *words)


SWEPT = {"t3": 0.03 * (0.1 + 0.15 * np.pi / 2 + 0.2)}  # m^3, by Pappus: its layers make a mesh that is 5e-3 smaller
LONG = {"t3", "t14", "t19", "t20"}  # of many small triangles, which take `info` and `plan` up to a minute


@pytest.mark.parametrize("name", BODIES)
def test_a_body(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, spacing = TUTORIALS / f"{name}.geo", BODIES[name]
    body = read_scene(path, parameters("body", spacing))
    assert isinstance(body, Body)
    solid = SWEPT.get(name) or measured(name, 3)
    assert body.shell.volume == pytest.approx(solid, rel=2e-3)
    built = build_file(path, parameters("body", spacing))
    assert built.grid.cells.sum() == pytest.approx(solid, rel=1e-2)
    if name not in LONG:
        words = [word for name, value in parameters("body", spacing) for word in ("--set", f"{name}={value}")]
        look_at(path, tmp_path, monkeypatch, *words)


def test_the_shell_of_an_stl_file() -> None:
    """t13, classified and given a geometry: its surface is that of the file, in the file's unit."""
    body = read_scene(TUTORIALS / "t13.geo", parameters("body", 0.5))
    assert isinstance(body, Body)
    lines = (TUTORIALS / "t13_data.stl").read_text(encoding="ascii").splitlines()
    corners = np.array([line.split()[1:] for line in lines if line.lstrip().startswith("vertex")], dtype=float)
    triangles = corners.reshape(-1, 3, 3)
    assert body.shell.volume == pytest.approx(abs(volume(triangles)), rel=1e-9)
    assert len(body.shell.triangles) == len(triangles)


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_body_and_no_plate_is_refused(name: str) -> None:
    zone = "body" if name == "t13" else "plate"
    with pytest.raises(SceneError, match=REFUSED[name]) as caught:
        build_file(TUTORIALS / f"{name}.geo", parameters(zone, 1.5))
    assert "\n" not in str(caught.value)
