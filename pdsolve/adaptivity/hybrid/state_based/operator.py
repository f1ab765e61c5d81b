"""The operator of a plate of a linear peridynamic solid with a moving fine zone: its current coarse and fine nodes.

Nodes are the fine nodes that are in fine cells alone, and the coarse nodes. A fine node on the border moves with the
coarse nodes around it and is no node of its own, unless it lies on a coarse one. Whole bonds between fine nodes break;
others, and pieces of bonds, never do. Bonds that are asked for are the whole ones between nodes, and the edges and
diagonals of coarse cells.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.arrays import AHEAD
from pdsolve.adaptivity.hybrid.engine import ZoneSummary
from pdsolve.adaptivity.hybrid.history import History
from pdsolve.adaptivity.hybrid.irregular_bonds import part_of
from pdsolve.adaptivity.hybrid.lattice import AROUND, COARSE, EMPTY, FINE, FREE, VOID
from pdsolve.adaptivity.hybrid.state_based import bilinear_cells, families
from pdsolve.adaptivity.hybrid.state_based.arrangement import nodes_of
from pdsolve.adaptivity.hybrid.state_based.border_weights import distinct
from pdsolve.adaptivity.hybrid.state_based.linked import linked
from pdsolve.adaptivity.hybrid.state_based.plate import Whole
from pdsolve.bonds.assembly import Counted
from pdsolve.checkpoint_validation import entry, expect_found, like
from pdsolve.errors import CheckpointError, LateZoneError
from pdsolve.model import Model
from pdsolve.numerics.dilation import in_disc
from pdsolve.operators.protocol import Kept
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class StateBasedHybrid:
    """The operator of the n current nodes, in the order of the grid."""

    name = "hybrid"
    symmetric = True
    unknowns: tuple[Unknown, ...] = (Unknown("u", 2, 2),)

    def __init__(self, whole: Whole, cells: NDArray[np.uint8], history: History) -> None:
        """`cells` (c,) are those of the zone."""
        self.whole, self.cells, self.history = whole, cells, history
        self._nodes = nodes_of(whole, cells)
        self.rows = np.flatnonzero((self._nodes.kind == FREE) | self._nodes.above)
        self._row = np.full(len(whole.xy), -1, dtype=np.int64)
        self._row[self.rows] = np.arange(len(self.rows))
        self._families, border = linked(whole, cells, self._nodes, self._row)
        self._sums = families.sums_of(self._families, len(self.rows))
        self._gone = np.zeros(len(self._families.inner.ends), dtype=np.int64)
        where = np.argwhere(cells.reshape(-1, whole.plate.at.cell_stride) == COARSE)
        y, x = 2 * (where - AROUND).T
        self._cells = self._row[np.column_stack([whole.row[y + b, x + a] for a, b in ((0, 0), (2, 0), (2, 2), (0, 2))])]
        self._elastic = 2 * whole.plate.h, whole.bulk, whole.shear
        self._on_border = self.spread(border)
        rows, w = self.spread(np.arange(len(whole.xy)))
        area = (w * whole.area[:, None]).ravel()
        self.volume: NDArray[np.float64] = np.bincount(rows.ravel(), area, minlength=len(self.rows)).astype(np.float64)
        self._links = self._linked()
        self._breaking = RLock()  # held while bonds and broken bonds disagree: results ask for both during a march

    def _linked(self) -> NDArray[np.int64]:
        """The directed bonds between nodes, source times n plus target, in order."""
        of, count = self._families, len(self.rows)
        whole = self.whole.bonds
        bond = of.pieces.bond[
            np.isclose(of.pieces.xi[:, 2], self.whole.plate.h * np.hypot(*self.whole.ways[whole.way[of.pieces.bond]].T))
        ]
        bond = np.concatenate([of.inner.bond, bond])
        ends = self._row[np.column_stack([whole.one[bond], whole.two[bond]])]
        pairs = [ends[(ends >= 0).all(axis=1)], *(self._cells[:, pair] for pair in bilinear_cells.PAIRS)]
        one, two = np.concatenate(pairs).T
        return distinct(np.concatenate([one * count + two, two * count + one]))

    @cached_property
    def model(self) -> Model:
        """The model of the n current nodes, without conditions."""
        found = part_of(self.whole.model, self.rows)
        delta = found.grid.delta.copy()
        delta[self._nodes.above[self.rows]] *= 2
        return dataclasses.replace(found, grid=dataclasses.replace(found.grid, delta=delta, areas=self.volume))

    def place(self, state: State) -> State:
        """The state itself: its arrays are those of all nodes."""
        return state

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, 2), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long.

        Raises LateZoneError if a bond that does not break exceeds its limit.
        """
        count, largest = families.gather(self._families, state.value, self._sums, self._gone)
        force = np.zeros_like(state.value)
        if count and step > 0:
            self._break(state, self._gone[:count].copy(), step, dt, force)
        else:
            families.pull(self._families, self._sums, force)
        bilinear_cells.pull_cells(self._cells, *self._elastic, state.value, force)
        out += force / self.volume[:, None]
        self.history = self.history._replace(largest=max(self.history.largest, largest))
        if step > 0 and largest > 1:
            raise LateZoneError(
                f"step {step}: found a bond at the border of the fine zone stretched to {largest:.2f} of what breaks"
                " it, expected less than 1: fine nodes came too late",
                step,
            )

    def _break(self, state: State, bonds: NDArray[np.int64], step: int, dt: float, force: NDArray[np.float64]) -> None:
        """Break bonds (k,) between free nodes, book what that spends, and fill in the forces, N, after it."""
        held, before = self._held(state), np.zeros_like(force)
        families.pull(self._families, self._sums, before)
        ends = self._families.inner.ends[bonds].astype(np.int64)
        both = np.concatenate([ends, ends[:, ::-1]])
        with self._breaking:
            self._clear(bonds)
            one, two = self.rows[both].T
            now = self.history
            self.history = now._replace(
                step=np.concatenate([now.step, np.full(len(both), step)]),
                source=np.concatenate([now.source, one]),
                target=np.concatenate([now.target, two]),
            )
        families.gather(self._families, state.value, self._sums, self._gone)
        some = np.unique(ends)
        state.dissipated[some] += ((held - self._held(state)) / self.volume)[some]
        families.pull(self._families, self._sums, force)
        # the last half step already went without the forces that are lost
        state.dissipated[:] += dt / 2 * ((before - force) * state.rate).sum(axis=1) / self.volume

    def _clear(self, bonds: NDArray[np.int64]) -> None:
        """Take bonds (k,) between free nodes out of the plate's."""
        inner = self._families.inner
        inner.a[bonds], inner.b[bonds], inner.limit[bonds] = 0.0, 0.0, np.inf
        self.whole.bonds.intact[inner.bond[bonds]] = False

    def _held(self, state: State) -> NDArray[np.float64]:
        """Energies (n,), J per unit thickness, of families, whose sums are gathered."""
        of, count = self._families, len(self.rows)
        held, beside = np.zeros(count), np.zeros(count + len(of.rows) + len(of.volume))
        families.hold(of, self._sums, held, beside)
        held += beside[:count]
        for m in range(2):
            held += np.bincount(of.rows[:, m], of.w[:, m] * beside[count : count + len(of.rows)], minlength=count)
        rows, w = self._on_border
        own = beside[2 * count + len(of.rows) :]
        return held + np.bincount(rows.ravel(), (w * own[:, None]).ravel(), minlength=count)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Strain energy densities (n,), J/m^3, and zeros: no bond softens."""
        families.gather(self._families, state.value, self._sums, self._gone)
        held = self._held(state)
        bilinear_cells.hold_cells(self._cells, *self._elastic, state.value, held)
        return held / self.volume, np.zeros(len(held))

    def held_around(self, state: State, new: NDArray[np.int64]) -> NDArray[np.float64]:
        """Strain energy densities (n,), J/m^3."""
        return self.energies(state)[0]

    def forces_around(self, state: State, new: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Force densities (n, 2), N/m^3, of all nodes, a mask (n,) that is true; nothing breaks."""
        out = np.zeros_like(state.value)
        self.add(state, out, 0, 0.0)
        return out, np.ones(len(out), dtype=np.bool_)

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: nothing is stored beside displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness that resists each node's motion, N/m^4; see `Operator`."""
        return self.whole.resistance * self.model.rho

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (2 n, 2 n), N/m^4, of the force densities by the values; see `Operator`."""
        from pdsolve.adaptivity.hybrid.state_based.tangent import Cells, tangent_of  # few runs need it

        families.gather(self._families, state.value, self._sums, self._gone)
        return tangent_of(self._families, self._sums, Cells(self._cells, *self._elastic), state.value, self.volume)

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first` to `last` - 1, or of those at the
        `start`."""
        count, links = len(self.rows), self._links
        with self._breaking:
            broken = self.broken()
        gone = np.sort(broken.source * count + broken.target)
        at = np.minimum(np.searchsorted(links, gone), len(links) - 1)
        links = np.delete(links, at[links[at] == gone])
        if start:
            links = np.insert(links, np.searchsorted(links, gone), gone)
        begin, end = np.searchsorted(links, [first * count, (count if last is None else last) * count])
        source, target = np.divmod(links[begin:end], count)
        return source, target

    @cached_property
    def counted(self) -> Counted:
        """Volumes (n,), and numbers of bonds at the start, with and without those cut by pre-cracks."""
        count = np.bincount(self.bonds(start=True)[0], minlength=len(self.rows))
        free = self._nodes.kind[self.rows] == FREE
        family = count + np.where(free, self.whole.cut[self.rows], 0)
        return Counted(self.volume, family, count)

    def broken(self, after: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        of = self.history
        later = of.step > after
        return Broken(of.step[later], self._row[of.source[later]], self._row[of.target[later]])

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone."""
        solid = np.count_nonzero((self.cells != VOID) & (self.cells != EMPTY))
        return ZoneSummary(self.history.made, np.count_nonzero(self.cells == FINE) / solid, self.history.largest)

    def wanted(self, state: State, since: int) -> NDArray[np.int64]:
        """Cells (k,) that become fine: around bonds broken after a step, and around stretched coarse cells."""
        at, hot = self.whole.plate.at, np.zeros(len(self.rows), dtype=np.bool_)
        bilinear_cells.stretched(
            self._cells, self._elastic[0], state.value, self.whole.lasts[self.rows], self.whole.hot, hot
        )
        hot[self.broken(since).source] = True
        return near(self.cells, at.cell_stride, self.whole.xy[self.rows[hot]], AHEAD)

    def refined(self, new: NDArray[np.int64]) -> StateBasedHybrid:
        """The operator after the cells `new` (k,) have become fine."""
        cells = self.cells.copy()
        cells[new] = FINE
        return StateBasedHybrid(self.whole, cells, self.history)

    def restored(self, kept: Kept) -> StateBasedHybrid:
        """The operator of a checkpoint's cells, some of which have become fine. Raises CheckpointError."""
        cells = like(kept, "cells", self.cells)
        new = (self.cells == COARSE) & (cells == FINE)
        if not ((cells == self.cells) | new).all():
            raise CheckpointError("found cells that are others than at the start, expected coarse ones to become fine")
        return self.refined(np.flatnonzero(new))

    def moved(self, which: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (k, 2) of rows of the grid `which` (k,), interpolated from those of the nodes here (n, 2)."""
        rows, w = self.spread(which)
        return np.asarray(np.einsum("nk,nka->na", w, values[rows]))

    def row_of_grid(self, which: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows (k,) of the rows of the grid `which`, -1 for nodes that are none now."""
        return self._row[which]

    def spread(self, which: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Rows (k, 4) of the nodes that move rows of the grid `which` (k,), and their shares."""
        own, even = self._row[which], self.whole.xy[which] % 2 == 0
        rows = self._row[self.whole.corners[which]]
        w = np.where(even[:, :1], [1.0, 0, 1, 0], 0.5) * np.where(even[:, 1:], [1.0, 1, 0, 0], 0.5)
        known = own >= 0
        rows[known], w[known] = own[known, None], np.eye(4)[0]
        rows[w == 0] = 0
        return rows, w

    def keep(self) -> Kept:
        """The cells and books for a checkpoint."""
        return {"cells": self.cells.copy(), "zone_books": np.array([self.history.made, self.history.largest])}

    def back(self, kept: Kept, broken: Broken) -> None:
        """Restore the broken bonds and the books of a checkpoint of these cells."""
        if not np.array_equal(like(kept, "cells", self.cells), self.cells):
            raise CheckpointError("found cells that are others than those of the nodes, expected the same")
        made, largest = entry(kept, "zone_books", (2,), float).tolist()
        ends, count = self._families.inner.ends.astype(np.int64), len(self.rows)
        low, high = np.minimum(broken.source, broken.target), np.maximum(broken.source, broken.target)
        key = ends.min(axis=1) * count + ends.max(axis=1)
        order = np.argsort(key)
        at = np.searchsorted(key[order], low * count + high)
        expect_found(np.append(key[order], -1)[at] == low * count + high, broken.source, broken.target)
        self._clear(np.unique(order[at]))
        source, target = self.rows[broken.source], self.rows[broken.target]
        self.history = History(broken.step.astype(np.int64), source, target, made, largest)

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        of = self._families
        parts = (*of, *of.inner, *of.pieces, *self._sums, *self.whole.bonds, self._links)
        return sum(getattr(array, "nbytes", 0) for array in parts)


def near(cells: NDArray[np.uint8], stride: int, places: NDArray[np.int64], radius: int) -> NDArray[np.int64]:
    """The coarse cells (k,) within `radius` spacings of the fine nodes at `places` (., 2)."""
    sides = len(cells) // stride, stride
    marked = np.zeros((2 * sides[0] + 2, 2 * sides[1] + 2), dtype=np.bool_)  # fine nodes
    marked[places[:, 1] + 2 * AROUND, places[:, 0] + 2 * AROUND] = True
    if not len(places):
        return np.zeros(0, dtype=np.int64)
    wide = in_disc(marked, radius - 1)
    found = np.zeros(sides, dtype=np.bool_)
    for y in range(3):
        for x in range(3):
            found |= wide[y : y + 2 * sides[0] : 2, x : x + 2 * sides[1] : 2]
    return np.flatnonzero(found.ravel() & (cells == COARSE))
