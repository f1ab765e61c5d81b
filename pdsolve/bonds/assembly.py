"""Bonds made by a scheme, in one list or in parts of some rows; areas of nodes by the thesis's equation 19.

A scheme says how bonds are made from a model, and has the properties that its users need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, Neighbours, Pairs, lengths, row_chunks, tree_of
from pdsolve.checkpoint_validation import expect_found
from pdsolve.model import Model

ROWS = 16384  # whose surroundings are looked at together
NEAREST = 24  # nodes looked at to find the four next ones; an interface of ratio 2 needs 13


def thesis_areas(
    position: NDArray[np.float64], delta: NDArray[np.float64], horizon: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Areas (n,), m^2, by eq. 19 of the thesis: (d_top + d_bottom)/2 * (d_left + d_right)/2.

    The four deltas (m) are those of the nearest node on each side, among the nodes within the `horizon` (n,) of each
    `position` (n, 2), or the node's own delta if that side is empty. A side is the quadrant around its axis, including
    its diagonals. At an interface with a gap of one fine delta, the area is therefore a tenth too small.
    """
    if len(position) < 2:
        return delta**2
    tree = tree_of(position)
    areas = []
    for begin in range(0, len(position), ROWS):
        rows = np.arange(begin, min(begin + ROWS, len(position)))
        distance, near = tree.query(position[rows], k=min(NEAREST, len(position) - 1) + 1)
        distance, near = distance[:, 1:], near[:, 1:]
        offset = position[near] - position[rows, None, :]
        within_horizon = distance <= horizon[rows, None] * (1 + ROUND_OFF)
        sums = []
        for axis in (0, 1):
            along, across = offset[..., axis], np.abs(offset[..., 1 - axis])
            total = np.zeros(len(rows))
            for side in (along, -along):
                on_side = within_horizon & (side > across * (1 - 1e-9)) & (side > 0)
                first = on_side.argmax(axis=1)
                total += np.where(on_side.any(axis=1), delta[near[np.arange(len(near)), first]], delta[rows])
            sums.append(total / 2)
        areas.append(sums[0] * sums[1])
    return np.concatenate(areas)


class Bonds(NamedTuple):
    """Bonds for the kernels, those of node i at start[i]:start[i + 1]; b of them, n nodes."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: NDArray[np.floating]  # (b, d) reference vector to the neighbour, m
    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,) stretch of the largest force; where it is the limit, the bond is brittle
    limit: NDArray[np.floating]  # (b,) stretch at which the bond is gone; both infinite where it must not break
    weight: NDArray[np.floating]  # (b,) of the neighbour's cell, as far as it counts, m^2

    @property
    def source(self) -> NDArray[np.int64]:
        """Row (b,) of the node of each bond."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    def of_rows(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The k bonds of some rows: which of these each has, and the indices of bonds."""
        begin, count = self.start[rows], np.diff(self.start)[rows]
        indices = np.arange(count.sum()) + np.repeat(begin - np.cumsum(count) + count, count)
        return np.repeat(np.arange(len(rows)), count), indices


class FamilyCounts(NamedTuple):
    """Data of n nodes besides their bonds."""

    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included
    bonds: NDArray[np.int64]  # (n,) bonds at the start, those cut by a pre-crack left out


class Assembly(NamedTuple):
    """The whole list of bonds of n nodes."""

    bonds: Bonds
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included

    @property
    def counted(self) -> FamilyCounts:
        """Data of the nodes besides their bonds."""
        return FamilyCounts(self.area, self.family, np.diff(self.bonds.start))


class Part(NamedTuple):
    """The bonds of k consecutive nodes from row `first` on; neighbours are rows of the whole grid."""

    first: int
    bonds: Bonds
    family: NDArray[np.int64]  # (k,) as in Assembly


class Paired(NamedTuple):
    """Pairs inside the plate, b of them, with the properties of their bonds."""

    pairs: Pairs
    intact: NDArray[np.bool_]  # (b,) no pre-crack cuts it
    stiffness: NDArray[np.float64]  # (b,) as in Bonds
    peak: NDArray[np.float64]
    limit: NDArray[np.float64]
    weight: NDArray[np.float64]


class BondSource(NamedTuple):
    """How a scheme makes the bonds of a model with n nodes."""

    area: NDArray[np.float64]  # (n,) m^2
    part: Callable[[NDArray[np.int64]], Part]  # the bonds of these consecutive rows
    pairs: Callable[[NDArray[np.int64]], Paired]  # of these rows, which increase; cut ones included
    strength: Callable[[Pairs], NDArray[np.float64]] | None = None  # how weights and stiffness of bonds (b,) compare
    # that are as long as the pairs say; None where they do not go round cracks

    def parts(self) -> Iterator[Part]:
        """All bonds, some rows at a time."""
        return (self.part(rows) for rows in row_chunks(len(self.area)))

    def whole(self) -> Assembly:
        """All bonds in one list."""
        return listed(self.parts(), self.area)


def listed(parts: Iterable[Part], area: NDArray[np.float64]) -> Assembly:
    """All parts as one list."""
    every = list(parts)
    counts = np.concatenate([np.diff(part.bonds.start) for part in every])
    columns = (np.concatenate(column) for column in zip(*(part.bonds[1:] for part in every), strict=True))
    bonds = Bonds(np.concatenate([[0], np.cumsum(counts)]), *columns)
    return Assembly(bonds, area, np.concatenate([part.family for part in every]))


def in_precision(bonds: Bonds, precision: str) -> Bonds:
    """The bonds with values rounded to a precision."""
    rounded = (np.ascontiguousarray(column, dtype=precision) for column in bonds[2:])
    return Bonds(bonds.start, bonds.neighbour, *rounded)


class ByPairs(Protocol):
    """A scheme that makes the bonds of a model with n nodes from pairs, each considered by itself."""

    area: NDArray[np.float64]  # (n,) m^2

    @property
    def neighbours(self) -> Neighbours:
        """The search for pairs."""

    def looked(self, pairs: Pairs) -> Paired:
        """Pairs that can be bonds, with the properties that depend on each pair alone."""

    def lack(self, rows: NDArray[np.int64], paired: Paired) -> NDArray[np.float64]:
        """Surface correction data (k, ...) of the families of `rows` (k,), which increase, from all their pairs."""

    def part(self, rows: NDArray[np.int64], paired: Paired, lack: NDArray[np.float64]) -> Part:
        """Bonds of consecutive rows from all their pairs and from the nodes' correction data (n, ...)."""


def part_of(
    position: NDArray[np.float64], unbreakable_nodes: NDArray[np.bool_], rows: NDArray[np.int64], paired: Paired
) -> Part:
    """Pairs of these rows as bonds, without those cut by a pre-crack; `unbreakable_nodes` (n,) keep all their bonds.

    `position` (n, d) in m.
    """
    pairs, intact = paired.pairs, paired.intact
    no_fail = unbreakable_nodes[pairs.source] | unbreakable_nodes[pairs.target]
    peak, limit = (np.where(no_fail, np.inf, bound) for bound in (paired.peak, paired.limit))
    source, target, first = pairs.source[intact], pairs.target[intact], int(rows[0])
    bonds = Bonds(
        start=np.searchsorted(source, np.append(rows, rows[-1] + 1)),
        neighbour=target.astype(np.int32),
        xi=position[target] - position[source],
        stiffness=paired.stiffness[intact],
        peak=peak[intact],
        limit=limit[intact],
        weight=paired.weight[intact],
    )
    return Part(first, bonds, np.bincount(pairs.source - first, minlength=len(rows)))


def areas(model: Model, usual: Literal["cells", "eq19"]) -> NDArray[np.float64]:
    """Areas (n,), m^2, or volumes of a body, m^3, by the model's rule, or by default the scheme's `usual` one.

    Exact cells come from the grid file; without them, full cells are used.
    """
    grid, rule = model.grid, model.settings.area_rule or usual
    if rule == "eq19":
        return thesis_areas(grid.position, grid.delta, model.horizons)
    return grid.delta**grid.dimension if rule == "square" else grid.cells


def ends(bonds: Bonds, numbers: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (k,) of both nodes of the bonds with these indices (k,)."""
    return np.searchsorted(bonds.start, numbers, side="right") - 1, bonds.neighbour[numbers].astype(np.int64)


def find(bonds: Bonds, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices (k,) of the bonds from `source` (k,) to `target` (k,). Raises CheckpointError for a missing bond."""
    nodes = len(bonds.start) - 1
    key = bonds.source * nodes + bonds.neighbour
    wanted = source * nodes + target
    bond_numbers = np.searchsorted(key, wanted)
    expect_found(np.append(key, -1)[bond_numbers] == wanted, source, target)
    return bond_numbers


def stiffness_bound(bonds: Bonds, stiffness: NDArray[np.floating], symmetric: bool) -> NDArray[np.float64]:
    """A bound (n,) of each node's stiffness, N/m^4: a step of sqrt(2 rho / it) is surely stable everywhere.

    With k = stiffness / |xi| (b,) and n = xi / |xi| of the bonds: sum k for any bonds, after S. A. Silling, E. Askari,
    Comput. Struct. 83 (2005) 1526-1535. For `symmetric` ones, the larger eigenvalue of sum k n n^T, as (n . (u_i -
    u_j))^2 <= 2 (n . u_i)^2 + 2 (n . u_j)^2 in their energy. This makes the step sqrt(2) times as long inside a square
    lattice, less at corrected edges, which are stiffer along themselves. True limits of plates are 1.15 to 1.27 times
    that, and 1.66 times the bound for any bonds.
    """
    nodes, dimension = len(bonds.start) - 1, bonds.xi.shape[1]
    length = lengths(bonds.xi)
    k, n = stiffness / length, (bonds.xi / length[:, None]).T
    row = bonds.source

    def total(terms: NDArray[np.floating]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(row, terms, minlength=nodes))

    if not symmetric:
        return total(k)
    sums = {(a, b): total(k * n[a] * n[b]) for a in range(dimension) for b in range(a, dimension)}
    if dimension == 2:
        return (sums[0, 0] + sums[1, 1]) / 2 + np.hypot((sums[0, 0] - sums[1, 1]) / 2, sums[0, 1])
    matrices = np.empty((nodes, dimension, dimension))
    for (a, b), values in sums.items():
        matrices[:, a, b] = matrices[:, b, a] = values
    return np.asarray(np.linalg.eigvalsh(matrices)[:, -1])


class BondStatistics:
    """Statistics of bonds, collected part by part."""

    def __init__(self, filling: BondSource, symmetric: bool) -> None:
        self._filling, self._symmetric = filling, symmetric
        self._counts: list[NDArray[np.int64]] = []
        self._families: list[NDArray[np.int64]] = []
        self._stiffness_bound: list[NDArray[np.float64]] = []
        self.softens = False

    def parts(self) -> Iterator[Part]:
        """All parts of the bonds; statistics are collected while they are iterated."""
        for part in self._filling.parts():
            self.look(part)
            yield part

    def look(self, part: Part) -> None:
        """Collect the statistics of a part, after those of the rows before it."""
        bonds = part.bonds
        self._counts.append(np.diff(bonds.start))
        self._families.append(part.family)
        self._stiffness_bound.append(stiffness_bound(bonds, bonds.stiffness, self._symmetric))
        self.softens |= bool((bonds.peak < bonds.limit).any())

    def counted(self, area: NDArray[np.float64]) -> FamilyCounts:
        """Data of the nodes besides their bonds, with these cells (n,), m^2, in space m^3."""
        return FamilyCounts(area, self.family, self.count)

    @property
    def count(self) -> NDArray[np.int64]:
        """Number (n,) of bonds of each node."""
        return np.concatenate(self._counts)

    @property
    def family(self) -> NDArray[np.int64]:
        """Number (n,) of bonds of each node at the start, including those cut by a pre-crack."""
        return np.concatenate(self._families)

    @property
    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness of each node under linear bonds, N/m^4."""
        return np.concatenate(self._stiffness_bound)


class Scheme(NamedTuple):
    """How the bonds of a model are made."""

    name: str  # as users give it
    fill: Callable[[Model], BondSource]
    by_pairs: Callable[[Model], ByPairs]  # the same for bonds that hold energy by themselves
    symmetric: bool  # energy and momentum are conserved
    partial_cells: bool  # families reach half a spacing beyond the horizon, if the micromodulus is constant
    matches_work: bool  # what softening and breaking bonds take from the motion is the area below their law's curve
    exact_load: bool  # the body forces of an edge sum to traction * length
