"""Bonds of leaves, built in full or updated: pairs of unchanged nodes are not recomputed.

Both ways give the same bits, so that a resumed run equals an uninterrupted one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, Pairs, chosen, tree_of
from pdsolve.adaptivity.quadtree.leaf_mapping import LeafOrigins
from pdsolve.bonds.assembly import Assembly, ByPairs, Paired
from pdsolve.model import Model


class LeafBonds(NamedTuple):
    """The bonds of n nodes, and the pairs they are made from."""

    assembly: Assembly
    pairs: Paired  # all pairs, each looked at by itself
    surface_correction: NDArray[np.float64]  # (n, ...) what nodes lack, by all their pairs


def create_leaf_bonds(rule: ByPairs) -> LeafBonds:
    """All bonds of a model."""
    rows = np.arange(len(rule.area))
    paired = rule.looked(rule.neighbours.pairs(rows))
    return _assemble_leaf_bonds(rule, paired, rule.lack(rows, paired))


def update_leaf_bonds(rule: ByPairs, model: Model, previous: LeafBonds, origins: LeafOrigins) -> LeafBonds:
    """All bonds of a model, reusing those of unchanged nodes from `previous`."""
    stays = origins.is_unchanged
    position, delta = model.grid.position, model.grid.delta
    reach = float((model.horizons + delta / 2).max()) * (1 + ROUND_OFF)
    away, _ = tree_of(position[~stays]).query(position, distance_upper_bound=2 * reach)
    near_rows = np.flatnonzero(away <= reach)  # new nodes, and all that may interact with one
    pairs = rule.neighbours.pairs(near_rows)
    new_pairs = rule.looked(chosen(pairs, ~(stays[pairs.source] & stays[pairs.target])))
    new_row_of_node = np.full(len(previous.surface_correction), -1)
    new_row_of_node[origins.origin_rows[stays, 0]] = np.flatnonzero(stays)
    source, target, length = previous.pairs.pairs
    source, target = new_row_of_node[source], new_row_of_node[target]
    unchanged = np.flatnonzero((source >= 0) & (target >= 0))
    old = _select_pairs(previous.pairs._replace(pairs=Pairs(source, target, length)), unchanged)
    ends: list[Any] = [np.concatenate(columns) for columns in zip(old.pairs, new_pairs.pairs, strict=True)]
    rest: list[Any] = [np.concatenate(columns) for columns in zip(old[1:], new_pairs[1:], strict=True)]
    paired = Paired(Pairs(*ends), *rest)
    order = np.argsort(paired.pairs.source * len(stays) + paired.pairs.target, kind="stable")
    paired = _select_pairs(paired, order)
    lack = np.zeros((len(stays), *previous.surface_correction.shape[1:]))
    lack[stays] = previous.surface_correction[origins.origin_rows[stays, 0]]
    changed = np.zeros(len(stays), dtype=bool)
    changed[near_rows] = True
    changed_pairs = np.flatnonzero(changed[paired.pairs.source])
    lack[near_rows] = rule.lack(near_rows, _select_pairs(paired, changed_pairs))
    return _assemble_leaf_bonds(rule, paired, lack)


def _select_pairs(paired: Paired, pair_numbers: NDArray[np.int64]) -> Paired:
    """The selected pairs."""
    rest: list[Any] = [column[pair_numbers] for column in paired[1:]]
    return Paired(chosen(paired.pairs, pair_numbers), *rest)


def _assemble_leaf_bonds(rule: ByPairs, paired: Paired, lack: NDArray[np.float64]) -> LeafBonds:
    part = rule.part(np.arange(len(rule.area)), paired, lack)
    return LeafBonds(Assembly(part.bonds, rule.area, part.family), paired, lack)
