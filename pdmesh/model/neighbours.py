"""Neighbour search for any rows of a grid at a time.

Nodes on a lattice find each other by lattice offsets, and other nodes find them in a window of the lattice. Nodes on no
lattice are found by a tree. Trees and connected components are SciPy's, which is imported when one is needed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

ROUND_OFF = 1e-9  # of a horizon: |xi| = horizon belongs to the family
ON_LATTICE = 1e-9  # of a spacing, and of its way from the first: how far a node may be from its place in a lattice
OFF_PLACE = 1e-3  # of a spacing: more than any node is
MOST_LATTICES = 16
LEAST_NODES = 64  # of a lattice; fewer are found by the tree
LEAST_FILLED = 0.1  # places of a lattice's rectangle that have a node
WIDEST = 64  # spacings from a node to the end of a window; beyond, a tree looks at less
PLACES = 2**21  # of windows that are looked at together
ROWS = 4096  # looked at together: few enough to stay near the processor; whole blocks of the solver's fast kernel


class Pairs(NamedTuple):
    """Directed pairs of rows of the grid, sorted by source, then target."""

    source: NDArray[np.int64]  # (b,) row of the node whose family it is
    target: NDArray[np.int64]  # (b,) row of the neighbour
    length: NDArray[np.float64]  # (b,) |xi|, m


@dataclass(frozen=True)
class _Group:
    """Nodes that are searched in one way: those of a lattice, with its map, or others without a map."""

    rows: NDArray[np.int64]
    position: NDArray[np.float64]  # (k, d) m
    reach: float  # the largest, m
    place: NDArray[np.int64]  # (k,) of each row in `map`
    map: NDArray[np.int32]  # rows by place, -1 where there is no node; (0,) without a lattice
    offsets: NDArray[np.int64]  # (o,) from a place to those within reach
    size: tuple[int, ...]  # places of the map along each axis, of which the first changes fastest
    corner: NDArray[np.float64]  # (d,) of the first place, m
    spacing: float  # m

    @cached_property
    def tree(self) -> cKDTree:
        """The k-d tree of these nodes."""
        return tree_of(self.position)

    @cached_property
    def filled(self) -> NDArray[np.int64]:
        """(..., rows + 1, columns + 1) cumulative node counts of the map below and to the left of each place."""
        table = np.zeros(tuple(side + 1 for side in self.size[::-1]), dtype=np.int64)
        occupied = (self.map.reshape(self.size[::-1]) >= 0).astype(np.int64)
        for axis in range(len(self.size)):
            occupied = occupied.cumsum(axis=axis)
        table[(slice(1, None),) * len(self.size)] = occupied
        return table

    def inside(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number (k,) of nodes in the map from the places `low` (k, d) to before the places `high`."""
        total = np.zeros(len(low), dtype=np.int64)
        for ends in product((0, 1), repeat=len(self.size)):
            corner = tuple(np.where(end, high[:, axis], low[:, axis]) for axis, end in enumerate(ends))
            total += (-1) ** (len(ends) - sum(ends)) * self.filled[corner[::-1]]
        return total


def chosen(pairs: Pairs, which: NDArray[np.bool_] | NDArray[np.int64]) -> Pairs:
    """The pairs selected by a mask (b,) or by indices."""
    return Pairs(pairs.source[which], pairs.target[which], pairs.length[which])


def row_chunks(nodes: int) -> Iterator[NDArray[np.int64]]:
    """All rows of a grid of `nodes` nodes, `ROWS` at a time."""
    return (np.arange(first, min(first + ROWS, nodes)) for first in range(0, nodes, ROWS))


def lengths(xi: NDArray[np.floating]) -> NDArray[np.float64]:
    """|xi| (k,) of vectors (k, 2 or 3), m."""
    return np.asarray(np.hypot(xi[:, 0], xi[:, 1]) if xi.shape[1] == 2 else np.sqrt((xi**2).sum(axis=1)))


class Neighbours:
    """Neighbours of the nodes at `position` (n, d), with spacings `delta` (n,), within their `reach` (n,); in m.

    With `mutual`, a pair counts if either end reaches the other.
    """

    def __init__(
        self,
        position: NDArray[np.float64],
        delta: NDArray[np.float64],
        reach: NDArray[np.float64],
        mutual: bool = False,
    ) -> None:
        self._position, self._reach, self._mutual = position, reach, mutual
        self._groups = list(_groups(position, delta, reach))
        self._group = np.zeros(len(position), dtype=np.int8)
        self._index = np.zeros(len(position), dtype=np.int32)  # within its group
        for number, group in enumerate(self._groups):
            self._group[group.rows] = number
            self._index[group.rows] = np.arange(len(group.rows))

    def maps(self) -> Iterator[NDArray[np.int32]]:
        """Each lattice as a map (..., lines, columns) of its nodes' rows, -1 where there is none."""
        return (group.map.reshape(group.size[::-1]) for group in self._groups if len(group.map))

    def pairs(self, rows: NDArray[np.int64]) -> Pairs:
        """The pairs of the nodes in `rows`, which must increase."""
        pair_lists = []
        for number, group in enumerate(self._groups):
            group_rows = rows[self._group[rows] == number]
            if not len(group_rows):
                continue
            if len(group.map):
                near = group.map[group.place[self._index[group_rows]][:, None] + group.offsets]
                exists = near >= 0
                pair_lists.append((np.repeat(group_rows, exists.sum(axis=1)), near[exists].astype(np.int64)))
            for target_group in self._groups:
                if target_group is not group or not len(group.map):
                    pair_lists += self._others(group_rows, target_group)
        source, target = (np.concatenate(column) for column in zip(*pair_lists, strict=True))
        key = source * len(self._position) + target
        if (np.diff(key) < 0).any():
            order = np.argsort(key, kind="stable")
            source, target = source[order], target[order]
        return Pairs(source, target, lengths(self._position[target] - self._position[source]))

    def _others(
        self, rows: NDArray[np.int64], target_group: _Group
    ) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        pair_lists = []
        size = np.ceil(2 * np.log2(self._reach[rows]))  # each node of an imported mesh may have a reach of its own
        for alike in np.unique(size):
            similar_rows = rows[size == alike]
            reach = float(self._reach[similar_rows].max())
            radius = (max(reach, target_group.reach) if self._mutual else reach) * (1 + ROUND_OFF)
            if len(target_group.map) and radius < WIDEST * target_group.spacing:
                source, target, length = _by_window(similar_rows, self._position, target_group, radius)
            else:
                tree = tree_of(self._position[similar_rows])
                near = tree.sparse_distance_matrix(target_group.tree, radius, output_type="ndarray")
                source, target, length = similar_rows[near["i"]], target_group.rows[near["j"]], near["v"]
            limit = np.maximum(self._reach[source], self._reach[target]) if self._mutual else self._reach[source]
            within_reach = (length <= limit * (1 + ROUND_OFF)) & (source != target)
            pair_lists.append((source[within_reach], target[within_reach]))
        return pair_lists


def _by_window(rows: NDArray[np.int64], position: NDArray[np.float64], target_group: _Group, radius: float) -> Pairs:
    """Pairs about `radius` apart at most, between any rows and those of a lattice, searched in windows around the
    rows."""
    size, d = np.array(target_group.size), len(target_group.size)
    side = int(radius / target_group.spacing) + 1
    at = np.floor((position[rows] - target_group.corner) / target_group.spacing).astype(np.int64)
    low, high = np.clip(at - side, 0, size), np.clip(at + side + 2, 0, size)
    candidates = np.flatnonzero(target_group.inside(low, high) > 0)
    steps = np.arange(-side, side + 2)
    gap = np.maximum(np.maximum(-steps, steps - 1), 0)  # to the nearest point of the place that a row is in
    away = lengths(np.stack(np.meshgrid(*(gap,) * d, indexing="ij"), axis=-1).reshape(-1, d).astype(float))
    near = np.unravel_index(
        np.flatnonzero(away * target_group.spacing <= radius + OFF_PLACE * target_group.spacing), (len(gap),) * d
    )
    ways = np.stack([steps[axis] for axis in near[::-1]])  # (d, w), the first axis changing fastest
    stride = np.cumprod([1, *target_group.size[:-1]])
    sources, targets = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for few in np.array_split(candidates, len(candidates) * ways.shape[1] // PLACES + 1):
        in_lattice, flat = np.ones((len(few), ways.shape[1]), dtype=bool), np.zeros((1, 1), dtype=np.int64)
        for axis in range(d):
            along = at[few, axis : axis + 1] + ways[axis]
            in_lattice &= (along >= 0) & (along < size[axis])
            flat = flat + stride[axis] * along
        map_rows = np.where(in_lattice, target_group.map[np.where(in_lattice, flat, 0)], -1)
        row, place = np.nonzero(map_rows >= 0)
        sources.append(rows[few[row]])
        targets.append(map_rows[row, place].astype(np.int64))
    source, target = np.concatenate(sources), np.concatenate(targets)
    return Pairs(source, target, lengths(position[target] - position[source]))


def _groups(position: NDArray[np.float64], delta: NDArray[np.float64], reach: NDArray[np.float64]) -> list[_Group]:
    unassigned = np.arange(len(position))
    groups: list[_Group] = []
    alike = ((d, r) for d in np.unique(delta) for r in np.unique(reach[delta == d]))
    for spacing, own_reach in islice(alike, MOST_LATTICES):
        rest = unassigned[(delta[unassigned] == spacing) & (reach[unassigned] == own_reach)]
        while len(rest) >= LEAST_NODES and len(groups) < MOST_LATTICES:
            place = (position[rest] - position[rest[0]]) / spacing
            lattice_index = np.rint(place)
            on = (np.abs(place - lattice_index) <= ON_LATTICE * (1 + np.abs(lattice_index))).all(axis=1)
            lattice = _lattice(position, rest[on], lattice_index[on].astype(np.int64), spacing, own_reach)
            if lattice is None:
                break
            groups.append(lattice)
            rest = rest[~on]
        assigned_rows = np.concatenate([np.zeros(0, dtype=np.int64), *(group.rows for group in groups)])
        unassigned = np.setdiff1d(unassigned, assigned_rows, assume_unique=True)
    if len(unassigned):
        nothing = np.zeros(0, dtype=np.int64)
        unmapped = nothing, np.zeros(0, dtype=np.int32), nothing, (), np.zeros(position.shape[1]), 0.0
        groups.append(_Group(unassigned, position[unassigned], float(reach[unassigned].max()), *unmapped))
    return groups


def _lattice(
    position: NDArray[np.float64], rows: NDArray[np.int64], place: NDArray[np.int64], spacing: float, reach: float
) -> _Group | None:
    """The lattice of these nodes; None if they are too few or too sparse, or if two coincide."""
    margin = int(reach / spacing * (1 + ROUND_OFF))
    low, high = place.min(axis=0) - margin, place.max(axis=0) + margin
    size = tuple(int(side) for side in high - low + 1)
    if len(rows) < LEAST_NODES or len(rows) < LEAST_FILLED * math.prod(size):
        return None
    stride = np.cumprod([1, *size[:-1]])
    flat = (place - low) @ stride
    lattice = np.full(math.prod(size), -1, dtype=np.int32)
    lattice[flat] = rows
    if np.count_nonzero(lattice >= 0) < len(rows):
        return None
    steps = np.arange(-margin, margin + 1)
    ways = np.stack(np.meshgrid(*(steps,) * len(size), indexing="ij")[::-1], axis=-1).reshape(-1, len(size))
    near = (lengths(ways.astype(float)) * spacing <= reach * (1 + ROUND_OFF)) & (ways != 0).any(axis=1)
    corner = position[rows[0]] + (low - place[0]) * spacing
    return _Group(rows, position[rows], reach, flat, lattice, ways[near] @ stride, size, corner, spacing)


def connected(count: int, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """The component number (count,) of each vertex, from edges between `source` (k,) and `target` (k,)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(source), dtype=np.int8), (source, target)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def tree_of(position: NDArray[np.float64]) -> cKDTree:
    """The k-d tree of nodes at `position` (n, d)."""
    # Here, as importing SciPy takes a fifth of the whole solution of a small plate, which may do without a tree
    from scipy.spatial import cKDTree

    return cKDTree(position)
