"""The operator of a plate with stencils on a coarse grid: its active nodes, fine and coarse.

Bonds are those of fine nodes to active ones and those of coarse nodes to the nodes of their stencils, without bonds to
fictitious nodes.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.collocation.engine import CollocationEngine
from pdsolve.adaptivity.collocation.layout import count_bonds, list_bonds
from pdsolve.adaptivity.collocation.row_stiffness import stiffness_of_bonds
from pdsolve.adaptivity.collocation.zone import COARSE, FINE
from pdsolve.adaptivity.two_lattice_operator import EnergyBalanceTotals, TwoLatticeOperator
from pdsolve.model import Model
from pdsolve.state import Broken, State
from pdsolve.zone.node_models import model_of_rows_with_spacing_and_areas

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class CollocationOperator(TwoLatticeOperator[CollocationEngine]):
    """The operator of the n active nodes, in the order of their places."""

    name = "collocation"
    symmetric = False  # the coupling conserves neither momentum nor energy, but for what is sent on

    def __init__(self, engine: CollocationEngine) -> None:
        """An operator on the currently active nodes."""
        self.engine, self._strain = engine, 0.0
        self.places, self._kind = engine.active_places, engine.zone.node_kinds.copy()
        self._is_active = (self._kind == FINE) | (self._kind == COARSE)
        self._row_of = np.full(engine.lattice.numbering.place_count, -1, dtype=np.int64)
        self._row_of[self.places] = np.arange(len(self.places))
        self.area = engine.area[self.places]
        self._switches = int(engine.zone.counts.refinements)

    @cached_property
    def current_nodes_model(self) -> Model:
        """The model of the n current nodes, without conditions."""
        rows = self.engine.plate.grid_row_at_place[self.places].astype(np.int64)
        widths = np.where(self._kind[self.places] == COARSE, 2.0, 1.0)
        return model_of_rows_with_spacing_and_areas(self.engine.plate.model, rows, widths, self.area)

    @cached_property
    def initial_bond_counts_and_family_sizes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Bonds (n,) of each node at the start, and their number including those cut by pre-cracks."""
        lattice, plate, fine = self.engine.lattice, self.engine.plate, self._kind[self.places] == FINE
        fine_places, count = self.places[fine], np.full(len(self.places), len(lattice.coarse_stencil_place_offsets) - 1)
        count[fine] = count_bonds(lattice, plate.cut_bond_bits, self._is_active, fine_places)
        family = count.copy()
        family[fine] += plate.precrack_cut_counts_of_places[fine_places]
        return count, family

    @property
    def signatures_of_changes(self) -> NDArray[np.int64]:
        """Signature (n,) that changes if a node or its bonds change."""
        share = np.round(self.area / self.engine.lattice.spacing**2 * 64).astype(
            np.int64
        )  # of a coarse node beside the seam
        return np.where(self._kind[self.places] == FINE, 1 + self.initial_bond_counts_and_family_sizes[0], -share)

    @property
    def nodes_are_unchanged(self) -> bool:
        """Whether no nodes have been switched since this operator was made."""
        return bool(self.engine.zone.counts.refinements == self._switches)

    def new_operator_if_nodes_changed(self) -> CollocationOperator | None:
        """The operator on the current nodes if they have changed, else None."""
        self.engine.refine_nodes_if_any_marked()
        return None if self.nodes_are_unchanged else CollocationOperator(self.engine)

    def _write_node_motion(self, state: State) -> None:
        """Set the active nodes to the values and rates of a state; fictitious nodes are interpolated."""
        zone = self.engine.zone
        zone.u[:, self.places], zone.v[:, self.places] = state.value.T, state.rate.T

    def copy_to_state(self, state: State) -> None:
        """Update a state from the active nodes."""
        for values, values_at_places in zip(state, self.engine.state, strict=True):
            values[:] = values_at_places[self.places]
        state.dissipated[:] = self.dissipated_energy()

    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations (n, 2), m/s^2, from the most recent sum of forces."""
        return np.asarray(self.engine.zone.f[:, self.places].T / self.engine.lattice.rho)

    def dissipated_energy(self) -> NDArray[np.float64]:
        """Energy density (n,), J/m^3, dissipated so far by the nodes' broken bonds."""
        return np.asarray(self.engine.zone.node_dissipation[self.places] / self.area)

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (2 n, 2 n), N/m^4, of the force densities by the values; see `Operator`.

        Fictitious nodes move with their parents by their weights.
        """
        from scipy.sparse import eye_array, kron, vstack  # few runs need it

        from pdsolve.operators.tangent import of_blocks, of_followers, of_springs

        lattice, zone, nodes = self.engine.lattice, self.engine.zone, len(self.places)
        fictitious, parents = zone.fictitious_nodes[:, 0], self._row_of[zone.fictitious_nodes[:, 1:]]
        point = self._row_of.copy()  # active nodes come first, in their order
        point[fictitious] = nodes + np.arange(len(fictitious))
        points = vstack([eye_array(nodes), of_followers(parents, np.full(parents.shape, 0.25), nodes)]).tocsr()

        fine, coarse = (self.places[self._kind[self.places] == kind] for kind in (FINE, COARSE))
        node, k = list_bonds(lattice, zone.cut_bond_bits, np.ones(len(point), dtype=np.bool_), fine)
        xi = lattice.spring_table[k, :2]
        pull = stiffness_of_bonds(lattice, fine[node], k) * np.sqrt((xi**2).sum(axis=1))
        source, target = point[fine[node]], point[fine[node] + lattice.neighbour_offsets[k]]
        matrix = of_springs(source, target, xi, pull, points @ state.value)

        stencils = point[coarse[:, None] + lattice.coarse_stencil_place_offsets]
        theta = np.tile(lattice.stencil_stiffness[:, [0, 1, 1, 2]].reshape(-1, 2, 2), (len(coarse), 1, 1))
        source = np.repeat(point[coarse], stencils.shape[1])
        matrix += of_blocks(source, stencils.ravel(), theta, nodes + len(fictitious))
        return (matrix[: 2 * nodes] @ kron(points, eye_array(2)).tocsr()).tocsr()

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Strain energy densities (n,), J/m^3, and zeros for softening, which collocation does not have."""
        self.set_node_motion(state)
        densities = self.engine.energy_densities()[self.places]
        self._strain = float((densities * self.area).sum())
        return densities, np.zeros_like(densities)

    def energy_balance_totals(self) -> EnergyBalanceTotals:
        """Energies, work and momentum at the state of the last call of `energies`."""
        engine, v = self.engine, self.engine.zone.v[:, self.places]
        mass, (damped, work) = engine.lattice.rho * self.area, engine.damped_energy_and_work
        kinetic, (x, y) = float((mass / 2 * (v**2).sum(axis=0)).sum()), (mass * v).sum(axis=1).tolist()
        dissipated = float(engine.zone.totals.dissipated_energy)
        return EnergyBalanceTotals(kinetic, self._strain, dissipated, damped, work, x, y, len(self.broken().step))

    def load_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 2), N/m, of the loads at factor 1."""
        loads, forces = self.engine.drive.loads, np.zeros((profile_count, 2))
        np.add.at(forces, (loads.profile, loads.axis), loads.value * self.engine.area[loads.node])
        return forces

    def constraint_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 2), N/m, that hold the nodes with prescribed motion."""
        drive, forces = self.engine.drive, np.zeros((profile_count, 2))
        holds = drive.holds
        np.add.at(forces, (holds.profile, holds.axis), -drive.held_force * self.engine.area[holds.node])
        return forces

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        lattice, places = self.engine.lattice, self.places[first_row:end_row]
        cut = (self.engine.plate if at_start else self.engine.zone).cut_bond_bits
        fine, coarse = (places[self._kind[places] == kind] for kind in (FINE, COARSE))
        node, k = list_bonds(lattice, cut, self._is_active, fine)
        ways = lattice.coarse_stencil_place_offsets[lattice.coarse_stencil_place_offsets != 0]
        sources = fine[node], np.repeat(coarse, len(ways))
        targets = fine[node] + lattice.neighbour_offsets[k], (coarse[:, None] + ways).ravel()
        source, target = (self._row_of[np.concatenate(ends)] for ends in (sources, targets))
        order = np.lexsort((target, source))
        return source[order], target[order]

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        breaks = self.engine.break_events()
        ends = self._row_of[[breaks.node, breaks.node + self.engine.lattice.neighbour_offsets[breaks.bond_number]]]
        return Broken(np.tile(breaks.step.astype(np.int64), 2), ends.ravel(), ends[::-1].ravel()).after(after_step)
