"""Time integration of a plate with fine and coarse nodes."""

from __future__ import annotations

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
    BreakEvents,
    CollocationZone,
    Counts,
    Totals,
    areas_of_active_nodes,
    interpolate_motion,
    mask_coarse_nodes_left_active,
    zone_with_active_coarse_nodes,
)
from pdsolve.adaptivity.hybrid.engine import ZoneSummary
from pdsolve.checkpoint_validation import entry, like, pulls_to_arrays, read_pulls
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.numerics.thread_team import side_by_side
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import State
from pdsolve.steppers.verlet import Verlet


class CollocationSettings(NamedTuple):
    """Settings of the collocation method: where it refines, how it damps, and its number of threads."""

    refinement_kappa: float  # share of what breaks a bond at which a coarse pair becomes fine
    seam_damping: float  # 1/s, damping of nodes within a horizon of the seam
    steps_between_checks: int  # steps between two looks
    threads: int


class CollocationEngine:
    """A plate in motion; nodes are numbered as on their lattice."""

    def __init__(
        self,
        plate: CollocationPlate,
        lattice: LatticeConstants,
        zone: CollocationZone,
        drive: Drive,
        settings: CollocationSettings,
    ) -> None:
        """`zone` is the initial zone; entries of `drive` refer to places."""
        self.plate, self.lattice, self.zone, self.drive, self.settings = plate, lattice, zone, drive, settings
        self.area, rho = areas_of_active_nodes(lattice, plate, zone.node_kinds), np.full(len(zone.damping), lattice.rho)
        dissipated, work = np.zeros((2, len(rho)))
        self._state = State(zone.u.T, zone.v.T, zone.a.T, dissipated, work, zone.damped_energy)  # by places
        self._verlet = Verlet(self, drive, rho, lattice.dt, zone.damping)
        self.sum_forces_and_break_bonds(0, 0.0)  # compiles before the clock runs

    @property
    def work(self) -> NDArray[np.float64]:
        """Work (places,) done on nodes so far, J/m^3."""
        return self._state.work

    def set_initial_motion(self, velocity: NDArray[np.float64]) -> None:
        """Set the velocities (n, 2), m/s, of all nodes, and the accelerations of an undeformed plate."""
        active = (self.zone.node_kinds == FINE) | (self.zone.node_kinds == COARSE)
        is_active = active[self.plate.place_of_grid_row]
        self.zone.v[:, self.plate.place_of_grid_row[is_active]] = velocity[is_active].T
        self.zone.a[:] = self.drive.force.T / self.lattice.rho - self.zone.damping * self.zone.v
        holds = self.drive.holds
        self.zone.a[holds.axis, holds.node] = 0.0

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises UnstableError if a coarse pair exceeds its limit."""
        self._verlet.advance(self._state, first_step, end_step)

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (places, 2), N/m^3, to `out`; bonds over their limit break, and nodes become fine
        where this is due.

        Raises UnstableError if a coarse pair exceeds its limit.
        """
        if step % self.settings.steps_between_checks == 0:
            interpolate_fictitious_nodes(self.zone)
            if mark_stretched_coarse_pairs(self.lattice, self.zone, self.settings.refinement_kappa):
                self._refine_in_time(step)
        while self._sum_forces_and_break_bonds(step, dt):
            self._refine_in_time(step)
        sum_coarse_forces(self.lattice, self.zone)
        add_force_densities(self.zone, out)

    def sum_forces_and_break_bonds(self, step: int, dt: float) -> None:
        """Sum the forces at the current displacements, without loads; bonds over their limit break in this step.

        `dt` is the time since the last step, s, 0 at rest. Nodes to refine are only noted; `refine_nodes_if_any_marked`
        refines them.
        """
        self._sum_forces_and_break_bonds(step, dt)
        sum_coarse_forces(self.lattice, self.zone)

    def _sum_forces_and_break_bonds(self, step: int, dt: float) -> bool:
        """Sum the forces of bonds; those over their limit break. Whether fine nodes are needed at their ends."""
        lattice, zone, threads = self.lattice, self.zone, self.settings.threads
        interpolate_fictitious_nodes(zone)
        rows = len(zone.rows_with_fine_nodes)

        def work(thread: int) -> None:
            sum_forces_of_fine_rows(lattice, zone, rows * thread // threads, rows * (thread + 1) // threads)

        side_by_side(work, threads)
        may_break = int(np.count_nonzero(zone.has_bond_over_limit)) * ROW * len(lattice.neighbour_offsets)
        if zone.counts.broken_bonds + may_break > len(zone.break_events.step):
            self._enlarge_break_arrays(may_break)
        return bool(break_stretched_bonds(lattice, self.zone, step, dt))

    def refine_nodes_if_any_marked(self) -> None:
        """Refine the nodes noted as wanted."""
        if self.zone.is_to_refine.any():
            self._refine_marked_nodes()

    def _refine_in_time(self, step: int) -> None:
        """Refine the nodes noted as wanted, unless a coarse pair has exceeded its limit already."""
        largest = self.zone_summary().clipped_stretch
        if largest > 1:
            raise UnstableError(
                f"step {step}: the fine zone was refined too late (stretch of coarse pairs: {largest:.2f} of"
                " critical); use a smaller run.collocation.kappa or time step"
            )
        self._refine_marked_nodes()

    def _enlarge_break_arrays(self, bonds: int) -> None:
        """Enlarge the arrays of broken bonds, for so many at least."""
        more = max(len(self.zone.break_events.step), bonds)
        longer = (np.concatenate([column, np.zeros(more, dtype=column.dtype)]) for column in self.zone.break_events)
        self.zone = self.zone._replace(break_events=BreakEvents(*longer))

    def _refine_marked_nodes(self) -> None:
        """Refine where wanted: switch coarse nodes to fine ones."""
        zone, lattice, plate = self.zone, self.lattice, self.plate
        zone.totals.damped_energy += self._damped_energy_since_refinement()
        zone.damped_energy[:] = 0.0
        before, coarse = self._strain_and_kinetic_energy_of_coarse_nodes(), zone.node_kinds == COARSE
        active = mask_coarse_nodes_left_active(lattice, coarse, zone.is_to_refine)
        new = zone_with_active_coarse_nodes(lattice, plate, zone, active, self.settings.seam_damping)
        born = np.flatnonzero((new.node_kinds == FINE) & (zone.node_kinds != FINE))
        interpolate_motion(zone, lattice.numbering, born[zone.node_kinds[born] != COARSE])
        zone.is_to_refine[:] = False
        self.zone, self.area = new, areas_of_active_nodes(lattice, plate, new.node_kinds)
        after = self._strain_and_kinetic_energy_of_coarse_nodes() + self._strain_and_kinetic_energy_at_places(
            born, self.energy_densities(np.unique(born // ROW))
        )
        self.zone.totals.refinement_energy += after - before
        self.zone.counts.refinements += 1

    def energy_densities(self, fine_rows: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """Energy densities (places,), J/m^3, of active coarse nodes and of fine nodes, of all or in `fine_rows`."""
        densities = np.zeros((1, self.lattice.numbering.place_count))
        fine_rows = self.zone.rows_with_fine_nodes if fine_rows is None else fine_rows
        store_strain_energy_densities(self.lattice, self.zone, fine_rows, densities)
        return np.asarray(densities[0])

    def _strain_and_kinetic_energy_at_places(self, places: NDArray[np.int64], densities: NDArray[np.float64]) -> float:
        """Kinetic plus strain energy of nodes, J/m."""
        moving = self.lattice.rho / 2 * (self.zone.v[:, places] ** 2).sum(axis=0)
        return float(((moving + densities[places]) * self.area[places]).sum())

    def _strain_and_kinetic_energy_of_coarse_nodes(self) -> float:
        return self._strain_and_kinetic_energy_at_places(
            self.zone.active_coarse_places,
            self.energy_densities(self.zone.rows_with_fine_nodes[:0]),
        )

    def active_places(self) -> NDArray[np.int64]:
        """Places of active nodes."""
        return np.flatnonzero((self.zone.node_kinds == FINE) | (self.zone.node_kinds == COARSE))

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

    def kinetic_energy_and_momentum(self) -> tuple[float, float, float]:
        """Kinetic energy, J/m, and momentum, N s/m."""
        places = self.active_places()
        mass, v = self.lattice.rho * self.area[places], self.zone.v[:, places]
        return (float((mass / 2 * (v**2).sum(axis=0)).sum()), *(mass * v).sum(axis=1).tolist())

    @property
    def dissipated_and_damped_energy_and_work(self) -> tuple[float, float, float]:
        """Energy dissipated by bonds and taken by damping, and work done, J/m."""
        totals = self.zone.totals
        damped = float(totals.damped_energy) + self._damped_energy_since_refinement()
        return float(totals.dissipated_energy), damped, float((self.work * self.area).sum())

    def _damped_energy_since_refinement(self) -> float:
        """Energy taken by damping since the last switch of nodes, J/m."""
        return float((self.zone.damped_energy * self.area).sum())

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, from which a run continues bit by bit."""
        zone, places = self.zone, self.active_places()
        broken = self.break_events()
        columns = ("break_step", broken.step), ("break_node", broken.node), ("break_spring", broken.bond_number)
        checkpoint: dict[str, NDArray[Any]] = {name: column.copy() for name, column in columns}
        checkpoint |= pulls_to_arrays(broken.step, broken.force_at_break, broken.stretch_growth_at_break)
        checkpoint |= {
            name: field[:, places].copy()
            for name, field in (("fine_u", zone.u), ("fine_v", zone.v), ("fine_a", zone.a))
        }
        checkpoint |= {"held_speed": self.drive.held_speed.copy(), "drive_force": self.drive.held_force.copy()}
        checkpoint |= {
            "total": zone.totals.values(),
            "number": zone.counts.values(),
            "coarse": zone.active_coarse_places.copy(),
        }
        checkpoint |= {"spent": zone.node_dissipation[places].copy(), "damped": zone.damped_energy[places].copy()}
        return checkpoint | {"places": places, "own_work": self.work[places].copy()}

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint, beginning with the initial state. Raises CheckpointError."""
        lattice, active = self.lattice, np.zeros(self.lattice.numbering.place_count, dtype=np.bool_)
        coarse = entry(checkpoint, "coarse", (None,), np.int64)
        if not np.isin(coarse, self.zone.active_coarse_places).all():
            raise CheckpointError("coarse nodes are none at the start; they must be some of those")
        active[coarse] = True
        breaks = self._read_checkpoint_breaks(checkpoint)
        node, spring = breaks.node.astype(np.int64), breaks.bond_number.astype(np.int64)
        half = len(lattice.neighbour_offsets) // 2
        for ends, k in ((node, spring), (node + lattice.neighbour_offsets[spring], spring + half)):
            mark_bonds_cut(self.zone.cut_bond_bits, ends, k)
            index = self.zone.stiffness_index_of_row
            index[ends // ROW] = np.where(index[ends // ROW] == WHOLE, UNCORRECTED, index[ends // ROW])
        self.zone = zone_with_active_coarse_nodes(lattice, self.plate, self.zone, active, self.settings.seam_damping)
        self.area, places = areas_of_active_nodes(lattice, self.plate, self.zone.node_kinds), self.active_places()
        if not np.array_equal(entry(checkpoint, "places", places.shape, np.int64), places):
            raise CheckpointError("places are not those of active nodes")
        while len(self.zone.break_events.step) < len(node):
            self._enlarge_break_arrays(0)
        for name, values in breaks._asdict().items():
            getattr(self.zone.break_events, name)[: len(node)] = values
        for name, field in (("fine_u", self.zone.u), ("fine_v", self.zone.v), ("fine_a", self.zone.a)):
            field[:] = 0.0
            field[:, places] = entry(checkpoint, name, (2, len(places)), float)
        drive, numbers = self.drive, like(checkpoint, "number", self.zone.counts.values())
        counts, totals = Counts.of(numbers), like(checkpoint, "total", self.zone.totals.values())
        if counts.broken_bonds != len(node) or (numbers < 0).any():
            raise CheckpointError(f"'number' has {counts.broken_bonds} broken bonds; {len(node)} broke")
        drive.held_speed[:] = like(checkpoint, "held_speed", drive.held_speed)
        drive.held_force[:] = like(checkpoint, "drive_force", drive.held_force)
        self.zone = self.zone._replace(totals=Totals.of(totals), counts=counts)
        for name, field in (
            ("own_work", self.work),
            ("damped", self.zone.damped_energy),
            ("spent", self.zone.node_dissipation),
        ):
            field[places] = entry(checkpoint, name, places.shape, float)

    def _read_checkpoint_breaks(self, checkpoint: CheckpointArrays) -> BreakEvents:
        """Broken bonds of a checkpoint, checked to exist at the start and to have broken once.

        Raises CheckpointError.
        """
        lattice, half = self.lattice, len(self.lattice.neighbour_offsets) // 2
        step = entry(checkpoint, "break_step", (None,), np.int32, 1)
        breaks = BreakEvents(
            step,
            entry(checkpoint, "break_node", step.shape, np.int32, 0, lattice.numbering.place_count - 1),
            entry(checkpoint, "break_spring", step.shape, np.int32, 0, half - 1),
            *read_pulls(checkpoint, len(step)),
        )
        node, spring = breaks.node.astype(np.int64), breaks.bond_number.astype(np.int64)
        target = node + lattice.neighbour_offsets[spring]
        has_node = np.zeros(lattice.numbering.place_count, dtype=np.bool_)
        has_node[self.plate.place_of_grid_row] = True
        inside = has_node[node] & (target >= 0) & (target < len(has_node)) & has_node[target.clip(0, len(has_node) - 1)]
        intact = self.zone.cut_bond_bits[node // ROW, spring] >> (node % ROW).astype(np.uint16) & 1 == 0
        if not (inside & intact).all() or len(np.unique(node * half + spring)) < len(node):
            raise CheckpointError("a broken bond is none of the plate, or there twice")
        return breaks

    def bytes(self) -> int:
        """Memory of all arrays, bytes; untouched parts take none in practice."""
        arrays = (array for part in (self.zone, self.lattice) for array in part if isinstance(array, np.ndarray))
        return sum(array.nbytes for array in arrays)
