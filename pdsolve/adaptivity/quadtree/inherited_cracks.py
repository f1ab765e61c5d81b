"""Broken bonds of new nodes: a crack stays where it is when the nodes around it change.

A new bond is broken if a bond between the parent nodes of its ends was. If the parents had no bond, being farther apart
than a horizon, their bonds to a node halfway decide. Bonds cut by pre-cracks do not exist.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree.leaf_mapping import LeafOrigins
from pdsolve.bonds.assembly import Bonds, ends

Rows = NDArray[np.int64]


class PreviousBonds:
    """The bonds of n nodes before a change, and the steps (b,) in which they broke; 0 while intact."""

    def __init__(self, bonds: Bonds, broken: NDArray[np.int32]) -> None:
        self.bonds, self.break_steps, self._nodes = bonds, broken, len(bonds.start) - 1
        self.source = bonds.source
        self.has_broken_bond = np.zeros(self._nodes, dtype=bool)  # which nodes have a broken bond
        self.has_broken_bond[ends(bonds, np.flatnonzero(broken))[0]] = True

    @cached_property
    def _key(self) -> Rows:
        return self.source * self._nodes + self.bonds.neighbour

    def find_bonds(self, source: Rows, target: Rows) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
        """Whether nodes (k,) had bonds to others (k,), and the step in which each broke."""
        key = source * self._nodes + target
        at = np.searchsorted(self._key, key).clip(max=len(self._key) - 1)
        had_bond = self._key[at] == key
        return had_bond, np.where(had_bond, self.break_steps[at], 0)

    def find_crack_separation_steps(self, source: Rows, target: Rows, xi: NDArray[np.float64]) -> NDArray[np.int32]:
        """Step (k,) since which a crack separates nodes (k,) from others without a bond, at vectors `xi` (k, 2), m.

        A crack separates them if exactly one of the two has lost its bond to a node halfway.
        """
        pair, number = self.bonds.of_rows(source)
        had_bond, when = self.find_bonds(self.bonds.neighbour[number].astype(np.int64), target[pair])
        pair, number, when = pair[had_bond], number[had_bond], when[had_bond]
        away = np.hypot(*(self.bonds.xi[number] - xi[pair] / 2).T)
        order = np.lexsort((away, pair))
        unique_pairs, first = np.unique(pair[order], return_index=True)
        ways = np.column_stack([self.break_steps[number], when])[order[first]]
        steps = np.zeros(len(source), dtype=np.int32)
        steps[unique_pairs] = np.where((ways > 0).sum(axis=1) == 1, ways.max(axis=1), 0)
        return steps


def inherit_break_steps(previous_bonds: PreviousBonds, new_bonds: Bonds, origins: LeafOrigins) -> NDArray[np.int32]:
    """Steps (b,) in which the new bonds broke; 0 for intact ones."""
    source, target = new_bonds.source, new_bonds.neighbour.astype(np.int64)
    steps = np.zeros(len(source), dtype=np.int32)
    stays, removed = origins.is_unchanged, np.ones(len(previous_bonds.has_broken_bond), dtype=bool)
    removed[origins.origin_rows[stays, 0]] = False
    same = stays[source] & stays[target]  # in the order they had
    steps[same] = previous_bonds.break_steps[~removed[previous_bonds.source] & ~removed[previous_bonds.bonds.neighbour]]
    changed_bonds = np.flatnonzero(~same)
    source_origin, target_origin, parts = (
        origins.origin_rows[source[changed_bonds]],
        origins.origin_rows[target[changed_bonds]],
        origins.mass_shares > 0,
    )
    mine, theirs = parts[source[changed_bonds]], parts[target[changed_bonds]]
    has_origin, when = source_origin[:, 0] == target_origin[:, 0], np.zeros(len(changed_bonds), dtype=np.int32)
    for a in range(4):
        for b in range(4):
            both_parts = np.flatnonzero(mine[:, a] & theirs[:, b])
            if not len(both_parts):
                continue
            had_bond, then = previous_bonds.find_bonds(source_origin[both_parts, a], target_origin[both_parts, b])
            back = np.flatnonzero(~had_bond)  # of a bond that only one end had
            had_bond[back], then[back] = previous_bonds.find_bonds(
                target_origin[both_parts[back], b], source_origin[both_parts[back], a]
            )
            has_origin[both_parts] |= had_bond
            when[both_parts] = np.maximum(when[both_parts], then)
    unknown = np.flatnonzero(
        ~has_origin
        & (previous_bonds.has_broken_bond[source_origin[:, 0]] | previous_bonds.has_broken_bond[target_origin[:, 0]])
    )
    if len(unknown):
        bonds = changed_bonds[unknown]
        xi = new_bonds.xi[bonds] + origins.mass_shift[source[bonds]] - origins.mass_shift[target[bonds]]
        when[unknown] = previous_bonds.find_crack_separation_steps(
            source_origin[unknown, 0], target_origin[unknown, 0], xi
        )
    steps[changed_bonds] = when
    return steps
