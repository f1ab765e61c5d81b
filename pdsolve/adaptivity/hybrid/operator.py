"""The operator of a plate with a moving fine zone: its current fine, coarse and far nodes.

A coarse node on the border is one with the fine node it lies on, a far one likewise with the coarse one. Bonds are
those of fine nodes and the springs of the coarse lattices, without pieces of clipped bonds, which never break.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.arrays import LatticeNodes
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.adaptivity.hybrid.node_constants import are_bonds_intact, node_constants_at_places
from pdsolve.adaptivity.hybrid.node_lists import (
    NodeLists,
    gather_node_values,
    interpolate_values_of_border_nodes,
    list_bonds_and_springs,
    number_current_nodes,
    pack_spring_existence_bits,
    scatter_node_motion,
)
from pdsolve.adaptivity.two_lattice_operator import EnergyBalanceTotals, TwoLatticeOperator
from pdsolve.codegen.vector_code import ROW
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken, State
from pdsolve.zone.cells import COARSE, FAR, IDLE, lattice_coordinates, place_number_at, place_on_finer_lattice
from pdsolve.zone.node_models import model_of_rows_with_spacing_and_areas

if TYPE_CHECKING:
    from scipy.sparse import csr_array


TOGETHER = 2**16  # coarse nodes that are read together
BITS = np.array([bits.bit_count() for bits in range(256)], dtype=np.int16)  # set in a byte

NOTHING = Broken(*np.zeros((3, 0), dtype=np.int64))


class HybridOperator(TwoLatticeOperator[HybridEngine]):
    """The operator of the n current nodes, in the order of their places."""

    name = "hybrid"
    symmetric = True

    def __init__(self, hybrid: HybridEngine, cut: NDArray[np.int64]) -> None:
        """`cut` is the number of bonds that pre-cracks cut, of irregular nodes and, last, of others."""
        self.engine, self._cut, self._strain = hybrid, cut, 0.0
        self._broken, self._looked = NOTHING, 0  # bonds whose rows are known, and how many have been looked for
        zone = hybrid.zone
        fine = _active_places(zone.fine, zone.counts.active_fine_rows)
        coarse, far = (
            _active_places(zone.coarse, zone.counts.active_coarse_rows),
            _active_places(zone.far, zone.counts.active_coarsest_rows),
        )
        self._fine, self._coarse, self._far = fine, coarse.astype(np.int32), far.astype(np.int32)
        del coarse, far
        self._fine_rows, self._coarse_rows = np.zeros(len(fine), np.int64), np.zeros(len(self._coarse), np.int32)
        self.places = number_current_nodes(
            hybrid.plate.numbering, fine, self._coarse, self._fine_rows, self._coarse_rows
        )
        # number the far nodes too
        if not len(self._far):
            self._far_rows = np.zeros(0, dtype=np.int32)
        else:
            beneath, before = self.engine.fine_places_of_coarsest_nodes(self._far.astype(np.int64)), self.places
            both = np.sort(np.concatenate([before, beneath]), kind="stable")  # two runs, which are merged
            self.places = both[np.append(True, both[1:] != both[:-1])]
            rows = np.searchsorted(self.places, before)
            self._fine_rows[:], self._coarse_rows[:] = rows[self._fine_rows], rows[self._coarse_rows]
            self._far_rows = np.searchsorted(self.places, beneath).astype(np.int32)
        self._lists = NodeLists(fine, self._coarse, self._fine_rows, self._coarse_rows)
        self._bonds = np.zeros(
            (len(fine), len(hybrid.lattice.neighbour_offsets)), dtype=np.bool_
        )  # past and present ones
        self._springs = np.zeros((len(self._coarse), 1), dtype=np.uint8)  # bits, without those that are fine bonds too
        lattice = hybrid.lattice
        number = {
            (int(dx), int(dy)): k for k, (dx, dy) in enumerate(zip(lattice.family_dx, lattice.family_dy, strict=True))
        }
        ways = zip(lattice.coarse_dx.tolist(), lattice.coarse_dy.tolist(), strict=True)
        # which bond of the fine family each spring (8,) of the coarse lattice is too; -1: none
        same = np.array([number.get((2 * dx, 2 * dy), -1) for dx, dy in ways])
        columns = (
            zone.fine.node_kinds,
            zone.fine.stiffness_index_of_row,
            zone.fine.row_stiffness,
            zone.coarse.stiffness_index_of_row,
            zone.coarse.row_stiffness,
        )
        list_bonds_and_springs(
            *columns, zone.broken_bond_bits, lattice.neighbour_offsets, same, self._lists, self._bonds, self._springs
        )
        self._far_springs = pack_spring_existence_bits(
            zone.far.stiffness_index_of_row, zone.far.row_stiffness, self._far
        )  # likewise
        self._changes = self._count_changes_and_coarse_cells()

    @property
    def kind(self) -> np.dtype[Any]:
        """Precision of the motion."""
        return self.engine.zone.fine.u.dtype

    def _count_changes_and_coarse_cells(self) -> tuple[int, int]:
        """How many changes of cells there have been, and how many cells are coarse."""
        zone = self.engine.zone
        return int(zone.counts.cell_changes), int(np.count_nonzero(zone.cell_kinds == COARSE))

    @property
    def grid_rows(self) -> NDArray[np.int64]:
        """Rows (n,) of the grid."""
        return self.engine.plate.grid_rows_at(self.places)

    def _rows_at_places(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the current nodes at fine places."""
        if not places.size:
            return np.zeros(places.shape, dtype=np.int64)
        first, last = np.searchsorted(self.places, [places.min(), places.max() + 1])
        return np.asarray(first + np.searchsorted(self.places[first:last], places))

    def _coarse_rows_and_places_in_chunks(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Rows and places of the coarse nodes, some at a time."""
        for first in range(0, len(self._coarse), TOGETHER):
            chunk = slice(first, first + TOGETHER)
            yield self._coarse_rows[chunk].astype(np.int64), self._coarse[chunk].astype(np.int64)

    @cached_property
    def current_nodes_model(self) -> Model:
        """The model of the n current nodes, without conditions."""
        widths = np.ones(len(self.grid_rows))
        widths[self._coarse_rows], widths[self._far_rows] = 2.0, 4.0
        return model_of_rows_with_spacing_and_areas(self.engine.plate.model, self.grid_rows, widths, self.area)

    @cached_property
    def area(self) -> NDArray[np.float64]:
        """Areas (n,), m^2: for a fine node its share of fine cells, for others likewise."""
        plate, zone = self.engine.plate, self.engine.zone
        nodes = self.engine.lattice.node_constants
        part = zone.fine.mass[self._fine] / node_constants_at_places(nodes, nodes.mass, self._fine)
        cell_areas = plate.area_shares_of_grid_rows(plate.grid_rows_at(self._fine)) * plate.spacing**2
        areas = np.zeros(len(self.places))
        areas[self._fine_rows] = part * cell_areas
        stride = plate.numbering.cells.strides[1]
        for rows, coarse in self._coarse_rows_and_places_in_chunks():
            corner = place_number_at(plate.numbering.cells, lattice_coordinates(plate.numbering.coarse, coarse))
            around = sum((zone.cell_kinds[corner - dy * stride - dx] == COARSE) for dy in (0, 1) for dx in (0, 1))
            areas[rows] += plate.spacing**2 * around
        for first in range(0, len(self._far), TOGETHER):
            far = self._far[first : first + TOGETHER].astype(np.int64)
            corner = place_on_finer_lattice(plate.numbering.far, plate.numbering.cells, 2, far)
            around = sum((zone.cell_kinds[corner - dy * stride - dx] == FAR) for dy in (0, 2) for dx in (0, 2))
            areas[self._far_rows[first : first + TOGETHER]] += 4 * plate.spacing**2 * around
        return areas

    @cached_property
    def initial_bond_counts_and_family_sizes(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Bonds (n,) of each node at the start, and their number including those cut by pre-cracks."""
        count, nodes = np.zeros(len(self.places), dtype=np.int16), self.engine.lattice.node_constants
        fine = np.zeros(len(self.places), dtype=np.bool_)
        fine[self._fine_rows] = True
        count[self._fine_rows] += self._bonds.sum(axis=1, dtype=np.int16)
        count[self._coarse_rows] += BITS[self._springs[:, 0]]
        count[self._far_rows] += BITS[self._far_springs[:, 0]]
        family = count.copy()
        family[self._fine_rows] += self._cut[
            node_constants_at_places(nodes, nodes.irregular_bond_row, self._fine)
        ].astype(np.int16)
        for rows, _ in self._coarse_rows_and_places_in_chunks():
            alone = rows[~fine[rows]]
            plate, zone = self.engine.plate, self.engine.zone
            x, y = lattice_coordinates(plate.numbering.fine, self.places[alone])
            corner = place_number_at(plate.numbering.cells, (x // 2, y // 2))
            south, west = plate.numbering.cells.strides[1], 1
            ne, nw, sw, se = (zone.cell_kinds[corner - away] == COARSE for away in (0, west, south + west, south))
            edges = [ne | se, ne | nw, nw | sw, sw | se]
            family[alone] = np.maximum(
                family[alone], np.asarray(sum(is_coarse.astype(np.int16) for is_coarse in (ne, nw, sw, se, *edges)))
            )
        return count, np.maximum(family, 1)  # one that is broken, of a node none of whose bonds is left

    @property
    def signatures_of_changes(self) -> NDArray[np.int16]:
        """Signature (n,) that changes if a node, its area or its bonds change."""
        quarters = np.round(4 * self.area / self.engine.plate.spacing**2)  # up to 64
        signature = (1900 * quarters % 2**15).astype(np.int16)
        signature[self._fine_rows] += 1 + self._bonds.sum(axis=1, dtype=np.int16)
        signature[self._coarse_rows] += 200 * (1 + BITS[self._springs[:, 0]])
        signature[self._far_rows] += 200 * (10 + BITS[self._far_springs[:, 0]])
        return signature

    @property
    def nodes_are_unchanged(self) -> bool:
        """Whether no cell has become fine or coarse since this operator was made."""
        return self._count_changes_and_coarse_cells() == self._changes

    def new_operator_if_nodes_changed(self) -> HybridOperator | None:
        """The operator on the current nodes if they have changed, else None."""
        return None if self.nodes_are_unchanged else HybridOperator(self.engine, self._cut)

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint; see `TwoLatticeOperator`."""
        self._broken, self._looked = NOTHING, 0
        super().restore(checkpoint, broken)

    def _gather_values(
        self,
        fine: NDArray[np.float64],
        coarse: NDArray[np.float64],
        far: NDArray[np.float64],
        out: NDArray[np.float64],
        over_mass: bool = False,
    ) -> None:
        """Gather values (2, .) of all lattices in out (n, 2), over the masses of nodes if `over_mass`."""
        zone, none = self.engine.zone, self.engine.zone.fine.inverse_mass[:0]
        over_fine, over_coarse, over_far = (
            nodes.inverse_mass if over_mass else none for nodes in (zone.fine, zone.coarse, zone.far)
        )
        border, tied = zone.border_nodes[: zone.counts.border_nodes], zone.tied_coarse_nodes[: zone.counts.tied_nodes]
        gather_node_values(fine, over_fine, self._fine, self._fine_rows, out)
        out[self._rows_at_places(border["border_node"])] = interpolate_values_of_border_nodes(
            border, coarse, over_coarse
        ).T
        gather_node_values(coarse, over_coarse, self._coarse, self._coarse_rows, out)
        tied_rows = self._coarse_rows[np.searchsorted(self._coarse, tied["border_node"])]
        out[tied_rows] = interpolate_values_of_border_nodes(tied, far, over_far).T
        gather_node_values(far, over_far, self._far, self._far_rows, out)

    def _write_node_motion(self, state: State) -> None:
        """Set all lattices to the values and rates of a state; border nodes are interpolated."""
        zone, now = self.engine.zone, self.engine.displacement_buffer_index
        border, tied = zone.border_nodes[: zone.counts.border_nodes], zone.tied_coarse_nodes[: zone.counts.tied_nodes]
        for nodes, places, rows in (
            (zone.coarse, self._coarse, self._coarse_rows),
            (zone.fine, self._fine, self._fine_rows),
            (zone.far, self._far, self._far_rows),
        ):
            scatter_node_motion(state.value, state.rate, places, rows, nodes.u[now], nodes.v, nodes.node_kinds)
        for nodes, border_nodes, interpolation_nodes in (
            (zone.fine, border, zone.coarse),
            (zone.coarse, tied, zone.far),
        ):
            swelling = np.stack([border_nodes["swelling_x"], border_nodes["swelling_y"]])
            values = interpolate_values_of_border_nodes(
                border_nodes, interpolation_nodes.u[now], interpolation_nodes.inverse_mass[:0]
            )
            nodes.u[now][:, border_nodes["border_node"]] = values + swelling

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let springs stretch from their lengths at these strains (n,) of all nodes of the grid, were they free."""
        self.engine.set_swelling_strain(strain)

    def copy_to_state(self, state: State) -> None:
        """Update a state from all lattices; work is known only to the ledger."""
        zone, now = self.engine.zone, self.engine.displacement_buffer_index
        self._gather_values(zone.fine.u[now], zone.coarse.u[now], zone.far.u[now], state.value)
        border = zone.border_nodes[: zone.counts.border_nodes]
        swelling = np.column_stack([border["swelling_x"], border["swelling_y"]])
        state.value[self._rows_at_places(border["border_node"])] += swelling
        self._gather_values(zone.fine.v, zone.coarse.v, zone.far.v, state.rate)
        _, acceleration, mass = self.engine.prescribed_components()
        force = self.engine.replace_forces_on_prescribed_components(mass * acceleration)
        self._gather_accelerations(state.second)
        self.engine.replace_forces_on_prescribed_components(force)
        spenders = self.engine.places_of_damaged_nodes()
        rows = np.minimum(self._rows_at_places(spenders), len(self.places) - 1)
        rows = rows[self.places[rows] == spenders]
        if state.dissipated.any():  # zeros that have not been written take no memory
            state.dissipated[:] = 0.0
        state.dissipated[rows] = zone.node_dissipation[self.places[rows]] / self.area[rows]

    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations (n, 2), m/s^2, from the most recent sum of forces."""
        acceleration = np.zeros((len(self.places), 2))
        self._gather_accelerations(acceleration)
        return acceleration

    def _gather_accelerations(self, out: NDArray[np.float64]) -> None:
        """Gather accelerations, m/s^2, from the most recent sum of forces in out (n, 2)."""
        zone = self.engine.zone
        self._gather_values(zone.fine.f, zone.coarse.f, zone.far.f, out, over_mass=True)

    def dissipated_energy(self) -> NDArray[np.float64]:
        """Energy density (n,), J/m^3, dissipated so far by the nodes' broken and softened bonds."""
        return np.asarray(self.engine.zone.node_dissipation[self.places] / self.area)

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (2 n, 2 n), N/m^4, of the force densities by the values; see `Operator`."""
        from pdsolve.adaptivity.hybrid.tangent import (  # few runs need it
            assemble_tangent,
            create_point_interpolation_weights,
        )
        from pdsolve.zone.tangent import tangent_of_ground_springs

        zone, light = self.engine.zone, np.zeros(len(self.places))
        light[self._fine_rows] = zone.fine.inverse_mass[self._fine]  # 0 of those on the border
        light[self._coarse_rows] = zone.coarse.inverse_mass[self._coarse]
        light[self._far_rows] = zone.far.inverse_mass[self._far]
        coarse, far = self._coarse.astype(np.int64), self._far.astype(np.int64)
        row_of = np.full(self.engine.plate.numbering.fine.place_count, -1, dtype=np.int32)
        row_of[self.places] = np.arange(len(self.places))
        points = create_point_interpolation_weights(self.engine, row_of, self._fine, coarse, far)
        del row_of  # of all fine places, beside the tangent
        place, springs, stiffness, _ = self.engine.supported_components()
        beneath = self.engine.fine_places_of_coarse((-1 - place).clip(0))
        row = self._rows_at_places(np.where(place >= 0, place, beneath))
        supports = tangent_of_ground_springs(row, springs["axis"], stiffness, state.value.shape)
        return assemble_tangent(self.engine, points, state.value, self.current_nodes_model.rho, light, supports)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Strain energy densities (n,), J/m^3, and zeros for softening, which is part of the state."""
        self.set_node_motion(state)
        fine, coarse, far = self.engine.strain_energies()
        energy = np.zeros(len(self.places))
        energy[self._fine_rows] = fine[self._fine]
        for rows, places in self._coarse_rows_and_places_in_chunks():
            energy[rows] += coarse[places]
        energy[self._far_rows] += far[self._far]
        self._strain = float(energy.sum())
        energy /= self.area
        return energy, np.zeros_like(energy)

    def energy_balance_totals(self) -> EnergyBalanceTotals:
        """Energies, work and momentum at the state of the last call of `energies`."""
        kinetic, x, y = self.engine.kinetic_energy_and_momentum().tolist()
        dissipated, work, _ = self.engine.dissipated_energy_work_and_refinement_energy
        return EnergyBalanceTotals(
            kinetic,
            self._strain,
            dissipated,
            self.engine.damped_energy,
            work,
            x,
            y,
            len(self.engine.break_events().step),
        )

    def load_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 2), N/m, of the loads at factor 1."""
        loads, forces = self.engine.zone.loads.entries, np.zeros((profile_count, 2))
        np.add.at(forces, (loads["profile"], loads["axis"]), loads["value"])
        return forces

    def constraint_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 2), N/m, that hold the nodes with prescribed motion, and of springs to the ground."""
        forces, (holds, acceleration, mass) = np.zeros((profile_count, 2)), self.engine.prescribed_components()
        force = mass * acceleration - holds["force_on_prescribed_component"]
        np.add.at(forces, (holds["profile"], holds["axis"]), force)
        _, springs, stiffness, displacement = self.engine.supported_components()
        np.add.at(forces, (springs["profile"], springs["axis"]), -stiffness * displacement)
        return forces

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        end_row = len(self.places) if end_row is None else end_row
        lists = self._fine_rows, self._coarse_rows, self._far_rows
        row_ranges = ((rows, np.array([first_row, end_row], dtype=rows.dtype)) for rows in lists)
        fine_numbers, coarse_numbers, far_numbers = (
            np.arange(*np.searchsorted(rows, ends)) for rows, ends in row_ranges
        )  # of one type: no copies
        return self._bonds_of_nodes_by_number(fine_numbers, coarse_numbers, far_numbers, at_start)

    def bonds_of(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of these nodes, which increase, in order."""
        is_wanted = np.zeros(len(self.places), dtype=np.bool_)
        is_wanted[rows] = True
        fine_numbers, coarse_numbers, far_numbers = (
            np.flatnonzero(is_wanted[at]) for at in (self._fine_rows, self._coarse_rows, self._far_rows)
        )
        return self._bonds_of_nodes_by_number(fine_numbers, coarse_numbers, far_numbers, False)

    def _bonds_of_nodes_by_number(
        self,
        fine_numbers: NDArray[np.int64],
        coarse_numbers: NDArray[np.int64],
        far_numbers: NDArray[np.int64],
        start: bool,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the bonds of some of the fine, coarse and far nodes, by their numbers."""
        lattice, zone, half = self.engine.lattice, self.engine.zone, len(self.engine.lattice.neighbour_offsets) // 2
        node, k = np.nonzero(self._bonds[fine_numbers])
        fine = self._fine[fine_numbers][node]
        target = fine + lattice.neighbour_offsets[k]
        if not start:
            owner = np.where(k < half, fine, target)
            intact = are_bonds_intact(lattice.node_constants, zone.broken_bond_bits, owner, k % half)
            fine, target = fine[intact], target[intact]
        node, k = np.nonzero(np.unpackbits(self._springs[coarse_numbers], axis=1))
        coarse = self._coarse[coarse_numbers][node].astype(np.int64)
        ends = [
            self.engine.fine_places_of_coarse(end) for end in (coarse, coarse + lattice.coarse_neighbour_offsets[k])
        ]
        node, k = np.nonzero(np.unpackbits(self._far_springs[far_numbers], axis=1))
        places = self._far[far_numbers][node].astype(np.int64)
        far_ends = (
            self.engine.fine_places_of_coarsest_nodes(end)
            for end in (places, places + lattice.coarsest_neighbour_offsets[k])
        )
        source, target = (
            np.concatenate([self._rows_at_places(end) for end in end_places])
            for end_places in zip((fine, target), ends, far_ends, strict=True)
        )
        order = np.lexsort((target, source))
        return source[order], target[order]

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step between current fine nodes: step, source row and target row of each."""
        broken = self._broken  # more have broken since, if any
        breaks, latest = self.engine.break_events(), slice(self._looked, None)
        step, node, spring = breaks.step[latest], breaks.node[latest], breaks.bond_number[latest]
        self._looked += len(step)
        if len(node):
            target = node + self.engine.lattice.neighbour_offsets[spring]
            both_fine = np.isin(node, self._fine) & np.isin(target, self._fine)
            more = (
                step[both_fine].astype(np.int64),
                self._rows_at_places(node[both_fine]),
                self._rows_at_places(target[both_fine]),
            )
            broken = self._broken = Broken(*map(np.concatenate, zip(broken, more, strict=True)))
        return broken.after(after_step)


def _active_places(nodes: LatticeNodes, rows: int) -> NDArray[np.int64]:
    """Places of the nodes that are not idle, from the first `rows` rows."""
    places = (nodes.active_rows[:rows, None] * ROW + np.arange(ROW)).ravel()
    return np.asarray(places[nodes.node_kinds[places] != IDLE])
