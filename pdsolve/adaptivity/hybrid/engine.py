"""Time integration of a plate with a moving fine zone."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid import arrays
from pdsolve.adaptivity.hybrid.arrays import (
    PRESCRIBED_COLUMNS,
    STORED,
    LatticeConstants,
    LatticeNodes,
    LoadOrPrescribedMotion,
    PlateZone,
)
from pdsolve.adaptivity.hybrid.clipped_bonds import stretch_from_double_green_strain
from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate, count_node_squares_in_cells
from pdsolve.adaptivity.hybrid.energy import store_strain_energies_of_lattices
from pdsolve.adaptivity.hybrid.march import CLIP, DONE, advance
from pdsolve.adaptivity.hybrid.node_constants import are_bonds_intact
from pdsolve.adaptivity.hybrid.swelling import (
    average_fine_values_to_coarse,
    set_all_swelling_offsets,
)
from pdsolve.checkpoint_validation import entry, like, pulls_to_arrays, read_pulls
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import ACCELERATION, Drive
from pdsolve.errors import CheckpointError
from pdsolve.lattice.row_histories import softening_entries
from pdsolve.laws.law import Law
from pdsolve.numerics.thread_team import gate_of, side_by_side
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken
from pdsolve.zone.bond_law import law_of_zone, stretch_that_makes_cells_fine
from pdsolve.zone.cells import COARSE, FAR, FINE, FREE, IDLE, place_on_finer_lattice
from pdsolve.zone.springs import double_green_strain_from_stretch
from pdsolve.zone.summary import ZoneSummary, create_too_late_error

TOGETHER = 2**14  # rows whose motion is added up together
_stretch = getattr(stretch_from_double_green_strain, "py_func", stretch_from_double_green_strain)


class NegativeHalfSwelling(NamedTuple):
    """Minus half the strains of free nodes, as `LatticeNodes.negative_half_swelling` has them."""

    fine: NDArray[np.float64]
    coarse: NDArray[np.float64]


class PrescribedComponents(NamedTuple):
    """Held components of nodes that move now."""

    entries: NDArray[LoadOrPrescribedMotion]  # (k,)
    acceleration: NDArray[np.float64]  # (k,) m/s^2; 0 unless it is prescribed
    mass: NDArray[np.float64]  # (k,) kg/m, of the nodes


class SupportedComponents(NamedTuple):
    """Components of nodes that move now which springs hold to the ground."""

    place: NDArray[np.int64]  # (k,) fine place, or -1 - coarse place
    entries: NDArray[LoadOrPrescribedMotion]  # (k,)
    stiffness: NDArray[np.float64]  # (k,) N/m^2
    displacement: NDArray[np.float64]  # (k,) m


class HybridEngine:
    """A plate in motion; nodes are numbered as on their lattices."""

    def __init__(self, plate: HybridPlate, lattice: LatticeConstants, zone: PlateZone, drive: Drive) -> None:
        """Cells of `zone` are those of the start."""
        self.plate, self.lattice, self.zone, self.drive, self.displacement_buffer_index = plate, lattice, zone, drive, 0
        self._squares = count_node_squares_in_cells(plate)
        self.time_step = float(lattice.dt)  # s
        self._whole, self._fine = int(self._squares.sum()), (-1, 0)  # squares in all cells; in fine ones, since when

    @property
    def law(self) -> Law:
        """The law of fine bonds."""
        return law_of_zone(self.plate.model)

    def initialize_motion_and_forces(self, velocity: NDArray[np.float64] | None) -> None:
        """Number the zone, set the velocities (n, 2), m/s, of all nodes, None: 0, and compute the forces."""
        self.derive_nodes_from_cells()
        if velocity is not None:
            lattices = (
                (self.zone.fine, None),
                (self.zone.coarse, self.fine_places_of_coarse),
                (self.zone.far, self.fine_places_of_coarsest_nodes),
            )
            for nodes, beneath in lattices:
                places_of_free_nodes = np.flatnonzero(nodes.node_kinds == FREE)
                nodes.v[:, places_of_free_nodes] = velocity[
                    self.plate.grid_rows_at(places_of_free_nodes if beneath is None else beneath(places_of_free_nodes))
                ].T
        self.compute_initial_forces()

    def compute_initial_forces(self) -> None:
        """Recompute the forces at the start."""
        self._advance(1, 1)

    def derive_nodes_from_cells(self) -> None:
        """Derive all nodes from the cells, whatever they were before."""
        zone = self.zone
        zone.fine.row_stiffness[: zone.counts.used_stiffness_rows] = 0
        for _, nodes, rows in self._lattices_with_active_rows():
            nodes.stiffness_index_of_row[:] = -1
            nodes.node_kinds.reshape(-1, ROW)[rows] = IDLE
            nodes.inverse_mass.reshape(-1, ROW)[rows] = 0.0
        zone.is_damaged[zone.damaged_nodes[: zone.counts.damaged_nodes]] = False
        zone = self.zone = zone._replace(counts=arrays.ZoneCounts.of())
        self._fine = -1, 0
        cells = np.flatnonzero(zone.cell_kinds == FINE)
        zone.new_cells[: len(cells)] = cells
        zone.counts.new_cells = len(cells)
        self.compute_initial_forces()
        around = arrays.allocate_zeros(len(zone.affected_coarse_nodes), dtype=np.int64)  # all coarse nodes were
        self.zone = self.zone._replace(totals=arrays.EnergyTotals.of(), affected_coarse_nodes=around)

    def fine_places_of_coarse(self, coarse: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine places (k,) that coarse nodes lie on."""
        numbering = self.plate.numbering
        return np.asarray(place_on_finer_lattice(numbering.coarse, numbering.fine, 2, coarse))

    def fine_places_of_coarsest_nodes(self, far: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine places (k,) that far nodes lie on."""
        numbering = self.plate.numbering
        return np.asarray(place_on_finer_lattice(numbering.far, numbering.fine, 4, far))

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1.

        Raises FineZoneTooLateError if a clipped bond exceeds its limit.
        """
        if first_step < end_step:
            self._advance(first_step, end_step)

    def sum_forces_and_break_bonds(self, step: int, dt: float) -> None:
        """Sum the forces of bonds and of springs to the ground; bonds over their limit break in this step.

        `dt` is the time since the last step, s, 0 at rest. Raises FineZoneTooLateError if a clipped bond exceeds its
        limit.
        """
        lattice, counts = self.lattice, self.zone.counts
        loads, holds, lattices = counts.node_loads, counts.prescribed_components, (self.zone.fine, self.zone.coarse)
        slowing = [nodes.damping for nodes in lattices]
        counts.node_loads, counts.prescribed_components, self.lattice = 0, 0, lattice._replace(dt=dt)
        try:
            self._replace_damping(None, None)
            self._advance(step + 1, step + 1)
        finally:
            counts.node_loads, counts.prescribed_components, self.lattice = loads, holds, lattice
            self._replace_damping(*slowing)

    def _replace_damping(self, fine: NDArray[np.float64] | None, coarse: NDArray[np.float64] | None) -> None:
        """Damp the nodes so from now on; see `LatticeNodes.damping`."""
        zone = self.zone
        self.zone = zone._replace(fine=zone.fine._replace(damping=fine), coarse=zone.coarse._replace(damping=coarse))

    def _advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1; if there are none, only finish the previous step."""
        drifted = False
        while True:
            how, step, self.displacement_buffer_index = self._advance_on_threads(first_step, end_step, drifted)
            if how == DONE:
                return
            if how == CLIP:
                raise create_too_late_error(step, self.zone_summary())
            self.zone = arrays.double_array_lengths(self.zone)
            if first_step < end_step:
                first_step, drifted = step, True

    def _advance_on_threads(self, *steps: int) -> tuple[int, int, int]:
        """Run the compiled march on all threads until it ends; returns its end code, step and buffer."""
        threads, end = len(self.zone.lane_sums), (0, 0, 0)
        arguments, barrier = (
            (self.lattice, self.zone, self.drive.profiles, self.displacement_buffer_index, *steps),
            gate_of(threads),
        )

        def work(thread: int) -> None:
            nonlocal end
            end = advance(*arguments, thread, barrier)

        side_by_side(work, threads)
        return end

    def set_refinement_stretch_ratio(self, refinement_stretch_ratio: float) -> None:
        """Refine, from now on, around coarse bonds at this ratio of the stretch that breaks or softens bonds."""
        lattice, bounds = self.lattice, self.lattice.strain_bounds.copy()
        for bound, *ends in zip(bounds, lattice.material_peak_strain, lattice.material_limit_strain, strict=True):
            peak, limit = (_stretch(e) for e in ends)
            stretch = stretch_that_makes_cells_fine(lattice.empty_law_columns, peak, limit, refinement_stretch_ratio)
            bound[2] = double_green_strain_from_stretch(stretch)
        self.lattice = self.lattice._replace(strain_bounds=bounds, least_strain_bounds=bounds.min(axis=0))

    def set_swelling_strain(self, strain: NDArray[np.float64]) -> None:
        """Let springs stretch from their lengths at these strains (n,) of all nodes of the grid, were they free."""
        fine, coarse = self.zone.fine.negative_half_swelling, self.zone.coarse.negative_half_swelling
        assert fine is not None
        assert coarse is not None
        fine[self._fine_places_of_grid] = strain / -2
        average_fine_values_to_coarse(self.lattice, fine, coarse)
        set_all_swelling_offsets(self.lattice, self.zone, self.displacement_buffer_index)

    def strain_energy(self) -> float:
        """Strain energy of all springs, J/m."""
        return float(sum(energies.sum() for energies in self.strain_energies()))

    def copy_negative_half_swelling(self) -> NegativeHalfSwelling:
        """A copy of the strains that springs have."""
        fine, coarse = self.zone.fine.negative_half_swelling, self.zone.coarse.negative_half_swelling
        assert fine is not None
        assert coarse is not None
        return NegativeHalfSwelling(fine.copy(), coarse.copy())

    def strain_energy_at_swelling(self, negative_half_swelling: NegativeHalfSwelling) -> float:
        """Strain energy, J/m, that all springs would have at these strains."""
        now = self.zone
        fine, coarse = (
            now.fine._replace(negative_half_swelling=negative_half_swelling.fine),
            now.coarse._replace(negative_half_swelling=negative_half_swelling.coarse),
        )
        self.zone = now._replace(fine=fine, coarse=coarse)
        set_all_swelling_offsets(self.lattice, self.zone, self.displacement_buffer_index)
        energy = self.strain_energy()
        self.zone = now
        set_all_swelling_offsets(self.lattice, self.zone, self.displacement_buffer_index)
        return energy

    def energy_density_at_unit_stretch(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Energy density (k,), J/m^3, at these rows of the grid, inside of one material whose bonds have stretch 1."""
        lattice = self.lattice
        density = (lattice.material_bond_stiffness / lattice.spring_table[:, 4]).sum(axis=1) / 4 / lattice.spacing**2
        return np.asarray(density[self.plate.model.material_of[rows]])

    def broken_by_grid_rows(self) -> Broken:
        """The broken bonds, by the rows of all nodes of the grid."""
        step, node, spring, *_ = self.break_events()
        neighbour = node + self.lattice.neighbour_offsets[spring]
        return Broken(step.astype(np.int64), self.plate.grid_rows_at(node), self.plate.grid_rows_at(neighbour))

    def add_work(self, work: float) -> None:
        """Book an energy, J/m, as work done on the plate."""
        self.zone.totals.work += work

    @cached_property
    def _fine_places_of_grid(self) -> NDArray[np.int64]:
        """Fine places (n,) of all nodes of the grid."""
        return self.plate.fine_places

    def break_events(self) -> arrays.BreakEvents:
        """Bonds broken so far."""
        return arrays.BreakEvents._make(column[: self.zone.counts.broken_bonds] for column in self.zone.break_events)

    def prescribed_components(self) -> PrescribedComponents:
        """The held components of nodes that move."""
        zone, dt = self.zone, self.time_step
        place, number = zone.holds.node_and_entry[: zone.counts.prescribed_components].T
        entries, is_fine = zone.holds.entries[number], place >= 0
        kick = entries["speed_at_last_step"] - entries["mean_speed_since_last_step"]
        acceleration = np.where(entries["prescribed_kind"] == ACCELERATION, 2 / dt * kick, 0.0)
        mass = np.where(is_fine, zone.fine.mass[place.clip(0)], zone.coarse.mass[(-1 - place).clip(0)])
        return PrescribedComponents(entries, acceleration, mass)

    def replace_forces_on_prescribed_components(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Set the forces (k,), N/m, on the held components of nodes that move; returns those before."""
        zone = self.zone
        place, number = zone.holds.node_and_entry[: zone.counts.prescribed_components].T
        axis, is_fine, before = zone.holds.entries["axis"][number], place >= 0, np.zeros(len(place))
        for nodes, which, at in ((zone.fine, is_fine, place), (zone.coarse, ~is_fine, -1 - place)):
            before[which] = nodes.f[axis[which], at[which]]
            nodes.f[axis[which], at[which]] = force[which]
        return before

    def places_of_damaged_nodes(self) -> NDArray[np.int64]:
        """Fine places (k,) at which a bond has broken or softened, in order."""
        return np.unique(
            np.concatenate([self.break_events().node, self.zone.damaged_nodes[: self.zone.counts.damaged_nodes]])
        )

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone for the run's report."""
        zone, changes = self.zone, int(self.zone.counts.cell_changes)
        if self._fine[0] != changes:
            self._fine = changes, int(self._squares[zone.cell_kinds == FINE].sum())
        fine = self._fine[1] / self._whole
        largest, limit = _stretch(zone.totals.largest_clipped_strain), _stretch(self.lattice.least_strain_bounds[0])
        return ZoneSummary(float(zone.totals.refinement_energy), float(fine), float(largest / limit))

    def _lattices_with_active_rows(self) -> Iterator[tuple[str, LatticeNodes, NDArray[np.int64]]]:
        """Name and nodes of all lattices, and their rows with a node that is not idle."""
        zone = self.zone
        yield "fine", zone.fine, zone.fine.active_rows[: zone.counts.active_fine_rows]
        yield "coarse", zone.coarse, zone.coarse.active_rows[: zone.counts.active_coarse_rows]
        yield "far", zone.far, zone.far.active_rows[: zone.counts.active_coarsest_rows]

    def places_of_free_nodes(self, nodes: LatticeNodes, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Places of the free nodes in these rows of a lattice."""
        places = (rows[:, None] * ROW + np.arange(ROW)).ravel()
        return np.asarray(places[nodes.node_kinds[places] == FREE])

    def strain_energies(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Strain energy of fine, of coarse and of far nodes, by their places, J/m."""
        numbering = self.plate.numbering
        fine, coarse, far = (
            np.zeros(places)
            for places in (numbering.fine.place_count, numbering.coarse.place_count, numbering.far.place_count)
        )
        store_strain_energies_of_lattices(self.lattice, self.zone, self.displacement_buffer_index, fine, coarse, far)
        place, _, stiffness, u = self.supported_components()
        energy, is_fine = stiffness * u**2 / 2, place >= 0
        np.add.at(fine, place[is_fine], energy[is_fine])
        np.add.at(coarse, -1 - place[~is_fine], energy[~is_fine])
        return fine, coarse, far

    def supported_components(self) -> SupportedComponents:
        """The components of nodes that move which springs hold to the ground."""
        zone, now = self.zone, self.displacement_buffer_index
        count = zone.counts.node_supports
        place, number = zone.supports.node_and_entry[:count].T
        entries, fine_u, coarse_u = zone.supports.entries[number], zone.fine.u[now], zone.coarse.u[now]
        axis, stiffness = entries["axis"], zone.supports.node_share[:count] * entries["value"]
        u = np.where(place >= 0, fine_u[axis, place.clip(0)], coarse_u[axis, (-1 - place).clip(0)])
        return SupportedComponents(place, entries, stiffness, u.astype(np.float64))

    def kinetic_energy_and_momentum(self) -> NDArray[np.float64]:
        """Kinetic energy, J/m, and momentum, N s/m."""
        totals = np.zeros(3)
        for _, nodes, rows in self._lattices_with_active_rows():
            for first in range(0, len(rows), TOGETHER):
                places = self.places_of_free_nodes(nodes, rows[first : first + TOGETHER])
                mass, x, y = (np.asarray(column[places], dtype=np.float64) for column in (nodes.mass, *nodes.v))
                totals += (mass / 2 * (x * x + y * y)).sum(), (mass * x).sum(), (mass * y).sum()
        return totals

    @property
    def dissipated_energy_work_and_refinement_energy(self) -> tuple[float, float, float]:
        """Energy dissipated, work done, and energy created by refinement, J/m."""
        totals = self.zone.totals
        return float(totals.dissipated_energy), float(totals.work), float(totals.refinement_energy)

    @property
    def damped_energy(self) -> float:
        """Energy taken by damping so far, J/m."""
        lattices = self.zone.fine, self.zone.coarse
        return sum((float(nodes.damped_energy.sum()) for nodes in lattices if nodes.damped_energy is not None), 0.0)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, from which a run continues bit by bit."""
        zone, broken = self.zone, self.break_events()
        columns = ("break_step", broken.step), ("break_node", broken.node), ("break_spring", broken.bond_number)
        checkpoint: dict[str, NDArray[Any]] = {name: column.copy() for name, column in columns}
        checkpoint |= pulls_to_arrays(broken.step, broken.force_at_break, broken.stretch_growth_at_break)
        for name, nodes, rows in self._lattices_with_active_rows():
            idle = nodes.node_kinds.reshape(-1, ROW)[rows] == IDLE
            for field, values in (("u", nodes.u[self.displacement_buffer_index]), ("v", nodes.v), ("f", nodes.f)):
                row_values = values.reshape(2, -1, ROW)[:, rows]
                row_values[:, idle] = 0.0
                checkpoint[f"{name}_{field}"] = row_values.reshape(2, -1)
            checkpoint[f"{name}_wide"] = nodes.has_large_stretch[rows]
            if nodes.damped_energy is not None:
                slowed = np.flatnonzero(nodes.damped_energy)
                checkpoint |= {f"{name}_slowed": slowed, f"{name}_damped": nodes.damped_energy[slowed]}
        if self.lattice.softens_or_limits_vary:
            entries = zone.fine.stiffness_index_of_row[zone.fine.active_rows[: zone.counts.active_fine_rows]]
            stiffness_rows = np.where(entries < 0, -2 - entries, entries)
            checkpoint |= {
                "edge": zone.fine.threshold_strain[stiffness_rows],
                "own": zone.fine.row_stiffness[stiffness_rows],
                "usual": entries < 0,
            }
            if zone.history is not None:
                checkpoint["remembered"] = softening_entries(zone.history)[stiffness_rows]
        stirs = zone.damaged_nodes[: zone.counts.damaged_nodes].copy()
        checkpoint |= {
            "holds": _prescribed_motion_columns(zone),
            "stirs": stirs,
            "spent": zone.node_dissipation[self.places_of_damaged_nodes()],
        }
        number = zone.counts.values()[:STORED]  # the others say where rows are, and what changed last
        return checkpoint | {"cells": zone.cell_kinds.copy(), "total": zone.totals.values(), "number": number}

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        zone, breaks, cells = (
            self.zone,
            self._read_checkpoint_breaks(checkpoint),
            like(checkpoint, "cells", self.zone.cell_kinds),
        )
        self._check_checkpoint_cells(cells)
        node, lost, (_, before, before_spring, _, _) = breaks.node, zone.broken_bond_bits, self.break_events()
        for k in range(
            len(self.lattice.neighbour_offsets) // 2
        ):  # exactly these are broken, besides those missing at the start
            bit = np.uint64(1) << np.uint64(k)
            lost[before[before_spring == k]] &= ~bit
            lost[node[breaks.bond_number == k]] |= bit
        for _, nodes, rows in self._lattices_with_active_rows():
            for array in nodes[:3]:
                array.reshape(-1, array.shape[-1] // ROW, ROW)[:, rows] = 0
        zone.cell_kinds[:], self.displacement_buffer_index = cells, 0
        while len(self.zone.break_events.step) < len(node):
            self.zone = arrays.double_array_lengths(self.zone)
        self.derive_nodes_from_cells()
        zone = self.zone
        for name, values in breaks._asdict().items():
            getattr(zone.break_events, name)[: len(node)] = values
        self._restore_counts_and_damaged_nodes(checkpoint, node, breaks.bond_number)
        if self.lattice.softens_or_limits_vary:
            _restore_stiffnesses_and_histories(checkpoint, zone)
        for name, nodes, rows in self._lattices_with_active_rows():
            places = (rows[:, None] * ROW + np.arange(ROW)).ravel()
            for field, values in (("u", nodes.u[0]), ("v", nodes.v), ("f", nodes.f)):
                values[:, places] = entry(checkpoint, f"{name}_{field}", (2, len(places)), values.dtype)
            nodes.has_large_stretch[rows] = entry(checkpoint, f"{name}_wide", rows.shape, np.uint8)
        for name, column in zip(
            PRESCRIBED_COLUMNS, like(checkpoint, "holds", _prescribed_motion_columns(zone)).T, strict=True
        ):
            zone.holds.entries[name] = column
        _restore_damped_energies(checkpoint, zone)
        self.zone = zone._replace(totals=arrays.EnergyTotals.of(like(checkpoint, "total", zone.totals.values())))

    def _check_checkpoint_cells(self, cells: NDArray[np.uint8]) -> None:
        """Raise CheckpointError for cells (c,) that those of the start do not become."""
        start = self.zone.cell_kinds
        may = (start == COARSE) & (cells == FINE)
        may |= (start == FAR) & ((cells == COARSE) | (cells == FINE))
        if not ((cells == start) | may).all():
            raise CheckpointError("cells are not those of the start; coarse ones may only become fine")

    def _read_checkpoint_breaks(self, checkpoint: CheckpointArrays) -> arrays.BreakEvents:
        """Broken bonds of a checkpoint, checked to exist at the start and to have broken once in each direction."""
        lattice, plate = self.lattice, self.plate
        step = entry(checkpoint, "break_step", (None,), np.int32, 1)
        node = entry(checkpoint, "break_node", step.shape, np.int64, 0, plate.numbering.fine.place_count - 1)
        spring = entry(checkpoint, "break_spring", step.shape, np.int32, 0, len(lattice.neighbour_offsets) - 1)
        target, half = node + lattice.neighbour_offsets[spring], len(lattice.neighbour_offsets) // 2
        inside = (target >= 0) & (target < plate.numbering.fine.place_count)
        inside &= plate.has_node(node) & plate.has_node(target.clip(0, plate.numbering.fine.place_count - 1))
        owner = np.where(spring < half, node, target.clip(0, plate.numbering.fine.place_count - 1))
        intact = are_bonds_intact(lattice.node_constants, self.zone.broken_bond_bits, owner, spring % half)
        if not (inside & intact).all() or len(np.unique(node * 2 * half + spring)) < len(node):
            raise CheckpointError("a broken bond is none of the plate, or there twice")
        return arrays.BreakEvents(step, node, spring, *read_pulls(checkpoint, len(step)))

    def _restore_counts_and_damaged_nodes(
        self, checkpoint: CheckpointArrays, node: NDArray[np.int64], spring: NDArray[np.int32]
    ) -> None:
        """Restore the counts of a checkpoint with these broken bonds, and the nodes with softened or broken bonds."""
        zone, numbers = self.zone, entry(checkpoint, "number", (None,), np.int64)
        if len(numbers) < STORED:
            raise CheckpointError(f"'number' has {len(numbers)} values; it needs {STORED} at least")
        past = arrays.ZoneCounts.of(numbers[:STORED])
        stirs = entry(checkpoint, "stirs", (None,), np.int64, 0, len(zone.damaged_nodes) - 1)
        fine = zone.fine.node_kinds
        others = (past.broken_bonds, past.damaged_nodes) != (len(node), len(stirs))
        if others or not 0 <= past.refined_damaged_nodes <= len(stirs):
            raise CheckpointError(f"'number' has other counts; there are {len(node)} bonds and {len(stirs)} nodes")
        if len(np.unique(stirs)) < len(stirs) or (fine[stirs] == IDLE).any():
            raise CheckpointError("stirred nodes are there twice, or are not fine")
        has_idle_end = (fine[node] == IDLE) | (fine[node + self.lattice.neighbour_offsets[spring]] == IDLE)
        if has_idle_end.any():
            raise CheckpointError("a broken bond is of a node that is not fine")
        zone.damaged_nodes[: len(stirs)], zone.is_damaged[stirs] = stirs, True
        zone.node_dissipation[:] = 0.0
        zone.counts.broken_bonds, zone.counts.damaged_nodes = past.broken_bonds, past.damaged_nodes
        zone.counts.refined_damaged_nodes, zone.counts.cell_changes = past.refined_damaged_nodes, past.cell_changes
        spenders = self.places_of_damaged_nodes()
        zone.node_dissipation[spenders] = entry(checkpoint, "spent", spenders.shape, float)

    def bytes(self) -> int:
        """Memory of all arrays, bytes; untouched parts take none in practice."""
        lattices = self.zone.fine, self.zone.coarse, self.zone.far
        return sum(array.nbytes for part in lattices for array in part if array is not None)


def _prescribed_motion_columns(zone: PlateZone) -> NDArray[np.float64]:
    """Values, velocities and forces (e, 4) of all held components, as checkpoints have them."""
    return np.column_stack([zone.holds.entries[name] for name in PRESCRIBED_COLUMNS])


def _restore_damped_energies(checkpoint: CheckpointArrays, zone: PlateZone) -> None:
    """Restore the energies that damping has taken from nodes."""
    for name, damped in (("fine", zone.fine.damped_energy), ("coarse", zone.coarse.damped_energy)):
        if damped is not None:
            slowed = entry(checkpoint, f"{name}_slowed", (None,), np.int64, 0, len(damped) - 1)
            damped[:] = 0.0
            damped[slowed] = entry(checkpoint, f"{name}_damped", slowed.shape, float)


def _restore_stiffnesses_and_histories(checkpoint: CheckpointArrays, zone: PlateZone) -> None:
    """Restore the stiffnesses of fine bonds, and what softening has left of them."""
    rows = zone.fine.active_rows[: zone.counts.active_fine_rows]
    stiffness_rows = np.where(
        zone.fine.stiffness_index_of_row[rows] < 0,
        -2 - zone.fine.stiffness_index_of_row[rows],
        zone.fine.stiffness_index_of_row[rows],
    )
    for name, array in (("edge", zone.fine.threshold_strain), ("own", zone.fine.row_stiffness)):
        array[stiffness_rows] = entry(
            checkpoint, name, (len(stiffness_rows), *array.shape[1:]), array.dtype, high=np.inf
        )
    if zone.history is not None:
        values, shape = softening_entries(zone.history), (len(stiffness_rows), *array.shape[1:])
        values[stiffness_rows] = entry(checkpoint, "remembered", shape, values.dtype, 0.0)
    zone.fine.stiffness_index_of_row[rows] = np.where(
        entry(checkpoint, "usual", stiffness_rows.shape, np.bool_), -2 - stiffness_rows, stiffness_rows
    )
