"""The operator of a body with a moving fine zone: its current coarse and fine nodes.

Nodes are the fine nodes that are in fine cells alone, and the coarse nodes. A fine node on the border moves with the
coarse nodes around it and is no node of its own, unless it lies on a coarse one. Bonds are the whole ones between
nodes, and the springs of coarse cells; pieces of clipped bonds never break.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.arrangement import count_bonds_of_sites
from pdsolve.adaptivity.hybrid.space.engine import BodyEngine
from pdsolve.adaptivity.hybrid.space.layout import list_bonds_of_sites
from pdsolve.adaptivity.hybrid.space.materials import ModelWithMeanDensities
from pdsolve.adaptivity.two_lattice_operator import EnergyBalanceTotals, TwoLatticeOperator
from pdsolve.codegen.rows_of_four import TOGETHER
from pdsolve.conditions import ACCELERATION
from pdsolve.lattice import tile_bonds
from pdsolve.laws.calls import pair_of
from pdsolve.model import Model
from pdsolve.state import Broken, State, Unknown
from pdsolve.zone.node_models import model_of_rows_with_spacing_and_areas

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.zone.tangent import SpringsBetweenPoints


class HybridBodyOperator(TwoLatticeOperator[BodyEngine]):
    """The operator of the n current nodes, in the order of their fine sites."""

    name = "hybrid"
    symmetric = True
    unknowns: tuple[Unknown, ...] = (Unknown("u", 3, 2),)

    def __init__(self, engine: BodyEngine) -> None:
        """It has the nodes that `engine` has now."""
        self.engine, nodes, self._changes = engine, engine.nodes, engine.cell_changes
        self._order = np.argsort(nodes.sites)  # of nodes of the engine
        self.places, self.grid_rows = nodes.sites[self._order], nodes.rows[self._order]
        row_of = np.argsort(self._order)
        self._coarse, self._fine = np.split(row_of, [len(nodes.coarse_places)])
        self._coarse_sites = nodes.coarse_places - engine.full_body.coarse_sites.margin
        self.area = engine.volume[self.grid_rows]
        self._row = np.full(len(engine.node_kinds), -1, dtype=np.int32)
        self._row[self.places] = np.arange(len(self.places))
        self._spring_row = np.full(len(engine.coarse.tiles.node), -1, dtype=np.int32)
        self._spring_row[self._coarse_sites] = self._coarse
        self._strain = self._softening = 0.0  # J
        with engine.fine.breaking:
            # bonds and springs of these nodes, and bonds that have broken before
            self._bits, self._spring_bits = engine.fine.tiles.bits.copy(), engine.coarse.tiles.bits.copy()
            self._broken_before = self.broken()
        count = count_bonds_of_sites(self.places, self._row, engine.fine.tiles.offsets, self._bits)
        count += np.bincount(self._broken_before.source, minlength=len(count))
        of_springs = self._coarse_sites, self._spring_row, engine.coarse.tiles.offsets, self._spring_bits
        count[self._coarse] += count_bonds_of_sites(*of_springs)
        family = count.copy()
        family[self._fine] += engine.full_body.precrack_cut_counts_of_places[self.grid_rows[self._fine]]
        self.initial_bond_counts_and_family_sizes = count, family

    @property
    def kind(self) -> np.dtype[Any]:
        """Precision of the motion."""
        return np.dtype(self.engine.kind)

    @cached_property
    def current_nodes_model(self) -> Model:
        """The model of the n current nodes, without conditions."""
        engine, widths = self.engine, np.ones(len(self.places))
        assert engine.full_body.model is not None
        widths[self._coarse] = 2.0
        model = model_of_rows_with_spacing_and_areas(engine.full_body.model, self.grid_rows, widths, self.area)
        if not model.settings.regions:
            return model
        return ModelWithMeanDensities(model.grid, model.settings, model.name, engine.rho[self.grid_rows])

    @property
    def signatures_of_changes(self) -> NDArray[np.int64]:
        """Signature (n,) that changes if a node, its volume or its bonds change."""
        count, family = self.initial_bond_counts_and_family_sizes
        return np.asarray(self.area.view(np.int64) * 31 + 4096 * family + count)

    @property
    def nodes_are_unchanged(self) -> bool:
        """Whether no cell has become fine since this operator was made."""
        return self.engine.cell_changes == self._changes

    def new_operator_if_nodes_changed(self) -> HybridBodyOperator | None:
        """The operator on the current nodes if they have changed, else None."""
        return None if self.nodes_are_unchanged else HybridBodyOperator(self.engine)

    def _write_node_motion(self, state: State) -> None:
        """Set the nodes to the values and rates of a state."""
        engine, by_engine = self.engine, np.argsort(self._order)
        engine.scatter(state.value[by_engine].T, engine.coarse.u[0], engine.fine.u[0])
        engine.scatter(state.rate[by_engine].T, engine.coarse.v[0], engine.fine.v[0])

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let springs stretch from their lengths at these strains (n,) of all nodes of the grid, were they free."""
        self.engine.set_swelling_strain(strain)

    def copy_to_state(self, state: State) -> None:
        """Update a state from the nodes."""
        engine = self.engine
        state.value[:] = engine.gather(engine.coarse.u[0], engine.fine.u[0])[:, self._order].T
        state.rate[:] = engine.gather(engine.coarse.v[0], engine.fine.v[0])[:, self._order].T
        for values, of_engine in zip(state[2:], engine.state[2:], strict=True):
            values[:] = of_engine[self.grid_rows]

    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations (n, 3), m/s^2, from the most recent sum of forces of bonds and ground springs."""
        return self.engine.bond_accelerations[self.grid_rows].astype(np.float64)

    def dissipated_energy(self) -> NDArray[np.float64]:
        """Energy density (n,), J/m^3, dissipated so far by the nodes' broken bonds."""
        return np.asarray(self.engine.state.dissipated[self.grid_rows])

    def forces_at_displacements(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces (n, 3), N, at displacements (n, 3), m, after which the motion is as before; nothing breaks."""
        nodes, before, largest_strain = len(value), self.state(), float(self.engine.largest_strain[0])
        self._write_node_motion(State(value, *np.zeros((2, nodes, 3)), *np.zeros((3, nodes))))
        self.engine.sum_forces_and_break_bonds(0, 0.0)
        self._write_node_motion(before)
        self.engine.largest_strain[0] = largest_strain
        return self.accelerations() * (self.engine.rho[self.grid_rows] * self.area)[:, None]

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        self.set_node_motion(state)
        energy, softened = (values[self.grid_rows] for values in self.engine.energies())
        self._strain, self._softening = float(energy.sum()), float(softened.sum())
        return energy / self.area, softened / self.area

    def energy_balance_totals(self) -> EnergyBalanceTotals:
        """Energies, work and momentum at the state of the last call of `energies`."""
        state = self.engine.state
        kinetic, x, y, z = self.engine.kinetic_energy_and_momentum().tolist()
        dissipated, work, damped = (
            float((self.area * values[self.grid_rows]).sum()) for values in (state.dissipated, state.work, state.damped)
        )
        work += self.engine.swelling_work
        broken = len(self.engine.fine.broken().step)
        return EnergyBalanceTotals(kinetic, self._strain, dissipated + self._softening, damped, work, x, y, broken, z)

    def load_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 3), N, of the loads at factor 1."""
        loads, forces = self.engine.drive.loads, np.zeros((profile_count, 3))
        np.add.at(forces, (loads.profile, loads.axis), loads.value * self.engine.full_volume[loads.node])
        return forces

    def constraint_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 3), N, that hold the nodes with prescribed motion, and of springs to the ground."""
        engine, holds = self.engine, self.engine.drive.holds
        forces = engine.ground_spring_force_by_profile(profile_count)
        now = np.logical_or(*engine.is_current(holds.node))
        node, axis = holds.node[now], holds.axis[now]
        acceleration = np.where(holds.kind[now] == ACCELERATION, engine.state.second[node, axis], 0.0)
        force = engine.volume[node] * (engine.rho[node] * acceleration - engine.held_force[now])
        np.add.at(forces, (holds.profile[now], axis), force)
        return forces

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness that resists each node's motion, N/m^4; see `Operator`."""
        return self.engine.full_body.stiffness_over_density * self.current_nodes_model.rho

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (3 n, 3 n), N/m^4, of the force densities by the values; see `Operator`."""
        from scipy.sparse import diags_array, eye_array, vstack  # few runs need it, and it takes long to import

        from pdsolve.operators.tangent import of_followers
        from pdsolve.zone.tangent import tangent_of_ground_springs, tangent_of_springs

        nodes, seam = len(self.places), self.engine.seam
        ends, margin = seam.pieces.points, self.engine.full_body.coarse_sites.margin
        fine = self._row[ends.interpolation_nodes.clip(min=0) - self.engine.full_body.fine_sites.margin]
        coarse = self._spring_row[-1 - ends.interpolation_nodes.clip(max=-1) - margin]
        of_border = of_followers(self._spring_row[seam.border.coarse_places - margin], seam.border.weights, nodes)
        of_ends = of_followers(np.where(ends.interpolation_nodes >= 0, fine, coarse), ends.interpolation_weights, nodes)
        points = vstack([eye_array(nodes), of_border, of_ends]).tocsr()
        density = diags_array(np.repeat(1 / self.area, 3))
        ground = self.engine.ground_springs
        row = self._row[self.engine.full_body.fine_sites.site[ground.node] - self.engine.full_body.fine_sites.margin]
        of_ground = tangent_of_ground_springs(row, ground.axis, ground.value / self.area[row], state.value.shape)
        springs = self._springs_between_points(points @ state.value)
        return (density @ tangent_of_springs(points, state.value, springs)).tocsr() + of_ground

    def _springs_between_points(self, u: NDArray[np.floating]) -> Iterator[SpringsBetweenPoints]:
        """The fine bonds, coarse springs, and pieces of clipped bonds, from both ends. Points are the nodes, those on
        the border, and the ends of pieces, and have the displacements u (p, 3)."""
        from pdsolve.zone.tangent import BondCurves, SpringsBetweenPoints

        engine, seam, nodes, border = (
            self.engine,
            self.engine.seam,
            len(self.places),
            len(self.engine.seam.border.place),
        )
        fine_place = np.concatenate([engine.full_body.fine_sites.margin + self.places, seam.border.place])
        numbers = self._row.copy()
        numbers[seam.border.place - engine.full_body.fine_sites.margin] = nodes + np.arange(border)
        fine_volume = engine.fine_volume[fine_place - engine.full_body.fine_sites.margin]
        coarse_place = np.full(nodes, engine.full_body.coarse_sites.margin)
        coarse_place[self._coarse] += self._coarse_sites
        for lattice, site, node, points, force_per_density in (
            (engine.fine, fine_place, numbers, np.append(self._fine, nodes + np.arange(border)), fine_volume),
            (engine.coarse, coarse_place, self._spring_row, self._coarse, np.ones(nodes)),
        ):
            tiles, sites = lattice.tiles, lattice.sites._replace(site=site.astype(np.int32), node=node)
            source, target, slot = tile_bonds.list_bonds(sites, tiles.bits, points)
            xi, stiffness = tile_bonds.springs_of_bonds(tiles, sites, source, target, slot)
            stiffness, eta = stiffness * force_per_density[source], u[target] - u[source]
            if pair_of(tiles.law).is_curved:
                curve = BondCurves(engine.full_body.law, *tile_bonds.curves_of_bonds(tiles, sites, source, slot))
                yield SpringsBetweenPoints(source, target, xi, stiffness, False, curve)
                continue
            softens = ((2 * xi + eta) * eta).sum(axis=1) > tiles.floor
            share = tile_bonds.remaining_shares(tiles, sites, source, slot)
            yield SpringsBetweenPoints(source, target, xi, stiffness * np.where(softens, share, 1.0), False)
        groups, is_stiff = seam.pieces.groups, seam.pieces.groups.stiffness > 0
        near = nodes + border + np.repeat(groups.near_point, TOGETHER)[is_stiff].astype(np.int64)
        far = nodes + border + groups.far_point[is_stiff].astype(np.int64)
        piece_xi, stiffness = seam.pieces.xi[groups.xi_row[is_stiff], :3], groups.stiffness[is_stiff]
        stiffness = stiffness * np.sqrt((piece_xi**2).sum(axis=1))
        for first, second, sign in ((near, far, 1.0), (far, near, -1.0)):
            yield SpringsBetweenPoints(first, second, sign * piece_xi, stiffness, False)

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        return self.bonds_of(np.arange(first_row, len(self.places) if end_row is None else end_row), at_start)

    def bonds_of(self, rows: NDArray[np.int64], at_start: bool = False) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of these nodes, which increase, in order; or of those at the
        start, if `at_start`."""
        fine, coarse, is_coarse = self.engine.fine.tiles, self.engine.coarse.tiles, np.isin(self._coarse, rows)
        bits = self._bits if at_start else self._bits & fine.bits
        springs = self._coarse_sites[is_coarse], self._coarse[is_coarse], self._spring_row
        bond_lists = [
            list_bonds_of_sites(self.places[rows], rows, self._row, fine._replace(bits=bits)),
            list_bonds_of_sites(*springs, coarse._replace(bits=self._spring_bits)),
        ]
        if at_start:
            is_wanted = np.isin(self._broken_before.source, rows)
            bond_lists.append((self._broken_before.source[is_wanted], self._broken_before.target[is_wanted]))
        source, target = (np.concatenate(ends) for ends in zip(*bond_lists, strict=True))
        order = np.lexsort((target, source))
        return source[order], target[order]

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step between these nodes: step, source and target row of each."""
        broken, sites = self.engine.fine.broken(after_step), self.engine.full_body.fine_sites
        source, target = (self._row[sites.site[end] - sites.margin].astype(np.int64) for end in broken[1:])
        is_here = (source >= 0) & (target >= 0)
        return Broken(broken.step[is_here], source[is_here], target[is_here])
