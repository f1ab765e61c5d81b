"""The origin of leaves after some have split and others merged."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree.tree import Quadtree, QuadtreeCells, concatenate_cell_sets

Rows = NDArray[np.int64]
SAME = 1e-9  # of a spacing: a centre of mass this near to the middle is there


class LeafOrigins(NamedTuple):
    """The origin of m leaves among the n leaves before."""

    origin_rows: Rows  # (m, 4) rows that each comes from: itself, the whole, or its four quarters
    mass_shares: NDArray[np.float64]  # (m, 4) of those, shares of its mass; 0 where there is none
    is_quarter: NDArray[np.bool_]  # (m,) quarters of what was whole
    is_merged: NDArray[np.bool_]  # (m,) whole, of what was quarters
    mass_shift: NDArray[np.float64]  # (m, 2) from the place of that mass before to its own, m; 0 of those that stay
    quarter_offset: NDArray[np.float64]  # (m, 2) of quarters: from their common centre of mass, m

    @property
    def is_unchanged(self) -> NDArray[np.bool_]:
        """Mask (m,) of the nodes that are unchanged."""
        return ~self.is_quarter & ~self.is_merged


def leaves_after_split_and_merge(
    tree: Quadtree, cells: QuadtreeCells, is_splitting: NDArray[np.bool_], merged_parents: QuadtreeCells
) -> tuple[QuadtreeCells, LeafOrigins]:
    """The leaves after those `is_splitting` (n,) split and the quarters of `merged_parents` merge; their origin."""
    ids = tree.node_ids(cells)
    by_id = np.argsort(ids)

    def rows(leaves: QuadtreeCells) -> Rows:
        return np.asarray(by_id[np.searchsorted(ids, tree.node_ids(leaves), sorter=by_id).clip(max=len(ids) - 1)])

    share = tree.areas(merged_parents.quarters()).reshape(-1, 4)
    share /= share.sum(axis=1, keepdims=True)
    from_quarters = np.where(share > 0, rows(merged_parents.quarters()).reshape(-1, 4), 0)
    stays = ~is_splitting
    stays[from_quarters[share > 0]] = False
    quarters = tree.select_cells_with_area(cells.select(is_splitting).quarters())
    alone = np.concatenate([np.flatnonzero(stays), rows(quarters.parents())])
    new = concatenate_cell_sets(cells.select(stays), quarters, merged_parents)
    before = np.concatenate([np.repeat(alone[:, None], 4, axis=1), from_quarters])
    parts = np.concatenate([np.tile([1.0, 0.0, 0.0, 0.0], (len(alone), 1)), share])
    counts = [len(cell_group.root_row) for cell_group in (cells.select(stays), quarters, merged_parents)]
    kind = np.repeat([0, 1, 2], counts)
    order = tree.sort_order(new)
    new, before, parts, kind = new.select(order), before[order], parts[order], kind[order]
    way = tree.spacing * (
        tree.centre_offsets(new) - (parts[..., None] * tree.centre_offsets(cells)[before]).sum(axis=1)
    )
    way[kind == 0] = 0.0
    way[(kind == 2) & (np.abs(way).max(axis=1, initial=0.0) < SAME * tree.spacing)] = 0.0
    split = kind == 1
    from_centre, area = np.zeros_like(way), tree.areas(new.select(split))  # of mass of the four quarters of a leaf
    _, group = np.unique(before[split, 0], return_inverse=True)
    for axis in (0, 1):
        mean = np.bincount(group, area * way[split, axis]) / np.bincount(group, area)
        from_centre[split, axis] = way[split, axis] - mean[group]
    return new, LeafOrigins(before, parts, split, kind == 2, way, from_centre)
