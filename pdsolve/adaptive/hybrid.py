"""A run with a fine zone that moves, as the rest of the solver sees it: an operator and a stepper in one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptive import arrays
from pdsolve.adaptive.arrays import BREAKS, DISSIPATED, LARGEST, REFINEMENT, WORK, Ground, Zone
from pdsolve.adaptive.energy import books
from pdsolve.adaptive.fields import show
from pdsolve.adaptive.lattice import FINE, VOID
from pdsolve.adaptive.march import CLIP, DONE, march
from pdsolve.adaptive.plate import Plate
from pdsolve.conditions import Drive
from pdsolve.operators.blocks.lanes import ROW
from pdsolve.operators.operator import Kept
from pdsolve.state import Broken, State, Unknown
from pdsolve.unstable import UnstableError

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Told(NamedTuple):
    """What a run says of its fine zone."""

    fine_share: float  # of the plate
    clipped_stretch: float  # the largest of clipped bonds so far, over the critical one
    refinement: float  # J/m: energy that refining has made so far


class Hybrid:
    """Marches a plate and shows it on the whole fine lattice of n nodes.

    The state is brought up to date when `energies` are asked for.
    """

    name = "hybrid"
    unknowns: tuple[Unknown, ...] = (Unknown("u", 2, 2),)
    symmetric = True

    def __init__(self, plate: Plate, ground: Ground, zone: Zone, drive: Drive, rest: NDArray[np.float64]) -> None:
        """`rest` (n,) as `stiffest` says; bits and cells of the zone are those of the start."""
        self.plate, self.ground, self.zone, self.drive = plate, ground, zone, drive
        self._stiffest, self._now = rest, 0
        self._at_start = self.zone.bits.copy()
        self._row = np.full(plate.at.places, -1, dtype=np.int64)
        self._row[plate.place] = np.arange(len(plate.place))
        self._scratch = np.zeros((2, plate.at.coarse_places))

    def start(self, velocity: NDArray[np.float64]) -> None:
        """Number the zone, give all nodes their velocities (n, 2), m/s, and compute the forces."""
        self._number(np.flatnonzero(self.zone.cells == FINE))
        zone, place = self.zone, self.plate.place
        free = zone.fine.kind[place] == 1
        zone.fine.v[:, place[free]] = velocity[free].T
        coincident, coarse = self._coincident()
        zone.coarse.v[:, coarse] = velocity[coincident].T * (zone.coarse.kind[coarse] == 1)
        self.renew()

    def renew(self) -> None:
        """Compute the forces at the start anew."""
        march(self.ground, self.zone, self.drive.profiles, self._now, 1, 1, False, 0)

    def _number(self, cells: NDArray[np.int64]) -> None:
        zone = self.zone
        zone.new[: len(cells)] = cells
        march(self.ground, zone, self.drive.profiles, self._now, 1, 0, False, len(cells))

    def _coincident(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows of fine nodes that coarse ones lie on, and the places of those."""
        at = self.plate.at
        row, column = np.divmod(self.plate.place, at.stride)
        column, row = column - 16, row - 8
        chosen = np.flatnonzero((column % 2 == 0) & (row % 2 == 0))
        return chosen, (row[chosen] // 2 + 2) * at.coarse_stride + 16 + column[chosen] // 2

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1. Raises UnstableError where a clipped bond is over its limit."""
        if first == last:
            return
        drifted = False
        while True:
            how, first, self._now = march(
                self.ground, self.zone, self.drive.profiles, self._now, first, last, drifted, 0
            )
            if how == DONE:
                return
            if how == CLIP:
                raise UnstableError(
                    f"step {first}: found a bond at the border of the fine zone stretched to"
                    f" {self.told().clipped_stretch:.2f} of what breaks it, expected less than 1: the fine zone is too"
                    " narrow for this motion; solve it with run.adapt none"
                )
            self.zone = arrays.grown(self.zone)
            drifted = True

    def told(self) -> Told:
        """What there is to say of the fine zone."""
        zone = self.zone
        inside = int(np.count_nonzero(zone.cells != VOID))
        stretches = (np.sqrt(1 + e) - 1 for e in (zone.total[LARGEST], self.ground.e_limit))
        largest, limit = stretches
        return Told(
            float(np.count_nonzero(zone.cells == FINE) / inside), float(largest / limit), float(zone.total[REFINEMENT])
        )

    def books(self) -> tuple[float, float, float, float, float, float]:
        """Kinetic, strain and dissipated energy, work, J/m, and momentum, N s/m."""
        out, total = np.zeros(4), self.zone.total
        books(self.ground, self.zone, self._now, out)
        kinetic, strain, x, y = out.tolist()
        return kinetic, strain, float(total[DISSIPATED]), float(total[WORK]), x, y

    def place(self, state: State) -> State:
        """As in `Operator`."""
        return state

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As in `Operator`; brings the state up to date."""
        held = np.zeros(len(self.plate.place))
        show(self.ground, self.zone, self._now, self.plate.place, self._scratch, *state[:3], held)
        holds, drive = self.zone.holds, self.drive
        active = holds.on[: self.zone.number[arrays.HOLDS], 1]
        drive.held_force[:] = 0
        drive.held_force[active] = holds.value[active, arrays.FORCE] / self._hold_area[active]
        return held, np.zeros_like(held)

    @property
    def _hold_area(self) -> NDArray[np.float64]:
        at, place = self.plate.at, self.zone.holds.what[:, arrays.PLACE]
        row, column = np.divmod(place, at.stride)
        share = np.where(np.isin(column - 16, (0, at.nx)), 0.5, 1.0) * np.where(np.isin(row - 8, (0, at.ny)), 0.5, 1.0)
        return np.asarray(share * self.plate.h**2)

    def stiffest(self) -> NDArray[np.float64]:
        """As in `Operator`."""
        return self._stiffest

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Raises TypeError: forces are those of nodes that move, not of a state on the fine lattice."""
        raise TypeError("hybrid: found a state on the fine lattice, expected to march")

    def tangent(self, state: State) -> csr_array:
        """Raises TypeError, as `add`."""
        raise TypeError("hybrid: found a state on the fine lattice, expected to march")

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """As in `Operator`: those of the whole fine lattice, made or not."""
        place, ways = self.plate.place[first:last], self.ground.ways
        bits, half = self._at_start if start else self.zone.bits, len(ways) // 2
        found = np.zeros((len(place), len(ways)), dtype=bool)
        for k in range(half):
            mask = np.uint64(1) << np.uint64(k)
            found[:, k] = bits[place] & mask != 0
            found[:, k + half] = bits[place + ways[k + half]] & mask != 0
        node, spring = np.nonzero(found)
        source, target = first + node, self._row[place[node] + ways[spring]]
        order = np.lexsort((target, source))
        return source[order], target[order]

    def broken(self, after: int = 0) -> Broken:
        """As in `Operator`."""
        step, node, spring = (column[: self.zone.number[BREAKS]] for column in self.zone.breaks)
        new = np.flatnonzero(step > after)
        step, node, spring = step[new].astype(np.int64), node[new], spring[new]
        return Broken(step, self._row[node], self._row[node + self.ground.ways[spring]])

    def keep(self) -> Kept:
        """As in `Operator`: all that a run needs to go on to the same bits."""
        zone, broken = self.zone, self.zone.number[BREAKS]
        kept = {f"break_{name}": column[:broken].copy() for name, column in zone.breaks._asdict().items()}
        for name, nodes in (("fine", zone.fine), ("coarse", zone.coarse)):
            kept |= {f"{name}_u": nodes.u[self._now].copy(), f"{name}_v": nodes.v.copy(), f"{name}_f": nodes.f.copy()}
            kept |= {f"{name}_wide": nodes.wide.copy()}
        kept["holds"] = zone.holds.value.copy()
        return kept | {"cells": zone.cells.copy(), "total": zone.total.copy(), "number": zone.number.copy()}

    def back(self, kept: Kept, broken: Broken) -> None:
        """As in `Operator`."""
        springs, self._now = len(self.ground.ways), 0
        known = len(kept["break_step"])
        cells = np.flatnonzero(kept["cells"].ravel() == FINE)
        rows = max(len(self.zone.fine.own), 4 * len(cells))
        fresh = arrays.zone_of(self.plate.at, springs, rows)
        fresh = fresh._replace(loads=self.zone.loads, holds=self.zone.holds, bits=self._at_start.copy())
        while len(fresh.breaks.step) < known + ROW * rows * springs:
            fresh = arrays.grown(fresh)
        self.zone = fresh
        for name, column in fresh.breaks._asdict().items():
            column[:known] = kept[f"break_{name}"]
        owned = fresh.breaks.spring[:known] < springs // 2
        for k in range(springs // 2):
            gone = owned & (fresh.breaks.spring[:known] == k)
            fresh.bits[fresh.breaks.node[:known][gone]] &= ~(np.uint64(1) << np.uint64(k))
        fresh.cells[cells] = FINE
        self._number(cells)
        for name, nodes in (("fine", fresh.fine), ("coarse", fresh.coarse)):
            for field, values in (("u", nodes.u[0]), ("v", nodes.v), ("f", nodes.f), ("wide", nodes.wide)):
                values[:] = kept[f"{name}_{field}"].reshape(values.shape)
        fresh.holds.value[:] = kept["holds"].reshape(fresh.holds.value.shape)
        fresh.total[:] = kept["total"]
        fresh.number[[BREAKS, arrays.KNOWN, arrays.REGRIDS]] = kept["number"][[BREAKS, arrays.KNOWN, arrays.REGRIDS]]

    def bytes(self) -> int:
        """As in `Operator`: all arrays in full, though what is never touched takes no memory."""
        return sum(array.nbytes for part in (self.zone.fine, self.zone.coarse) for array in part)
