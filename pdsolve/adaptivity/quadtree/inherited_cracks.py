"""Broken bonds of new nodes: a crack stays where it is when the nodes around it change.

A new bond is broken if a bond between the parent nodes of its ends was. If the parents had no bond, being farther apart
than a horizon, their bonds to a node halfway decide. Bonds cut by pre-cracks do not exist.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree.leaf_mapping import Transfer
from pdsolve.bonds.assembly import Bonds, ends

Rows = NDArray[np.int64]


def sources(bonds: Bonds) -> Rows:
    """Source row (b,) of each bond."""
    return np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))


class Before:
    """The bonds of n nodes before a change, and the steps (b,) in which they broke; 0 while intact."""

    def __init__(self, bonds: Bonds, broken: NDArray[np.int32]) -> None:
        self.bonds, self.broken, self._nodes = bonds, broken, len(bonds.start) - 1
        self.hurt = np.zeros(self._nodes, dtype=bool)  # which nodes have a broken bond
        self.hurt[ends(bonds, np.flatnonzero(broken))[0]] = True

    @cached_property
    def source(self) -> Rows:
        """Source row (b,) of each bond."""
        return sources(self.bonds)

    @cached_property
    def _key(self) -> Rows:
        return self.source * self._nodes + self.bonds.neighbour

    def between(self, one: Rows, other: Rows) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
        """Whether nodes (k,) had bonds to others (k,), and the step in which each broke."""
        key = one * self._nodes + other
        at = np.searchsorted(self._key, key).clip(max=len(self._key) - 1)
        there = self._key[at] == key
        return there, np.where(there, self.broken[at], 0)

    def by_way_of(self, one: Rows, other: Rows, xi: NDArray[np.float64]) -> NDArray[np.int32]:
        """Step (k,) since which a crack separates nodes (k,) from others without a bond, at vectors `xi` (k, 2), m.

        A crack separates them if exactly one of the two has lost its bond to a node halfway.
        """
        begin, count = self.bonds.start[one], np.diff(self.bonds.start)[one]
        own = np.repeat(np.arange(len(one)), count)
        number = np.arange(count.sum()) + np.repeat(begin - np.cumsum(count) + count, count)
        there, when = self.between(self.bonds.neighbour[number].astype(np.int64), other[own])
        own, number, when = own[there], number[there], when[there]
        away = np.hypot(*(self.bonds.xi[number] - xi[own] / 2).T)
        order = np.lexsort((away, own))
        asked, first = np.unique(own[order], return_index=True)
        ways = np.column_stack([self.broken[number], when])[order[first]]
        found = np.zeros(len(one), dtype=np.int32)
        found[asked] = np.where((ways > 0).sum(axis=1) == 1, ways.max(axis=1), 0)
        return found


def inherited(before: Before, new: Bonds, transfer: Transfer) -> NDArray[np.int32]:
    """Steps (b,) in which the new bonds broke; 0 for intact ones."""
    source, target = sources(new), new.neighbour.astype(np.int64)
    found = np.zeros(len(source), dtype=np.int32)
    stays, gone = transfer.stays, np.ones(len(before.hurt), dtype=bool)
    gone[transfer.before[stays, 0]] = False
    same = stays[source] & stays[target]  # in the order they had
    found[same] = before.broken[~gone[before.source] & ~gone[before.bonds.neighbour]]
    asked = np.flatnonzero(~same)
    one, other, parts = transfer.before[source[asked]], transfer.before[target[asked]], transfer.parts > 0
    mine, theirs = parts[source[asked]], parts[target[asked]]
    known, when = one[:, 0] == other[:, 0], np.zeros(len(asked), dtype=np.int32)
    for a in range(4):
        for b in range(4):
            some = np.flatnonzero(mine[:, a] & theirs[:, b])
            if not len(some):
                continue
            there, then = before.between(one[some, a], other[some, b])
            back = np.flatnonzero(~there)  # of a bond that only one end had
            there[back], then[back] = before.between(other[some[back], b], one[some[back], a])
            known[some] |= there
            when[some] = np.maximum(when[some], then)
    unknown = np.flatnonzero(~known & (before.hurt[one[:, 0]] | before.hurt[other[:, 0]]))
    if len(unknown):
        bonds = asked[unknown]
        xi = new.xi[bonds] + transfer.away[source[bonds]] - transfer.away[target[bonds]]
        when[unknown] = before.by_way_of(one[unknown, 0], other[unknown, 0], xi)
    found[asked] = when
    return found


def healed(before: Before, new: Bonds, transfer: Transfer, broken: NDArray[np.int32]) -> int:
    """Number of new bonds that are intact although a bond between their parent nodes was broken."""
    child, part = np.nonzero(transfer.parts > 0)
    old = transfer.before[child, part]
    order = np.argsort(old, kind="stable")
    child, begin = child[order], np.searchsorted(old[order], np.arange(len(before.hurt) + 1))
    which = np.flatnonzero(before.broken)
    one, other = before.source[which], before.bonds.neighbour[which].astype(np.int64)
    counts = np.diff(begin)
    pairs = counts[one] * counts[other]
    row, number = np.repeat(np.arange(len(which)), pairs), np.arange(pairs.sum())
    number -= np.repeat(np.cumsum(pairs) - pairs, pairs)
    wide = counts[other[row]]
    source = child[begin[one[row]] + number // np.maximum(wide, 1)]
    target = child[begin[other[row]] + number % np.maximum(wide, 1)]
    now = Before(new, broken)
    there, when = now.between(source, target)
    return int(np.count_nonzero(there & (when == 0)))
