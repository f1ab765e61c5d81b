"""Families, visibility, and what the two schemes make of them."""

from __future__ import annotations

import dataclasses
import itertools

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid, two_scale_grid

from pdmesh.model.document import Load
from pdmesh.model.lattice_calibration import full_family, hu_beta
from pdmesh.model.neighbours import Neighbours, Pairs, chosen
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import Sight
from pdsolve.bonds.assembly import Bonds, stiffness_bound
from pdsolve.schemes import average_horizon, one_sided
from pdsolve.schemes.one_sided import softening


def pairs_of(grid: Grid, ratio: float) -> Pairs:
    """All pairs within a ratio of the spacing."""
    return Neighbours(grid.position, grid.delta, ratio * grid.delta).pairs(np.arange(len(grid)))


def test_the_thesis_table_1() -> None:
    """Potential bonds, actual bonds and softening of a corner, an inner and an edge node, m = 3."""
    model = plate(square_grid(15, 15))
    assembly = one_sided.fill(model).whole()
    corner, inner, edge = 0, 7 * 15 + 7, 7 * 15
    assert full_family(3) == 28
    assert assembly.family[[corner, inner, edge]].tolist() == [10, 28, 17]
    assert [round(float(value), 2) for value in softening(28, assembly.family[[corner, inner, edge]])] == [
        2.8,
        1.0,
        1.65,
    ]


def test_families_of_a_full_lattice() -> None:
    assert [full_family(m) for m in (1, 2, 3, 4, 6)] == [4, 12, 28, 48, 112]


def test_hu_beta() -> None:
    """1 up to h - d/2, 1/2 at h, 0 from h + d/2 on."""
    xi = np.array([1.0, 2.5, 2.75, 3.0, 3.25, 3.5, 4.0])
    assert hu_beta(xi, np.array(3.0), np.array(1.0)).tolist() == [1, 1, 0.75, 0.5, 0.25, 0, 0]


def test_pairs_are_all_there_and_sorted() -> None:
    grid = two_scale_grid()
    reach = 3 * grid.delta
    pairs = pairs_of(grid, 3)
    distance = np.hypot(*(grid.position[:, None] - grid.position[None]).T)
    seen = (reach[:, None] * (1 + 1e-9) >= distance.T) & ~np.eye(len(grid), dtype=bool)
    assert np.array_equal(np.stack([pairs.source, pairs.target]), np.stack(np.nonzero(seen)))


def test_no_bond_crosses_a_crack_and_its_tip_counts() -> None:
    grid = dataclasses.replace(square_grid(9, 6, y0=-2.5e-3), cracks=np.array([[0.0, 0.0, 4e-3, 0.0]]))
    pairs = pairs_of(grid, 3)
    a, b = grid.position[pairs.source], grid.position[pairs.target]
    crosses = a[:, 1] * b[:, 1] < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        where = a[:, 0] + (b[:, 0] - a[:, 0]) * a[:, 1] / (a[:, 1] - b[:, 1])
    expected = crosses & (where <= 4e-3 + 1e-15)
    assert 0 < expected.sum() < crosses.sum()
    assert np.array_equal(Sight(grid).cut(pairs), expected)


def test_no_bond_crosses_a_hole_or_leaves_the_plate() -> None:
    """An L-shaped plate with a square hole: bonds along the edges stay, bonds across the corner and the hole go."""
    full = square_grid(11, 11)
    x, y = full.position.T
    keep = ((x <= 5e-3) | (y <= 5e-3)) & ~((x > 1e-3) & (x < 4e-3) & (y > 1e-3) & (y < 4e-3))
    corners = [[0, 0], [10, 0], [10, 5], [5, 5], [5, 10], [0, 10]]
    hole = [[1, 1], [4, 1], [4, 4], [1, 4]]
    grid = dataclasses.replace(
        full,
        ids=full.ids[keep],
        position=full.position[keep],
        delta=full.delta[keep],
        border=full.border[keep],
        hole_id=full.hole_id[keep],
        outline=(1e-3 * np.array(corners),),
        holes=(1e-3 * np.array(hole),),
    )
    pairs = pairs_of(grid, 3)
    pairs = chosen(pairs, Sight(grid).inside(pairs))
    there = {
        (tuple(np.round(1e3 * grid.position[i]).astype(int)), tuple(np.round(1e3 * grid.position[j]).astype(int)))
        for i, j in zip(pairs.source, pairs.target, strict=True)
    }
    assert ((6, 5), (8, 5)) in there  # along the outline
    assert ((1, 1), (1, 4)) in there  # along the hole
    assert ((5, 5), (5, 7)) in there
    assert ((6, 5), (5, 6)) not in there  # around the corner
    assert ((4, 7), (6, 5)) not in there
    assert ((1, 2), (4, 2)) not in there  # through the hole
    assert ((2, 1), (1, 2)) not in there  # cuts the corner of the hole
    assert all((b, a) in there for a, b in there)


def test_marks_say_where_a_hole_is_when_a_bare_file_gives_no_outline() -> None:
    """A round hole of 4.3 mm: the same bonds by its outline and by border and hole_id alone, but for grazing ones."""
    full = square_grid(24, 24)
    centre, radius = 1e-3 * np.array([11.5, 11.5]), 4.3e-3
    away = np.hypot(*(full.position - centre).T)
    keep = away >= radius
    angle = np.linspace(0, 2 * np.pi, 721)
    ring = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    square = 1e-3 * np.array([[0, 0], [23, 0], [23, 23], [0, 23]])
    bare = dataclasses.replace(
        full,
        **{name: getattr(full, name)[keep] for name in ("ids", "position", "delta", "border")},
        hole_id=np.where(away < radius + 1e-3, 0, -1)[keep],
    )
    pairs = pairs_of(bare, 6)
    by_outline = Sight(dataclasses.replace(bare, outline=(square,), holes=(ring,))).inside(pairs)
    by_marks = Sight(bare).inside(pairs)
    a, b = bare.position[pairs.source] - centre, bare.position[pairs.target] - centre
    along = np.clip(-(a * (b - a)).sum(axis=1) / pairs.length**2, 0, 1)
    nearest = np.hypot(*(a + along[:, None] * (b - a)).T)
    assert (~by_outline).sum() > 400
    assert (by_outline == by_marks)[np.abs(nearest - radius) > 0.75e-3].all()
    assert not by_marks[nearest < radius - 0.75e-3].any()
    assert by_marks[nearest > radius].all()


def test_a_plate_without_holes_needs_no_outline() -> None:
    grid = two_scale_grid()
    marked = dataclasses.replace(grid, border=np.ones(len(grid), dtype=bool))
    assert Sight(marked).inside(pairs_of(grid, 4)).all()


@pytest.mark.parametrize("scheme", [one_sided, average_horizon])
def test_bonds_of_loaded_nodes_do_not_break(scheme: object) -> None:
    model = plate(square_grid(9, 6), conditions=(Load(nodes=(1,), body_force=(0.0, 1.0)),))
    bonds = scheme.fill(model).whole().bonds  # type: ignore[attr-defined]
    source = np.repeat(np.arange(len(model.grid)), np.diff(bonds.start))
    assert np.array_equal(np.isinf(bonds.limit), (source == 0) | (bonds.neighbour == 0))


@pytest.mark.parametrize("profile", ["conical", "constant"])
def test_average_horizon_bonds_come_in_equal_pairs(profile: str) -> None:
    """c_ij = c_ji and s0_ij = s0_ji across an interface, so that nothing pushes without being pushed."""
    model = plate(two_scale_grid(), material=msgspec.structs.replace(GLASS, micromodulus=profile))
    assembly = average_horizon.fill(model).whole()
    bonds, n = assembly.bonds, len(model.grid)
    source = np.repeat(np.arange(n), np.diff(bonds.start))
    modulus, limit = np.zeros((n, n)), np.zeros((n, n))
    modulus[source, bonds.neighbour] = bonds.stiffness / assembly.area[bonds.neighbour]
    limit[source, bonds.neighbour] = bonds.limit
    assert np.allclose(modulus, modulus.T, rtol=1e-14, atol=0)
    assert np.array_equal(limit, limit.T)
    assert np.array_equal(modulus > 0, limit > 0)


def test_one_sided_bonds_do_not() -> None:
    """The thesis's lists: a coarse node sees a fine one that does not see it."""
    bonds = one_sided.fill(plate(two_scale_grid())).whole().bonds
    source = np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))
    directed = set(zip(source.tolist(), bonds.neighbour.tolist(), strict=True))
    assert any((j, i) not in directed for i, j in directed)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_bound_of_symmetric_bonds_is_the_largest_eigenvalue(dimension: int) -> None:
    """Of the sums of k n n^T over each node's bonds, beside numpy's; and the sum of k for others."""
    draw = np.random.default_rng(3)
    count = np.array([5, 7, 0, 4])
    xi, k = draw.normal(size=(count.sum(), dimension)), draw.uniform(1, 9, count.sum())
    start, nothing = np.cumsum([0, *count]), np.zeros(count.sum())
    bonds = Bonds(start, nothing.astype(np.int32), xi, *(nothing for _ in Bonds._fields[3:]))
    size = np.hypot.reduce(xi, axis=1)
    found = [stiffness_bound(bonds, k * size, symmetric) for symmetric in (True, False)]
    for node, (first, last) in enumerate(itertools.pairwise(start)):
        n, own = xi[first:last] / size[first:last, None], k[first:last]
        whole = np.einsum("b,ba,bc->ac", own, n, n)
        assert found[0][node] == pytest.approx(np.linalg.eigvalsh(whole)[-1])
        assert found[1][node] == pytest.approx(own.sum())
