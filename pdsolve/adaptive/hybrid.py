"""A plate with a fine zone that moves, as it marches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptive import arrays
from pdsolve.adaptive.arrays import (
    BREAKS,
    DISSIPATED,
    ENTRIES,
    KNOWN,
    LARGEST,
    REFINEMENT,
    REGRIDS,
    ROWS,
    STIRS,
    WORK,
    Ground,
    Nodes,
    Zone,
)
from pdsolve.adaptive.clip import stretch_of
from pdsolve.adaptive.energy import held
from pdsolve.adaptive.lattice import AROUND, BELOW, BELOW_COARSE, FINE, FREE, IDLE, LEFT
from pdsolve.adaptive.march import CLIP, DONE, march
from pdsolve.adaptive.plate import Plate, squares
from pdsolve.adaptive.regrid import refine
from pdsolve.conditions import Drive
from pdsolve.operators.blocks.lanes import ROW
from pdsolve.operators.operator import Kept
from pdsolve.unstable import UnstableError

GROWN = 64  # rows: room for so many more is always kept
_stretch = getattr(stretch_of, "py_func", stretch_of)


class Told(NamedTuple):
    """What a run says of its fine zone."""

    refinement: float  # J/m: energy that refining has made so far
    fine_share: float  # of the plate
    clipped_stretch: float  # the largest of clipped bonds so far, over that which softens or breaks one


class Hybrid:
    """Marches a plate; its nodes are numbered as on their lattices."""

    def __init__(self, plate: Plate, ground: Ground, zone: Zone, drive: Drive) -> None:
        """Bits and cells of the zone are those of the start."""
        self.plate, self.ground, self.zone, self.drive, self.now = plate, ground, zone, drive, 0
        self.bits_at_start = zone.bits.copy()
        at, there = plate.at, squares((plate.row >= 0).reshape(-1, plate.at.stride))
        inside = there[BELOW : BELOW + at.ny, LEFT : LEFT + at.nx].reshape(at.ny // 2, 2, at.nx // 2, 2)
        self._solid = np.pad(inside.mean(axis=(1, 3)), AROUND).ravel()

    def start(self, velocity: NDArray[np.float64]) -> None:
        """Number the zone, give all nodes their velocities (n, 2), m/s, and compute the forces."""
        self.number()
        place = self.plate.place
        for nodes, own, rows in (
            (self.zone.fine, place, np.arange(len(place))),
            (self.zone.coarse, *self.coincident()),
        ):
            free = nodes.kind[own] == FREE
            nodes.v[:, own[free]] = velocity[rows[free]].T
        self.renew()

    def renew(self) -> None:
        """Compute the forces at the start anew."""
        march(self.ground, self.zone, self.drive.profiles, self.now, 1, 1, False)

    def number(self) -> None:
        """Make all nodes what the cells say, whatever they were."""
        at, zone = self.plate.at, self.zone
        zone.fine.own[: zone.number[ENTRIES]] = 0
        zone.fine.entry[:] = -1
        zone.fine.kind[:] = IDLE
        zone.stirred[:] = False
        zone.number[:] = 0
        y, x = np.mgrid[0 : at.ny // 2 + 1, 0 : at.nx // 2 + 1]
        coarse = ((y + BELOW_COARSE) * at.coarse_stride + LEFT + x).ravel()
        self._refine(np.flatnonzero(self.zone.cells == FINE), coarse)
        self.zone.total[:] = 0.0

    def _refine(self, new: NDArray[np.int64], coarse: NDArray[np.int64] | None = None) -> None:
        """Make these cells (k,) fine; `coarse` are places of nodes that are to be looked at, None: those around."""
        at, reach = self.plate.at, self.ground.reach + 2
        y, x = np.divmod(new, at.cell_stride)
        if coarse is None:
            corner = (y - AROUND + BELOW_COARSE) * at.coarse_stride + LEFT + x - AROUND
            coarse = np.unique(corner[:, None] + [0, 1, at.coarse_stride, at.coarse_stride + 1])
        marked = self.zone.mark.reshape(-1, at.stride)
        for left, low in zip((2 * (x - AROUND)).tolist(), (2 * (y - AROUND)).tolist(), strict=True):
            marked[
                max(BELOW + low - reach, 0) : BELOW + low + reach + 3, LEFT + left - reach : LEFT + left + reach + 3
            ] = True
        low, high = (max(0, BELOW + 2 * (int(end) - AROUND)) for end in (y.min(initial=AROUND), y.max(initial=AROUND)))
        some = np.s_[max(low - reach, 0) * at.stride : (high + reach + 3) * at.stride]
        dirty = some.start + np.flatnonzero(self.zone.mark[some])
        self.zone.mark[some] = False
        self._make_room(len(np.unique(dirty // ROW)))
        refine(self.ground, self.zone, new, dirty[self.plate.row[dirty] >= 0], coarse, self.now)

    def _make_room(self, rows: int) -> None:
        """Grow until there is room for so many more rows, and for all of their bonds to break."""
        while True:
            zone = self.zone
            events = ROW * (zone.number[ROWS] + rows) * zone.fine.own.shape[1]
            if zone.number[ENTRIES] + rows + GROWN <= len(zone.fine.own) and (
                zone.number[BREAKS] + events <= len(zone.breaks.step)
            ):
                return
            self.zone = arrays.grown(zone)

    def coincident(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Places of coarse nodes, and the rows of fine nodes that they lie on."""
        at, place = self.plate.at, self.plate.place
        row, column = np.divmod(place, at.stride)
        chosen = np.flatnonzero(((column - LEFT) % 2 == 0) & ((row - BELOW) % 2 == 0))
        x, y = (column[chosen] - LEFT) // 2, (row[chosen] - BELOW) // 2
        return (y + BELOW_COARSE) * at.coarse_stride + LEFT + x, chosen

    def march(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1. Raises UnstableError where a clipped bond is over its limit."""
        if first == last:
            return
        drifted = False
        while True:
            how, first, self.now, count = march(
                self.ground, self.zone, self.drive.profiles, self.now, first, last, drifted
            )
            if how == DONE:
                return
            if how == CLIP:
                raise UnstableError(
                    f"step {first}: found a bond at the border of the fine zone stretched to"
                    f" {self.told().clipped_stretch:.2f} of what breaks it, expected less than 1: the fine zone is too"
                    " narrow for this motion; solve it with run.adapt none"
                )
            if count:
                self._refine(self.zone.new[:count].copy())
            self._make_room(0)
            drifted = True

    def told(self) -> Told:
        """What there is to say of the fine zone."""
        zone = self.zone
        fine = self._solid[zone.cells == FINE].sum() / self._solid.sum()
        largest, limit = _stretch(zone.total[LARGEST]), _stretch(self.ground.least[0])
        return Told(float(zone.total[REFINEMENT]), float(fine), float(largest / limit))

    def active(self, nodes: Nodes, rows: int) -> NDArray[np.int64]:
        """Places of the nodes of a lattice, in so many rows, that are free."""
        places = (nodes.rows[:rows, None] * ROW + np.arange(ROW)).ravel()
        return np.asarray(places[nodes.kind[places] == FREE])

    def held(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy held by fine and by coarse nodes, by their places, J/m."""
        fine, coarse = np.zeros(self.plate.at.places), np.zeros(self.plate.at.coarse_places)
        held(self.ground, self.zone, self.now, fine, coarse)
        return fine, coarse

    def motion(self) -> NDArray[np.float64]:
        """Kinetic energy, J/m, and momentum, N s/m."""
        zone, found = self.zone, np.zeros(3)
        for nodes, rows in ((zone.fine, zone.number[ROWS]), (zone.coarse, zone.number[arrays.COARSE_ROWS])):
            own = self.active(nodes, rows)
            mass, v = nodes.mass[own], nodes.v[:, own]
            found += [float((mass / 2 * (v**2).sum(axis=0)).sum()), *(mass * v).sum(axis=1).tolist()]
        return found

    @property
    def spent(self) -> tuple[float, float, float]:
        """Energy dissipated, work done, and energy that refining made, J/m."""
        total = self.zone.total
        return float(total[DISSIPATED]), float(total[WORK]), float(total[REFINEMENT])

    def keep(self) -> Kept:
        """All that a run needs to go on to the same bits."""
        zone, broken = self.zone, self.zone.number[BREAKS]
        kept = {f"break_{name}": column[:broken].copy() for name, column in zone.breaks._asdict().items()}
        for name, nodes, rows in (
            ("fine", zone.fine, zone.number[ROWS]),
            ("coarse", zone.coarse, zone.number[arrays.COARSE_ROWS]),
        ):
            places = (nodes.rows[:rows, None] * ROW + np.arange(ROW)).ravel()
            there = nodes.kind[places] != IDLE
            for field, values in (("u", nodes.u[self.now]), ("v", nodes.v), ("f", nodes.f)):
                kept[f"{name}_{field}"] = np.where(there, values[:, places], 0.0)
            kept[f"{name}_wide"] = nodes.wide[nodes.rows[:rows]]
        if self.ground.varied:
            entry = zone.fine.entry[zone.fine.rows[: zone.number[ROWS]]]
            own = np.where(entry < 0, -2 - entry, entry)
            kept |= {"edge": zone.fine.edge[own], "own": zone.fine.own[own], "usual": entry < 0}
        kept |= {"holds": zone.holds.value.copy(), "stirs": zone.stirs[: zone.number[STIRS]].copy()}
        return kept | {"cells": zone.cells.copy(), "total": zone.total.copy(), "number": zone.number.copy()}

    def back(self, kept: Kept) -> None:
        """Go back to what was kept."""
        zone, half = self.zone, len(self.ground.ways) // 2
        zone.bits[:] = self.bits_at_start
        node, spring = kept["break_node"], kept["break_spring"]
        for k in range(half):
            zone.bits[node[spring == k]] &= ~(np.uint64(1) << np.uint64(k))
        for nodes in (zone.fine, zone.coarse):
            for array in nodes[:3]:
                array[:] = 0
        zone.cells[:], self.now = kept["cells"].reshape(zone.cells.shape), 0
        while len(self.zone.breaks.step) < len(node):
            self.zone = arrays.grown(self.zone)
        self.number()
        zone = self.zone
        for name, column in zone.breaks._asdict().items():
            column[: len(node)] = kept[f"break_{name}"]
        stirs = kept["stirs"]
        zone.stirs[: len(stirs)], zone.stirred[stirs] = stirs, True
        zone.number[[BREAKS, STIRS, KNOWN, REGRIDS]] = kept["number"][[BREAKS, STIRS, KNOWN, REGRIDS]]
        if self.ground.varied:
            rows = zone.fine.rows[: zone.number[ROWS]]
            entry = np.where(zone.fine.entry[rows] < 0, -2 - zone.fine.entry[rows], zone.fine.entry[rows])
            for name, array in (("edge", zone.fine.edge), ("own", zone.fine.own)):
                array[entry] = kept[name].reshape(-1, *array.shape[1:])
            zone.fine.entry[rows] = np.where(kept["usual"], -2 - entry, entry)
        for name, nodes, rows in (
            ("fine", zone.fine, zone.number[ROWS]),
            ("coarse", zone.coarse, zone.number[arrays.COARSE_ROWS]),
        ):
            places = (nodes.rows[:rows, None] * ROW + np.arange(ROW)).ravel()
            for field, values in (("u", nodes.u[0]), ("v", nodes.v), ("f", nodes.f)):
                values[:, places] = kept[f"{name}_{field}"].reshape(2, -1)
            nodes.wide[nodes.rows[:rows]] = kept[f"{name}_wide"]
        zone.holds.value[:] = kept["holds"].reshape(zone.holds.value.shape)
        zone.total[:] = kept["total"]

    def bytes(self) -> int:
        """All arrays in full, though what is never touched takes no memory."""
        return sum(array.nbytes for part in (self.zone.fine, self.zone.coarse) for array in part)
