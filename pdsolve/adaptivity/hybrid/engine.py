"""Time integration of a plate with a moving fine zone."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid import arrays
from pdsolve.adaptivity.hybrid.arrays import HOLD_COLUMNS, STORED, LatticeConstants, LatticeNodes, PlateZone
from pdsolve.adaptivity.hybrid.clipped_bonds import stretch_from_e
from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate, count_squares_in_cells
from pdsolve.adaptivity.hybrid.energy import fill_strain_energies
from pdsolve.adaptivity.hybrid.lattice import BELOW, BELOW_COARSE, COARSE, FAR, FINE, FREE, IDLE, LEFT
from pdsolve.adaptivity.hybrid.march import CLIP, DONE, advance
from pdsolve.adaptivity.hybrid.node_rows import are_bonds_intact
from pdsolve.adaptivity.hybrid.springs import e_from_stretch
from pdsolve.adaptivity.hybrid.swelling import average_to_coarse, set_swelling_offsets, total_strain_energy
from pdsolve.checkpoint_validation import entry, like
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive
from pdsolve.errors import CheckpointError, LateZoneError
from pdsolve.numerics.thread_team import gate_of, side_by_side
from pdsolve.operators.pending_pulls import pulls_to_arrays, read_pulls
from pdsolve.operators.protocol import CheckpointArrays

TOGETHER = 2**14  # rows whose motion is added up together
_stretch = getattr(stretch_from_e, "py_func", stretch_from_e)


class ZoneSummary(NamedTuple):
    """Summary of the fine zone for a run's report."""

    refinement: float  # J/m: energy that refining has made so far
    fine_share: float  # of the plate
    clipped_stretch: float  # the largest of clipped bonds so far, over that which softens or breaks one


class FreeStrains(NamedTuple):
    """Minus half the strains of free nodes, as `LatticeNodes.half_shrinkage` has them."""

    fine: NDArray[np.float64]
    coarse: NDArray[np.float64]


class HybridEngine:
    """A plate in motion; nodes are numbered as on their lattices."""

    def __init__(self, plate: HybridPlate, lattice: LatticeConstants, zone: PlateZone, drive: Drive) -> None:
        """Cells of `zone` are those of the start."""
        self.plate, self.lattice, self.zone, self.drive, self.buffer = plate, lattice, zone, drive, 0
        self._squares = count_squares_in_cells(plate)
        self._whole, self._fine = int(self._squares.sum()), (-1, 0)  # squares in all cells; in fine ones, since when

    def start(self, velocity: NDArray[np.float64] | None) -> None:
        """Number the zone, set the velocities (n, 2), m/s, of all nodes, None: 0, and compute the forces."""
        self.derive_nodes_from_cells()
        if velocity is not None:
            lattices = (
                (self.zone.fine, None),
                (self.zone.coarse, self.fine_places_of_coarse),
                (self.zone.far, self.fine_places_of_far),
            )
            for nodes, beneath in lattices:
                free_places = np.flatnonzero(nodes.kind == FREE)
                nodes.v[:, free_places] = velocity[
                    self.plate.grid_rows_at(free_places if beneath is None else beneath(free_places))
                ].T
        self.recompute_forces()

    def recompute_forces(self) -> None:
        """Recompute the forces at the start."""
        self._advance(1, 1)

    def derive_nodes_from_cells(self) -> None:
        """Derive all nodes from the cells, whatever they were before."""
        zone = self.zone
        zone.fine.row_stiffness[: zone.counts.stiffness_rows] = 0
        for _, nodes, rows in self._lattice_nodes_and_rows():
            nodes.stiffness_index[:] = -1
            nodes.kind.reshape(-1, ROW)[rows] = IDLE
            nodes.inverse_mass.reshape(-1, ROW)[rows] = 0.0
        zone.is_damaged[zone.damaged_nodes[: zone.counts.damaged_nodes]] = False
        zone = self.zone = zone._replace(counts=arrays.Counts.of())
        self._fine = -1, 0
        cells = np.flatnonzero(zone.cells == FINE)
        zone.new_cells[: len(cells)] = cells
        zone.counts.new_cells = len(cells)
        self.recompute_forces()
        around = arrays.lazy_zeros(len(zone.affected_coarse), dtype=np.int64)  # all coarse nodes were
        self.zone = self.zone._replace(totals=arrays.Totals.of(), affected_coarse=around)

    def fine_places_of_coarse(self, coarse: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine places (k,) that coarse nodes lie on."""
        numbering = self.plate.numbering
        y, x = np.divmod(coarse, numbering.coarse_stride)
        return np.asarray((2 * (y - BELOW_COARSE) + BELOW) * numbering.stride + LEFT + 2 * (x - LEFT))

    def fine_places_of_far(self, far: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine places (k,) that far nodes lie on."""
        numbering = self.plate.numbering
        y, x = np.divmod(far, numbering.far_stride)
        return np.asarray((4 * (y - BELOW_COARSE) + BELOW) * numbering.stride + LEFT + 4 * (x - LEFT))

    def advance(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1. Raises LateZoneError if a clipped bond exceeds its limit."""
        if first < last:
            self._advance(first, last)

    def sum_forces(self, step: int, dt: float) -> None:
        """Sum the forces at the current displacements, of bonds alone; bonds over their limit break in this step.

        `dt` is the time since the last step, s, 0 at rest. Raises LateZoneError if a clipped bond exceeds its limit.
        """
        lattice, counts = self.lattice, self.zone.counts
        loads, holds, lattices = counts.loads, counts.holds, (self.zone.fine, self.zone.coarse)
        slowing = [nodes.damping for nodes in lattices]
        counts.loads, counts.holds, self.lattice = 0, 0, lattice._replace(dt=dt)
        try:
            self._set_damping(None, None)
            self._advance(step + 1, step + 1)
        finally:
            counts.loads, counts.holds, self.lattice = loads, holds, lattice
            self._set_damping(*slowing)

    def _set_damping(self, fine: NDArray[np.float64] | None, coarse: NDArray[np.float64] | None) -> None:
        """Damp the nodes so from now on; see `LatticeNodes.damping`."""
        zone = self.zone
        self.zone = zone._replace(fine=zone.fine._replace(damping=fine), coarse=zone.coarse._replace(damping=coarse))

    def _advance(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1; with `last` = `first`, only finish the previous step."""
        drifted = False
        while True:
            how, step, self.buffer = self._advance_on_threads(first, last, drifted)
            if how == DONE:
                return
            if how == CLIP:
                raise LateZoneError(
                    f"step {step}: the fine zone was refined too late (stretch at its border:"
                    f" {self.zone_summary().clipped_stretch:.2f} of critical)",
                    step,
                )
            self.zone = arrays.enlarge_zone(self.zone)
            if first < last:
                first, drifted = step, True

    def _advance_on_threads(self, *steps: int) -> tuple[int, int, int]:
        """Run the compiled march on all threads until it ends; returns its end code, step and buffer."""
        threads, end = len(self.zone.lane_sums), (0, 0, 0)
        arguments, gate = (self.lattice, self.zone, self.drive.profiles, self.buffer, *steps), gate_of(threads)

        def work(thread: int) -> None:
            nonlocal end
            end = advance(*arguments, thread, gate)

        side_by_side(work, threads)
        return end

    def set_kappa(self, kappa: float) -> None:
        """Make cells fine from now on around coarse bonds at `kappa` of the stretch that breaks or softens bonds."""
        bounds = self.lattice.e_bounds.copy()
        bounds[:, 2] = [e_from_stretch(kappa * _stretch(e)) for e in bounds[:, 0].tolist()]
        self.lattice = self.lattice._replace(e_bounds=bounds, least_e_bounds=bounds.min(axis=0))

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let springs stretch from their lengths at these strains (n,) of all nodes of the grid, were they free."""
        fine, coarse = self.zone.fine.half_shrinkage, self.zone.coarse.half_shrinkage
        assert fine is not None
        assert coarse is not None
        fine[self._places] = strain / -2
        average_to_coarse(self.lattice, fine, coarse)
        set_swelling_offsets(self.lattice, self.zone, self.buffer)

    def strain_energy(self) -> float:
        """Strain energy of all springs, J/m."""
        return float(total_strain_energy(self.lattice, self.zone, self.buffer))

    def copy_free_strains(self) -> FreeStrains:
        """A copy of the strains that springs have."""
        fine, coarse = self.zone.fine.half_shrinkage, self.zone.coarse.half_shrinkage
        assert fine is not None
        assert coarse is not None
        return FreeStrains(fine.copy(), coarse.copy())

    def strain_energy_at_free_strains(self, strains: FreeStrains) -> float:
        """Strain energy, J/m, that all springs would have at these strains."""
        now = self.zone
        fine, coarse = (
            now.fine._replace(half_shrinkage=strains.fine),
            now.coarse._replace(half_shrinkage=strains.coarse),
        )
        self.zone = now._replace(fine=fine, coarse=coarse)
        set_swelling_offsets(self.lattice, self.zone, self.buffer)
        energy = self.strain_energy()
        self.zone = now
        set_swelling_offsets(self.lattice, self.zone, self.buffer)
        return energy

    def book_work(self, work: float) -> None:
        """Book an energy, J/m, as work done on the plate."""
        self.zone.totals.work += work

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        """Fine places (n,) of all nodes of the grid."""
        return self.plate.fine_places

    def broken(self) -> arrays.BreakEvents:
        """Bonds broken so far."""
        return arrays.BreakEvents._make(column[: self.zone.counts.broken_bonds] for column in self.zone.breaks)

    def places_of_dissipation(self) -> NDArray[np.int64]:
        """Fine places (k,) at which a bond has broken or softened, in order."""
        return np.unique(
            np.concatenate([self.broken().node, self.zone.damaged_nodes[: self.zone.counts.damaged_nodes]])
        )

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone for the run's report."""
        zone, changes = self.zone, int(self.zone.counts.cell_changes)
        if self._fine[0] != changes:
            self._fine = changes, int(self._squares[zone.cells == FINE].sum())
        fine = self._fine[1] / self._whole
        largest, limit = _stretch(zone.totals.largest_e), _stretch(self.lattice.least_e_bounds[0])
        return ZoneSummary(float(zone.totals.refinement), float(fine), float(largest / limit))

    def _lattice_nodes_and_rows(self) -> Iterator[tuple[str, LatticeNodes, NDArray[np.int64]]]:
        """Name and nodes of all lattices, and their rows with a node that is not idle."""
        zone = self.zone
        yield "fine", zone.fine, zone.fine.rows[: zone.counts.fine_rows]
        yield "coarse", zone.coarse, zone.coarse.rows[: zone.counts.coarse_rows]
        yield "far", zone.far, zone.far.rows[: zone.counts.far_rows]

    def free_places(self, nodes: LatticeNodes, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Places of the free nodes in these rows of a lattice."""
        places = (rows[:, None] * ROW + np.arange(ROW)).ravel()
        return np.asarray(places[nodes.kind[places] == FREE])

    def strain_energies(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Strain energy of fine, of coarse and of far nodes, by their places, J/m."""
        numbering = self.plate.numbering
        fine, coarse, far = (
            np.zeros(places) for places in (numbering.places, numbering.coarse_places, numbering.far_places)
        )
        fill_strain_energies(self.lattice, self.zone, self.buffer, fine, coarse, far)
        return fine, coarse, far

    def kinetic_and_momentum(self) -> NDArray[np.float64]:
        """Kinetic energy, J/m, and momentum, N s/m."""
        totals = np.zeros(3)
        for _, nodes, rows in self._lattice_nodes_and_rows():
            for first in range(0, len(rows), TOGETHER):
                places = self.free_places(nodes, rows[first : first + TOGETHER])
                mass, x, y = (np.asarray(column[places], dtype=np.float64) for column in (nodes.mass, *nodes.v))
                totals += (mass / 2 * (x * x + y * y)).sum(), (mass * x).sum(), (mass * y).sum()
        return totals

    @property
    def energy_totals(self) -> tuple[float, float, float]:
        """Energy dissipated, work done, and energy created by refinement, J/m."""
        totals = self.zone.totals
        return float(totals.dissipated), float(totals.work), float(totals.refinement)

    @property
    def damped(self) -> float:
        """Energy taken by damping so far, J/m."""
        lattices = self.zone.fine, self.zone.coarse
        return sum((float(nodes.damped.sum()) for nodes in lattices if nodes.damped is not None), 0.0)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, from which a run continues bit by bit."""
        zone, broken = self.zone, self.broken()
        checkpoint = {f"break_{name}": column.copy() for name, column in broken._asdict().items()}
        checkpoint |= pulls_to_arrays(broken.step, broken.pull, broken.growth)
        for name, nodes, rows in self._lattice_nodes_and_rows():
            idle = nodes.kind.reshape(-1, ROW)[rows] == IDLE
            for field, values in (("u", nodes.u[self.buffer]), ("v", nodes.v), ("f", nodes.f)):
                row_values = values.reshape(2, -1, ROW)[:, rows]
                row_values[:, idle] = 0.0
                checkpoint[f"{name}_{field}"] = row_values.reshape(2, -1)
            checkpoint[f"{name}_wide"] = nodes.has_large_stretch[rows]
            if nodes.damped is not None:
                slowed = np.flatnonzero(nodes.damped)
                checkpoint |= {f"{name}_slowed": slowed, f"{name}_damped": nodes.damped[slowed]}
        if self.lattice.limits_vary:
            entries = zone.fine.stiffness_index[zone.fine.rows[: zone.counts.fine_rows]]
            stiffness_rows = np.where(entries < 0, -2 - entries, entries)
            checkpoint |= {
                "edge": zone.fine.threshold_e[stiffness_rows],
                "own": zone.fine.row_stiffness[stiffness_rows],
                "usual": entries < 0,
            }
        stirs = zone.damaged_nodes[: zone.counts.damaged_nodes].copy()
        checkpoint |= {
            "holds": _held_component_columns(zone),
            "stirs": stirs,
            "spent": zone.node_dissipation[self.places_of_dissipation()],
        }
        number = zone.counts.values()[:STORED]  # the others say where rows are, and what changed last
        return checkpoint | {"cells": zone.cells.copy(), "total": zone.totals.values(), "number": number}

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        zone, breaks, cells = self.zone, self._checkpoint_breaks(checkpoint), like(checkpoint, "cells", self.zone.cells)
        self._check_checkpoint_cells(cells)
        node, lost, (_, before, before_spring, _, _) = breaks.node, zone.broken_bits, self.broken()
        for k in range(len(self.lattice.offsets) // 2):  # exactly these are broken, besides those missing at the start
            bit = np.uint64(1) << np.uint64(k)
            lost[before[before_spring == k]] &= ~bit
            lost[node[breaks.spring == k]] |= bit
        for _, nodes, rows in self._lattice_nodes_and_rows():
            for array in nodes[:3]:
                array.reshape(-1, array.shape[-1] // ROW, ROW)[:, rows] = 0
        zone.cells[:], self.buffer = cells, 0
        while len(self.zone.breaks.step) < len(node):
            self.zone = arrays.enlarge_zone(self.zone)
        self.derive_nodes_from_cells()
        zone = self.zone
        for name, column in zone.breaks._asdict().items():
            column[: len(node)] = breaks._asdict()[name]
        self._restore_counts(checkpoint, node, breaks.spring)
        if self.lattice.limits_vary:
            rows = zone.fine.rows[: zone.counts.fine_rows]
            stiffness_rows = np.where(
                zone.fine.stiffness_index[rows] < 0,
                -2 - zone.fine.stiffness_index[rows],
                zone.fine.stiffness_index[rows],
            )
            for name, array in (("edge", zone.fine.threshold_e), ("own", zone.fine.row_stiffness)):
                array[stiffness_rows] = entry(
                    checkpoint, name, (len(stiffness_rows), *array.shape[1:]), array.dtype, high=np.inf
                )
            zone.fine.stiffness_index[rows] = np.where(
                entry(checkpoint, "usual", stiffness_rows.shape, np.bool_), -2 - stiffness_rows, stiffness_rows
            )
        for name, nodes, rows in self._lattice_nodes_and_rows():
            places = (rows[:, None] * ROW + np.arange(ROW)).ravel()
            for field, values in (("u", nodes.u[0]), ("v", nodes.v), ("f", nodes.f)):
                values[:, places] = entry(checkpoint, f"{name}_{field}", (2, len(places)), values.dtype)
            nodes.has_large_stretch[rows] = entry(checkpoint, f"{name}_wide", rows.shape, np.uint8)
        _restore_holds(checkpoint, zone)
        _restore_damped_energies(checkpoint, zone)
        self.zone = zone._replace(totals=arrays.Totals.of(like(checkpoint, "total", zone.totals.values())))

    def _check_checkpoint_cells(self, cells: NDArray[np.uint8]) -> None:
        """Raise CheckpointError for cells (c,) that those of the start do not become."""
        start = self.zone.cells
        may = (start == COARSE) & (cells == FINE)
        may |= (start == FAR) & ((cells == COARSE) | (cells == FINE))
        if not ((cells == start) | may).all():
            raise CheckpointError("cells are not those of the start; coarse ones may only become fine")

    def _checkpoint_breaks(self, checkpoint: CheckpointArrays) -> arrays.BreakEvents:
        """Broken bonds of a checkpoint, checked to exist at the start and to have broken once in each direction."""
        lattice, plate = self.lattice, self.plate
        step = entry(checkpoint, "break_step", (None,), np.int32, 1)
        node = entry(checkpoint, "break_node", step.shape, np.int64, 0, plate.numbering.places - 1)
        spring = entry(checkpoint, "break_spring", step.shape, np.int32, 0, len(lattice.offsets) - 1)
        target, half = node + lattice.offsets[spring], len(lattice.offsets) // 2
        inside = (target >= 0) & (target < plate.numbering.places)
        inside &= plate.has_node(node) & plate.has_node(target.clip(0, plate.numbering.places - 1))
        owner = np.where(spring < half, node, target.clip(0, plate.numbering.places - 1))
        intact = are_bonds_intact(lattice.node_rows, self.zone.broken_bits, owner, spring % half)
        if not (inside & intact).all() or len(np.unique(node * 2 * half + spring)) < len(node):
            raise CheckpointError("a broken bond is none of the plate, or there twice")
        return arrays.BreakEvents(step, node, spring, *read_pulls(checkpoint, len(step)))

    def _restore_counts(self, checkpoint: CheckpointArrays, node: NDArray[np.int64], spring: NDArray[np.int32]) -> None:
        """Restore the counts of a checkpoint with these broken bonds, and the nodes with softened or broken bonds."""
        zone, numbers = self.zone, entry(checkpoint, "number", (None,), np.int64)
        if len(numbers) < STORED:
            raise CheckpointError(f"'number' has {len(numbers)} values; it needs {STORED} at least")
        past = arrays.Counts.of(numbers[:STORED])
        stirs = entry(checkpoint, "stirs", (None,), np.int64, 0, len(zone.damaged_nodes) - 1)
        fine = zone.fine.kind
        others = (past.broken_bonds, past.damaged_nodes) != (len(node), len(stirs))
        if others or not 0 <= past.refined_damaged_nodes <= len(stirs):
            raise CheckpointError(f"'number' has other counts; there are {len(node)} bonds and {len(stirs)} nodes")
        if len(np.unique(stirs)) < len(stirs) or (fine[stirs] == IDLE).any():
            raise CheckpointError("stirred nodes are there twice, or are not fine")
        has_idle_end = (fine[node] == IDLE) | (fine[node + self.lattice.offsets[spring]] == IDLE)
        if has_idle_end.any():
            raise CheckpointError("a broken bond is of a node that is not fine")
        zone.damaged_nodes[: len(stirs)], zone.is_damaged[stirs] = stirs, True
        zone.node_dissipation[:] = 0.0
        zone.counts.broken_bonds, zone.counts.damaged_nodes = past.broken_bonds, past.damaged_nodes
        zone.counts.refined_damaged_nodes, zone.counts.cell_changes = past.refined_damaged_nodes, past.cell_changes
        spenders = self.places_of_dissipation()
        zone.node_dissipation[spenders] = entry(checkpoint, "spent", spenders.shape, float)

    def bytes(self) -> int:
        """Memory of all arrays, bytes; untouched parts take none in practice."""
        lattices = self.zone.fine, self.zone.coarse, self.zone.far
        return sum(array.nbytes for part in lattices for array in part if array is not None)


def _held_component_columns(zone: PlateZone) -> NDArray[np.float64]:
    """Values, velocities and forces (e, 4) of all held components, as checkpoints have them."""
    return np.column_stack([zone.holds.entries[name] for name in HOLD_COLUMNS])


def _restore_holds(checkpoint: CheckpointArrays, zone: PlateZone) -> None:
    """Restore values, velocities and forces of all held components."""
    for name, column in zip(HOLD_COLUMNS, like(checkpoint, "holds", _held_component_columns(zone)).T, strict=True):
        zone.holds.entries[name] = column


def _restore_damped_energies(checkpoint: CheckpointArrays, zone: PlateZone) -> None:
    """Restore the energies that damping has taken from nodes."""
    for name, damped in (("fine", zone.fine.damped), ("coarse", zone.coarse.damped)):
        if damped is not None:
            slowed = entry(checkpoint, f"{name}_slowed", (None,), np.int64, 0, len(damped) - 1)
            damped[:] = 0.0
            damped[slowed] = entry(checkpoint, f"{name}_damped", slowed.shape, float)
