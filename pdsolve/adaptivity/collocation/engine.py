"""Time integration of a plate with fine and coarse nodes."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.collocation.forces import (
    add_force_densities,
    break_stretched_bonds,
    interpolate_fictitious_nodes,
    mark_stretched_coarse_pairs,
    store_strain_energy_densities,
    sum_coarse_forces,
    sum_forces_of_fine_rows,
)
from pdsolve.adaptivity.collocation.layout import CollocationPlate, LatticeConstants, mark_bonds_cut
from pdsolve.adaptivity.collocation.row_stiffness import UNCORRECTED, WHOLE
from pdsolve.adaptivity.collocation.zone import (
    COARSE,
    FINE,
    EnergyTotals,
    ZoneCounts,
    areas_of_active_nodes,
    create_collocation_zone,
    interpolate_motion_between_coarse_nodes,
    mask_coarse_nodes_after_refinement,
    mask_nodes_near_border,
    zone_with_active_coarse_nodes,
)
from pdsolve.adaptivity.hybrid.arrays import BreakEvents
from pdsolve.checkpoint_validation import entry, like, pulls_to_arrays, read_pulls
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.numerics.memory import aligned
from pdsolve.numerics.thread_team import share
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import State
from pdsolve.steppers.verlet import Verlet
from pdsolve.zone.summary import ZoneSummary


class CollocationSettings(NamedTuple):
    """Settings of the collocation method: where it refines, how it damps, and its number of threads."""

    refinement_stretch_ratio: float  # share of what breaks a bond at which a coarse pair becomes fine
    border_damping: float  # 1/s, damping of nodes within a horizon of the seam
    steps_between_checks: int  # steps between two looks
    threads: int


class CollocationEngine:
    """A plate in motion; nodes are numbered as on their lattice."""

    def __init__(
        self,
        plate: CollocationPlate,
        lattice: LatticeConstants,
        is_active: NDArray[np.bool_],
        drive: Drive,
        settings: CollocationSettings,
    ) -> None:
        """`is_active` (places,) are the active coarse nodes at the start; entries of `drive` refer to places."""
        self.plate, self.lattice, self.drive, self.settings = plate, lattice, drive, settings
        self.time_step = float(lattice.dt)  # s
        motion, rho = aligned(np.zeros((3, 2, len(is_active)))), np.full(len(is_active), lattice.rho)
        self.state = State(*(field.T for field in motion), *np.zeros((3, len(rho))))  # by places
        self.zone, self.damping = create_collocation_zone(plate, self.state), np.zeros(len(rho))
        self.set_active_coarse_nodes(is_active)
        self._verlet = Verlet(self, drive, rho, lattice.dt, self.damping, active_rows=lambda: self.active_places)
        self.sum_forces_and_break_bonds(0, 0.0)  # compiles before the clock runs

    def set_initial_motion(self, velocity: NDArray[np.float64]) -> None:
        """Set the velocities (n, 2), m/s, of all nodes, and the accelerations of an undeformed plate."""
        places = self.active_places
        self.state.rate[places] = velocity[self.plate.grid_row_at_place[places]]
        self.state.second[:] = self.drive.force / self.lattice.rho - self.damping[:, None] * self.state.rate
        self.state.second[self.drive.holds.node, self.drive.holds.axis] = 0.0

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises UnstableError if a coarse pair exceeds its limit."""
        self._verlet.advance(self.state, first_step, end_step)

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (places, 2), N/m^3, to `out`; bonds over their limit break, and nodes become fine
        where this is due.

        Raises UnstableError if a coarse pair exceeds its limit.
        """
        if step % self.settings.steps_between_checks == 0:
            interpolate_fictitious_nodes(self.zone)
            if mark_stretched_coarse_pairs(self.lattice, self.zone, self.settings.refinement_stretch_ratio):
                self._refine_or_raise_if_over_limit(step)
        while self._sum_forces_and_break_bonds(step, dt):
            self._refine_or_raise_if_over_limit(step)
        sum_coarse_forces(self.lattice, self.zone)
        add_force_densities(self.zone.f, self.active_places, out)

    def sum_forces_and_break_bonds(self, step: int, dt: float) -> None:
        """Sum the forces at the current displacements, without loads; bonds over their limit break in this step.

        `dt` is the time since the last step, s, 0 at rest. Nodes to refine are only noted; `refine_nodes_if_any_marked`
        refines them.
        """
        self._sum_forces_and_break_bonds(step, dt)
        sum_coarse_forces(self.lattice, self.zone)

    def _sum_forces_and_break_bonds(self, step: int, dt: float) -> bool:
        """Sum the forces of bonds; those over their limit break. Whether fine nodes are needed at their ends."""
        lattice, zone, lanes = self.lattice, self.zone, ROW * len(self.zone.rows_with_fine_nodes)
        interpolate_fictitious_nodes(zone)
        sum_rows = partial(sum_forces_of_fine_rows, lattice, zone)
        share(lambda first, last: sum_rows(first // ROW, last // ROW), lanes, self.settings.threads)
        may_break = int(np.count_nonzero(zone.has_bond_over_limit)) * ROW * len(lattice.neighbour_offsets)
        self._enlarge_break_arrays(zone.counts.broken_bonds + may_break)
        return bool(break_stretched_bonds(lattice, self.zone, step, dt))

    def refine_nodes_if_any_marked(self) -> None:
        """Refine the nodes noted as wanted."""
        if self.zone.is_to_refine.any():
            self._refine_marked_nodes()

    def _refine_or_raise_if_over_limit(self, step: int) -> None:
        """Refine the nodes noted as wanted, unless a coarse pair has exceeded its limit already."""
        largest = self.zone_summary().clipped_stretch
        if largest > 1:
            raise UnstableError(
                f"step {step}: the fine zone was refined too late (stretch of coarse pairs: {largest:.2f} of"
                " critical); use a smaller run.collocation.kappa or time step"
            )
        self._refine_marked_nodes()

    def _enlarge_break_arrays(self, bonds: int) -> None:
        """Enlarge the arrays of broken bonds if they have no room for so many."""
        events, room = self.zone.break_events, len(self.zone.break_events.step)
        if bonds > room:
            more = max(room, bonds - room)
            longer = (np.concatenate([column, np.zeros(more, dtype=column.dtype)]) for column in events)
            self.zone = self.zone._replace(break_events=BreakEvents(*longer))

    def _refine_marked_nodes(self) -> None:
        """Refine where wanted: switch coarse nodes to fine ones."""
        zone, kinds = self.zone, self.zone.node_kinds
        zone.totals.damped_energy += (self.state.damped * self.area).sum()
        self.state.damped[:] = 0.0
        before = self._total_energy_of_nodes(np.zeros(0, dtype=np.int64))
        self.set_active_coarse_nodes(
            mask_coarse_nodes_after_refinement(self.lattice, kinds == COARSE, zone.is_to_refine)
        )
        zone.is_to_refine[:] = False
        born = np.flatnonzero((self.zone.node_kinds == FINE) & (kinds != FINE))
        interpolate_motion_between_coarse_nodes(self.state, self.lattice.numbering, born[kinds[born] != COARSE])
        zone.totals.refinement_energy += self._total_energy_of_nodes(born) - before
        zone.counts.refinements += 1

    def set_active_coarse_nodes(self, is_active: NDArray[np.bool_]) -> None:
        """Let these coarse places, of those that may be, be the active nodes."""
        self.zone = zone_with_active_coarse_nodes(self.lattice, self.plate, self.zone, is_active)
        kinds = self.zone.node_kinds
        self.active_places = np.flatnonzero((kinds == FINE) | (kinds == COARSE))
        self.area = areas_of_active_nodes(self.lattice, self.plate, kinds)
        near_seam = mask_nodes_near_border(self.lattice, self.plate, kinds)
        self.damping[:] = np.where(near_seam, self.settings.border_damping, 0.0)

    def energy_densities(self, fine_rows: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """Energy densities (places,), J/m^3, of active coarse nodes and of fine nodes, of all or in `fine_rows`."""
        densities = np.zeros((1, self.lattice.numbering.place_count))
        fine_rows = self.zone.rows_with_fine_nodes if fine_rows is None else fine_rows
        store_strain_energy_densities(self.lattice, self.zone, fine_rows, densities)
        return np.asarray(densities[0])

    def _total_energy_of_nodes(self, fine_places: NDArray[np.int64]) -> float:
        """Kinetic plus strain energy of the active coarse nodes and of some fine ones, J/m."""
        densities, energy = self.energy_densities(np.unique(fine_places // ROW)), 0.0
        for places in (self.zone.active_coarse_places, fine_places):
            moving = self.lattice.rho / 2 * (self.zone.v[:, places] ** 2).sum(axis=0)
            energy += float(((moving + densities[places]) * self.area[places]).sum())
        return energy

    def break_events(self) -> BreakEvents:
        """Bonds broken so far."""
        count = self.zone.counts.broken_bonds
        return BreakEvents._make(column[:count] for column in self.zone.break_events)

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone for the run's report."""
        fine = self.area[self.zone.node_kinds == FINE].sum() / self.plate.node_areas.sum()
        # of a place without neighbours e is 0
        largest, limit = (
            np.sqrt(1 + e) - 1
            for e in (self.zone.totals.largest_double_green_strain, self.lattice.limit_double_green_strain)
        )
        return ZoneSummary(float(self.zone.totals.refinement_energy), float(fine), float(largest / limit))

    @property
    def damped_energy_and_work(self) -> tuple[float, float]:
        """Energy taken by damping, and work done, J/m."""
        damped, work = (float((density * self.area).sum()) for density in (self.state.damped, self.state.work))
        return float(self.zone.totals.damped_energy) + damped, work

    @property
    def _motion_fields_of_checkpoint(self) -> dict[str, NDArray[np.float64]]:
        """Fields (..., places) of active nodes, by their names in checkpoints."""
        u, v, a, _, work, damped = self.state
        fields = {"fine_u": u.T, "fine_v": v.T, "fine_a": a.T, "own_work": work, "damped": damped}
        return fields | {"spent": self.zone.node_dissipation}

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, from which a run continues bit by bit."""
        zone, places, broken, drive = self.zone, self.active_places, self.break_events(), self.drive
        return {
            "break_step": broken.step.copy(),
            "break_node": broken.node.astype(np.int32),
            "break_spring": broken.bond_number.copy(),
            **pulls_to_arrays(broken.step, broken.force_at_break, broken.stretch_growth_at_break),
            **{name: field[..., places] for name, field in self._motion_fields_of_checkpoint.items()},
            "held_speed": drive.held_speed.copy(),
            "drive_force": drive.held_force.copy(),
            "total": zone.totals.values(),
            "number": zone.counts.values(),
            "coarse": zone.active_coarse_places.copy(),
            "places": places,
        }

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint, beginning with the initial state. Raises CheckpointError."""
        is_active, coarse = np.zeros(len(self.area), dtype=np.bool_), entry(checkpoint, "coarse", (None,), np.int64)
        if not np.isin(coarse, self.zone.active_coarse_places).all():
            raise CheckpointError("coarse nodes are none at the start; they must be some of those")
        is_active[coarse] = True
        self._restore_breaks(checkpoint)
        self.set_active_coarse_nodes(is_active)
        places, drive, zone = self.active_places, self.drive, self.zone
        if not np.array_equal(entry(checkpoint, "places", places.shape, np.int64), places):
            raise CheckpointError("places are not those of active nodes")
        for name, field in self._motion_fields_of_checkpoint.items():
            field[...] = 0.0
            field[..., places] = entry(checkpoint, name, (*field.shape[:-1], len(places)), float)
        counts = ZoneCounts.of(like(checkpoint, "number", zone.counts.values()))
        totals = EnergyTotals.of(like(checkpoint, "total", zone.totals.values()))
        if counts.broken_bonds != zone.counts.broken_bonds or (counts.values() < 0).any():
            raise CheckpointError(f"'number' has {counts.broken_bonds} broken bonds; {zone.counts.broken_bonds} broke")
        drive.held_speed[:] = like(checkpoint, "held_speed", drive.held_speed)
        drive.held_force[:] = like(checkpoint, "drive_force", drive.held_force)
        self.zone = zone._replace(totals=totals, counts=counts)

    def _restore_breaks(self, checkpoint: CheckpointArrays) -> None:
        """Break the bonds that a checkpoint has. Raises CheckpointError unless each was there, and breaks once."""
        plate, zone, ways = self.plate, self.zone, self.lattice.neighbour_offsets
        half, step = len(ways) // 2, entry(checkpoint, "break_step", (None,), np.int32, 1)
        node, number = (
            entry(checkpoint, name, step.shape, np.int32, 0, count - 1)
            for name, count in (("break_node", len(self.area)), ("break_spring", half))
        )
        places, lanes = node.astype(np.int64), (node % ROW).astype(np.uint16)
        intact = plate.cut_bond_bits[node // ROW, number] >> lanes & 1 == 0  # as no bond to where no node is
        exists = (plate.grid_row_at_place[node] >= 0) & intact
        if not exists.all() or len(np.unique(places * half + number)) < len(node):
            raise CheckpointError("a broken bond is none of the plate, or there twice")
        breaks = BreakEvents(step, places, number, *read_pulls(checkpoint, len(step)))
        for ends, k in ((places, number), (places + ways[number], number + half)):
            mark_bonds_cut(zone.cut_bond_bits, ends, k)
            rows = ends[zone.stiffness_index_of_row[ends // ROW] == WHOLE] // ROW
            zone.stiffness_index_of_row[rows] = UNCORRECTED
        self._enlarge_break_arrays(len(node))
        for name, values in breaks._asdict().items():
            getattr(self.zone.break_events, name)[: len(node)] = values
        zone.counts.broken_bonds = len(node)

    def bytes(self) -> int:
        """Memory of all arrays, bytes; untouched parts take none in practice."""
        arrays = (array for part in (self.zone, self.lattice) for array in part if isinstance(array, np.ndarray))
        return sum(array.nbytes for array in arrays)
