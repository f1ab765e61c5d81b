"""What a crack leaves of the sight of nodes: cut, or round its tips (pdmesh.model.visibility and detours).

Counts of cut bonds and weights on a lattice of spacing 1 were computed independently.
"""

from __future__ import annotations

import dataclasses
import re

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import lattice

from pdmesh.model.document import Horizon, Material, Settings
from pdmesh.model.neighbours import Neighbours, Pairs
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import Sight, SightInSpace
from pdmesh.scene.solids import brick
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import select_scheme
from pdsolve.schemes import SCHEMES

SOLID = Material(E=1.0, rho=1.0, G0=1.0, nu=0.3, model="correspondence")
STRAIGHT = [(-9.5, 0, 0, 0)]
OUTLINE = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])


def row_at(grid: Grid, place: tuple[float, float]) -> int:
    return int(np.hypot(*(grid.position - place).T).argmin())


def far(
    cracks: object, start: tuple[float, float], end: tuple[float, float], gamma: float = 1.0, **more: object
) -> float:
    """How far apart two places are, both ways, by the way round."""
    bare = lattice(cracks)
    grid = dataclasses.replace(
        bare,
        ids=np.arange(len(bare) + 2),
        position=np.vstack([bare.position, start, end]),
        delta=np.ones(len(bare) + 2),
        **more,
    )
    n, length = len(bare), np.hypot(*np.subtract(start, end))
    pairs = Pairs(np.array([n, n + 1]), np.array([n + 1, n]), np.full(2, length))
    one, other = Sight(grid).apart(pairs, gamma, 10.0)
    assert one == other
    return float(one)


@pytest.mark.parametrize(
    ("ratio", "x0", "expected"),
    [
        (3, 0.5, [[11, 11, 11, 11, 10, 3, 0, 0, 0], [6, 6, 6, 6, 4, 2, 1, 0, 0], [1] * 5 + [0] * 4, [0] * 9]),
        (
            4,
            0.5,
            [
                [20, 20, 20, 20, 17, 5, 1, 0, 0],
                [13, 13, 13, 12, 9, 5, 2, 0, 0],
                [6, 6, 6, 5, 4, 2, 1, 0, 0],
                [1] * 5 + [0] * 4,
            ],
        ),
        (3, 0.0, [[11, 11, 11, 11, 7, 1, 0, 0, 0]]),
        (4, 0.0, [[20, 20, 20, 19, 12, 2, 0, 0, 0]]),
    ],
)
def test_bonds_that_a_crack_cuts(ratio: int, x0: float, expected: list[list[int]]) -> None:
    """Columns from 4.5 (4 where the tip is on one) before the tip on; the tip counts, on both sides of the crack."""
    grid = lattice(STRAIGHT, x0)
    pairs = Neighbours(grid.position, grid.delta, ratio * grid.delta).pairs(np.arange(len(grid)))
    cut = np.bincount(pairs.source, Sight(grid).cut(pairs), minlength=len(grid))
    first = -4.5 if x0 else -4
    for row, counts in enumerate(expected):
        for side in (1, -1):
            found = [cut[row_at(grid, (first + k, side * (row + 0.5)))] for k in range(9)]
            assert found == counts
    behind = grid.position[:, 0] == (-5.5 if x0 else -5)
    assert cut[behind].sum() == {3: 36, 4: 80}[ratio]


NEIGHBOURS = [(-0.5, -0.5), (-1.5, -0.5), (-0.5, -1.5), (0.5, -1.5), (0.5, -0.5), (-1.5, -1.5)]
SHAPES = {  # gamma: sum of weights, shape tensor xx, xy, yy, weights of the neighbours above
    None: (1.763446, 1.839630, -0.044032, 1.205681, []),
    1.0: (2.210971, 2.073293, -0.259141, 1.761538, [0.19680, 0.01781, 0.01781, 0.01781, 0.19680, 0.00025]),
    2.0: (2.026726, 2.051524, -0.270017, 1.520240, [0.04938, 0, 0.00275, 0.01409, 0.19680, 0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("gamma", SHAPES)
def test_weights_around_a_tip(gamma: float | None) -> None:
    """A node half a spacing before the tip and beside it; here a cubic spline is 1, there 2/3 at the node itself."""
    grid, total = lattice(STRAIGHT), SHAPES[gamma]
    bonds = SCHEMES["conservative"].fill(model_of(grid, gamma)).whole().bonds
    own = slice(*bonds.start[[row_at(grid, (-0.5, 0.5)), row_at(grid, (-0.5, 0.5)) + 1]])
    (x, y), w = bonds.xi[own].T, bonds.weight[own] / 1.5
    assert [w.sum(), w @ (x * x), w @ (x * y), w @ (y * y)] == pytest.approx(total[:4], abs=1e-6)
    for place, expected in zip(NEIGHBOURS, total[4], strict=False):
        there = (x == place[0] + 0.5) & (y == place[1] - 0.5)
        assert w[there].sum() == pytest.approx(expected, abs=6e-6)


def model_of(grid: Grid, gamma: float | None, **more: object) -> Model:
    sight = {} if gamma is None else {"sight": "diffraction", "gamma": gamma}
    return Model(grid, Settings(material=msgspec.structs.replace(SOLID, **sight, **more), horizon=Horizon(3)))


@pytest.mark.parametrize("gamma", [1.0, 2.0])
def test_what_is_seen_is_continuous_across_the_ray(gamma: float) -> None:
    """The line from a node over the tip and on: measured 4e-16; across the crack there is a jump."""
    node = np.array([-0.6, -0.4])
    for along in (0.3, 1.0, 1.9):
        lit = -node / np.hypot(*node) * along
        across = 1e-9 * np.array([-lit[1], lit[0]])
        one, other = (far(STRAIGHT, tuple(node), tuple(lit + side * across), gamma) for side in (1, -1))
        assert abs(one - other) < 1e-13
    above, below = (far(STRAIGHT, tuple(node), (-0.3, side * 1e-6), gamma) for side in (1, -1))
    assert (above, below) == pytest.approx((0.5 * ((np.hypot(0.6, 0.4) + 0.3) / 0.5) ** gamma, 0.5), abs=1e-5)


BENT = np.array([(-2.0, 0.0), (0.0, 0.0), (0.0, 1.0), (-1.0, 1.0)])
R = np.sqrt(0.5)


def polyline(points: object) -> NDArray[np.float64]:
    places = np.asarray(points, dtype=float)
    return np.hstack([places[:-1], places[1:]])


@pytest.mark.parametrize(
    ("cracks", "start", "end", "expected"),
    [
        (polyline(BENT), (-0.5, 0.5), (0.5, 0.5), R + 1 + R),  # over the tip, along the crack, over a bend
        (polyline([(-3, -3), (0, 0), (3, -3)]), (-1, -0.5), (1, -0.5), 2 * np.hypot(1, 0.5)),  # over a bend alone
        ([(-1, 0, 2, 0)], (0, 0.5), (0, -0.5), 2 * np.hypot(1, 0.5)),  # the nearer one of two tips
        (polyline([(-9, 0), (-1, 0), (-0.3, 0), (0.5, 0)]), (0, 0.5), (0, -0.5), 2 * np.hypot(0.5, 0.5)),
        ([(-1, 0, 1, 0), (0, -1, 0, 1)], (-0.5, 0.5), (0.5, -0.5), 2 * np.hypot(0.5, 0.5) + np.sqrt(2)),  # crossed
        ([(-9, 0, 1, 0), (0, 1e-17, 0, 1)], (-0.5, 0.5), (0.5, 0.5), 2 * np.hypot(0.5, 0.5)),  # one ends on another
        ([(-9, 0, 1, 0), (0, 1e-17, 0, 9)], (-0.5, 0.5), (0.5, 0.5), 20.0),  # no way round
    ],
)
def test_ways_round_cracks_that_are_kinked_crossed_or_inside(
    cracks: object, start: tuple[float, float], end: tuple[float, float], expected: float
) -> None:
    assert far(cracks, start, end) == pytest.approx(expected, abs=1e-12)


def test_a_curved_crack_is_gone_round_along_its_outer_side() -> None:
    """Half a circle of 64 chords: from inside, over the tip, along the circle; chords make it 7e-5 shorter."""
    angle = np.linspace(0, np.pi, 65)
    arc = polyline(2 * np.column_stack([np.cos(angle), np.sin(angle)]))
    found = far(arc, (1.0, 1e-3), (2.5 * np.cos(1.0), 2.5 * np.sin(1.0)))
    leaving = 1.0 - np.arccos(2 / 2.5)  # where the tangent to the end leaves the circle
    assert found == pytest.approx(np.hypot(1.0, 1e-3) + 2 * leaving + np.sqrt(2.5**2 - 4), abs=1e-4)


def test_a_mouth_is_no_tip() -> None:
    """A crack from the left edge, with an outline or without: the way from beside it is round its other end."""
    for crack, outline in (([(-9, 0, 0, 0)], (OUTLINE,)), (STRAIGHT, ())):
        found = far(crack, (-8.5, 0.5), (-8.5, -0.5), outline=outline)
        assert found == pytest.approx(2 * np.hypot(8.5, 0.5), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [None, 1.0, 2.0])
@pytest.mark.parametrize("x0", [0.0, 0.5])
def test_mirror_images_have_mirrored_weights(gamma: float | None, x0: float) -> None:
    """Below and above a crack; tips on a column are ties. Measured 0."""
    grid = lattice(STRAIGHT, x0)
    bonds = SCHEMES["conservative"].fill(model_of(grid, gamma)).whole().bonds
    image = np.array([row_at(grid, (x, -y)) for x, y in grid.position])
    own = np.repeat(np.arange(len(grid)), np.diff(bonds.start))
    dense = np.zeros((len(grid), len(grid)))
    dense[own, bonds.neighbour] = bonds.weight
    assert np.abs(dense - dense.T).max() == 0
    assert np.abs(dense - dense[np.ix_(image, image)]).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("law", ["bond", "ordinary", "micropolar"])
def test_every_law_takes_the_way_round(law: str) -> None:
    """A bond that goes round has some stiffness or weight, less than one that does not; the same both ways."""
    grid, own = lattice(STRAIGHT), {"model": law, "nu": 1 / 3 if law == "bond" else 0.2}
    straight, found = (
        SCHEMES["conservative"].fill(model_of(grid, gamma, **own)).whole().bonds for gamma in (None, 1.0)
    )
    key, key_before = (
        np.repeat(np.arange(len(grid)), np.diff(each.start)) * len(grid) + each.neighbour for each in (found, straight)
    )
    new = ~np.isin(key, key_before)
    strength = found.stiffness if law == "bond" else found.weight
    assert 0 < new.sum() < 100
    assert (strength[new] > 0).all()
    back = key % len(grid) * len(grid) + key // len(grid)
    if law != "bond":  # areas are 1
        assert np.array_equal(strength, strength[np.searchsorted(key, back)])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gamma": 2.0}, "material.gamma (2)"),
        ({"sight": "diffraction", "model": "bond", "nu": None}, "material.sight is 'diffraction'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(change: dict[str, object], said: str) -> None:
    model = Model(lattice(STRAIGHT), Settings(material=msgspec.structs.replace(SOLID, **change), horizon=Horizon(3)))
    with pytest.raises(ModelError, match=re.escape(said)):
        select_scheme(model, Options("conservative" if "gamma" in change else "thesis"))


def test_gamma_is_one_or_more() -> None:
    with pytest.raises(msgspec.ValidationError, match=r">= 1\.0"):
        msgspec.convert({"E": 1.0, "rho": 1.0, "G0": 1.0, "gamma": 0.5}, Material)


@pytest.mark.parametrize("dent", [1e-4, 1e-6, 0.0])
def test_a_dent_however_small_is_seen(dent: float) -> None:
    """A notch of a millionth of the plate's area between two nodes parts them; a plate without one has no void."""
    depth = 18.0 * 18.0 * dent / 0.2 * 2
    outline = [[-9.0, -9.0], [-0.1, -9.0], [0.0, -9.0 + depth], [0.1, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
    bare = lattice([])
    end = -9.0 + depth / 2
    places = np.array([[-0.15, end], [0.15, end]])
    grid = dataclasses.replace(
        bare,
        ids=np.arange(len(bare) + 2),
        position=np.vstack([bare.position, places]),
        delta=np.ones(len(bare) + 2),
        outline=(np.array(outline),),
    )
    n = len(bare)
    sight = Sight(grid)
    assert sight.inside(Pairs(np.array([n]), np.array([n + 1]), np.array([0.3]))).tolist() == [dent == 0]
    assert sight.clear == (dent == 0)


def test_the_front_of_a_crack_in_a_body_is_where_it_ends_inside() -> None:
    """A crack from the face x = 0 of a cube to its middle: its three edges on faces are its mouth, and no way leads
    round there, however near to the face within round-off, or short of it by a thousandth of a spacing."""
    corners = [[0.0, -4.0, 0.0], [4.0, -4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]]
    for short, edges in ((0.0, 1), (1e-9, 1), (1e-3, 2)):
        a, b, c, d = (np.maximum(corner, [short, -4.0, 0.0]) for corner in corners)
        grid = cube(np.array([[a, b, c], [a, c, d]]))
        assert len(SightInSpace(grid)._front) == edges


def cube(cracks: NDArray[np.float64]) -> Grid:
    """A cube from 0 to 8 along x, -4 to 4 along y and z, of nodes 1 m apart, with triangles of a crack."""
    steps = np.arange(8) + 0.5
    position = np.stack(np.meshgrid(steps, steps - 4, steps - 4, indexing="ij"), axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    faces = brick((0.0, -4.0, -4.0), (8.0, 4.0, 4.0)).triangles
    rows = cracks.reshape(-1, 9)
    ids, ones = np.arange(len(position)), np.ones(len(position))
    return Grid(ids, position, ones, nowhere >= 0, nowhere, rows, outline=tuple(faces))
