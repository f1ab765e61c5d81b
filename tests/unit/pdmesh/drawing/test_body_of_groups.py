"""Drawings of volumes become bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming
from plates import GEOMETRIES

from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.model.document import Displacement, InitialVelocity, Load, RigidBody
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.scene.body import Body
from pdmesh.scene.shapes import SceneError

BLOCK = """
SetFactory("OpenCASCADE");
DefineConstant[
  h = {100, Name "Peridynamics/Zones/coarse/Spacing"}
  k = {50, Name "Peridynamics/Zones/fine/Spacing"}
  u = {"mm", Name "Peridynamics/Units"}
  E = {1e9, Name "Peridynamics/Material/E"}
  r = {1e3, Name "Peridynamics/Material/rho"}
  G = {1e2, Name "Peridynamics/Material/G0"}
  m = {2e9, Name "Peridynamics/Materials/stiff/E"}
  t = {1e5, Name "Peridynamics/Loads/top/Traction z"}
  v = {1, Name "Peridynamics/Moves/core/Initial velocity z"}
  c = {"xz", Name "Peridynamics/Fixes/bottom/Components"}
  b = {"-1 -1 -1 401 401 50", Name "Peridynamics/Fixes/bottom/Box"}
];
Box(1) = {0, 0, 0, 1000, 1000, 600};
Box(2) = {800, 0, 0, 800, 1000, 600};
Box(3) = {0, 0, 0, 400, 400, 400};
Disk(50) = {500, 500, 300, 250};
Physical Volume("zone:coarse") = {1};
Physical Volume("zone:fine") = {2};
Physical Volume("material:stiff") = {3};
Physical Volume("move:core") = {3};
Physical Surface("crack:disc") = {50};
Physical Surface("load:top") = {6};
"""


def drawing(folder: Path, text: str = BLOCK) -> Path:
    path = folder / "block.geo"
    path.write_text(text)
    return path


@pytest.mark.slow
def test_groups_are_zones_regions_cracks_and_conditions(tmp_path: Path) -> None:
    """Overlapping zones are one body; lengths are in the drawing's unit."""
    built = build_file(drawing(tmp_path))
    grid, settings = built.grid, built.settings
    assert grid.dimension == 3
    assert grid.cells.sum() == pytest.approx(0.96, rel=1e-9)
    assert np.unique(grid.delta) == pytest.approx([0.05, 0.1])
    fine = grid.delta < 0.06
    assert grid.position[fine, 0].min() == pytest.approx(0.525)  # the zone begins at 0.8, coarse nodes see 0.3
    assert len(grid.cracks) > 8
    assert np.abs(grid.cracks.reshape(-1, 3)[:, 2] - 0.3).max() < 1e-12
    (stiff,) = settings.regions
    assert (stiff.material.E, len(stiff.nodes or ())) == (2e9, 64)
    load, fix, move = settings.conditions
    assert isinstance(load, Load)
    assert isinstance(fix, Displacement)
    assert (load.traction, load.surface) == ((0, 0, 1e5), pytest.approx(1.0))
    assert grid.position[np.array(load.nodes) - 1, 2].min() > 0.5
    assert (fix.x, fix.y, fix.z, len(fix.nodes or ())) == (0, None, 0, 16)
    assert len(move.nodes or ()) == 64


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('Volume("zone:fine")', 'Volume("zone:odd")', naming(expected="Peridynamics/Zones/fine")),
        ('Surface("crack:disc") = {50}', 'Volume("crack:disc") = {2}', naming('Volume("crack:disc")')),
        ('"-1 -1 -1 401 401 50"', '"0 0 1 1"', "six numbers"),
        ("Loads/top/Traction z", "Refine/crack/Distance", naming(found=("body", "space"), expected="leave it out")),
        ("Loads/top/Traction z", "Bodies/ram/Mass", naming('Volume("body:ram")', "Bodies/ram")),
        ("{100, Name", "{-1, Name", "zone 'coarse': spacing"),
        ("250};", "-250};", "Gmsh says"),
        ("Disk(50) = {500, 500, 300, 250}", "Disk(50) = {500, 500, 3000, 250}", naming("crack 'disc'")),
    ],
)
def test_what_makes_no_body_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in BLOCK
    with pytest.raises(SceneError, match=said):
        build_file(drawing(tmp_path, BLOCK.replace(old, new)))


@pytest.mark.slow
def test_components_along_z_are_refused_in_plates(tmp_path: Path) -> None:
    text = (GEOMETRIES / "duran50.geo").read_text().replace("Loads/top/Traction y", "Loads/top/Traction z")
    assert "Traction z" in text
    with pytest.raises(SceneError, match=naming(expected="plate")):
        build_file(drawing(tmp_path, text))


@pytest.mark.slow
def test_solids_of_a_step_file_are_a_body(tmp_path: Path) -> None:
    gmsh = pytest.importorskip("gmsh", exc_type=OSError)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1000, 300)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "rod.step"))
    finally:
        gmsh.finalize()
    scene = read_scene(tmp_path / "rod.step", [("Zones/body/Spacing", "0.1"), ("Units", "m")])
    assert isinstance(scene, Body)
    assert scene.shell.volume == pytest.approx(np.pi * 0.09, rel=1e-9)


BESIDE = """
SetFactory("OpenCASCADE");
DefineConstant[
  h = {0.1, Name "Peridynamics/Zones/plate/Spacing"}
  E = {1e9, Name "Peridynamics/Material/E"}
  r = {1e3, Name "Peridynamics/Material/rho"}
  G = {1e2, Name "Peridynamics/Material/G0"}
  f = {0.3, Name "Peridynamics/Contact/Friction"}
  s = {0.05, Name "Peridynamics/Bodies/block/Spacing"}
  d = {3e3, Name "Peridynamics/Bodies/block/rho"}
  v = {-2, Name "Peridynamics/Bodies/block/Velocity z"}
  t = {"0 3 0", Name "Peridynamics/Bodies/block/Spin"}
  R = {1, Name "Peridynamics/Bodies/lid/Rigid"}
  m = {5, Name "Peridynamics/Bodies/lid/Mass"}
  w = {"0 0 1.5", Name "Peridynamics/Bodies/lid/Spin"}
  c = {"x spin", Name "Peridynamics/Bodies/lid/Held"}
];
Box(1) = {0, 0, 0, 1, 1, 0.3};
Box(2) = {0, 0, 0.3, 0.4, 0.4, 0.2};
Box(3) = {0.6, 0.6, 0.3, 0.4, 0.4, 0.3};
Physical Volume("zone:plate") = {1};
Physical Volume("body:block") = {2};
Physical Volume("body:lid") = {3};
"""


@pytest.mark.process
def test_volumes_are_bodies_beside_the_first_one(tmp_path: Path) -> None:
    """Each with its spacing, velocity and material, or rigid with its mass and spin."""
    built = build_file(drawing(tmp_path, BESIDE))
    grid, settings = built.grid, built.settings
    assert grid.bodies is not None
    assert grid.bodies.names == ("plate", "block", "lid")
    assert np.bincount(grid.bodies.number).tolist() == [300, 256, 48]
    assert set(grid.delta[grid.bodies.number == 1]) == {0.05}
    assert settings.contact == Contact(friction=0.3)
    (heavy,) = settings.regions
    assert (heavy.material.rho, heavy.material.E, len(heavy.nodes or ())) == (3e3, 1e9, 256)
    moves, lid = settings.conditions
    assert isinstance(moves, InitialVelocity)
    assert (moves.x, moves.y, moves.z, moves.spin, moves.nodes) == (0, 0, -2, (0, 3, 0), tuple(range(301, 557)))
    assert isinstance(lid, RigidBody)
    assert (lid.mass, lid.spin, lid.held) == (5, (0, 0, 1.5), ("x", "spin"))


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"0 0 1.5"', '"1.5"', naming("Bodies/lid/Spin'", found="1.5", expected="three")),
        (
            '{1, Name "Peridynamics/Bodies/lid/Rigid"}',
            '{0, Name "Peridynamics/Bodies/lid/Rigid"}',
            naming("Bodies/lid/Held'", expected="leave it out"),
        ),
        ("Bodies/lid/Mass", "Bodies/lid/E", naming("Bodies/lid/E'", expected="leave it out")),
    ],
)
def test_what_no_body_beside_can_be_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in BESIDE
    with pytest.raises(SceneError, match=said):
        build_file(drawing(tmp_path, BESIDE.replace(old, new)))
