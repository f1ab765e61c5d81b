"""Criteria for splitting and merging leaves: thesis, pp. 97-103, with a floor below which no cell is refined.

A node is flagged if its energy density is above a share of the plate's largest (thesis: 60 %), or its most stretched
bond above a share of the critical stretch. Everything within the horizon of a flagged node is split, while that horizon
is still the old one. Leaves that touch differ by at most one level. Four leaves merge if they have been calm for
several checks and are far from flagged nodes and from broken bonds, which could lie in their parent's horizon but not
in theirs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material_constants import C11, critical_stretch
from pdmesh.model.neighbours import ROUND_OFF, tree_of
from pdsolve.adaptivity.quadtree.tree import Quadtree, QuadtreeCells
from pdsolve.bonds.assembly import Bonds

FAR = 2.0  # horizons of their parent from flagged nodes: where leaves may merge


class LeafStates(NamedTuple):
    """State of n leaves at a check."""

    cells: QuadtreeCells
    position: NDArray[np.float64]  # (n, 2) m
    criterion_value: NDArray[np.float64]  # (n,) over what everything is measured by; flagged above the threshold
    has_broken_bond: NDArray[np.bool_]  # (n,) whether a bond has broken


def critical_energy_densities(tree: Quadtree) -> NDArray[np.float64]:
    """Energy density (roots,), J/m^3, of uniform extension to the critical stretch of a root's horizon.

    That of a finer cell is higher in proportion to the square of its critical stretch.
    """
    model, critical_energy = tree.model, np.zeros(tree.count)
    for rows, material in model.material_columns.of(model.material_of):
        stretch = critical_stretch(material, model.horizons[rows])
        critical_energy[rows] = C11[material.plane] * material.E / 2 * stretch**2
    return critical_energy


def energy_densities_over_largest(
    tree: Quadtree, cells: QuadtreeCells, energy: NDArray[np.float64], critical_energy: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Energy densities `energy` (n,), J/m^3, over the largest of nodes without conditions; 0 below the floor.

    The largest is capped at the ceiling: otherwise one crushed node would hide the tip of a crack.
    """
    wanted, free = tree.model.settings.run.split, ~tree.pinned[cells.root_row]
    cell_critical = critical_energy[cells.root_row] * 2.0**cells.level
    largest = np.minimum(float(energy[free].max(initial=0.0)), wanted.ceiling * cell_critical)
    counts = free & (energy > wanted.floor * cell_critical) & (energy > 0)
    return np.where(counts, energy / np.where(counts, largest, 1.0), 0.0)


def largest_relative_stretches(
    tree: Quadtree, cells: QuadtreeCells, bonds: Bonds, broken: NDArray[np.int32], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Stretch (n,) of each node's most stretched intact bond over the critical one; `u` (n, 2) are displacements, m.

    Unbreakable bonds count as unstretched.
    """
    source = bonds.source
    y = bonds.xi + u[bonds.neighbour] - u[source]
    stretch = np.hypot(*y.T) / np.hypot(*bonds.xi.T) - 1
    largest = np.zeros(len(cells.root_row))
    np.maximum.at(largest, source, np.where(broken == 0, stretch / bonds.limit, 0.0))
    return np.where(tree.pinned[cells.root_row], 0.0, largest)


def mask_leaves_to_split(tree: Quadtree, leaf_states: LeafStates, threshold: float) -> NDArray[np.bool_]:
    """Mask (n,) of the leaves that split: wanted ones and the coarser ones they touch, without those whose coarser
    neighbour cannot be split."""
    flagged = leaf_states.criterion_value > threshold
    level, can = leaf_states.cells.level, tree.mask_splittable(leaf_states.cells)
    to_split = can.copy()
    to_split[can] = _mask_positions_near_leaves(leaf_states.position[can], leaf_states, flagged, tree.horizons)
    for at in range(tree.levels - 1, 0, -1):
        coarser = np.flatnonzero(can & (level < at))
        to_split[coarser] |= _mask_touching_leaves(
            tree, leaf_states.cells.select(coarser), leaf_states, to_split & (level == at)
        )
    for at in range(1, tree.levels):
        finer = np.flatnonzero(to_split & (level == at))
        to_split[finer] = ~_mask_touching_leaves(
            tree, leaf_states.cells.select(finer), leaf_states, ~to_split & (level < at)
        )
    return to_split


def _mask_positions_near_leaves(
    positions: NDArray[np.float64],
    leaf_states: LeafStates,
    selected: NDArray[np.bool_],
    radius: NDArray[np.float64],
    norm: float = 2.0,
) -> NDArray[np.bool_]:
    """Mask (k,) of `positions` (k, 2) near the `selected` leaves (n,): within the `radius` (levels + 1,) or
    (levels + 1, k), m, of a leaf's level."""
    within = np.zeros(len(positions), dtype=bool)
    for level in np.unique(leaf_states.cells.level[selected]) if len(positions) else ():
        leaves = leaf_states.position[selected & (leaf_states.cells.level == level)]
        bound = 2 * float(radius[level].max())
        away, _ = tree_of(leaves).query(positions, p=norm, distance_upper_bound=bound)
        within |= away <= radius[level] * (1 + ROUND_OFF)
    return within


def _mask_touching_leaves(
    tree: Quadtree, cells: QuadtreeCells, leaf_states: LeafStates, other_leaves: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mask of cells (k,) that touch one of the leaves `other_leaves` (n,), also at a corner."""
    half_sides = (tree.sides[cells.level] + tree.sides[:, None]) / 2
    return _mask_positions_near_leaves(tree.centres(cells), leaf_states, other_leaves, half_sides, np.inf)


def list_parents_to_merge(
    tree: Quadtree,
    leaf_states: LeafStates,
    is_below_threshold: NDArray[np.bool_],
    is_splitting: NDArray[np.bool_],
    threshold: float,
) -> QuadtreeCells:
    """QuadtreeCells whose four quarters are leaves, `is_below_threshold` (n,), and merge."""
    cells = leaf_states.cells
    may_merge = is_below_threshold & (cells.level > 0) & ~is_splitting
    parents = cells.select(may_merge).parents()
    key = tree.node_ids(parents)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    parents = parents.select(first)
    quarter_count = (tree.areas(parents.quarters()).reshape(-1, 4) > 0).sum(axis=1)
    parents = parents.select(count == quarter_count)
    keep = np.ones(len(parents.root_row), dtype=bool)
    place, flagged = tree.centres(parents), leaf_states.criterion_value > threshold
    for at in np.unique(parents.level):
        at_level = parents.level == at
        reach, same = tree.horizons[at], np.ones_like(tree.sides)
        keep[at_level] &= ~_mask_positions_near_leaves(place[at_level], leaf_states, flagged, FAR * reach * same)
        past = reach + tree.sides[at]
        keep[at_level] &= ~_mask_positions_near_leaves(
            place[at_level], leaf_states, leaf_states.has_broken_bond, past * same
        )
        finer = leaf_states.cells.level + is_splitting > at + 1
        keep[at_level] &= ~_mask_touching_leaves(tree, parents.select(at_level), leaf_states, finer)
    return parents.select(keep)
