"""Cracks and refinements from the command line, for drawings of every kind; kept in the model."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from messages import naming
from plates import GEOMETRIES

pytest.importorskip("gmsh", exc_type=OSError)

from pdmesh import SceneError
from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.model.document import read_file, write_file

OUTLINE = """
from pathlib import Path
from pdmesh import Scene, read_outline
here = Path(__file__).parent
scene = Scene(read_outline(here / "plate.step", 1e-3), 1e-3).crack([(0, 0.0105), (0.01, 0.0105)])
"""


@pytest.fixture(scope="module")
def drawings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate of 40 x 20 mm as STEP (in mm), as BREP and mesh (in numbers of 40 x 20), and a scene around the STEP."""
    import gmsh

    folder = tmp_path_factory.mktemp("drawings")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 40, 20)
    gmsh.model.occ.synchronize()
    gmsh.write(str(folder / "plate.step"))
    gmsh.write(str(folder / "plate.brep"))
    gmsh.finalize()
    x, y = np.meshgrid(np.arange(41.0), np.arange(21.0))
    corner = (np.arange(40) + 41 * np.arange(20)[:, None]).ravel()
    quads = corner[:, None] + np.array([0, 1, 42, 41])
    meshio.write(
        folder / "plate.vtu", meshio.Mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), {"quad": quads})
    )
    (folder / "outline.py").write_text(OUTLINE)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["step", "brep", "vtu"])
def test_a_crack_in_millimetres(suffix: str, drawings: Path, tmp_path: Path) -> None:
    spacing = [] if suffix == "vtu" else [("Zones/plate/Spacing", "1")]
    built = build_file(
        drawings / f"plate.{suffix}", [("Units", "mm"), *spacing], cracks=["0,10,5,10,8,12", "35,5.2,40,5.2"]
    )
    assert built.grid.cracks * 1e3 == pytest.approx(np.array([[0, 10, 5, 10], [5, 10, 8, 12], [35, 5.2, 40, 5.2]]))
    low, high = built.grid.position.min(axis=0), built.grid.position.max(axis=0)
    assert (low >= 0).all()
    assert (high <= [0.04, 0.02]).all()
    if suffix == "vtu":
        assert built.grid.areas == pytest.approx(1e-6)
        assert built.grid.delta == pytest.approx(1e-3)
        return
    path = tmp_path / "model.json"
    write_file(built.document, path)
    again = build_file(path)
    assert again.document == read_file(path)
    more = build_file(path, cracks=["20,3.3,25,3.3"])
    assert len(more.grid.cracks) == 4


@pytest.mark.slow
def test_cracks_of_drawings_and_scripts(drawings: Path, tmp_path: Path) -> None:
    for source in ("duran50.geo", "duran50_one_scale.py"):
        built = build_file(GEOMETRIES / source, cracks=["0.08,0.0005,0.09,0.0005"], refine=["crack:2e-3"], trust=True)
        assert built.grid.cracks[-1] == pytest.approx((0.08, 0.0005, 0.09, 0.0005))
        path = tmp_path / "model.json"
        write_file(built.document, path)
        assert build_file(path, trust=True).document == built.document
    assert len(build_file(drawings / "outline.py", trust=True).grid.cracks) == 1


@pytest.mark.process
def test_refinements_are_in_the_unit_of_the_drawing(drawings: Path) -> None:
    given = [("Units", "mm"), ("Zones/plate/Spacing", "1")]
    scene = read_scene(drawings / "plate.step", given, ["crack:3:0.5"], cracks=["0,10,5,10"])
    ((target, distance, spacing),) = [(one.target, one.distance, one.spacing) for one in scene.refinements]
    assert (target, distance, spacing) == ("crack", 0.003, 0.0005)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("word", ["", "1,2", "1,2,3", "1,2,3,x", "1,2,3,4,5", "nan,0,1,1", "0,0,inf,1", "0,0,0,0"])
def test_words_that_are_no_crack(word: str) -> None:
    with pytest.raises(SceneError, match=r"duran50.geo: (--crack: |crack '.*')"):
        read_scene(GEOMETRIES / "duran50.geo", cracks=[word])


@pytest.mark.slow
@pytest.mark.parametrize(
    "word", ["crack", "crack:nan", "crack:inf", "crack:-1", "crack:1e-3:nan", "crack:1e-3:0", "x:1"]
)
def test_words_that_are_no_refinement(word: str) -> None:
    with pytest.raises(SceneError, match=naming("duran50.geo", re.compile("refine"))):
        build_file(GEOMETRIES / "duran50.geo", refine=[word])
