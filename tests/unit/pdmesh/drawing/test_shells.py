"""Bodies whose drawn triangles do not close, or do not enclose what Gmsh says, have their right volumes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pdmesh import Body, SceneError, Sphere
from pdmesh.drawing import geo
from pdmesh.drawing.building import meshed
from pdmesh.drawing.file_reading import build_file, file_parameters, read_scene
from pdmesh.drawing.sandbox import child
from pdmesh.grid.cubic import place_nodes

pytestmark = [pytest.mark.process]
OCC = 'SetFactory("OpenCASCADE");\n'
QUARTER = """Point(1) = {0, 0, 0}; Point(2) = {0.6, 0, 0}; Point(3) = {0, 0, 1.2};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1}; Curve Loop(1) = {1, 2, 3}; Plane Surface(1) = {1};
a[] = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/2} { Surface{1}; };
"""
PRISM = """Point(1) = {0, 0, 0}; Point(2) = {0.1, 0, 0}; Point(3) = {0.1, 0.05, 0}; Point(4) = {0.02, 0.08, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
v[] = Extrude {0, 0, 0.05} { Surface{1}; };
"""
LOFT = (
    OCC
    + """Circle(1) = {0, 0, 0, 0.05}; Circle(2) = {0.01, 0, 0.1, 0.025}; Circle(3) = {0, 0, 0.2, 0.06};
Wire(1) = {1}; Wire(2) = {2}; Wire(3) = {3};
Ruled ThruSections(1) = {1, 2, 3};
f() = Abs(Boundary{ Volume{1}; }); e() = Unique(Abs(Boundary{ Surface{f()}; })); Fillet{1}{e()}{0.01}
"""
)
DILATED = OCC + "Cylinder(1) = {0, 0, 0, 0, 0, 1, 1}; Dilate {{0, 0, 0}, {1, 2, 1}} { Volume{1}; }\n"
UNION = (
    OCC
    + """Sphere(1) = {0, 0, 0, 1}; Box(2) = {0, 0, 0, 2, 2, 2};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
"""
)


def drawing(folder: Path, shapes: str, spacing: float, group: str = "zone:part") -> Path:
    """A drawing of a body whose volumes are all in a group."""
    path = folder / "part.geo"
    path.write_text(
        f'{shapes}Physical Volume("{group}") = {{Volume{{:}}}};\n'
        f'DefineConstant[ s = {{{spacing}, Name "Peridynamics/Zones/part/Spacing"}}, '
        'E = {7e10, Name "Peridynamics/Material/E"}, r = {2700, Name "Peridynamics/Material/rho"}, '
        'G = {1e3, Name "Peridynamics/Material/G0"} ];\n',
        encoding="utf-8",
    )
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shapes", "spacing", "volume", "most"),
    [
        (QUARTER, 0.1, np.pi * 0.36 * 1.2 / 12, 3000),  # no end before
        (PRISM, 5e-3, 3e-4, 40),  # 13 s of meshing flat faces before
        pytest.param(LOFT, 1e-2, 1.0309e-3, 25000, marks=pytest.mark.slow),  # was called open
        (DILATED, 0.25, 2 * np.pi, 5000),  # Open CASCADE: 0.9 % more
        (UNION, 0.2, 8 + np.pi * 7 / 6, 5000),  # Gmsh doubts a union that is right
    ],
    ids=["quarter cone", "prism", "loft", "dilated", "union"],
)
def test_a_body_has_its_volume_and_triangles_in_proportion(
    shapes: str, spacing: float, volume: float, most: int, tmp_path: Path
) -> None:
    body = read_scene(drawing(tmp_path, shapes, spacing))
    assert isinstance(body, Body)
    assert body.shell.volume == pytest.approx(volume, rel=1e-4)
    assert len(body.shell.triangles) < most
    assert sum(level.volume.sum() for level in place_nodes(body)) == pytest.approx(volume, rel=1e-4)


@pytest.mark.slow
def test_overlapping_spheres_of_a_scene_are_one_closed_body() -> None:
    """The volume of two balls without that of the lens they share; their drawn triangles do not pair."""
    R, r, d = 20e-3, 14e-3, float(np.sqrt(18**2 + 3**2 + 2**2)) * 1e-3
    lens = np.pi * (R + r - d) ** 2 * (d**2 + 2 * d * (r + R) - 3 * (r - R) ** 2) / (12 * d)
    body = meshed(Body(Sphere((0, 0, 0), R) + Sphere((18e-3, 3e-3, 2e-3), r), 3e-3))
    (level,) = place_nodes(body)
    assert level.volume.sum() == pytest.approx(4 / 3 * np.pi * (R**3 + r**3) - lens, rel=1e-4)


@pytest.mark.parametrize("name", ["zone:part", "zone:other", "part"])
def test_zones_and_spacings_are_checked_before_anything_is_meshed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    read = child._read
    monkeypatch.setattr(child, "_read", lambda *given: seen.append(read(*given)) or seen[-1])
    path = drawing(tmp_path, UNION, -1.0, name)
    path.write_text(path.read_text().replace("Zones/part/", "Plate/") if name == "part" else path.read_text())
    with pytest.raises(SceneError, match=r"zone|Zones"):
        build_file(path)
    assert [found["points"] for found in seen] == [[]]


@pytest.mark.slow
def test_a_reader_that_does_not_end_says_what_it_did(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geo, "TIME_LIMIT", 1.0)
    path = tmp_path / "stuck.geo"
    path.write_text("For i In {1:1e9}\nx = i;\nEndFor\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"still reading after 1 s of processor time"):
        read_scene(path)


@pytest.mark.slow
def test_a_brep_file_may_end_as_draw_saves_it(tmp_path: Path) -> None:
    gmsh = pytest.importorskip("gmsh", exc_type=OSError)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "box.brep"))
    finally:
        gmsh.finalize()
    path = tmp_path / "drawn.brep"
    path.write_bytes((tmp_path / "box.brep").read_bytes().rstrip() + b"\n0\n\n")
    body = read_scene(path, [("Zones/body/Spacing", "1"), ("Units", "mm")])
    assert isinstance(body, Body)
    assert body.shell.volume == pytest.approx(1e-6, rel=1e-9)
    listed = {
        one.name.partition("/")[2]: (one.value, one.unit) for one in file_parameters(path, [("Material/E", "2e9")])
    }
    assert listed["Zones/body/Spacing"] == ("", "m")
    assert listed["Material/E"] == (2e9, "Pa")
    assert listed["Units"] == ("m", "")
    path.write_bytes((tmp_path / "box.brep").read_bytes()[:-300])
    with pytest.raises(SceneError, match="whole BREP file"):
        read_scene(path, [("Zones/body/Spacing", "1"), ("Units", "mm")])
