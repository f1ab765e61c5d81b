"""Bodies in space: solids become nodes, which are written and read."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh import Body, Box, Cylinder, Material, Medium, SceneError, Sphere
from pdmesh.drawing.building import build as make
from pdmesh.drawing.building import meshed
from pdmesh.grid.building import Built, build
from pdmesh.grid.cubes import Cubes, inside, shares
from pdmesh.grid.cubic import Cubic, _given, _thin
from pdmesh.model.document import GridError, Run, encode, read_document
from pdmesh.model.node_grid import grid_of
from pdmesh.model.triangulated_surface import facing, outward, volume
from pdmesh.scene.solids import Shell, Solid, brick

GLASS = Material(E=1e9, rho=1000.0, G0=100.0)


@cache
def built(solid: Solid, spacing: float) -> Built:
    return build(meshed(Body(solid, spacing, GLASS)))


def box(low: tuple[float, float, float] = (0, 0, 0), high: tuple[float, float, float] = (1, 0.6, 0.4)) -> Built:
    return built(Box(low, high), 0.1)


@pytest.mark.process
def test_a_box_is_full_of_cubes() -> None:
    grid = box().grid
    assert len(grid) == 240
    assert grid.position.min(axis=0) == pytest.approx([0.05, 0.05, 0.05], abs=1e-12)
    assert grid.cells == pytest.approx(np.full(240, 1e-3), rel=1e-9)
    assert grid.border.sum() == 240 - 8 * 4 * 2
    assert box().settings.material == msgspec.structs.replace(GLASS, plane="space")


@pytest.mark.slow
def test_a_sphere_has_the_nodes_of_one_and_its_volume() -> None:
    """57 856 nodes are those of the cubes of a ball whose middles are in it, counted."""
    count = 24
    middles = np.arange(-count, count) + 0.5
    x, y, z = np.meshgrid(middles, middles, middles)
    grid = built(Sphere((0, 0, 0), 6), 0.25).grid
    assert len(grid) == (x**2 + y**2 + z**2 < count**2).sum() == 57856
    assert grid.cells.sum() == pytest.approx(4 / 3 * np.pi * 216, rel=1e-9)
    mirrored = np.unique(np.abs(grid.position), axis=0)
    assert 8 * len(mirrored) == len(grid)


@pytest.mark.slow
def test_a_body_that_is_its_mirror_image_has_volumes_that_are() -> None:
    """A hole through a block: what is in cubes of no node is shared by all that are as near."""
    size = (40e-3, 16e-3, 16e-3)
    grid = built(Box((0, 0, 0), size) - Cylinder((20e-3, 0, 8e-3), (20e-3, 16e-3, 8e-3), 3e-3), 1e-3).grid
    order = np.lexsort(np.round(2000 * grid.position).T)
    for axis, end in enumerate(size):
        turned = grid.position.copy()
        turned[:, axis] = end - turned[:, axis]
        other = np.lexsort(np.round(2000 * turned).T)
        assert grid.position[order] == pytest.approx(turned[other], abs=1e-12)
        assert grid.cells[order] == pytest.approx(grid.cells[other], rel=5e-3)  # 1.9e-3, of a polygon


@pytest.mark.slow
def test_volumes_are_measured_before_they_are_scaled() -> None:
    """Cubes have what triangles enclose: a cylinder three cubes across, a ball of twenty."""
    for solid in (Cylinder((0, 0, 0), (0.2, 0.3, 1), 0.17), Sphere((0, 0, 0), 1)):
        body = meshed(Body(solid, 0.1))
        low, high = body.shell.bounds
        cubes = Cubes(low - 0.05, 0.1, np.ceil((high - low) / 0.1).astype(int) + 2)
        found = shares(outward(body.shell.triangles), cubes).sum() * 1e-3
        assert found == pytest.approx(volume(body.shell.triangles), rel=1e-12)
        assert inside(body.shell.triangles, cubes, "body").sum() * 1e-3 == pytest.approx(body.shell.volume, rel=0.1)


@pytest.mark.slow
def test_a_void_is_left_out_of_a_volume() -> None:
    """Whichever way its triangles turn; the hull of the body is not all that bonds may not cross."""
    shell = meshed(Body(Box((0, 0, 0), (1, 1, 1)) - Sphere((0.5, 0.5, 0.5), 0.25), 0.1)).shell
    exact = 1 - np.pi / 48
    assert shell.volume == pytest.approx(exact, rel=1e-9)
    assert volume(shell.triangles) == pytest.approx(exact, rel=2e-3)
    assert volume(shell.triangles[:, ::-1]) == pytest.approx(exact, rel=2e-3)
    some = np.random.default_rng(1).random(len(shell.triangles)) < 0.5
    mixed = np.where(some[:, None, None], shell.triangles, shell.triangles[:, ::-1])
    assert volume(mixed) == pytest.approx(volume(shell.triangles), rel=1e-12)
    seen = facing(shell.triangles)
    assert np.abs(seen - 0.5).max() < 0.26
    assert len(seen) > len(shell.triangles) - 12 - 4  # two have no area


@pytest.mark.slow
def test_a_difference_has_a_hole_that_no_bond_crosses() -> None:
    from pdmesh.reports.bonds_and_step import bonds

    grid = built(Box((0, 0, 0), (1, 1, 0.3)) - Box((0.4, -1, -1), (0.6, 0.5, 1)), 0.1).grid
    assert len(grid) == 300 - 30
    for part in bonds(grid, 3.0):
        i, j = (grid.position[end][part.inside] for end in (part.source, part.target))
        middle = (i + j) / 2
        within = (middle[:, 0] > 0.401) & (middle[:, 0] < 0.599) & (middle[:, 1] < 0.499)
        assert not within.any()
        assert (~part.inside).any()


@pytest.mark.process
def test_what_is_written_is_read(tmp_path: Path) -> None:
    """Version 2, z and delta z real; the same grid comes back."""
    found = build(
        meshed(
            Body(Box((0, 0, 0), (1, 0.6, 0.4)), 0.1, GLASS)
            .crack([[[0.5, 0, 0], [0.5, 1, 0], [0.5, 0, 1]]], "half")
            .fix("left")
            .load("right", traction=(1e5, 0, 0))
            .move(Box((0, 0, 0), (0.2, 0.2, 0.2)), initial_velocity=(0, 0, 3))
        )
    )
    path = tmp_path / "box.json"
    found.write(path)
    raw = json.loads(path.read_bytes())
    assert raw["version"] == 2
    assert raw["nodes"][1]["position"] == [0.15, 0.05, 0.05]
    assert raw["nodes"][1]["delta"] == [0.1, 0.1, 0.1]
    assert len(raw["notch"]) == 1
    document = read_document(path.read_bytes(), "box")
    grid = grid_of(document, "box")
    assert np.array_equal(grid.position, found.grid.position)
    assert np.array_equal(grid.cracks, found.grid.cracks)
    assert np.array_equal(grid.faces, found.grid.faces)
    assert encode(document) == path.read_bytes()
    fixed, loaded, moved = document.conditions
    assert len(fixed.nodes or ()) == len(loaded.nodes or ()) == 24
    assert loaded.surface == pytest.approx(0.24)  # type: ignore[union-attr]
    assert len(moved.nodes or ()) == 8
    assert moved.z == 3  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": 1}, "same z for all nodes of a plate"),
        ({"notch": [[0, 0, 0, 1, 1, 0]]}, naming(found="6 numbers", expected="9")),
        ({"outline": [[[0, 0], [1, 0], [1, 1]]]}, naming(found="2 numbers", expected="3")),
        ({"holes": [[[0, 0], [1, 0], [1, 1]]]}, naming(found="2 numbers", expected="3")),
        ({"version": 3}, naming(expected=("1", "2"))),
    ],
)
def test_a_plate_in_a_body_is_refused(change: dict[str, object], said: str) -> None:
    raw = json.loads(encode(box().document)) | change
    with pytest.raises(GridError, match=said):
        grid_of(read_document(json.dumps(raw), "box"), "box")


def test_an_open_surface_is_named_where_it_is_open() -> None:
    """A triangle over one column of cubes alone, that of (1.25, 2.35) m."""
    one = np.array([[[1.22, 2.32, 3.1], [1.29, 2.33, 3.1], [1.24, 2.39, 3.1]]])
    cubes = Cubes(np.array([1.0, 2.0, 3.0]), 0.1, np.array([5, 6, 7]))
    with pytest.raises(SceneError, match=naming("plate", found=("x = 1.25", "y = 2.35 m"))):
        inside(one, cubes, "plate")


@pytest.mark.slow
def test_what_makes_no_body_is_refused() -> None:
    whole = meshed(Body(Box((0, 0, 0), (1, 1, 1)), 0.1)).shell
    with pytest.raises(SceneError, match=naming(found=("surface", "open"))):
        build(Body(Shell(whole.triangles[1:], 1.0), 0.1))
    other = meshed(Body(Box((0.5, 0.5, 0.5), (1.5, 1.5, 1.5)), 0.1)).shell
    crossing = np.concatenate([whole.triangles, other.triangles])
    with pytest.raises(SceneError, match=naming("surface", "crosses", "itself")):
        build(Body(Shell(crossing, volume(crossing)), 0.1))
    stack = [[[-9, -9, z], [9, -9, z], [0, 20, z]] for z in 0.55 + 0.1 / 16 * np.arange(-8, 8)]
    with pytest.raises(SceneError, match=naming("crack 'stack'", found="100 nodes")):
        build(Body(whole, 0.1).crack(stack, "stack"))
    with pytest.raises(SceneError, match=naming("radius", found="-1 m")):
        Body(Sphere((0, 0, 0), -1), 0.1)
    with pytest.raises(SceneError, match=naming("body", found="nothing")):
        meshed(Body(Box((0, 0, 0), (1, 1, 1)) & Box((2, 2, 2), (3, 3, 3)), 0.1))
    with pytest.raises(SceneError, match=naming(expected=("left", "right"))):
        Body(Box((0, 0, 0), (1, 1, 1)), 0.1).fix("up")


@pytest.mark.slow
def test_a_crack_through_nodes_is_moved_across_itself_by_less_than_half_a_spacing() -> None:
    """Flat, and at 45 degrees through the middle of the block, where it meets the ten nodes of a diagonal in each row.

    Moved as little as is enough, it parts the nodes of its plane from those in front of it.
    """
    block = Body(Box((0, 0, 0), (1, 1, 1)), 0.1, GLASS)
    flat = make(block.crack([[[-9, -9, 0.55], [9, -9, 0.55], [0, 20, 0.55]]], "flat"))
    assert flat.grid.cracks[:, [2, 5, 8]] == pytest.approx(np.full((1, 3), 0.55 + 0.1 / 16))
    assert re.search(naming("crack 'flat'", "(0, 0, 0.00625) m", "100 nodes"), flat.notes[0])
    corners = np.array([[0.2, -1, 0.2], [0.8, -1, 0.8], [0.8, 2, 0.8], [0.2, 2, 0.2]])
    slanted = make(block.crack([corners[[0, 1, 2]], corners[[0, 2, 3]]]))
    moved = slanted.grid.cracks.reshape(-1, 3) - corners[[0, 1, 2, 0, 2, 3]]
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(6, 0.1 / 16))
    assert np.abs(moved.sum(axis=1)).max() < 1e-12
    assert re.search(naming("crack '1'", "60 nodes"), slanted.notes[0])
    assert not make(block.crack([[[-9, -9, 0.5], [9, -9, 0.5], [0, 20, 0.5]]])).notes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda body: body.crack([[[5, 5, 5], [6, 5, 5], [5, 6, 5]]]),
            naming("crack '1'", found=("outside", "body")),
        ),
        (lambda body: body.crack([[[0, 0, 0.5], [1, 0, 0.5], [0.5, 0, 0.5]]]), naming(found="triangle 0")),
        (lambda body: body.zone(Box((5, 5, 5), (6, 6, 6)), 0.05), naming("zone '1'", found=("middle", "cube"))),
        (
            lambda body: body.zone(body.solid, 0.2),
            naming("spacing", "zone '1'", found="0.2 m", expected=("0.1 m", "over 1", "2", "4", "8")),
        ),
        (
            lambda body: body.zone(body.solid, 0.03),
            naming("spacing", "zone '1'", found="0.03 m", expected=("0.1 m", "over 1", "2", "4", "8")),
        ),
        (lambda body: Body(body.solid, -0.1), naming("spacing", found="-0.1", expected="0 m")),
        (
            lambda body: Body(body.solid, 0.1, horizon=0.0),
            naming("horizon", found="0.0", expected=("ratio", "spacing")),
        ),
        (
            lambda body: Body(body.solid, 0.1, Material(E=-1.0, rho=1.0, G0=1.0)),
            re.escape("material: $.E is "),
        ),
        (lambda body: Body(body.solid, 0.1, medium=Medium(D=-1.0)), re.escape("medium: $.D is -1.0")),
        (lambda body: Body(body.solid, 0.1, run=Run(steps=-4)), re.escape("run: $.steps is -4")),
    ],
)
def test_odd_parts_are_refused(make: Callable[[Body], Body], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        build(meshed(make(Body(brick((0, 0, 0), (1, 1, 1)), 0.1, GLASS))))


@pytest.mark.slow
def test_zones_part_cubes_and_volumes_stay() -> None:
    """Two steps finer in the middle: spacings change by one step, and no node sees two."""
    body = Body(Box((0, 0, 0), (3.2, 2, 2)), 0.2, GLASS).zone(Box((1.5, 0.9, 0.9), (1.7, 1.1, 1.1)), 0.05)
    grid = build(meshed(body)).grid
    assert np.unique(grid.delta) == pytest.approx([0.05, 0.1, 0.2])
    assert grid.cells.sum() == pytest.approx(12.8, rel=1e-9)
    assert grid.cells == pytest.approx(grid.delta**3, rel=1e-9)
    finest, coarsest = (np.isclose(grid.delta, size) for size in (0.05, 0.2))
    apart = np.sqrt(((grid.position[finest][:, None] - grid.position[coarsest]) ** 2).sum(axis=2))
    assert apart.min() > 3 * 0.1  # as far as a node of the step between sees
    inner = np.abs(grid.position - [1.6, 1, 1]).max(axis=1) < 0.1
    assert finest[inner].all()


@pytest.mark.slow
def test_a_segment_is_cut_by_small_triangles_as_by_large_ones() -> None:
    """A square in 2 and in 200 triangles; both against what arithmetic says, edges included."""
    from pdmesh.model.neighbours import Pairs, lengths
    from pdmesh.model.triangulated_surface import Screen

    random = np.random.default_rng(3)
    position = np.vstack(
        [random.uniform(-1, 1, (100, 3)), [[0.25, 0.25, 0.5], [0.25, 0.25, -0.5], [0.5, 0, 1], [0.5, 0, -1]]]
    )
    i, j = (side.ravel() for side in np.indices((len(position),) * 2))
    kept = i != j
    i, j = i[kept], j[kept]
    pairs = Pairs(i, j, lengths(position[j] - position[i]))
    along = np.linspace(-0.5, 0.5, 11)
    x, y = (side.ravel() for side in np.meshgrid(along[:-1], along[:-1]))

    def square(x: object, y: object, side: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        corners = [
            np.stack(np.broadcast_arrays(x + a * side, y + b * side, 0.0), axis=-1)
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]  # type: ignore[operator]
        return np.concatenate(
            [
                np.stack([corners[0], corners[1], corners[2]], axis=1),
                np.stack([corners[0], corners[2], corners[3]], axis=1),
            ]
        )

    delta = np.full(len(position), 0.1)
    few = Screen(square(np.array([-0.5]), np.array([-0.5]), 1.0), position, delta).met(pairs)
    many = Screen(square(x, y, 0.1), position, delta).met(pairs)
    p, q = position[i], position[j]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = p + (p[:, 2] / (p[:, 2] - q[:, 2]))[:, None] * (q - p)
    expected = (p[:, 2] * q[:, 2] < 0) & (np.abs(crossing[:, :2]) <= 0.5).all(axis=1)
    assert np.array_equal(few, expected)
    assert np.array_equal(many, expected)
    assert few.sum() > 1000


def test_a_body_is_thin_four_nodes_from_where_it_has_three_across() -> None:
    """A block with a fin one cube thick: its first three cubes are within four of the block's innermost, and belong to
    a sharp edge; those further out are thin, and nothing else is."""
    solid = np.zeros((24, 11, 11), dtype=bool)
    solid[1:10, 1:10, 1:10] = True
    solid[10:20, 1:10, 5] = True
    cubes = Cubes(np.zeros(3), 1.0, np.array(solid.shape))
    thin = _thin(solid, cubes, cubes)
    assert np.array_equal(thin, solid & (np.arange(24) >= 13)[:, None, None])


def test_what_is_in_no_node_is_scaled_with_the_nodes_it_is_given_to() -> None:
    """Three whole cubes and half of one beside the first: what lines have missed of the body's volume is put into the
    first alone."""
    cubes, no = Cubes(np.zeros(3), 1.0, np.array([3, 1, 1])), np.zeros(3, dtype=bool)
    level = Cubic(cubes, np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.ones(3), no, no)
    body = SimpleNamespace(shell=SimpleNamespace(volume=3.6))
    (found,) = _given(body, [level], [(np.array([[-0.5, 0.5, 0.5]]), np.array([0.5]))])  # type: ignore[arg-type]
    assert found.volume == pytest.approx([1.6, 1.0, 1.0])
