"""Bonds on a lattice in slots relative to a base cell: neighbours follow from the positions of nodes.

Nodes are cells of a box with a margin. A slot is a conductance and the offset of a bond's other end, in cells. All
cells of a run along one axis are processed together. Cells without a node hold 0, so that bonds to them add nothing;
the outflow of a node is that of its existing bonds.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ON_LATTICE, ROUND_OFF
from pdsolve.diffusion.families import DiffusionFamilies, Unlike, shape
from pdsolve.diffusion.flux import four, gained, two
from pdsolve.diffusion.listed import BondList, ChangedBonds, compiled
from pdsolve.numerics.thread_team import side_by_side

if TYPE_CHECKING:
    from scipy.sparse import csr_array

TOGETHER = 8  # slots that a cell is summed up over before it is put down
ABREAST = 8  # cells that are summed up at once: runs are as if longer, and what is beyond them is not put down
FEWER = 0.7  # of the runs along x: worth that nodes, which are in its order, are read and written out of theirs
LEAST_FILLED = 0.2  # cells of the box that have a node
LEAST_NODES = 64
MOST_UNLIKE = 0.2  # of the bonds: how many may differ from those of the lattice


class Runs(NamedTuple):
    """Runs of consecutive nodes along the axis with the fewest runs, r of them."""

    cell: NDArray[np.int64]  # (r,) of the first
    node: NDArray[np.int64]  # (r,) its place in the order of cells
    cells: NDArray[np.int64]  # (r,) how many


class ConductanceSlots(NamedTuple):
    """The s slots of a lattice; one at the end makes their number even and has conductance 0."""

    ahead: NDArray[np.int64]  # (s,) cells
    conductance: NDArray[np.float64]  # (s,) 1/(s m^d)


class LatticeTables(NamedTuple):
    """What a lattice of n nodes is, for who sums it elsewhere."""

    cells: int
    cell: NDArray[np.int64]  # (n,)
    ahead: NDArray[np.int64]  # (s,) cells
    conductance: NDArray[np.float64]  # (s,) 1/(s m^d)
    scale: NDArray[np.float64]  # (n,)
    outflow: NDArray[np.float64]  # (n,) 1/s
    change: BondList | None


class Box(NamedTuple):
    """Cells of n nodes in a box."""

    size: int  # cells
    cell: NDArray[np.int64]  # (n,) of each node
    order: NDArray[np.int64]  # (w,) rows of the nodes whose sums are wanted, in the order of their cells
    runs: Runs
    strides: NDArray[np.int64]  # (d,) cells from one to the next along each axis


def box_of(position: NDArray[np.float64], spacing: float, margin: int, wanted: int | None = None) -> Box | None:
    """Cells of nodes at `position` (n, d), m; None if they are not on one lattice, or fill too little of it.

    Sums are needed for the first `wanted` nodes, by default for all.
    """
    at = (position - position[0]) / spacing
    lattice_index = np.rint(at)
    if (
        len(position) < LEAST_NODES
        or not (np.abs(at - lattice_index) <= ON_LATTICE * (1 + np.abs(lattice_index))).all()
    ):
        return None
    low, high = lattice_index.min(axis=0), lattice_index.max(axis=0)
    if len(position) < LEAST_FILLED * np.prod(high - low + 1):
        return None
    side = (high - low + 1 + 2 * margin).astype(np.int64)
    place = (lattice_index - low).astype(np.int64) + margin
    filled = np.zeros(side, dtype=bool)
    filled[tuple(place.T)] = True
    if np.count_nonzero(filled) < len(place):
        return None
    begin = np.array([np.count_nonzero(filled & ~np.roll(filled, 1, axis)) for axis in range(len(side))])
    along = int(np.argmin(begin)) if begin.min() < FEWER * begin[0] else 0
    axes = np.roll(np.arange(len(side)), -along)
    strides = np.empty(len(side), dtype=np.int64)
    strides[axes] = np.concatenate([[1], np.cumprod(side[axes][:-1])])
    cell = place @ strides
    order = np.argsort(cell[:wanted], kind="stable")
    return Box(int(np.prod(side)), cell, order, runs_of(cell[order]), strides)


def runs_of(cell: NDArray[np.int64]) -> Runs:
    """The runs of increasing cells (w,)."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(cell) != 1) + 1])
    return Runs(cell[first], first, np.diff(np.append(first, len(cell))))


def slots_of(steps: NDArray[np.int64], conductance: NDArray[np.float64], box: Box) -> ConductanceSlots:
    """Slots of bonds (k,) to nodes at offsets `steps` (k, d), in the order of cells."""
    order = np.argsort(steps @ box.strides)
    padding = -len(order) % 2
    ahead = np.concatenate([(steps @ box.strides)[order], np.zeros(padding, dtype=np.int64)])
    return ConductanceSlots(ahead, np.concatenate([conductance[order], np.zeros(padding)]))


def family(families: DiffusionFamilies, spacing: float, D: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Offsets (k, d) and conductances (k,) of the bonds of a node with a full family."""
    ratio = families.model.settings.horizon.ratio
    side = int(ratio + 0.5) + 1
    steps = np.array([at for at in product(range(-side, side + 1), repeat=families.dimension) if any(at)])
    length, ones = np.linalg.norm(steps, axis=1) * spacing, np.ones(len(steps))
    conductance = families.even(D) * shape(
        length, ratio * spacing * ones, spacing * ones, families.dimension, families.power
    )
    within_horizon = conductance > ROUND_OFF * conductance.max()
    return steps[within_horizon], conductance[within_horizon]


def on_lattice(families: DiffusionFamilies, volume: NDArray[np.float64], threads: int) -> OnLattice | None:
    """Bonds of a model as slots; None unless its nodes are on one lattice, and few bonds differ from those there."""
    grid, D = families.model.grid, families.diffusivity
    if (grid.delta != grid.delta[0]).any() or families.dimension != grid.position.shape[1]:
        return None
    steps, conductance = family(families, float(grid.delta[0]), float(D[0]))
    box = box_of(grid.position, float(grid.delta[0]), int(np.abs(steps).max()))
    if box is None:
        return None
    unlike = families.unlike()
    exchange = OnLattice(box, slots_of(steps, conductance, box), volume, threads, D / D[0], unlike)
    return None if len(unlike.source) > MOST_UNLIKE * exchange.count.sum() else exchange


class OnLattice:
    """Exchange between the nodes of one lattice; few of its bonds may differ from what they are inside of one medium.

    Rates of a node are `scale` (n,) times those of the slots; by default 1.
    """

    name = "lattice"

    def __init__(
        self,
        box: Box,
        slots: ConductanceSlots,
        volume: NDArray[np.float64],
        threads: int,
        scale: NDArray[np.float64] | None = None,
        unlike: Unlike | None = None,
    ) -> None:
        self.volume, self.threads = volume, threads
        self._box, self._slots = box, slots
        self._change: BondList | None = None
        self._scale = np.ones(len(volume)) if scale is None else scale
        self._amount, self._whole = np.zeros((2, box.size + ABREAST))
        self._whole[box.cell] = volume
        runs = box.runs
        ends = np.searchsorted(runs.node, np.linspace(0, len(box.order), threads + 1)[1:-1])
        self._ends = np.concatenate([[0], ends, [len(runs.cell)]]).tolist()
        nothing, ones, counts = np.zeros(len(volume)), np.ones(len(volume)), np.zeros(len(volume))
        self._amount[box.cell] = 1.0
        unit_slots = slots._replace(conductance=np.sign(np.abs(slots.conductance)))
        self._share(_pull, unit_slots, (self._amount, nothing, nothing, ones, box.order), counts)
        self.count = np.rint(counts).astype(np.int64)
        self._outflow = nothing  # (n,) 1/s, of the slots
        _put(box.cell, ones, volume, self._amount)
        self._share(_pull, slots, (self._amount, ones, nothing, ones, box.order), outflow := np.zeros(len(volume)))
        self._outflow, self.total = outflow, self._scale * outflow
        self.blocked = np.zeros(len(volume), dtype=np.int64)  # (n,) bonds that a crack blocks
        if unlike is not None and len(unlike.source):
            self._change = ChangedBonds(*unlike[:3], volume, threads)
            self.count, self.blocked = self.count - unlike.lost, unlike.blocked
            self.total = self.total + self._change.total

    def part(self, first: int, last: int, begin: int, end: int) -> OnLattice:
        """The bonds of the rows `first` to `last` - 1, on one thread; nodes are the rows `begin` to `end` - 1, which
        have all neighbours."""
        cell, margin = self._box.cell[begin:end], int(np.abs(self._slots.ahead).max())
        base = int(cell.min()) - margin
        order = first + np.argsort(self._box.cell[first:last], kind="stable") - begin
        runs = runs_of((cell - base)[order])
        box = Box(int(cell.max()) - base + margin + 1, cell - base, order, runs, self._box.strides)
        part = OnLattice(box, self._slots, self.volume[begin:end], 1, self._scale[begin:end])
        if self._change is not None:
            part._change = self._change.part(first, last, begin, end)
            part.total = part.total + part._change.total
        return part

    def _share(self, kernel, slots, of, out) -> None:  # type: ignore[no-untyped-def]
        runs, ends = self._box.runs, self._ends
        side_by_side(lambda part: kernel(runs, slots, of, out, ends[part], ends[part + 1]), self.threads)

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        _put(self._box.cell, potential, self.volume, self._amount)
        self._share(_pull, self._slots, (self._amount, potential, self._outflow, self._scale, self._box.order), out)
        if self._change is not None:
            self._change.rates(potential, out)

    def tables(self) -> LatticeTables:
        """The cells and slots of the lattice, and what its few other bonds add."""
        box, slots = self._box, self._slots
        return LatticeTables(box.size + ABREAST, box.cell, *slots, self._scale, self._outflow, self._change)

    def lacking(self, cell: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose total conductance differs from that of a full family of whole cells, m^d."""
        full = self._scale * self._slots.conductance.sum() * cell
        return np.asarray(np.abs(self.total - full) > ROUND_OFF * full)

    def tangent(self) -> csr_array:
        """Derivative (n, n) of the rates by the potentials, 1/s."""
        from scipy.sparse import coo_array  # here, as it takes long to import

        nodes, row = np.arange(len(self.volume)), np.full(self._box.size, -1)
        row[self._box.cell] = nodes
        entries = [(-self._scale * self._outflow, nodes, nodes)]
        for ahead, conductance in zip(*self._slots, strict=True):
            target = row[self._box.cell + ahead]
            has_neighbour = (target >= 0) & (conductance > 0)
            pulls = self._scale[has_neighbour] * conductance * self.volume[target[has_neighbour]]
            entries.append((pulls, nodes[has_neighbour], target[has_neighbour]))
        value, source, target = (np.concatenate(column) for column in zip(*entries, strict=True))
        matrix: csr_array = coo_array((value, (source, target)), shape=(len(nodes), len(nodes))).tocsr()
        return matrix if self._change is None else (matrix + self._change.tangent()).tocsr()

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Sum over bonds of the differences of `share` (n,), weighted by conductance and both volumes, m^d/s."""
        self._amount[self._box.cell] = share
        out = np.zeros(len(share))
        self._share(_differ, self._slots, (self._amount, self._whole, share, self._box.order), out)
        contrast = float((out * self._scale * self.volume).sum())
        return contrast if self._change is None else contrast + self._change.contrast(share)


@compiled()
def _put(cell, potential, volume, amount):  # type: ignore[no-untyped-def]
    for i in range(len(cell)):
        amount[cell[i]] = potential[i] * volume[i]


@compiled(fastmath={"nsz"})
def _pull(runs, slots, of, out, first, last):  # type: ignore[no-untyped-def]
    amount, potential, total, scale, order = of
    ahead, g = slots
    eights = len(ahead) // TOGETHER * TOGETHER
    s = np.zeros((runs.cells[first:last].max() if last > first else 1) + ABREAST)
    for r in range(first, last):
        cell, cells = runs.cell[r], np.uint64((runs.cells[r] + ABREAST - 1) // ABREAST) * np.uint64(ABREAST)
        s[:cells] = 0
        for k in range(0, eights, TOGETHER):
            b0, b1 = np.uint64(cell + ahead[k]), np.uint64(cell + ahead[k + 1])
            b2, b3 = np.uint64(cell + ahead[k + 2]), np.uint64(cell + ahead[k + 3])
            b4, b5 = np.uint64(cell + ahead[k + 4]), np.uint64(cell + ahead[k + 5])
            b6, b7 = np.uint64(cell + ahead[k + 6]), np.uint64(cell + ahead[k + 7])
            g0, g1, g2, g3, g4, g5, g6, g7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
            for x in range(cells):
                first_sum = four(g0, amount[b0 + x], g1, amount[b1 + x], g2, amount[b2 + x], g3, amount[b3 + x])
                second_sum = four(g4, amount[b4 + x], g5, amount[b5 + x], g6, amount[b6 + x], g7, amount[b7 + x])
                s[x] += first_sum + second_sum
        for k in range(eights, len(ahead), 2):
            b0, b1, g0, g1 = np.uint64(cell + ahead[k]), np.uint64(cell + ahead[k + 1]), g[k], g[k + 1]
            for x in range(cells):
                s[x] += two(g0, amount[b0 + x], g1, amount[b1 + x])
        for x in range(runs.cells[r]):
            i = order[runs.node[r] + x]
            out[i] += gained(scale[i], s[x], total[i], potential[i])


@compiled()
def _differ(runs, slots, of, out, first, last):  # type: ignore[no-untyped-def]
    amount, volume, share, order = of
    for r in range(first, last):
        for x in range(runs.cells[r]):
            i, cell = order[runs.node[r] + x], runs.cell[r] + x
            s = 0.0
            for k in range(len(slots.ahead)):
                neighbour = cell + slots.ahead[k]
                s += slots.conductance[k] * volume[neighbour] * abs(amount[neighbour] - share[i])
            out[i] = s
