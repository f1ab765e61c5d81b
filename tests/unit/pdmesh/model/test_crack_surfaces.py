"""Cracks of triangles in space: who is parted, and the way round their front (pdmesh.model.visibility)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import meets, normals
from pdmesh.model.visibility import apart, around, front, parted

Array = NDArray[np.float64]


def rectangle(x0: float, x1: float, y0: float, y1: float) -> Array:
    """Two triangles in the plane z = 0."""
    a, b, c, d = (np.array([x, y, 0.0]) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
    return np.array([[a, b, c], [a, c, d]])


HALF = rectangle(-9, 0, -9, 9)
TIP = front(HALF)[(front(HALF)[:, :, 0] == 0).all(axis=1)]  # the other edges are its mouth


def cloud(half: int = 3) -> Array:
    steps = np.arange(-half, half) + 0.5
    return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)


def pairs_within(reach: float) -> tuple[Array, Array]:
    nodes = cloud()
    far = np.sqrt(((nodes[:, None] - nodes) ** 2).sum(axis=2))
    return tuple(nodes[rows] for rows in np.nonzero((far > 0) & (far <= reach)))  # type: ignore[return-value]


def test_pairs_are_parted_where_they_pass_through() -> None:
    """Against the plane's own rule: other sides, and over x of 0 or less there, the front included."""
    a, b = pairs_within(3.0)
    crosses = a[:, 2] * b[:, 2] < 0
    at = a[:, 0] + (b[:, 0] - a[:, 0]) * a[:, 2] / np.where(crosses, a[:, 2] - b[:, 2], 1)
    expected = crosses & (at <= 1e-12)
    found = parted(a, b, HALF)
    assert 0 < expected.sum() < crosses.sum()
    assert (crosses & (np.abs(at) < 1e-12)).any()  # ties are there
    assert np.array_equal(found, expected)
    assert np.array_equal(found, parted(b, a, HALF))
    mirror = np.array([1, 1, -1])
    assert np.array_equal(found, parted(a * mirror, b * mirror, HALF[:, ::-1]))


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ((1, 1, 1), (1, 1, -1), True),  # through the face
        ((1, 1, 1), (1, 1, 0), True),  # an end on it
        ((1, 1, 1), (1, 1, 0.01), False),
        ((2, 0, 1), (2, 0, -1), True),  # through an edge
        ((1, -1, 1), (3, 1, -1), True),  # the same, aslant
        ((4, 0, 1), (4, 0, -1), True),  # through a corner
        ((2, -1e-11, 1), (2, -1e-11, -1), False),  # beside an edge, by more than 1e-12 of the size
        ((2, -1e-13, 1), (2, -1e-13, -1), True),  # by less
        ((1, 1, 1), (1, 1, 1e-13), True),
        ((-1, 1, 0), (1, 1, 0), True),  # in its plane, an end on it
        ((-1, 1, 0), (5, 1, 0), True),  # its middle on it
        ((-1, 1, 0), (-3, 1, 0), False),
        ((-5, 1, 0), (1, -5, 0), False),
        ((-9, 1, 0), (6, 1, 0), False),  # across it, but neither ends nor middle
        ((1, 1, 1), (2, 2, 1), False),  # beside its plane
    ],
)
def test_what_touches_a_triangle_meets_it(a: tuple[float, ...], b: tuple[float, ...], expected: bool) -> None:
    """Of legs of 4, in all six orders of its corners, both ways along the segment, and mirrored."""
    triangle, ends = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), np.array([a, b], dtype=float)
    for order in itertools.permutations(range(3)):
        for mirror in ([1, 1, 1], [1, 1, -1], [-1, 1, 1]):
            corners, (p, q) = triangle[list(order)][None] * mirror, ends[:, None] * mirror
            found = {bool(meets(*way, corners, normals(corners))[0]) for way in ((p, q), (q, p))}
            assert found == {expected}


def test_the_front_is_what_is_of_one_triangle_alone() -> None:
    assert len(front(HALF)) == 4
    assert len(TIP) == 1
    assert len(front(np.concatenate([HALF, rectangle(0, 4, -9, 9)]))) == 6  # two squares that share an edge
    assert front(np.zeros((0, 3, 3))).shape == (0, 2, 3)


def test_the_way_round_a_straight_front_is_that_of_the_plane() -> None:
    """Pairs across it in a plane as in test_sight; shifted along the front, the way leans."""
    a = np.array([[-0.5, 0.0, 0.5], [-0.5, -1.0, 0.5], [-1.5, 0.0, 0.5]])
    b = np.array([[-1.5, 0.0, -0.5], [-0.5, 1.0, -0.5], [0.5, 0.0, -1.5]])
    flat = np.sqrt([0.5, 0.5, 2.5]) + np.sqrt([2.5, 0.5, 2.5])
    expected = np.hypot(flat, [0, 2, 0])  # both legs turned into one plane
    assert around(a, b, HALF, TIP) == pytest.approx(expected, abs=1e-14)
    straight = np.sqrt(((a - b) ** 2).sum(axis=1))
    assert apart(a, b, HALF, TIP, 2.0, 9.0) == pytest.approx((expected / straight) ** 2 * straight, abs=1e-13)
    assert apart(a, b, HALF, TIP, None, 9.0).tolist() == [18.0] * 3


def test_what_is_seen_is_continuous_across_the_shadow_of_a_front() -> None:
    node = np.array([[-0.6, 0.3, -0.4]])
    for gamma in (1.0, 2.0):
        for along in (0.3, 1.1):
            lit = node * [-along, 1, -along] + [0, 0.7, 0]
            moved = (lit + np.array([[0, 0, side * 1e-9]]) for side in (1, -1))
            one, other = (apart(node, place, HALF, TIP, gamma, 9.0)[0] for place in moved)
            assert abs(one - other) < 2e-9  # as the place itself is 2e-9 farther
    above, below = (apart(node, np.array([[-0.3, 0.3, z]]), HALF, TIP, 1.0, 9.0)[0] for z in (1e-6, -1e-6))
    assert (above, below) == pytest.approx((np.hypot(0.6, 0.4) + 0.3, 0.5), abs=1e-5)


def test_a_disc_inside_a_body_is_gone_round_on_its_rim() -> None:
    """Twelve triangles, against the least of 24 000 places on the rim: measured 1.4e-8."""
    angle = np.linspace(0, 2 * np.pi, 13)
    rim = 2 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    disc = np.stack([np.zeros((12, 3)), rim[:-1], rim[1:]], axis=1)
    edges = front(disc)
    assert len(edges) == 12
    a, b = np.array([[1.0, 0.4, 0.7], [-0.3, 1.5, 0.2]]), np.array([[0.8, 0.9, -0.5], [0.2, 1.1, -0.9]])
    share = np.linspace(0, 1, 2000)[:, None]
    places = np.concatenate([start + share * (end - start) for start, end in edges])
    for k in range(2):
        every = np.sqrt(((places - a[k]) ** 2).sum(axis=1)) + np.sqrt(((places - b[k]) ** 2).sum(axis=1))
        found = around(a[k : k + 1], b[k : k + 1], disc, edges)[0]
        assert found <= every.min() <= found + 1e-7


def test_legs_do_not_pass_through_other_triangles() -> None:
    """With a wall on the front that stands up, the way from above leads over the wall's own edge."""
    wall = HALF[:, :, [2, 1, 0]] * [1, 1, -1]  # x = 0, from z = 0 to 9
    both = np.concatenate([HALF, wall])
    a, b = np.array([[-0.5, 0.0, 0.5]]), np.array([[-0.5, 0.0, -0.5]])
    assert np.isfinite(around(a, b, HALF, TIP)[0])
    assert around(np.array([[0.5, 0.0, 0.5]]), b, both, TIP)[0] == pytest.approx(2 * np.sqrt(0.5))
    top = np.array([[[0.0, -9, 2], [0.0, 9, 2]]])
    low = np.concatenate([HALF, np.clip(wall, None, 2)])
    assert around(a, np.array([[0.5, 0.0, 0.5]]), low, top)[0] == pytest.approx(2 * np.hypot(0.5, 1.5))
    assert np.isinf(around(a, np.array([[-0.5, 0.0, -0.5]]), low, top)[0])  # no two legs lead round both
