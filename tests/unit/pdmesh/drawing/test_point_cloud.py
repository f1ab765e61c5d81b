"""Points with volumes that are on no lattice in space are the nodes of a body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from numpy.typing import NDArray

from pdmesh import SceneError
from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.drawing.point_cloud import surface_of
from pdmesh.model.document import Load
from pdmesh.model.triangulated_surface import gap, volume
from pdmesh.reports.report import plan

STEEL = [("Material/E", "2e11"), ("Material/rho", "7800"), ("Material/G0", "10"), ("Units", "mm")]


def shaken(counts: tuple[int, int, int], by: float = 0.2) -> NDArray[np.float64]:
    """Points 1 apart, each moved at random by so much at most along each axis."""
    places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(places + by * np.random.default_rng(1).uniform(-1, 1, places.shape))


def table(places: NDArray[np.float64], volumes: NDArray[np.float64]) -> str:
    """The file of points, in block 1 where x < 3, else in block 2."""
    blocks = np.where(places[:, 0] < 3, 1, 2)
    rows = zip(places.tolist(), blocks.tolist(), volumes.tolist(), strict=True)
    return "".join(f"{x!r} {y!r} {z!r} {block} {size!r}\n" for (x, y, z), block, size in rows)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    places = shaken((6, 5, 4))
    (tmp_path / "cloud.txt").write_text(table(places, np.linspace(0.8, 1.2, len(places))))
    return tmp_path / "cloud.txt"


def test_points_on_no_lattice_are_nodes(path: Path) -> None:
    """As they are, with their volumes; the surface around them has the volume of all."""
    built = build_file(path, [*STEEL, ("Materials/block_2/E", "1e11")])
    grid, places = built.grid, shaken((6, 5, 4))
    assert grid.position == pytest.approx(1e-3 * places, abs=1e-15)
    assert grid.areas == pytest.approx(1e-9 * np.linspace(0.8, 1.2, 120))
    assert grid.delta == pytest.approx(1e-3, rel=0.07)
    assert np.ptp(grid.delta) > 5e-5  # nodes of smaller volumes are nearer to each other
    assert gap(grid.faces) is None
    assert volume(grid.faces) == pytest.approx(grid.size)
    assert grid.border.sum() == 120 - 4 * 3 * 2
    (region,) = built.settings.regions
    assert region.nodes == tuple(np.flatnonzero(places[:, 0] >= 3) + 1)
    assert mentions(built.notes, "on no lattice", "they are the nodes", "mm wide")
    assert mentions(built.notes, "block_1", "no material")


def test_conditions_on_sides_blocks_and_boxes(path: Path) -> None:
    faces = [("Loads/pull/Face", "right"), ("Loads/pull/Traction x", "1e6"), ("Fixes/held/Box", "-1 -1 -1 0.5 9 9")]
    built = build_file(path, [*STEEL, *faces, ("Moves/block_2/Initial velocity x", "1")])
    x, nodes = built.grid.position[:, 0], {one.name: one.nodes for one in built.settings.conditions}
    assert nodes["held"] == tuple(np.flatnonzero(x < 0.5e-3) + 1)
    assert nodes["pull"] is not None
    assert 18 <= len(nodes["pull"]) <= 20
    assert nodes["block_2"] == tuple(np.flatnonzero(x >= 3e-3) + 1)
    assert any(isinstance(one, Load) for one in built.settings.conditions)


def test_a_hollow_cloud_has_an_inner_surface() -> None:
    """A cube 8 wide less one 6 wide, whose corners are cut off."""
    places = shaken((9, 9, 9), 0.05)
    inner = (np.abs(np.rint(places) - 4) <= 2).all(axis=1)
    triangles = places[~inner][surface_of(places[~inner], np.ones(int((~inner).sum())))]
    assert gap(triangles) is None
    assert 8**3 - 6**3 < volume(triangles) < 345  # measured 332; 512 without the inner one


def test_points_on_the_surface_are_inside_the_drawn_one(tmp_path: Path) -> None:
    """Volumes of nodes of a mesh sum to its hull: no bond of the outer nodes leaves the body."""
    places = shaken((6, 5, 4), 0.01)
    (tmp_path / "a.txt").write_text(table(places, np.full(120, 5 * 4 * 3 / 120)))
    grid = build_file(tmp_path / "a.txt", STEEL).grid
    low, high = grid.faces.min(axis=(0, 1)), grid.faces.max(axis=(0, 1))
    assert (low < grid.position.min(axis=0) - 5e-6).all()
    assert (high > grid.position.max(axis=0) + 5e-6).all()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([("Zones/body/Spacing", "1")], naming("Zones/body/Spacing", expected="leave it out")),
        ([("--adapt", "hybrid")], naming("run.adapt", found="hybrid", expected="none")),
    ],
)
def test_what_needs_a_lattice_is_refused(more: list[tuple[str, str]], message: str, path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        build_file(path, [*STEEL, *more])


def test_volumes_of_another_unit_are_refused(path: Path) -> None:
    path.write_text(table(shaken((6, 5, 4)), np.full(120, 1e-9)))
    with pytest.raises(SceneError, match=naming("points", found="farther apart", expected="neighbours")):
        build_file(path, STEEL)


@pytest.mark.slow
def test_the_plan_of_points(path: Path) -> None:
    scene = read_scene(path, STEEL)
    assert plan(scene)["scene"]["nodes"] == 120
