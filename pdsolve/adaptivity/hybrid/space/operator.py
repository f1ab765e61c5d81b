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

from pdsolve.adaptivity.hybrid.space import arrangement, coarse_springs, pieces
from pdsolve.adaptivity.hybrid.space.clipped_pieces import TOGETHER
from pdsolve.adaptivity.hybrid.space.layout import (
    BodyZone,
    FullBody,
    ZoneHistory,
    coarse_nodes_at_cell_corners,
    list_bonds_of_sites,
    mask_near_cells,
    zone_after_refinement,
)
from pdsolve.adaptivity.hybrid.space.materials import ModelWithMeanDensities, fine_node_masses
from pdsolve.adaptivity.hybrid.space.zone import refine_cells_within_radius
from pdsolve.bonds.assembly import Counted
from pdsolve.checkpoint_validation import entry, like
from pdsolve.codegen.vector_code import ROW
from pdsolve.errors import CheckpointError
from pdsolve.lattice import tile_bonds
from pdsolve.lattice.energies import sum_energies
from pdsolve.lattice.operator import TileLattice
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.sums import sum_some, sum_tiles
from pdsolve.lattice.tiles import EMPTY, SOFTENED, VOLUME, Tiles, room_for
from pdsolve.model import Model
from pdsolve.numerics.thread_team import share
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken, State, Unknown
from pdsolve.zone.cells import (
    AHEAD,
    BORDER,
    COARSE,
    FINE,
    FREE,
    ZoneNumbering,
    cell_at,
    lattice_coordinates,
    place_number_at,
)
from pdsolve.zone.node_models import model_of_rows_with_spacing_and_areas
from pdsolve.zone.springs import double_green_strain_from_stretch
from pdsolve.zone.summary import ZoneSummary, create_too_late_error

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.zone.tangent import SpringsBetweenPoints


class HybridBodyOperator:
    """The operator of the n current nodes, in the order of their fine sites."""

    name = "hybrid"
    symmetric = True
    unknowns: tuple[Unknown, ...] = (Unknown("u", 3, 2),)

    def __init__(self, full_body: FullBody, zone: BodyZone, history: ZoneHistory, threads: int) -> None:
        """`zone` is that of its cells."""
        self.full_body, self._zone, self.history, self._threads = full_body, zone, history, threads
        fine, count = full_body.fine_lattice, len(full_body.fine_sites.node)
        self.sites = np.flatnonzero((zone.node_kinds == FREE) | zone.has_coarse_node)
        self.rows = fine.tiles.node[self.sites].astype(np.int64)  # of the grid
        self._row = np.full(count, -1, dtype=np.int32)
        self._row[self.sites] = np.arange(len(self.sites))
        self._free = np.flatnonzero(zone.node_kinds[self.sites] == FREE)
        self._coarse = np.flatnonzero(zone.has_coarse_node[self.sites])
        self._border = np.flatnonzero(zone.node_kinds == BORDER)
        nodes, border, margin = len(self.sites), len(self._border), full_body.fine_sites.margin
        on, self._w = np.zeros((border, arrangement.ENDS), np.int64), np.zeros((border, arrangement.ENDS))
        arrangement.fill_border_interpolation_nodes(fine.numbering, self._border, on, self._w)
        self._on, self._pieces = (
            self._row[on],
            pieces.create_grouped_bond_piece_springs(fine, zone.node_kinds, self._row, zone.clipped_pieces),
        )
        volume = fine.node_volume * fine.tiles.cells[VOLUME, margin : margin + count]
        self.volume = self._lump_fine_values_to_current_nodes(volume)
        self._border_volume = volume[self._border]
        tiles, springs = self._tiles_with_node_numbers(zone.fine_tiles), zone.coarse_springs
        points = (margin + np.append(self.sites, self._border)).astype(np.int32)
        sites, bound = full_body.fine_sites._replace(site=points, node=tiles.node), np.zeros(len(points))
        self.fine_bonds = TileLattice(full_body.law, tiles, sites, bound, True, threads)  # of nodes and border nodes
        springs.node[:] = -1
        springs.node[self._coarse_sites_at(self.sites[self._coarse])] = self._coarse
        springs = springs._replace(unbreakable=np.ones(nodes, np.bool_), material=np.zeros(nodes, np.uint8))
        self._zone = zone._replace(coarse_springs=springs)
        self._coarse_sites = self.full_body.coarse_sites.margin + self._coarse_sites_at(self.sites[self._coarse])
        self._force, self._density = np.zeros((nodes, 3)), np.zeros((nodes + border, 3))
        self._point_u = np.zeros((nodes + border, 3), self.kind)  # of nodes and border nodes

    @property
    def _numbering(self) -> ZoneNumbering:
        return self.full_body.fine_lattice.numbering

    @cached_property
    def _spring_sites(self) -> Sites:
        """The coarse sites of nodes, 0 of those that are none."""
        at = self.full_body.coarse_sites
        site = np.full(len(self.sites), at.margin, dtype=np.int32)
        site[self._coarse] = self._coarse_sites
        return at._replace(site=site, node=self._zone.coarse_springs.node)

    def _lump_fine_values_to_current_nodes(self, fine_values: NDArray[np.floating]) -> NDArray[np.float64]:
        """What nodes (n,) have of what is the fine nodes' `fine_values` (sites,)."""
        node_values, coarse = fine_values[self.sites].astype(np.float64), np.zeros(len(self._coarse))
        arrangement.lump_fine_values_to_coarse_nodes(
            self.full_body.fine_lattice, self._zone.node_kinds, self.sites[self._coarse], fine_values, coarse
        )
        node_values[self._coarse] = coarse
        return node_values

    def _coarse_sites_at(self, sites: NDArray[np.int64]) -> NDArray[np.int64]:
        """The coarse sites at fine sites."""
        numbering = self._numbering
        return np.asarray(place_number_at(numbering.coarse, cell_at(lattice_coordinates(numbering.fine, sites))))

    def _tiles_with_node_numbers(self, tiles: Tiles) -> Tiles:
        """The tiles with the numbers of nodes, followed by those on the border, whose bonds do not break."""
        zone, full_tiles, nodes = self._zone, self.full_body.fine_lattice.tiles, len(self.sites)
        tiles.node[:] = np.where(zone.node_kinds == FREE, self._row, -1)
        tiles.node[self._border] = nodes + np.arange(len(self._border))
        has_node = (tiles.node.reshape(-1, ROW) >= 0).any(axis=1)
        tiles.kind[:] = np.where(has_node, full_tiles.kind + np.uint8(SOFTENED) * (tiles.memory >= 0), EMPTY)
        every = np.concatenate([self.rows, full_tiles.node[self._border]])
        unbreakable = full_tiles.unbreakable[every]
        unbreakable[nodes:] = True
        return tiles._replace(unbreakable=unbreakable, material=full_tiles.material[every])

    @cached_property
    def current_nodes_model(self) -> Model:
        """The model of the n current nodes, without conditions."""
        assert self.full_body.model is not None
        widths = np.ones(len(self.rows))
        widths[self._coarse] = 2.0
        active_model = model_of_rows_with_spacing_and_areas(self.full_body.model, self.rows, widths, self.volume)
        if not active_model.settings.regions:
            return active_model
        mass = self._lump_fine_values_to_current_nodes(
            fine_node_masses(self.full_body.model, self.full_body.fine_sites, self.full_body.fine_lattice)
        )
        return ModelWithMeanDensities(active_model.grid, active_model.settings, active_model.name, mass / self.volume)

    @property
    def kind(self) -> np.dtype[Any]:
        """Precision of the motion."""
        return self._zone.coarse_u.dtype

    @cached_property
    def damping_rates(self) -> NDArray[np.float64]:
        """Damping (n,), 1/s, of the current nodes: that of the fine nodes where they are."""
        return self.full_body.damping_rates[self.rows]

    def to_own_layout(self, state: State) -> State:
        """The state itself: its arrays are those of all nodes."""
        return state

    def _set_displacements(self, value: NDArray[np.floating]) -> NDArray[np.floating]:
        """Set displacements (n, 3), m, of coarse nodes; returns those of nodes and border nodes."""
        point_u, nodes = self._point_u, len(self.sites)
        point_u[:nodes] = value
        pieces.interpolate_border_displacements(self._on, self._w, value, point_u[nodes:])
        pieces.copy_displacements_to_sites(self._coarse, self._coarse_sites, value, self._zone.coarse_u)
        return point_u

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, 3), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long.

        Raises FineZoneTooLateError if a clipped bond would soften or break.
        """
        points = self._set_displacements(state.value)
        zone, nodes, force, density = self._zone, len(self.sites), self._force, self._density
        force[:], density[:] = 0, 0
        self.fine_bonds.accumulate_force(state._replace(value=points), density, step, dt)
        nothing = room_for(ROW * len(zone.coarse_springs.offsets) + 1)
        of_state = state.rate, dt, 0, force, state.dissipated

        def work(first: int, last: int) -> None:
            sum_tiles(zone.coarse_springs, zone.coarse_u, *of_state, nothing, first, last)

        share(work, len(zone.coarse_springs.kind), self._threads)
        largest = self._add_bond_piece_forces(state.value, force)
        out += density[:nodes] + force / self.volume[:, None]
        self.history = self.history._replace(largest_clipped_strain=max(self.history.largest_clipped_strain, largest))
        if step > 0 and largest > self._least_peak_strain:
            raise create_too_late_error(step, self.zone_summary())

    @property
    def _least_peak_strain(self) -> float:
        return float(double_green_strain_from_stretch(self.full_body.fine_lattice.tiles.peak.min()))

    def force_densities_near_new_cells(
        self, state: State, new_cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Force densities (n, 3), N/m^3, on nodes whose bonds may be others since `new_cells` (k, 3) became fine, and
        which (n,) these are; nothing breaks."""
        numbering, reach = self._numbering, self.full_body.fine_lattice.reach
        which = mask_near_cells(numbering, new_cells, reach + 1)[
            self.sites
        ]  # the ends of pieces move with nodes up to 2 h from them
        self.fine_bonds.place_displacements(self._set_displacements(state.value))
        zone, density, force, bonds = self._zone, self._density, self._force, self.fine_bonds
        force[:], density[:] = 0, 0
        for tiles, u, out, site_mask in (
            (bonds.tiles, bonds.u[0], density, mask_near_cells(numbering, new_cells, reach + 2)),
            (zone.coarse_springs, zone.coarse_u, force, np.ones(len(zone.coarse_springs.node), dtype=np.bool_)),
        ):
            sum_some(tiles, u, state.rate, out, state.dissipated, site_mask)
        self._add_bond_piece_forces(state.value, force)
        return density[: len(self.sites)] + force / self.volume[:, None], which

    def _add_bond_piece_forces(self, value: NDArray[np.float64], force: NDArray[np.float64]) -> float:
        """Add to `force` (n, 3), N, that of pieces and what is on the border; the largest e of pieces."""
        largest = pieces.add_bond_piece_forces(value, self._pieces, force)
        pieces.distribute_border_densities_to_coarse_nodes(
            self._density[len(self.sites) :], self._on, self._w, self._border_volume, force
        )
        return float(largest)

    def forces_at_displacements(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces (n, 3), N, at displacements (n, 3), m; nothing breaks."""
        nodes = len(value)
        state, out = State(value, *np.zeros((2, nodes, 3)), *np.zeros((3, nodes))), np.zeros((nodes, 3))
        self.accumulate_force(state, out, 0, 0.0)
        return out * self.volume[:, None]

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        zone = self._zone
        every, above = (np.ones(len(sites), dtype=np.bool_) for sites in (zone.node_kinds, zone.coarse_springs.node))
        return self._energy_densities(state, every, above)

    def energies_near_new_cells(self, state: State, new_cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Strain energy densities (n,), J/m^3, without bonds that are as before `new_cells` (k, 3) became fine."""
        site_mask = mask_near_cells(self._numbering, new_cells, self.full_body.fine_lattice.reach - 1)
        above = np.zeros(len(self._zone.coarse_springs.node), np.bool_)
        above[place_number_at(self._numbering.coarse, tuple(coarse_nodes_at_cell_corners(new_cells).T))] = True
        return self._energy_densities(state, site_mask, above)[0]

    def _energy_densities(
        self, state: State, site_mask: NDArray[np.bool_], coarse_site_mask: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3, stored in and dissipated by softening of bonds, springs and pieces from fine
        nodes of `site_mask` (sites,), or coarse ones of `coarse_site_mask` (sites,), and others in their tiles."""
        self.fine_bonds.place_displacements(self._set_displacements(state.value))
        zone, nodes, node_energy = self._zone, len(self.sites), np.zeros(len(self.sites))
        bond_density, spent = np.zeros((2, len(self._density)))
        tiles, u = self.fine_bonds.tiles, self.fine_bonds.u[0]
        sum_energies(tiles, tiles, u, bond_density, spent, 0, len(tiles.kind), site_mask)
        coarse_springs.add_spring_energies(
            zone.coarse_springs,
            zone.coarse_u,
            node_energy,
            np.flatnonzero(coarse_site_mask.reshape(-1, ROW).any(axis=1)),
        )
        pieces.add_bond_piece_energies(state.value, self._pieces, site_mask, node_energy)
        pieces.distribute_border_densities_to_coarse_nodes(
            bond_density[nodes:, None], self._on, self._w, self._border_volume, node_energy[:, None]
        )
        return node_energy / self.volume + bond_density[:nodes], spent[:nodes]

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: bonds store no fields beside the displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness that resists each node's motion, N/m^4; see `Operator`."""
        return self.full_body.stiffness_over_density * self.current_nodes_model.rho

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative (3 n, 3 n), N/m^4, of the force densities by the values; see `Operator`."""
        from scipy.sparse import diags_array, eye_array, vstack  # few runs need it, and it takes long to import

        from pdsolve.operators.tangent import of_followers
        from pdsolve.zone.tangent import tangent_of_springs

        nodes, interpolation_nodes = len(self.sites), self._pieces.points
        followers = (
            (self._on, self._w),
            (interpolation_nodes.interpolation_nodes, interpolation_nodes.interpolation_weights),
        )
        points = vstack([eye_array(nodes), *(of_followers(*each, nodes) for each in followers)]).tocsr()
        density = diags_array(np.repeat(1 / self.volume, 3))
        return (density @ tangent_of_springs(points, state.value, self._springs_between_points())).tocsr()

    def _springs_between_points(self) -> Iterator[SpringsBetweenPoints]:
        """The fine bonds, coarse springs, and pieces of clipped bonds, from both ends. Points are the nodes, those on
        the border, and the ends of pieces."""
        from pdsolve.zone.tangent import SpringsBetweenPoints

        nodes, border, bonds, springs = len(self.sites), len(self._border), self.fine_bonds, self._zone.coarse_springs
        bond_points = np.append(self._free, nodes + np.arange(border))
        for tiles, sites, points, force_per_density in (
            (bonds.tiles, bonds.sites, bond_points, np.append(self.volume, self._border_volume)),
            (springs, self._spring_sites, self._coarse, np.ones(nodes)),
        ):
            source, target, slot = tile_bonds.list_bonds(sites, tiles.bits, points)
            xi, stiffness = tile_bonds.springs_of_bonds(tiles, sites, source, target, slot)
            stiffness *= tile_bonds.remaining_shares(tiles, sites, source, slot) * force_per_density[source]
            yield SpringsBetweenPoints(source, target, xi, stiffness, False)
        groups, is_stiff = self._pieces.groups, self._pieces.groups.stiffness > 0
        near = nodes + border + np.repeat(groups.near_point, TOGETHER)[is_stiff].astype(np.int64)
        far = nodes + border + groups.far_point[is_stiff].astype(np.int64)
        piece_xi, stiffness = self._pieces.xi[groups.xi_row[is_stiff], :3], groups.stiffness[is_stiff]
        stiffness = stiffness * np.sqrt((piece_xi**2).sum(axis=1))
        for first, second, sign in ((near, far, 1.0), (far, near, -1.0)):
            yield SpringsBetweenPoints(first, second, sign * piece_xi, stiffness, False)

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        end_row = len(self.sites) if end_row is None else end_row
        bonds, springs, rows = self.fine_bonds, self._zone.coarse_springs, np.arange(first_row, end_row)
        low, high = np.searchsorted(self._coarse, [first_row, end_row])
        with bonds.breaking:
            bond_lists = [list_bonds_of_sites(self.sites[first_row:end_row], rows, self._row, bonds.tiles)]
            _, broken_source, broken_target = self.broken()
        sites, rows = self._coarse_sites[low:high] - self.full_body.coarse_sites.margin, self._coarse[low:high]
        bond_lists.append(list_bonds_of_sites(sites, rows, springs.node, springs))
        if at_start:
            in_range = (broken_source >= first_row) & (broken_source < end_row)
            bond_lists.append((broken_source[in_range], broken_target[in_range]))
        source, target = (np.concatenate(ends) for ends in zip(*bond_lists, strict=True))
        order = np.lexsort((target, source))
        return source[order], target[order]

    @cached_property
    def volumes_and_bond_counts(self) -> Counted:
        """Volumes (n,), and numbers of bonds at the start, with and without those cut by pre-cracks."""
        return self._count_bonds(np.ones(len(self.sites), dtype=np.bool_), np.zeros(len(self.sites), dtype=np.int64))

    def _count_bonds(self, changed: NDArray[np.bool_], known_counts: NDArray[np.int64]) -> Counted:
        """Volumes (n,) and numbers of bonds at the start; `known_counts` (n,) of those that are not `changed` (n,)."""
        springs, count, tiles = self._zone.coarse_springs, known_counts, self.fine_bonds.tiles
        with self.fine_bonds.breaking:
            sites = self.sites[changed]
            count[changed] = arrangement.count_bonds_of_sites(sites, self._row, tiles.offsets, tiles.bits)
            source = self.broken().source
            count += np.bincount(source[changed[source]], minlength=len(count))
        fresh = changed[self._coarse]
        above = self._coarse_sites[fresh] - self.full_body.coarse_sites.margin
        count[self._coarse[fresh]] += arrangement.count_bonds_of_sites(
            above, springs.node, springs.offsets, springs.bits
        )
        family = count.copy()
        family[self._free] += self.full_body.precrack_cut_counts_of_places[self.rows[self._free]]
        return Counted(self.volume, family, count)

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        return self.fine_bonds.broken(after_step)

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone."""
        share, peak = (
            np.count_nonzero(self._zone.cell_kinds == FINE) / self.full_body.solid_cell_count,
            self._least_peak_strain,
        )
        stretch = self.history.largest_clipped_strain / (1 + np.sqrt(1 + self.history.largest_clipped_strain))
        return ZoneSummary(self.history.refinement_energy, float(share), float(stretch / (np.sqrt(1 + peak) - 1)))

    def mark_new_fine_cells(self, state: State, after_step: int) -> NDArray[np.int64]:
        """Cells (k, 3) that become fine: around bonds that have softened or broken after a step, and around stretched
        springs.

        They are marked as fine at once; `operator_after_refinement` makes the operator for them.
        """
        self._set_displacements(state.value)
        zone, numbering, fine = self._zone, self._numbering, self.full_body.fine_lattice
        sites = np.unique(self.sites[self.broken(after_step).source])
        hot_sites = np.zeros(26 * max(len(self._coarse), 1), dtype=np.int64)
        unbreakable = fine.tiles.unbreakable[self.rows]
        count = coarse_springs.list_nodes_with_stretched_springs(
            numbering, zone.coarse_springs, unbreakable, zone.coarse_u, self.full_body.refinement_stretch, hot_sites
        )
        tiles, softened = self.fine_bonds.tiles, np.flatnonzero(self.fine_bonds.tiles.memory >= 0)
        which, _, lane = np.nonzero(tiles.worst[tiles.memory[softened]])
        sites = np.unique(np.concatenate([sites, hot_sites[:count], softened[which] * ROW + lane]))
        new = np.zeros(np.count_nonzero(zone.cell_kinds == COARSE), dtype=np.int64)
        count = refine_cells_within_radius(numbering, zone.cell_kinds, sites, AHEAD, new)
        return np.column_stack(lattice_coordinates(numbering.cells, new[:count]))

    def operator_after_refinement(self, new_cells: NDArray[np.int64]) -> HybridBodyOperator:
        """The operator after the cells `new_cells` (k, 3) have become fine."""
        bonds, full_body, broken = self.fine_bonds, self.full_body, self.broken()
        tile, slot, bit = tile_bonds.find_slots(bonds.sites, broken.source, broken.target)
        np.bitwise_and.at(full_body.fine_lattice.tiles.bits, (tile, slot), ~bit)  # so that none is there again
        zone = zone_after_refinement(full_body, self._zone._replace(fine_tiles=bonds.tiles), new_cells)
        after = HybridBodyOperator(full_body, zone, self.history, self._threads)
        row_after, (step, source, target) = after._row[self.sites].astype(np.int64), broken
        pending_bonds = bonds.pending.bonds.copy()
        pending_bonds[:, 1:] = row_after[pending_bonds[:, 1:]]
        pending = bonds.pending._replace(bonds=pending_bonds)
        after.fine_bonds.take_over(Broken(step, row_after[source], row_after[target]), pending)
        row = self._row[after.sites]
        near_new = mask_near_cells(self._numbering, new_cells, self.full_body.fine_lattice.reach + 1)
        changed = (row < 0) | near_new[after.sites]
        after.volumes_and_bond_counts = after._count_bonds(
            changed, np.where(changed, 0, self.volumes_and_bond_counts.bonds[row])
        )
        return after

    def operator_with_checkpoint_cells(self, checkpoint: CheckpointArrays) -> HybridBodyOperator:
        """The operator of a checkpoint's cells, some of which have become fine. Raises CheckpointError."""
        cells = like(checkpoint, "cells", self._zone.cell_kinds)
        new = (self._zone.cell_kinds == COARSE) & (cells == FINE)
        if not ((cells == self._zone.cell_kinds) | new).all():
            raise CheckpointError("cells are not those of the start; coarse ones may only become fine")
        self._zone.cell_kinds[:] = cells
        return self.operator_after_refinement(
            np.column_stack(lattice_coordinates(self._numbering.cells, np.flatnonzero(new)))
        )

    def interpolate_at_grid_rows(self, grid_rows: NDArray[np.int64], values: NDArray[np.floating]) -> NDArray[Any]:
        """Values (k, 3) of rows of the grid `grid_rows` (k,), interpolated from those of the nodes here (n, 3)."""
        rows = self.current_rows_of_grid_rows(grid_rows)
        grid_values, is_new = values[rows], rows < 0
        interpolation_nodes, w = self.interpolation_rows_and_weights_of_grid_rows(grid_rows[is_new])
        grid_values[is_new] = (w[:, :, None] * values[interpolation_nodes]).sum(axis=1)
        return grid_values

    def current_rows_of_grid_rows(self, grid_rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows (k,) of the rows of the grid `grid_rows`, -1 for nodes that are none now."""
        return self._row[self.full_body.fine_sites.site[grid_rows] - self.full_body.fine_sites.margin].astype(np.int64)

    def interpolation_rows_and_weights_of_grid_rows(
        self, grid_rows: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Rows (k, 8) of the nodes that move rows of the grid `grid_rows` (k,), and their shares."""
        margin = self.full_body.fine_sites.margin
        sites, numbering = self.full_body.fine_sites.site[grid_rows] - margin, self._numbering.fine
        node_rows, at = self._row[sites], np.column_stack(lattice_coordinates(numbering, sites))
        rows, w = np.zeros((len(grid_rows), 8), np.int64), np.zeros((len(grid_rows), 8))
        for number, corner_steps in enumerate(np.ndindex(2, 2, 2)):
            step = np.array(corner_steps)
            w[:, number] = np.where(at % 2 == 1, 0.5, 1.0 - step).prod(axis=1)
            end = np.minimum(at - at % 2 + 2 * step, np.array(numbering.counts) - 1)
            rows[:, number] = self._row[place_number_at(numbering, tuple(end.T))]
        is_node = node_rows >= 0
        rows[is_node], w[is_node] = node_rows[is_node, None], np.eye(8)[0]
        rows[w == 0] = 0
        return rows, w

    @property
    def cell_kinds(self) -> NDArray[np.uint8]:
        """All cells (c,)."""
        return self._zone.cell_kinds

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The history of bonds, the cells and the books for a checkpoint."""
        cells, books = self._zone.cell_kinds.copy(), np.array(self.history)
        return {**self.fine_bonds.checkpoint_arrays(), "cells": cells, "zone_books": books}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the broken bonds and the books of a checkpoint of these cells."""
        if not np.array_equal(like(checkpoint, "cells", self._zone.cell_kinds), self._zone.cell_kinds):
            raise CheckpointError("cells are not those of the nodes")
        self.history = ZoneHistory(*entry(checkpoint, "zone_books", (2,), float).tolist())
        self.fine_bonds.restore(checkpoint, broken)

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        parts = (
            *self._zone,
            *self._zone.coarse_springs,
            *self.full_body.fine_lattice.tiles,
        )
        return self.fine_bonds.bytes() + sum(getattr(array, "nbytes", 0) for array in parts)
