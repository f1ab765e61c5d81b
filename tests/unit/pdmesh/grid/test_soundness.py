"""Pieces, ligaments and supports: what of a grid is not the plate that was drawn."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
import shapely
from messages import mentions, naming
from plates import GLASS
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pdmesh import Circle, Scene, SceneError, box
from pdmesh.drawing.file_reading import build_file
from pdmesh.grid import soundness
from pdmesh.grid.lattice import build_grid
from pdmesh.grid.pieces import Ligament, faces_of, ligaments, pieces
from pdmesh.model.neighbours import Neighbours, Pairs
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import Sight, plate_of


def blocks(neck: float, low: float = 0.0102, gap: float = 1e-3, far: float = 0.041) -> Scene:
    """Two blocks 20 mm high, `gap` apart, joined by a neck of this width; 1 mm between nodes."""
    shapes = [box(0, 0, 0.02, 0.02), box(0.02 + gap, 0, far, 0.02), box(0.02, low, 0.02 + gap, low + neck)]
    return Scene(shapely.union_all(shapes), 1e-3, GLASS)


def said(scene: Scene) -> tuple[str, ...]:
    return soundness.remarks(*build_grid(scene)[:2])


def thin(scene: Scene) -> list[Ligament]:
    grid = build_grid(scene)[0]
    plate = plate_of(grid)
    assert plate is not None
    return ligaments(grid, faces_of(plate, grid))


# ---- pieces


def test_a_neck_without_a_node_is_refused_with_its_place() -> None:
    with pytest.raises(SceneError) as caught:
        said(blocks(0.6e-3))
    neck = ("441 nodes", "(0.031, 0.01) m", "0.0006 m", "(0.0205, 0.0105) m", "0.001 m")
    assert mentions(caught.value, "plate", found=neck, expected="0.0002 m")


def test_the_cure_cures() -> None:
    assert said(blocks(0.6e-3).zone(box(0.018, 0.008, 0.023, 0.013), 1.25e-4)) == ()
    (cut,) = said(blocks(0.6e-3).crack([(0.0205, 0.0102), (0.0205, 0.0108)]))
    assert cut.startswith("the cracks cut the plate into pieces: 441 nodes around (0.01, 0.01) m; 441 nodes around")


LOOSE = {
    "a crack that nearly closes": lambda plate: plate.crack(
        [(0.01, 0.005), (0.03, 0.005), (0.03, 0.015), (0.01, 0.015), (0.01, 0.0052)]
    ),
    "a core on two thin bridges": lambda plate: plate.hole(
        box(0.0095, 0.0055, 0.0205, 0.0155)
        .difference(box(0.0105, 0.0065, 0.0195, 0.0145))
        .difference(box(0, 0.0102, 0.04, 0.0107))
    ),
    "a small piece with a load": lambda _: blocks(0.6e-3, far=0.0225).load(
        box(0.021, 0, 0.03, 0.02), body_force=(1, 0)
    ),
    "a part without a node": lambda _: Scene(
        shapely.union_all([box(0, 0, 0.02, 0.02), box(0.0202, 2e-4, 0.0208, 0.0198)]), 1e-3
    ),
}


@pytest.mark.parametrize("name", LOOSE)
def test_what_the_drawing_joins_and_no_bond_does_is_refused(name: str, plate: Scene) -> None:
    with pytest.raises(SceneError, match=naming(found=re.compile(r"(\d+ nodes around|no node is in a part)"))):
        said(LOOSE[name](plate))


def test_a_zone_boundary_across_a_neck() -> None:
    """The finer nodes beside the coarser ones are dropped, so that the neck's own row goes."""
    neck = shapely.union_all([box(0, 0, 0.02, 0.02), box(0.03, 0, 0.05, 0.02), box(0.02, 0.0088, 0.03, 0.0112)])
    scene = Scene(neck, 4e-3, GLASS).zone(box(0, 0, 0.025, 0.02), 2e-3, grown=False)
    try:
        notes = said(scene)
    except SceneError as error:
        notes = (str(error),)
    assert any("0.0024 m" in note for note in notes)


def test_crumbs_are_warned_of() -> None:
    tip = shapely.union_all([box(0, 0, 0.02, 0.02), box(0.021, 0.009, 0.0225, 0.012), box(0.02, 0.0102, 0.021, 0.0108)])
    loose, narrow = said(Scene(tip, 1e-3))
    assert loose.startswith("warning: no bond joins 8 nodes around (0.0215, 0.0105) m to the rest")
    assert mentions(narrow, "warning", found=("0.0006 m", "(0.0205, 0.0105) m", "0.6 spacings of 0.001 m"))
    with pytest.raises(SceneError, match=naming("plate", found="8 nodes")):
        said(Scene(tip, 1e-3).load(box(0.021, 0.009, 0.0225, 0.012), body_force=(1, 0)))
    bare, _ = said(Scene(shapely.union_all([box(0, 0, 0.02, 0.02), box(0.0202, 0.0202, 0.0208, 0.0208)]), 1e-3))
    assert bare.startswith("warning: no node is in a part of the plate around (0.0205, 0.0205) m, 3.6e-07 m^2")


def test_a_crack_may_cut_the_plate_and_says_so(plate: Scene) -> None:
    (cut,) = said(plate.crack([(0, 0.0105), (0.04, 0.0105)]))
    assert mentions(cut, "cracks", "451 nodes", "(0.02, 0.005) m", "410 nodes", "(0.02, 0.0155) m")


def test_a_part_in_a_hole_of_another_keeps_its_bonds() -> None:
    """A frame of 40 x 40 mm around a block of 10 x 10."""
    frame = box(0, 0, 0.04, 0.04).difference(box(0.01, 0.01, 0.03, 0.03))
    grid, settings, _ = build_grid(Scene(shapely.union_all([frame, box(0.015, 0.015, 0.025, 0.025)]), 1e-3))
    plate = plate_of(grid)
    assert plate is not None
    assert plate.area == pytest.approx(0.0013, rel=1e-12)
    assert pieces(grid, 3.0).max() == 1
    assert soundness.remarks(grid, settings) == ()


def test_parts_that_touch_in_a_point() -> None:
    (touching,) = said(Scene(shapely.MultiPolygon([box(0, 0, 0.02, 0.02), box(0.02, 0.02, 0.04, 0.04)]), 1e-3))
    assert mentions(touching, "touches", "point")


def brute(grid: Grid, reach: float) -> np.ndarray:
    """The pieces from all bonds."""
    found = Neighbours(grid.position, grid.delta, reach * grid.delta, mutual=True).pairs(np.arange(len(grid)))
    near = found.length <= reach * (grid.delta[found.source] + grid.delta[found.target]) / 2 * (1 + 1e-9)
    pairs = Pairs(*(column[near] for column in found))
    seen = Sight(grid).inside(pairs) & ~Sight(grid).cut(pairs)
    links = coo_array((np.ones(seen.sum()), (pairs.source[seen], pairs.target[seen])), shape=(len(grid), len(grid)))
    return connected_components(links, directed=False)[1]


def test_bonds_are_as_long_as_the_mean_horizon_at_most() -> None:
    """Nodes of 1 and 2 mm: with a ratio of 3 they see each other up to 4.5 mm, though the coarse one's horizon is 6."""
    for gap, count in ((4.49e-3, 1), (4.51e-3, 2)):
        grid = Grid(
            ids=np.array([1, 2]),
            position=np.array([[0, 0], [gap, 0]]),
            delta=np.array([1e-3, 2e-3]),
            border=np.ones(2, dtype=bool),
            hole_id=np.full(2, -1),
            cracks=np.empty((0, 4)),
            outline=(np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),),
        )
        assert pieces(grid, 3.0).max() + 1 == count


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two numberings part the nodes alike."""
    count = len(np.unique(np.stack([one, other], axis=1), axis=0))
    return count == len(np.unique(one)) == len(np.unique(other))


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("seed", range(12))
def test_pieces_are_those_of_all_bonds(seed: int) -> None:
    """Random cracks, holes and zones: connected parts as from the whole list of bonds."""
    random = np.random.default_rng(seed)
    scene = Scene(box(0, 0, 0.04, 0.03), 1e-3)
    for _ in range(random.integers(0, 4)):
        x, y, radius = random.uniform([0.005, 0.005, 0.001], [0.035, 0.025, 0.004])
        scene = scene.hole(Circle(x, y, radius))
    if seed % 2:
        scene = scene.zone(box(*np.sort(random.uniform(0, 0.03, (2, 2)), axis=0).ravel()), 5e-4, grown=seed % 4 == 1)
    while len(scene.cracks) < random.integers(1, 9):
        ends = random.uniform(0, [0.04, 0.03], (2, 2))
        if seed % 3 == 0:
            ends[:, 0] = [0, 0.04]
        line = shapely.LineString(ends)
        if scene.shape.covers(line):
            scene = scene.crack(line)
    grid, _, _ = build_grid(scene)
    for reach in (1.5, 3.0):
        assert same(pieces(grid, reach), brute(grid, reach))


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("grading", [1.0, 4.0])
def test_pieces_of_a_mesh_are_those_of_all_bonds(grading: float, tmp_path: Path) -> None:
    count = 24
    x, y = np.meshgrid(*[np.linspace(0, 1, count + 1) ** grading * 0.04] * 2)
    corner = (np.arange(count) + (count + 1) * np.arange(count)[:, None]).ravel()
    halves = [corner[:, None] + np.array(step) for step in ([0, 1, count + 2], [0, count + 2, count + 1])]
    meshio.write(
        tmp_path / "m.vtu",
        meshio.Mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), {"triangle": np.concatenate(halves)}),
    )
    built = build_file(tmp_path / "m.vtu", cracks=["0,0.0201,0.04,0.0201"])
    assert same(pieces(built.grid, 3.0), brute(built.grid, 3.0))
    assert any(mentions(note, "cracks", "plate", "pieces") for note in built.notes)


def two_blocks(neck: float) -> meshio.Mesh:
    """Two blocks of 4 x 4 cells of 1 mm with one more cell between them, 1 mm long, in the middle of a cell's side."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(25)])
    corner = (np.arange(4) + 5 * np.arange(4)[:, None]).ravel()
    quads = corner[:, None] + np.array([0, 1, 6, 5])
    low, high = 2.5 - neck / 2, 2.5 + neck / 2
    between = np.array([[4, low, 0], [5, low, 0], [5, high, 0], [4, high, 0]])
    points = np.concatenate([points, points + np.array([5.0, 0, 0]), between]) * 1e-3
    return meshio.Mesh(points, {"quad": np.concatenate([quads, quads + 25, [[50, 51, 52, 53]]])})


@pytest.mark.slow
def test_a_bare_mesh_of_two_blocks_and_a_neck(tmp_path: Path) -> None:
    meshio.write(tmp_path / "m.vtu", two_blocks(0.6))
    (note,) = build_file(tmp_path / "m.vtu").notes
    assert mentions(note, "warning", found=("0.0006 m", re.compile(r"\(0\.005")))
    crooked = two_blocks(0.1)
    crooked.points[50:, 1] += [0.5e-3] * 4  # in the middle of no cell's side
    meshio.write(tmp_path / "m.vtu", crooked)
    with pytest.raises(
        SceneError,
        match=naming("plate", "m.vtu", found=("16 nodes", "0.0001 m", re.compile(r"\(0\.004\d+, 0\.003\) m"))),
    ):
        build_file(tmp_path / "m.vtu")


@pytest.mark.slow
def test_cells_that_overlap_are_refused(tmp_path: Path) -> None:
    mesh = two_blocks(0.6)
    mesh.points[25:50, 0] -= 0.5e-3
    meshio.write(tmp_path / "m.vtu", mesh)
    with pytest.raises(
        SceneError,
        match=naming("cells", "m.vtu", found=("3.26e-05", "3.23e-05"), expected=("cells", "overlap")),
    ):
        build_file(tmp_path / "m.vtu")


# ---- ligaments

HOLE = Circle(0.02, 0.0105, 0.003)
THIN: dict[str, tuple[Callable[[Scene], Scene], tuple[float, float], float]] = {  # scene, place and width, mm
    "neck": (lambda _: blocks(2e-3, gap=0.01), (25, 11.2), 2.0),
    "hole and edge": (lambda plate: plate.hole(Circle(0.02, 0.005, 0.003)), (20, 1), 2.0),
    "two holes": (lambda plate: plate.hole(HOLE).hole(Circle(0.012, 0.0105, 0.003)), (16, 10.5), 2.0),
    "tip and edge": (lambda plate: plate.crack([(0, 0.0105), (0.038, 0.0105)]), (39, 10.5), 2.0),
    "tip and tip": (
        lambda plate: plate.crack([(0, 0.0105), (0.019, 0.0105)]).crack([(0.021, 0.0105), (0.04, 0.0105)]),
        (20, 10.5),
        2.0,
    ),
    "crack inside and edge": (lambda plate: plate.crack([(0.019, 0.0185), (0.021, 0.0185)]), (19, 19.25), 1.5),
    "crack and hole": (lambda plate: plate.hole(HOLE).crack([(0, 0.0105), (0.015, 0.0105)]), (16, 10.5), 2.0),
    "as thin as nothing": (lambda plate: plate.hole(Circle(0.02, 0.003001, 0.003)), (20, 0), 0.001),
    "plate": (lambda _: Scene(box(0, 0, 0.002, 0.004), 1e-3), (1, 2), 2.0),
    "between coarse nodes only": (
        lambda _: Scene(
            shapely.union_all([box(0, 0, 0.02, 0.02), box(0.03, 0, 0.05, 0.02), box(0.02, 0.008, 0.03, 0.012)]), 2e-3
        ).zone(box(0.023, 0, 0.027, 0.02), 1e-3, grown=False),
        (27, 10),
        4.0,
    ),
    "behind which a disc has no room": (lambda _: blocks(0.0011, far=0.0232), (20.5, 10.75), 1.1),
}


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("name", THIN)
def test_thin_places_are_found(name: str, plate: Scene) -> None:
    make, place, width = THIN[name]
    (found,) = thin(make(plate))
    assert np.array(found.place) * 1e3 == pytest.approx(place, abs=1.1)
    assert found.width * 1e3 == pytest.approx(width, rel=2e-3, abs=1e-3)
    (note,) = [note for note in said(make(plate)) if "the plate" in note]
    assert mentions(note, expected=3)


THICK: dict[str, Callable[[Scene], Scene]] = {
    "plate": lambda plate: plate,
    "three spacings": lambda _: blocks(3e-3, gap=3e-3),
    "a strip of three spacings": lambda _: Scene(box(0, 0, 0.04, 0.003), 1e-3),
    "a hole 3.1 spacings from the edge": lambda plate: plate.hole(Circle(0.02, 0.0061, 0.003)),
    "finer nodes": lambda plate: plate.hole(Circle(0.02, 0.005, 0.003)).refine("hole", 3e-3),
    "a crack through": lambda plate: plate.crack([(0, 0.0105), (0.04, 0.0105)]),
    "cracks that cross": lambda plate: plate.crack([(0.01, 0.005), (0.03, 0.0152)]).crack(
        [(0.01, 0.0152), (0.03, 0.005)]
    ),
    "a slanting crack from a corner": lambda plate: plate.crack([(0, 0), (0.02, 0.0052)]),
    "a crack with kinks": lambda plate: plate.crack([(0, 0.0105), (0.01, 0.0105), (0.008, 0.0145), (0.02, 0.0152)]),
    "a sharp wedge": lambda _: Scene([(0, 0), (0.04, 0), (0, 0.01)], 1e-3),
    "a disc": lambda _: Scene(Circle(0, 0, 0.01), 1e-3),
    "a notch": lambda plate: plate.notch([(0.018, 0.02), (0.02, 0.012), (0.022, 0.02)]),
    "two plates beside each other": lambda _: Scene(
        shapely.MultiPolygon([box(0, 0, 0.01, 0.01), box(0.0105, 0, 0.02, 0.01)]), 1e-3
    ),
}


@pytest.mark.quick_cases(10)
@pytest.mark.parametrize("name", THICK)
def test_no_false_alarm(name: str, plate: Scene) -> None:
    assert thin(THICK[name](plate)) == []


def test_many_thin_places_are_counted() -> None:
    scene = Scene(box(0, 0, 0.08, 0.02), 1e-3)
    for x in range(6):
        scene = scene.hole(Circle(0.007 + 0.012 * x, 0.006, 0.004))
    assert said(scene)[3:] == ("warning: 3 more places are as thin",)


def test_a_grid_without_outline_is_not_looked_at(plate: Scene) -> None:
    grid, settings, _ = build_grid(plate)
    assert soundness.remarks(dataclasses.replace(grid, outline=()), settings) == ()


@pytest.mark.parametrize("points", [2, 50])
def test_a_crack_that_round_off_ends_short_of_the_edges_parts_the_plate(plate: Scene, points: int) -> None:
    grid = build_grid(plate)[0]
    x = np.linspace(1e-11, 0.04 - 1e-11, points)
    line = np.column_stack([x, 0.0101 + 1e-4 * np.sin(900 * x)])
    grid = dataclasses.replace(grid, cracks=np.hstack([line[:-1], line[1:]]))
    lower, upper = sorted(face.area for face in faces_of(plate.shape, grid))
    assert lower + upper == pytest.approx(8e-4, rel=1e-9)
