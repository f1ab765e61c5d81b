"""Volumes of cells are those of the solid that is cut, whatever the direction of its faces."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pdmesh import Body, SceneError
from pdmesh.grid.cubes import Cubes, inside, shares
from pdmesh.grid.cubic import place_nodes
from pdmesh.model.triangulated_surface import outward, volume
from pdmesh.scene.solids import Shell, brick

Array = NDArray[np.float64]
CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))


def hull(corners: Array) -> tuple[Array, float]:
    """The triangles around corners, and their exact volume."""
    found = ConvexHull(corners)
    return outward(corners[found.simplices]), float(found.volume)


def turned(corners: Array) -> Array:
    """Corners turned about (1, 2, 3) by one radian."""
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    across = np.cross(axis, corners)
    return corners + np.sin(1) * across + (1 - np.cos(1)) * np.cross(axis, across)


def chamfered(axis: int, far: bool) -> Array:
    """A cube of 0.1 m with a chamfer of 20 mm along an axis, at its near or at its far edge."""
    flat = np.array([[0.02, 0], [0.1, 0], [0.1, 0.1], [0, 0.1], [0, 0.02]])
    if far:
        flat = 0.1 - flat
    both = np.concatenate([np.insert(flat, 2, 0.0, axis=1), np.insert(flat, 2, 0.1, axis=1)])
    return np.roll(both, axis + 1, axis=1)


def around(ends: tuple[float, float], sides: int) -> Array:
    """Corners of a prism or cone between two radii, 1 m apart, about a slanted axis."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)], 1) for z, r in enumerate(ends)]
    return turned(np.unique(np.concatenate(rings), axis=0))


SOLIDS = {
    **{f"chamfer {'xyz'[axis]} {far}": chamfered(axis, far) for axis in range(3) for far in (False, True)},
    "rotated box": turned(CORNERS * [0.9, 0.5, 0.3]),
    "wedge": np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.05, 0], [0.02, 0.08, 0], [0.04, 0.02, 0.05]]),
    "prism": around((0.3, 0.3), 5),
    "cylinder": around((0.3, 0.3), 64),
    "cone": around((0.4, 0.0), 48),
}


def cubes_around(triangles: Array, across: int) -> Cubes:
    """About `across` cubes along the longest side, and one more beyond each end."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    spacing = float((high - low).max()) / across
    size = np.ceil((high - low) / spacing - 1e-6).astype(int) + 2
    return Cubes((low + high) / 2 - size / 2 * spacing, spacing, size)


@pytest.mark.parametrize("name", SOLIDS)
def test_cells_have_the_volume_of_the_solid_along_any_axis(name: str) -> None:
    triangles, exact = hull(SOLIDS[name])
    cubes = cubes_around(triangles, 13)
    share = shares(triangles, cubes)
    assert share.sum() * cubes.spacing**3 == pytest.approx(exact, rel=1e-12)
    assert -1e-12 < share.min() < share.max() < 1 + 1e-12
    for order in map(list, permutations(range(3))):
        other = shares(outward(triangles[..., order]), Cubes(cubes.corner[order], cubes.spacing, cubes.size[order]))
        assert np.abs(other - share.transpose(order)).max() < 1e-11


@pytest.mark.parametrize("name", SOLIDS)
def test_nodes_of_a_body_with_other_axes_are_the_same_nodes(name: str) -> None:
    """Centres on a slanted face too: those of the chamfers are, 4 of each layer of 16 squares."""
    triangles, exact = hull(SOLIDS[name])
    spacing = float(np.ptp(triangles, axis=(0, 1)).max()) / 20

    def nodes(order: list[int]) -> tuple[Array, Array]:
        (level,) = place_nodes(Body(Shell(triangles[..., order], exact), spacing))
        back = np.argsort(order)
        position = level.position[:, back]
        rows = np.lexsort(np.round(position / spacing * 64).T)
        return position[rows], level.volume[rows]

    position, volumes = nodes([0, 1, 2])
    assert volumes.sum() == pytest.approx(exact, rel=1e-12)
    if name.startswith("chamfer"):
        assert len(position) == 20 * (400 - 6)
        assert np.unique(np.round(volumes / spacing**3, 9)).tolist() == [0.5, 1.0]
    for order in map(list, permutations(range(3))):
        other, their = nodes(order)
        assert np.abs(other - position).max() < 1e-6 * spacing
        assert np.abs(their / volumes - 1).max() < 1e-9


def test_a_part_of_the_cubes_has_the_shares_of_all() -> None:
    """Also where the body goes on beyond the part, on each side."""
    triangles, _ = hull(np.random.default_rng(0).normal(size=(50, 3)))
    cubes = cubes_around(triangles, 20)
    low, size = np.array([5, 6, 4]), np.array([9, 8, 6])
    part = Cubes(cubes.corner + low * cubes.spacing, cubes.spacing, size)
    x, y, z = (slice(first, first + count) for first, count in zip(low, size, strict=True))
    assert np.abs(shares(triangles, part) - shares(triangles, cubes)[x, y, z]).max() < 1e-12


def test_triangles_of_any_orientation_enclose_the_same_with_voids_and_bodies_in_them() -> None:
    """A box with a void, in which there is a box; and two boxes that share an edge."""
    boxes = [brick((i, i, i), (9 - i, 9 - i, 9 - i)).triangles for i in (0, 1, 2)]
    beside = brick((9, 9, 0), (12, 12, 9)).triangles
    every = np.concatenate([*boxes, beside])
    exact = 729 - 343 + 125 + 81
    assert volume(every) == pytest.approx(exact, rel=1e-12)
    turn = np.random.default_rng(1).random(len(every)) < 0.5
    mixed = np.where(turn[:, None, None], every, every[:, ::-1])
    assert volume(mixed) == pytest.approx(exact, rel=1e-12)
    assert len(outward(np.concatenate([every, every[:1, [0, 0, 1]]]))) == len(every)
    cubes = Cubes(np.full(3, -0.5), 1.0, np.full(3, 13))
    assert shares(outward(mixed), cubes).sum() == pytest.approx(exact, rel=1e-12)


def test_centres_on_a_surface_are_inside_if_some_slack_is_asked_for() -> None:
    """A box whose faces pass through centres has them on both sides; without slack on the lower side alone."""
    cubes = Cubes(np.zeros(3), 1.0, np.full(3, 6))
    triangles = brick((1.5, 1.5, 1.5), (3.5, 3.5, 3.5)).triangles
    assert inside(triangles, cubes, "body").sum() == 2**3
    assert inside(triangles, cubes, "body", 1e-4).sum() == 3**3


def test_a_surface_that_crosses_itself_is_named_with_the_place() -> None:
    one, other = (brick((i, i, i), (i + 1.0, i + 1.0, i + 1.0)).triangles for i in (0, 0.5))
    crossing = np.concatenate([one, other])
    with pytest.raises(SceneError, match=r"crosses itself near \(0\.\d+, 0\.\d+, 0\.\d+\) m"):
        place_nodes(Body(Shell(crossing, 2.0), 0.1))
