"""Cells that split where energy is and merge behind it: the tree of cells, who splits, what the transfer have."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Load, Region, Run, Split
from pdsolve.adaptivity.quadtree import criteria
from pdsolve.adaptivity.quadtree.incremental_bonds import create_leaf_bonds, update_leaf_bonds
from pdsolve.adaptivity.quadtree.inherited_cracks import PreviousBonds, inherit_break_steps
from pdsolve.adaptivity.quadtree.interpolation import interpolate_state
from pdsolve.adaptivity.quadtree.leaf_mapping import LeafOrigins, leaves_after_split_and_merge
from pdsolve.adaptivity.quadtree.operator import replace_boxes_by_node_ids
from pdsolve.adaptivity.quadtree.tree import Quadtree, QuadtreeCells
from pdsolve.bonds.assembly import Bonds
from pdsolve.model import Model
from pdsolve.run.measures import kinetic_energy
from pdsolve.schemes import SCHEMES
from pdsolve.state import State

MODES = ("thesis", "conservative")


def tree(columns: int = 21, rows: int = 21, levels: int = 1, ratio: float = 3.0, **settings: Any) -> Quadtree:
    """The cells of a plate of glass without an outline."""
    split = Run(adapt="split", split=Split(levels=levels))
    return Quadtree(plate(square_grid(columns, rows), ratio, run=split, **settings))


def looked(of: Quadtree, cells: QuadtreeCells, flagged: NDArray[np.int64]) -> criteria.LeafStates:
    """A look at leaves of which these rows are flagged; no bond has broken."""
    height = np.zeros(len(cells.root_row))
    height[flagged] = 1.0
    return criteria.LeafStates(cells, of.centres(cells), height, np.zeros(len(height), dtype=bool))


def nearest(of: Quadtree, cells: QuadtreeCells, x: float, y: float) -> NDArray[np.int64]:
    """The row of the leaf at a place."""
    return np.array([np.hypot(*(of.centres(cells) - (x, y)).T).argmin()])


@pytest.mark.parametrize(("ratio", "count"), [(3.0, 29), (4.0, 49)])
def test_all_within_the_old_horizon_split(ratio: float, count: int) -> None:
    """One flagged node splits itself and its 28 or 48 neighbours, into 116 and 196."""
    of = tree(ratio=ratio)
    cells = of.roots()
    splits = criteria.mask_leaves_to_split(of, looked(of, cells, np.array([220])), 0.5)
    assert splits.sum() == count
    new, transfer = leaves_after_split_and_merge(of, cells, splits, cells.select(splits[:0].nonzero()[0]))
    assert transfer.is_quarter.sum() == 4 * count
    assert len(new.root_row) == 441 + 3 * count


def test_leaves_that_touch_differ_by_one_level() -> None:
    """Three levels around one node, and beside nodes that stay whole as they carry a load."""
    load = Load(box=(-1.0, 10.9e-3, 1.0, 1.0), body_force=(0.0, 1.0))
    of = tree(levels=3, conditions=(load,))
    cells = of.roots()
    nothing = cells.select(np.zeros(0, dtype=np.int64))
    for _ in range(6):
        splits = criteria.mask_leaves_to_split(of, looked(of, cells, nearest(of, cells, 10.1e-3, 10.1e-3)), 0.5)
        cells, _ = leaves_after_split_and_merge(of, cells, splits, nothing)
    assert np.bincount(cells.level).all()
    assert cells.level.max() == 3
    place, half = of.centres(cells), of.spacing / 2.0 ** (cells.level + 1)
    away = np.abs(place[:, None] - place).max(axis=2)
    touch = away <= (half[:, None] + half) * (1 + 1e-9)
    assert np.abs(cells.level[:, None] - cells.level)[touch].max() == 1
    assert cells.level[of.pinned[cells.root_row]].max() == 0
    assert of.areas(cells).sum() == pytest.approx(441e-6, rel=1e-14)


def test_energy_is_measured_by_the_largest_between_floor_and_ceiling() -> None:
    """Nodes with conditions do not count; what is crushed counts as the ceiling, of finer cells a higher one."""
    of = tree(conditions=(Load(box=(-1.0, 19.9e-3, 1.0, 1.0), body_force=(0.0, 1.0)),))
    cells, critical = of.roots(), criteria.critical_energy_densities(of)
    material, horizon = of.model.materials[0], 3e-3
    squared = 5 * np.pi * material.G0 / (9 * material.E * horizon)  # of the conical critical stretch
    assert critical == pytest.approx(np.full(441, 1.125 * material.E / 2 * squared), rel=1e-12)
    energy = np.zeros(441)
    energy[[0, 1, 2, 440]] = critical[0] * np.array([0.5, 0.2, 0.05, 9.0])
    found = criteria.energy_densities_over_largest(of, cells, energy, critical)
    assert found[[0, 1, 2, 440]] == pytest.approx([1.0, 0.4, 0.0, 0.0])
    energy[3] = 50 * critical[0]
    assert criteria.energy_densities_over_largest(of, cells, energy, critical)[:4] == pytest.approx(
        [0.5, 0.2, 0.0, 50.0]
    )
    finer = cells._replace(level=np.ones(441, dtype=np.int64))
    assert criteria.energy_densities_over_largest(of, finer, energy, critical)[:4] == pytest.approx(
        [0.25, 0.0, 0.0, 25.0]
    )
    assert not criteria.energy_densities_over_largest(of, cells, np.zeros(441), critical).any()


def test_ids_say_which_cells_they_are() -> None:
    """Of all levels, with nodes whose ids are in no order."""
    of = tree(5, 4, levels=3)
    shuffled = np.random.default_rng(1).permutation(of.model.grid.ids) * 7
    of = Quadtree(dataclasses.replace(of.model, grid=dataclasses.replace(of.model.grid, ids=shuffled)))
    cells = of.roots()
    for level in range(4):
        found = of.cells_of_ids(of.node_ids(cells))
        assert all(np.array_equal(one, other) for one, other in zip(cells, found, strict=True))
        assert len(np.unique(of.centres(cells).round(9), axis=0)) == 20 * 4**level
        cells = cells.quarters()


def edged() -> Model:
    """A plate whose outer nodes are on its edges, with half cells, and a round hole."""
    outline = 1e-3 * np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = 1e-3 * (10.3 + 3.2 * np.column_stack([np.cos(turn), np.sin(turn)]))
    from pdmesh.grid.lattice import cell_areas
    from pdmesh.model.visibility import plate_of

    grid = dataclasses.replace(square_grid(21, 21), outline=(outline,), holes=(ring,))
    shape = plate_of(grid)
    assert shape is not None
    import shapely

    own = np.flatnonzero(shapely.contains_xy(shape.buffer(1e-9), grid.position))
    columns = {name: getattr(grid, name)[own] for name in ("ids", "position", "delta", "border", "hole_id")}
    grid = dataclasses.replace(grid, **columns)
    areas = cell_areas(grid.position, shape, grid.delta)
    return plate(dataclasses.replace(grid, areas=areas), 3, run=Run(adapt="split", split=Split(levels=2)))


def test_cells_that_an_edge_cuts_keep_their_area() -> None:
    """Only quarters whose middle is in the plate are made, and share all of it; momentum is kept to round-off."""
    of = Quadtree(edged())
    cells, random = of.roots(), np.random.default_rng(2)
    whole, v = of.area.sum(), random.normal(size=(of.count, 2))
    filled = SCHEMES["conservative"].fill(of.model_of_leaves(cells)).whole()
    state = State(np.zeros_like(v), v, v, *np.ones((3, of.count)))
    splits = of.mask_splittable(cells)
    new, transfer = leaves_after_split_and_merge(of, cells, splits, cells.select(np.zeros(0, dtype=np.int64)))
    assert splits.sum() > 0.95 * of.count
    assert len(new.root_row) < 4 * of.count - 100
    assert of.areas(new).sum() == pytest.approx(whole, rel=1e-13)
    begun = interpolate_state(state, transfer, filled.bonds, np.ones(len(filled.bonds.weight), dtype=bool))
    momentum = of.areas(new) @ begun.rate
    assert momentum == pytest.approx(of.area @ v, abs=1e-14 * np.abs(of.area @ np.abs(v)).max())
    merged, back = leaves_after_split_and_merge(of, new, np.zeros(len(new.root_row), dtype=bool), cells.select(splits))
    filled = SCHEMES["conservative"].fill(of.model_of_leaves(new)).whole()
    begun = interpolate_state(begun, back, filled.bonds, np.ones(len(filled.bonds.weight), dtype=bool))
    assert np.array_equal(of.node_ids(merged), of.node_ids(cells))
    assert of.area @ begun.rate == pytest.approx(of.area @ v, abs=1e-14 * np.abs(of.area @ np.abs(v)).max())


def split_once(of: Quadtree, state: State, splits: NDArray[np.bool_]) -> tuple[QuadtreeCells, LeafOrigins, State]:
    """Roots of which these have split, and their state."""
    cells = of.roots()
    bonds = SCHEMES["conservative"].fill(of.model_of_leaves(cells)).whole().bonds
    new, transfer = leaves_after_split_and_merge(of, cells, splits, cells.select(np.zeros(0, dtype=np.int64)))
    return new, transfer, interpolate_state(state, transfer, bonds, np.ones(len(bonds.weight), dtype=bool))


def test_linear_fields_are_split_exactly_and_energy_as_the_formula_has_it() -> None:
    """u, v and a of the quarters, momentum, m D^2 |grad v|^2 / 32 of kinetic energy more; merging loses it again."""
    of = tree(levels=2)
    random = np.random.default_rng(3)
    slope, place = random.normal(size=(3, 2, 2)), of.model.grid.position
    u, v, a = (place @ one.T + 0.1 for one in slope)
    state = State(u, v, a, *random.uniform(size=(3, 441)))
    new, transfer, begun = split_once(of, state, np.ones(441, dtype=bool))
    for one, found in zip(slope, begun[:3], strict=True):
        assert found == pytest.approx(of.centres(new) @ one.T + 0.1, rel=1e-12)
    rho, area = 2235.0, of.areas(new)
    mass, whole = rho * area, rho * of.area
    gain = kinetic_energy(mass, begun.rate) - kinetic_energy(whole, v)
    formula = 441 * rho * 1e-6 * 1e-6 * (slope[1] ** 2).sum() / 32
    assert gain == pytest.approx(formula, abs=1e-14 * kinetic_energy(whole, v))  # 1e-16 of it
    assert mass @ begun.rate == pytest.approx(whole @ v, rel=1e-14)
    for spent in ("dissipated", "work", "damped"):
        assert area @ getattr(begun, spent) == pytest.approx(of.area @ getattr(state, spent), rel=1e-13)
    shaken = begun._replace(rate=begun.rate + random.normal(size=begun.rate.shape))
    bonds = SCHEMES["conservative"].fill(of.model_of_leaves(new)).whole().bonds
    merged, back = leaves_after_split_and_merge(of, new, np.zeros(len(new.root_row), dtype=bool), of.roots())
    after = interpolate_state(shaken, back, bonds, np.ones(len(bonds.weight), dtype=bool))
    apart = shaken.rate - after.rate[np.searchsorted(merged.root_row, new.root_row)]
    loss = kinetic_energy(mass, shaken.rate) - kinetic_energy(whole, after.rate)
    assert loss == pytest.approx(kinetic_energy(mass, apart), abs=1e-14 * kinetic_energy(mass, shaken.rate))
    assert whole @ after.rate == pytest.approx(mass @ shaken.rate, abs=1e-14 * np.abs(mass @ np.abs(shaken.rate)).max())
    assert transfer.is_quarter.all()


@pytest.mark.parametrize("mode", MODES)
def test_each_node_has_the_horizon_of_its_own_cell(mode: str) -> None:
    """The bonds of quarters amid quarters are those of a grid of half the spacing."""
    of = tree(16, 16)
    cells = of.roots()
    x, y = of.model.grid.position.T * 1e3
    new, _ = leaves_after_split_and_merge(
        of, cells, (x > 3.5) & (x < 12.5) & (y > 3.5), cells.select(np.zeros(0, dtype=np.int64))
    )
    filled = SCHEMES[mode].fill(of.model_of_leaves(new)).whole()
    fine = square_grid(32, 32, 5e-4, x0=-2.5e-4, y0=-2.5e-4)
    expected = SCHEMES[mode].fill(plate(fine, 3, area_rule="square")).whole()
    at = nearest(of, new, 7.75e-3, 7.75e-3)[0]
    other = np.hypot(*(fine.position - of.centres(new)[at]).T).argmin()
    assert new.level[at] == 1
    for name in ("stiffness", "limit", "weight"):
        own, theirs = (
            np.sort(getattr(one.bonds, name)[one.bonds.start[row] : one.bonds.start[row + 1]])
            for one, row in ((filled, at), (expected, other))
        )
        assert own == pytest.approx(theirs, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("mode", MODES)
def test_no_bond_heals(mode: str) -> None:
    """Bonds across a line are broken: all that cross it are, after any cells split and merge; none beside it is."""
    of, random = tree(21, 20), np.random.default_rng(4)
    cells, scheme = of.roots(), SCHEMES[mode]
    for _ in range(3):
        bonds = scheme.fill(of.model_of_leaves(cells)).whole().bonds
        broken = crossing(of, cells, bonds)
        splits = of.mask_splittable(cells) & (random.uniform(size=len(cells.root_row)) < 0.3)
        new, transfer = leaves_after_split_and_merge(of, cells, splits, cells.select(np.zeros(0, dtype=np.int64)))
        now = scheme.fill(of.model_of_leaves(new)).whole().bonds
        before = PreviousBonds(bonds, broken)
        found = inherit_break_steps(before, now, transfer)
        assert np.array_equal(found, crossing(of, new, now))
        assert count_healed_bonds(before, now, transfer, found) == 0
        assert count_healed_bonds(before, now, transfer, np.zeros_like(found)) > 100
        cells = new


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("mode", MODES)
def test_what_has_changed_is_filled_as_all_would_be(mode: str) -> None:
    """To the bit, with an edge, a hole, a pre-crack and two materials, where cells split and merge."""
    model, stiff = edged(), msgspec.structs.replace(GLASS, E=2 * GLASS.E)
    grid = dataclasses.replace(model.grid, cracks=1e-3 * np.array([[-1.0, 15.5, 6.0, 15.5]]))
    settings = msgspec.structs.replace(model.settings, regions=(Region(box=(0.0, 0.0, 4e-3, 1.0), material=stiff),))
    of, scheme, random = (
        Quadtree(replace_boxes_by_node_ids(Model(grid, settings))),
        SCHEMES[mode],
        np.random.default_rng(5),
    )
    cells = of.roots()
    now = create_leaf_bonds(scheme.by_pairs(of.model_of_leaves(cells)))
    x, y = grid.position.T
    for near in ((2e-3, 15e-3), (14e-3, 10e-3), (4e-3, 14e-3)):
        close = np.hypot(x - near[0], y - near[1])[cells.root_row] < 3.1e-3
        splits = of.mask_splittable(cells) & close & (random.uniform(size=len(close)) < 0.7)
        parents = cells.select((cells.level == 1) & (cells.path == 0) & ~close).parents()
        cells, transfer = leaves_after_split_and_merge(of, cells, splits, parents)
        model = of.model_of_leaves(cells)
        rule = scheme.by_pairs(model)
        now, again = update_leaf_bonds(rule, model, now, transfer), create_leaf_bonds(rule)
        assert transfer.is_quarter.any()
        for one, other in zip(now.assembly.bonds, again.assembly.bonds, strict=True):
            assert np.array_equal(one, other)
        assert np.array_equal(now.assembly.family, again.assembly.family)
        whole = scheme.fill(model).whole()
        assert np.array_equal(whole.bonds.stiffness, again.assembly.bonds.stiffness)
    assert transfer.is_merged.any()


def crossing(of: Quadtree, cells: QuadtreeCells, bonds: Any) -> NDArray[np.int32]:
    """7 of bonds (b,) that cross a row's edge in the middle of the plate, 0 of others."""
    upper = of.centres(cells)[:, 1] > 9.5e-3
    source = np.repeat(np.arange(len(upper)), np.diff(bonds.start))
    return np.where(upper[source] != upper[bonds.neighbour], 7, 0).astype(np.int32)


def count_healed_bonds(
    old_bonds: PreviousBonds, new_bonds: Bonds, origins: LeafOrigins, broken: NDArray[np.int32]
) -> int:
    """Number of new bonds that are intact although a bond between their parent nodes was broken."""
    child, part = np.nonzero(origins.mass_shares > 0)
    old = origins.origin_rows[child, part]
    order = np.argsort(old, kind="stable")
    child, begin = child[order], np.searchsorted(old[order], np.arange(len(old_bonds.has_broken_bond) + 1))
    which = np.flatnonzero(old_bonds.break_steps)
    old_source, old_target = old_bonds.source[which], old_bonds.bonds.neighbour[which].astype(np.int64)
    counts = np.diff(begin)
    pairs = counts[old_source] * counts[old_target]
    row, number = np.repeat(np.arange(len(which)), pairs), np.arange(pairs.sum())
    number -= np.repeat(np.cumsum(pairs) - pairs, pairs)
    wide = counts[old_target[row]]
    source = child[begin[old_source[row]] + number // np.maximum(wide, 1)]
    target = child[begin[old_target[row]] + number % np.maximum(wide, 1)]
    now = PreviousBonds(new_bonds, broken)
    has_bond, when = now.find_bonds(source, target)
    return int(np.count_nonzero(has_bond & (when == 0)))
