"""Time integration of a body with a moving fine zone; what follows from its cells is changed in place.

Nodes are numbered by the rows of the grid, n of them: fine nodes in fine cells alone, and coarse nodes, which lie on
fine ones. A fine node on the border has the number of its row plus n in tiles, and no motion of its own.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space import arrangement, coarse_springs, pieces
from pdsolve.adaptivity.hybrid.space.arrangement import ClippedBondPiece
from pdsolve.adaptivity.hybrid.space.layout import FullBody, coarse_nodes_at_cell_corners, mask_near_cells
from pdsolve.adaptivity.hybrid.space.march import (
    BorderNodes,
    GroundSprings,
    Seam,
    add_ground_spring_forces,
    interpolate_border_displacements,
    sweep_zone,
)
from pdsolve.adaptivity.hybrid.space.materials import fine_node_masses
from pdsolve.adaptivity.hybrid.space.swelling import SwellingBody, bending_of_places
from pdsolve.adaptivity.hybrid.space.zone import refine_cells_within_radius
from pdsolve.checkpoint_validation import entry, like
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import ACCELERATION, Drive, Entries, chosen, drive_of, factors_at, put_loads
from pdsolve.errors import CheckpointError
from pdsolve.lattice import tile_bonds
from pdsolve.lattice.energies import sum_energies
from pdsolve.lattice.march import LatticeMarch, SweepRange
from pdsolve.lattice.marched_bonds import MarchedTiles
from pdsolve.lattice.operator import TileLattice
from pdsolve.lattice.sums import sum_some
from pdsolve.lattice.tile_bonds import INVERSE, PULL
from pdsolve.lattice.tiles import EMPTY, MODULUS, SOFTENED, VOLUME
from pdsolve.numerics.memory import aligned_zeros, bytes_of_arrays
from pdsolve.numerics.thread_team import gate_of, side_by_side
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken, State, zero_state
from pdsolve.zone.cells import (
    AHEAD,
    BORDER,
    COARSE,
    EVERY,
    FINE,
    FREE,
    cell_at,
    lattice_coordinates,
    place_number_at,
    place_on_finer_lattice,
)
from pdsolve.zone.springs import double_green_strain_from_stretch
from pdsolve.zone.summary import ZoneSummary, create_too_late_error

PIECES_OF_NODE = 16  # about
STATE = "second", "dissipated", "work", "damped"  # of a node's state, what is not its motion


class CurrentNodes(NamedTuple):
    """The k nodes that move: j coarse ones, and then fine ones."""

    rows: NDArray[np.int64]  # (k,) of the grid
    sites: NDArray[np.int64]  # (k,) fine ones
    coarse_places: NDArray[np.int64]  # (j,)
    fine_places: NDArray[np.int64]  # (k - j,)


class BodyEngine(SwellingBody):
    """A body in motion."""

    def __init__(
        self,
        full_body: FullBody,
        cell_kinds: NDArray[np.uint8],
        vertex_force_ratio: float,
        threads: int,
        kind: type[np.floating],
    ) -> None:
        """Cells (c,) are those of the start; the motion has the precision `kind`."""
        fine, sites = full_body.fine_lattice, full_body.fine_sites
        self.node_count, site_count, tiles = len(sites.site), len(sites.node), fine.tiles
        self.full_body, self.cell_kinds, self.threads, self.kind = full_body, cell_kinds, threads, kind
        self.node_kinds, self.has_coarse_node = np.zeros(site_count, np.uint8), np.zeros(site_count, np.bool_)
        self.clipped_pieces = np.empty(0, ClippedBondPiece.fields())
        tiles = tile_bonds.in_precision(tiles, kind)._replace(
            bits=np.zeros_like(tiles.bits),
            node=np.full(site_count, -1, np.int32),
            kind=np.full(len(tiles.kind), EMPTY, np.uint8),
            memory=tiles.memory.copy(),
            unbreakable=np.append(tiles.unbreakable, np.ones(self.node_count, np.bool_)),  # those on the border
            material=np.tile(tiles.material, 2),
        )
        elastic = coarse_springs.cubic_stiffness(tiles.vectors)
        strength = coarse_springs.coarse_spring_stiffnesses(elastic, vertex_force_ratio, sites.spacing)
        law = coarse_springs.law_of_springs(full_body.law)
        of_springs = law, full_body.coarse_sites, strength
        springs = tile_bonds.in_precision(coarse_springs.create_spring_tiles(*of_springs), kind)
        if full_body.swells:
            tiles = tiles._replace(shrink=aligned_zeros(tiles.cells.shape[1], kind))
            springs = springs._replace(shrink=aligned_zeros(springs.cells.shape[1], kind))
        bounds = np.zeros(self.node_count), True, threads
        self.fine = TileLattice(full_body.law, tiles, sites._replace(node=tiles.node), *bounds)
        self.coarse = TileLattice(law, springs, full_body.coarse_sites, *bounds)
        self.state = zero_state(2 * self.node_count, 3, kind)._replace(
            value=np.zeros((0, 3), kind), rate=np.zeros((0, 3), kind)
        )
        self.bond_accelerations = np.zeros_like(self.state.second)  # of the last call of `sum_forces_and_break_bonds`
        cells = fine.tiles.cells[VOLUME, sites.margin :][:site_count].astype(np.float64)
        self.fine_volume = fine.node_volume * cells  # (sites,) m^3
        self.full_volume = self.fine_volume[sites.site - sites.margin]  # (n,) m^3, of all fine nodes
        self.volume = self.full_volume.copy()  # (n,) m^3, of nodes that move
        model = full_body.model
        self._fine_mass = None
        if model is not None and model.settings.regions:
            self._fine_mass = fine_node_masses(model, sites, fine)
        self.rho = np.ones(self.node_count) if model is None else model.rho.astype(np.float64)  # (n,) kg/m^3
        self.refinement_energy, self.largest_strain, self.cell_changes = 0.0, np.zeros(1), 0
        self.swelling_work = 0.0  # J, done on it as it swelled
        self._removed = 0  # bonds, of those broken so far, that those of the whole body are without
        self.time_step = self.time = 0.0
        self.damping = np.append(full_body.damping_rates, np.zeros(len(full_body.damping_rates)))
        if not len(self.damping):
            self.damping = np.zeros(2 * self.node_count)
        drive = full_body.full_drive
        self.drive = drive_of([], [], [], (self.node_count, 3), kind) if drive is None else drive
        self.held_force = np.zeros(len(self.drive.holds.node))  # (e,) N/m^3, of all prescribed components
        self._inverse_volumes = [np.zeros(tiles.cells.shape[1]), np.zeros(springs.cells.shape[1])]
        inverse = np.divide(1.0, self.fine_volume, out=np.zeros(site_count), where=self.fine_volume > 0)
        self._inverse_volumes[0][sites.margin : sites.margin + site_count] = inverse
        self._derive_nodes(np.flatnonzero(cell_kinds == FINE), True)

    @property
    def fine_u(self) -> NDArray[np.floating]:
        """Displacements (3, m) of fine places, m."""
        return np.asarray(self.fine.u[0])

    @property
    def coarse_u(self) -> NDArray[np.floating]:
        """Displacements (3, q) of coarse places, m."""
        return np.asarray(self.coarse.u[0])

    def fine_sites_of_coarse(self, coarse: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine sites (k,) that coarse sites (k,) lie on."""
        numbering = self.full_body.fine_lattice.numbering
        return np.asarray(place_on_finer_lattice(numbering.coarse, numbering.fine, 2, coarse))

    def coarse_sites_at(self, sites: NDArray[np.integer]) -> NDArray[np.int64]:
        """Coarse sites (k,) at fine sites (k,)."""
        numbering = self.full_body.fine_lattice.numbering
        return np.asarray(place_number_at(numbering.coarse, cell_at(lattice_coordinates(numbering.fine, sites))))

    def _derive_nodes(self, new_cells: NDArray[np.int64], begins: bool = False) -> None:
        """Derive nodes, bonds and springs near cells (k,), by their places, which have become fine."""
        fine, numbering, coarse = self.full_body.fine_lattice, self.full_body.fine_lattice.numbering, self.coarse
        cells = np.column_stack(lattice_coordinates(numbering.cells, new_cells))
        dirty = np.flatnonzero(mask_near_cells(numbering, cells, fine.reach - 1, 0))  # lower ends of bonds there
        changed, corners = dirty, coarse_nodes_at_cell_corners(cells)
        if begins:
            changed = np.arange(len(self.node_kinds))
            corners = np.column_stack(lattice_coordinates(numbering.coarse, np.arange(numbering.coarse.place_count)))
        of_kinds = self.node_kinds, self.has_coarse_node
        arrangement.set_node_kinds(numbering, fine.tiles.node, self.cell_kinds, changed, *of_kinds)
        rows, kinds, tiles = fine.tiles.node[changed], self.node_kinds[changed], self.fine.tiles
        tiles.node[changed] = np.select([kinds == FREE, kinds == BORDER], [rows, rows + self.node_count], -1)
        # the bits of whole bonds, and the pieces of the others
        old = self.clipped_pieces
        of_bonds = fine, self.cell_kinds, self.fine.tiles.bits, dirty
        new = np.empty(2 * len(old) + PIECES_OF_NODE * len(dirty), ClippedBondPiece.fields())
        count = arrangement.mark_whole_bonds_and_list_bond_pieces(*of_bonds, new)
        if count > len(new):
            new = np.empty(count, ClippedBondPiece.fields())
            arrangement.mark_whole_bonds_and_list_bond_pieces(*of_bonds, new)
        is_stale, new = np.zeros(len(self.node_kinds), dtype=bool), new[:count]
        is_stale[dirty] = True
        room = len(old) - np.count_nonzero(is_stale[old["owner_site"]]) + count
        self.clipped_pieces = np.empty(room, ClippedBondPiece.fields())
        order = np.argsort(new["near_end_place"], kind="stable")
        arrangement.merge_bond_pieces_by_near_end(old, is_stale, new, order, self.clipped_pieces)
        of_springs = numbering, self.cell_kinds, self.full_body.relative_cell_modulus, self.full_body.coarse_sites.ways
        coarse_springs.set_coarse_springs(*of_springs, corners, coarse.tiles)
        sites = np.asarray(place_number_at(numbering.coarse, tuple(corners.T)))
        # numbers, volumes and densities of coarse nodes, and of fine ones in their places
        below = self.fine_sites_of_coarse(sites)
        rows, inside = np.full(len(sites), -1), np.flatnonzero(below < len(self.node_kinds))
        rows[inside] = fine.tiles.node[below[inside]]
        is_node = rows >= 0
        sites, below, rows = sites[is_node], below[is_node], rows[is_node]
        is_coarse, places = self.has_coarse_node[below], self.full_body.coarse_sites.margin + sites
        self.coarse.tiles.node[sites] = np.where(is_coarse, rows, -1)
        self.volume[rows] = self.fine_volume[below]
        self.volume[rows[is_coarse]] = self._lump(below[is_coarse], self.fine_volume)
        self._inverse_volumes[1][places] = np.where(is_coarse, 1 / self.volume[rows], 0.0)
        for velocity in self.coarse.v:
            velocity[:, places[~is_coarse]] = 0
        if self._fine_mass is not None:
            self.rho[rows] = self._fine_mass[below] / self.fine_volume[below]
            self.rho[rows[is_coarse]] = self._lump(below[is_coarse], self._fine_mass) / self.volume[rows[is_coarse]]
        changed_tiles = np.unique(changed // ROW)
        has_node = (tiles.node.reshape(-1, ROW)[changed_tiles] >= 0).any(axis=1)
        softened = np.uint8(SOFTENED) * (tiles.memory[changed_tiles] >= 0)
        tiles.kind[changed_tiles] = np.where(has_node, fine.tiles.kind[changed_tiles] + softened, EMPTY)
        self.cell_changes += 1
        self._list_nodes()

    def _lump(self, sites: NDArray[np.int64], fine_values: NDArray[np.floating]) -> NDArray[np.float64]:
        """What coarse nodes at fine sites (k,) have of the `fine_values` (sites,) of nodes that are not free."""
        values = np.zeros(len(sites))
        of_nodes = self.full_body.fine_lattice, self.node_kinds, sites, fine_values
        arrangement.lump_fine_values_to_coarse_nodes(*of_nodes, values)
        return values

    def _list_nodes(self) -> None:
        """List the nodes that move, those on the border, and what pieces pull at."""
        sites, numbering = self.full_body.fine_sites, self.full_body.fine_lattice.numbering
        margins = sites.margin, self.full_body.coarse_sites.margin
        free, coarse = np.flatnonzero(self.node_kinds == FREE), np.flatnonzero(self.coarse.tiles.node >= 0)
        moving = np.append(self.fine_sites_of_coarse(coarse), free)
        rows = self.full_body.fine_lattice.tiles.node[moving].astype(np.int64)
        self.nodes = CurrentNodes(rows, moving, margins[1] + coarse, margins[0] + free)
        border = np.flatnonzero(self.node_kinds == BORDER)
        on, w = np.zeros((len(border), arrangement.ENDS), np.int64), np.zeros((len(border), arrangement.ENDS))
        arrangement.fill_border_interpolation_nodes(numbering, border, on, w)
        border_nodes = BorderNodes(
            margins[0] + border,
            margins[1] + self.coarse_sites_at(on),
            w,
            self.fine_volume[border],
            np.zeros((len(border), 3)) if self.full_body.swells else None,
        )

        def encode_places(at: NDArray[np.int32]) -> NDArray[np.int64]:
            is_free = self.node_kinds[at] == FREE
            return np.where(is_free, margins[0] + at.astype(np.int64), -1 - margins[1] - self.coarse_sites_at(at))

        springs = pieces.create_grouped_bond_piece_springs(
            self.full_body.fine_lattice, self.node_kinds, encode_places, self.clipped_pieces, self.full_body.swells
        )
        ends, is_on_border = springs.points.interpolation_nodes.ravel(), np.zeros(len(self.node_kinds), np.bool_)
        is_on_border[border] = True
        fine_touched, coarse_touched = (np.zeros(each.sites.tiles, np.bool_) for each in (self.fine, self.coarse))
        fine_touched[(np.append(ends[ends >= 0], border_nodes.place) - margins[0]) // ROW] = True
        coarse_ends = np.append(-1 - ends[ends < 0], border_nodes.coarse_places.ravel())
        coarse_touched[(coarse_ends - margins[1]) // ROW] = True
        ground, self.ground_springs = self._create_ground_springs()
        fine_touched[(ground.place[ground.place >= 0] - margins[0]) // ROW] = True
        coarse_touched[(-1 - ground.place[ground.place < 0] - margins[1]) // ROW] = True
        self.seam = Seam(
            border_nodes,
            springs,
            ground,
            np.zeros((3, self.fine.tiles.cells.shape[1])),
            np.zeros((3, self.coarse.tiles.cells.shape[1])),
            self._inverse_volumes[0],
            self._inverse_volumes[1],
            fine_touched,
            coarse_touched,
            is_on_border,
            self.least_peak_strain,
            self.largest_strain,
        )
        if self.full_body.swells:
            self._locate_seam()
        # under the conditions, and without any; made as they are asked for
        self._marches: tuple[LatticeMarch, LatticeMarch] | None = None
        self._free_marches: tuple[LatticeMarch, LatticeMarch] | None = None

    def energy_density_at_unit_stretch(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Energy density (k,), J/m^3, at these rows of the grid, inside of one material whose bonds have stretch 1."""
        tiles, sites = self.full_body.fine_lattice.tiles, self.full_body.fine_sites
        density = float((tiles.vectors[:, PULL] / tiles.vectors[:, INVERSE]).sum()) / 4
        return np.asarray(density * 2.0 * tiles.cells[MODULUS, sites.site[rows]])

    def broken_by_grid_rows(self) -> Broken:
        """The broken bonds, by the rows of all nodes of the grid."""
        return self.fine.broken()

    @property
    def least_peak_strain(self) -> float:
        """The least e at which a bond softens or breaks."""
        return float(double_green_strain_from_stretch(self.full_body.fine_lattice.tiles.peak.min()))

    def is_current(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Masks (k,) of the rows of the grid with a fine node that moves, and with a coarse one."""
        sites = self.full_body.fine_sites.site[rows] - self.full_body.fine_sites.margin
        return self.node_kinds[sites] == FREE, self.has_coarse_node[sites]

    def interpolation_rows_and_weights(
        self, grid_rows: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Rows (k, 8) of the grid of the nodes that move those of `grid_rows` (k,), and their shares."""
        fine, margin = self.full_body.fine_lattice, self.full_body.fine_sites.margin
        sites, numbering = self.full_body.fine_sites.site[grid_rows] - margin, fine.numbering.fine
        at = np.column_stack(lattice_coordinates(numbering, sites))
        rows, w = np.zeros((len(grid_rows), 8), np.int64), np.zeros((len(grid_rows), 8))
        for number, corner_steps in enumerate(np.ndindex(2, 2, 2)):
            step = np.array(corner_steps)
            w[:, number] = np.where(at % 2 == 1, 0.5, 1.0 - step).prod(axis=1)
            end = np.minimum(at - at % 2 + 2 * step, np.array(numbering.counts) - 1)
            rows[:, number] = fine.tiles.node[place_number_at(numbering, tuple(end.T))]
        is_node = np.logical_or(*self.is_current(grid_rows))
        rows[is_node], w[is_node] = grid_rows[is_node, None], np.eye(8)[0]
        rows[w == 0] = 0
        return rows, w

    def _march_of(self, drive: Drive, damping: NDArray[np.float64] | None) -> tuple[LatticeMarch, LatticeMarch]:
        """What marches fine and coarse nodes under a drive, with this damping (2 n,) of their numbers, 1/s."""
        masks, rho = self.is_current(drive.holds.node), np.tile(self.rho, 2).astype(self.kind)
        fine, coarse = (
            LatticeMarch(
                MarchedTiles(lattice),
                drive._replace(
                    holds=chosen(drive.holds, mask),
                    **{name: getattr(drive, name)[mask] for name in ("held_force", "held_speed")},
                ),
                rho,
                self.time_step,
                damping,
            )
            for lattice, mask in zip((self.fine, self.coarse), masks, strict=True)
        )
        return fine, coarse

    def _create_drive(self) -> Drive:
        """Conditions of the whole body on the current nodes: idle ones pass loads on to coarse nodes."""
        every, loaded = self.drive, self._share_with_current_nodes(self.drive.loads)
        loaded = loaded._replace(value=loaded.value / self.volume[loaded.node])
        zone_drive = drive_of([], [], [], (2 * self.node_count, 3), self.kind)._replace(
            profiles=every.profiles, loads=loaded, holds=every.holds, varies=every.varies
        )
        put_loads(zone_drive, self.time)
        zone_drive.before[loaded.node, loaded.axis] = zone_drive.force[loaded.node, loaded.axis]
        return zone_drive._replace(held_force=self.held_force, held_speed=np.zeros(len(self.held_force)))

    def _share_with_current_nodes(self, entries: Entries) -> Entries:
        """Entries of fine nodes, per m^3, as those of the nodes that move: idle ones pass theirs on to coarse nodes."""
        acting = np.flatnonzero(entries.value)
        node, force = entries.node[acting], entries.value[acting] * self.full_volume[entries.node[acting]]
        rows, w = self.interpolation_rows_and_weights(node)
        columns = [np.repeat(column[acting], rows.shape[1]) for column in (entries.profile, entries.axis)]
        key, shares = np.column_stack([*columns, rows.ravel()]), (w * force[:, None]).ravel()
        key, shares = key[shares != 0], shares[shares != 0]
        which, at = np.unique(key, axis=0, return_inverse=True)
        sums = np.bincount(at.ravel(), shares, minlength=len(which)).astype(float) if len(which) else np.zeros(0)
        profile, axis, node = which.T.astype(np.int64)
        return Entries(node, axis, sums, profile, np.zeros(len(node), dtype=np.int64), profile)

    def _create_ground_springs(self) -> tuple[GroundSprings, Entries]:
        """The springs from the nodes that move to the ground, and the same by rows of the grid, N/m."""
        every = self.full_body.ground_springs
        none = np.zeros(0, dtype=np.int64)
        if every is None or not len(every.node):
            return GroundSprings(none, none, np.zeros(0)), Entries(none, none, np.zeros(0), none, none, none)
        springs, place = self._share_with_current_nodes(every), np.zeros(self.node_count, dtype=np.int64)
        coarse = len(self.nodes.coarse_places)
        place[self.nodes.rows[:coarse]], place[self.nodes.rows[coarse:]] = (
            -1 - self.nodes.coarse_places,
            self.nodes.fine_places,
        )
        return GroundSprings(place[springs.node], springs.axis, springs.value), springs

    def displacements_at_ground_springs(self) -> NDArray[np.float64]:
        """Displacements (e,) of components at their ends, m."""
        place, axis = self.seam.ground.place, self.seam.ground.axis
        fine_u, coarse_u = self.fine_u[axis, place.clip(0)], self.coarse_u[axis, (-1 - place).clip(0)]
        return np.asarray(np.where(place >= 0, fine_u, coarse_u), dtype=np.float64)

    def ground_spring_force_by_profile(self, profile_count: int) -> NDArray[np.float64]:
        """Forces (profiles, 3), N, of the springs to the ground."""
        springs, forces = self.ground_springs, np.zeros((profile_count, 3))
        pull = -springs.value * self.displacements_at_ground_springs()
        np.add.at(forces, (springs.profile, springs.axis), pull)
        return forces

    def initialize_motion(self, velocity: NDArray[np.float64]) -> None:
        """Set the velocities (n, 3), m/s, and the accelerations at time 0 of the undeformed body."""
        self.zone_drive = self._create_drive()
        velocity = velocity[self.nodes.rows]
        self.scatter(velocity.T, self.coarse.v[0], self.fine.v[0])
        self._begin_accelerations(np.zeros_like(self.state.second), velocity)

    def compute_initial_forces(self) -> None:
        """Set the accelerations at time 0 from the displacements there are; nothing breaks yet."""
        self.sum_forces_and_break_bonds(0, 0.0)
        self._begin_accelerations(self.bond_accelerations, self.gather(self.coarse.v[0], self.fine.v[0]).T)

    def _begin_accelerations(self, of_bonds: NDArray[np.floating], velocity: NDArray[np.floating]) -> None:
        """Set the accelerations at time 0 with those that bonds give nodes (2 n, 3), m/s^2, and the velocities (k, 3),
        m/s, of those that move."""
        holds, force, rows = self.drive.holds, self.zone_drive.force, self.nodes.rows
        rho = self.rho[:, None].astype(self.kind)
        pull = rho[holds.node, 0] * of_bonds[holds.node, holds.axis]
        self.held_force[:] = force[holds.node, holds.axis] + pull
        self.state.second[rows] = force[rows] / rho[rows] + of_bonds[rows]
        self.state.second[rows] -= self.damping[rows, None] * velocity
        now = holds.value * factors_at(self.drive.profiles, self.time)[holds.profile]
        self.state.second[holds.node, holds.axis] = np.where(holds.kind == ACCELERATION, now, 0.0)

    def gather(self, coarse_values: NDArray[Any], fine_values: NDArray[Any]) -> NDArray[Any]:
        """Values (w, k) of the nodes that move, from those of coarse (w, q) and fine places (w, m)."""
        nodes = self.nodes
        return np.concatenate([coarse_values[:, nodes.coarse_places], fine_values[:, nodes.fine_places]], axis=1)

    def scatter(self, values: NDArray[Any], coarse_values: NDArray[Any], fine_values: NDArray[Any]) -> None:
        """Set those of coarse (w, q) and fine places (w, m) to values (w, k) of the nodes that move."""
        nodes, coarse = self.nodes, len(self.nodes.coarse_places)
        coarse_values[:, nodes.coarse_places], fine_values[:, nodes.fine_places] = (
            values[:, :coarse],
            values[:, coarse:],
        )

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises FineZoneTooLateError."""
        step = first_step
        while step < end_step:
            if (step - 1) % EVERY == 0:
                new = self.mark_new_fine_cells(step - 1 - EVERY)
                if len(new):
                    self.refine_cells(new)
            until = min(end_step, (step - 1) // EVERY * EVERY + EVERY + 1)
            if self._marches is None:
                self._marches = self._march_of(self.zone_drive, self.damping)
            self._sweep_with(self._marches, SweepRange(step, until, 0, False), self.state, self.time_step)
            for march, mask in zip(self._marches, self.is_current(self.drive.holds.node), strict=True):
                self.held_force[mask] = march.drive_of_lanes.held_force
            step, self.time = until, (until - 1) * self.time_step

    def sum_forces_and_break_bonds(self, step: int, dt: float) -> None:
        """Sum the forces of bonds and of springs to the ground; bonds over their limit break in this step.

        `dt` is the time since the last step, s.
        """
        velocities = [each.v.copy() for each in (self.fine, self.coarse)]
        if self._free_marches is None:
            nothing = drive_of([], [], [], (2 * self.node_count, 3), self.kind)
            self._free_marches = self._march_of(nothing, None)
        for each in (self.fine, self.coarse):
            each.u, each.v = each.u[::-1], each.v[::-1]
        state = self.state._replace(second=self.bond_accelerations)
        self._sweep_with(self._free_marches, SweepRange(step, step + 1, 1, False), state, dt)
        for each, velocity in zip((self.fine, self.coarse), velocities, strict=True):
            each.v[:] = velocity

    def _sweep_with(
        self, marches: tuple[LatticeMarch, LatticeMarch], sweeps: SweepRange, state: State, dt: float
    ) -> None:
        """Do sweeps with the first arrays of motion, and let those behind the last sweep be the first then."""
        fine, coarse = marches
        bonds, end_sweep, gate = fine.bonds, sweeps.end_step - sweeps.first_step + 1, gate_of(self.threads)
        fine_arrays, coarse_arrays = (
            march.arrays._replace(u=tuple(lattice.u), v=tuple(lattice.v))
            for march, lattice in ((fine, self.fine), (coarse, self.coarse))
        )
        drives = fine.drive_of_lanes, coarse.drive_of_lanes

        def sweep_part(sweeps: SweepRange, gate: Any, thread: int) -> None:
            sweep_zone(
                *fine.bonds.of_thread(thread),
                *coarse.bonds.of_thread(thread),
                fine_arrays,
                coarse_arrays,
                drives,
                self.seam,
                state,
                dt,
                sweeps,
                thread,
                gate,
            )

        coarse_arrays.stalled_sweep[0] = -1
        coarse.bonds.begin_sweeps()
        while sweeps.first_sweep < end_sweep:
            fine_arrays.next_sweep[0], fine_arrays.stalled_sweep[0] = end_sweep, -1
            with self.fine.breaking:
                bonds.begin_sweeps()
                side_by_side(partial(sweep_part, sweeps, gate), self.threads)
                while fine_arrays.stalled_sweep[0] >= 0:
                    stalled = int(fine_arrays.stalled_sweep[0])
                    bonds.make_room(fine_arrays.waiting_reason)
                    fine_arrays.next_sweep[0], fine_arrays.stalled_sweep[0] = stalled + 1, -1
                    sweep_part(sweeps._replace(first_sweep=stalled, only_waiting_groups=True), gate_of(1), 0)
                bonds.end_sweeps()
            sweeps = sweeps._replace(first_sweep=int(fine_arrays.next_sweep[0]))
            if coarse_arrays.stalled_sweep[0] >= 0:
                step = sweeps.first_step + int(coarse_arrays.stalled_sweep[0]) - 1
                raise create_too_late_error(step, self.zone_summary())
        for each in (self.fine, self.coarse):
            each.u, each.v = (each.u if end_sweep % 2 else each.u[::-1]), (each.v[::-1] if end_sweep % 2 else each.v)
        self.fine.drop_pending_before(sweeps.end_step - 1)

    def mark_new_fine_cells(self, after_step: int) -> NDArray[np.int64]:
        """Places (k,) of the cells that become fine: around bonds that have softened or broken after a step, and around
        stretched springs. They are marked as fine at once."""
        fine, numbering = self.full_body.fine_lattice, self.full_body.fine_lattice.numbering
        margin, springs, tiles = self.full_body.fine_sites.margin, self.coarse.tiles, self.fine.tiles
        torn = self.full_body.fine_sites.site[np.unique(self.fine.broken(after_step).source)].astype(np.int64) - margin
        hot_sites = np.zeros(26 * max(len(self.nodes.coarse_places), 1), dtype=np.int64)
        of_springs = self.full_body.refinement_stretch, self.full_body.either_way
        count = coarse_springs.list_nodes_with_stretched_springs(
            numbering, springs, fine.tiles.unbreakable, self.coarse_u, *of_springs, hot_sites
        )
        softened = np.flatnonzero(tiles.memory >= 0)
        which, _, lane = np.nonzero(tiles.worst[tiles.memory[softened]])
        near = np.unique(np.concatenate([torn, hot_sites[:count], softened[which] * ROW + lane]))
        new = np.zeros(np.count_nonzero(self.cell_kinds == COARSE), dtype=np.int64)
        return new[: refine_cells_within_radius(numbering, self.cell_kinds, near, AHEAD, new)]

    def refine_cells(self, new: NDArray[np.int64]) -> None:
        """Derive what follows from cells, by their places (k,), that are marked as fine.

        New nodes take the motion of the coarse ones around them; the change of energy is booked.
        """
        numbering, reach = self.full_body.fine_lattice.numbering, self.full_body.fine_lattice.reach
        cells = np.column_stack(lattice_coordinates(numbering.cells, new))
        before, volume = self._conserved_energy(cells), self.volume.copy()
        self._remove_broken_bonds_of_full_body()
        near = np.flatnonzero(mask_near_cells(numbering, cells, 0))  # nodes in and at the new cells
        rows = self.full_body.fine_lattice.tiles.node[near]
        near, rows = near[rows >= 0], rows[rows >= 0].astype(np.int64)
        was_free = self.node_kinds[near] == FREE
        on, w = self.interpolation_rows_and_weights(rows[~was_free])
        coarse_sites = self.full_body.fine_sites.site[on] - self.full_body.fine_sites.margin
        places = self.full_body.coarse_sites.margin + self.coarse_sites_at(coarse_sites)
        motion = [(w * values[0][:, places]).sum(axis=2) for values in (self.coarse.u, self.coarse.v)]
        second = (w[:, :, None] * self.state.second[on]).sum(axis=1)
        if self.full_body.swells:
            corners = np.stack(lattice_coordinates(numbering.fine, coarse_sites), axis=-1).astype(np.float64)
            motion[0] = motion[0] + self.offsets_at_places(bending_of_places(numbering.fine, corners, w)).T
        self._derive_nodes(new)
        is_new = self.node_kinds[near[~was_free]] == FREE
        at = self.full_body.fine_sites.margin + near[~was_free][is_new]
        for values, interpolated in zip((self.fine.u, self.fine.v), motion, strict=True):
            values[0][:, at] = interpolated[:, is_new]
        self.state.second[rows[~was_free][is_new]] = second[is_new]
        changed = np.flatnonzero(self.volume != volume)  # energy stays where it was
        for booked in self.state[3:]:
            booked[changed] *= volume[changed] / self.volume[changed]
        self.zone_drive = self._create_drive()
        self.refinement_energy += self._conserved_energy(cells) - before
        self.refinement_energy += self._set_forces_near(mask_near_cells(numbering, cells, reach + 1), cells)

    def _remove_broken_bonds_of_full_body(self) -> None:
        """Take the bonds that have broken out of those of the whole body, so that none is there again."""
        _, source, target = (column[self._removed :] for column in self.fine.broken())
        self._removed += len(source)
        tile, slot, bit = tile_bonds.find_slots(self.fine.sites, source, target)
        np.bitwise_and.at(self.full_body.fine_lattice.tiles.bits, (tile, slot), ~bit)

    def _conserved_energy(self, new_cells: NDArray[np.int64]) -> float:
        """The energy that leapfrog keeps, J, of nodes near cells (k, 3), without bonds that stay as they are."""
        numbering = self.full_body.fine_lattice.numbering
        near = mask_near_cells(numbering, new_cells, self.full_body.fine_lattice.reach - 1)
        above = np.zeros(len(self.coarse.tiles.node), np.bool_)
        above[place_number_at(numbering.coarse, tuple(coarse_nodes_at_cell_corners(new_cells).T))] = True
        which = mask_near_cells(numbering, new_cells, 1)[self.nodes.sites]
        speed, rows = self.gather(self.coarse.v[0], self.fine.v[0])[:, which], self.nodes.rows[which]
        swing = (self.time_step / 2) ** 2 * (self.state.second[rows] ** 2).sum(axis=1)
        kinetic = (self.rho * self.volume)[rows] / 2 * ((speed**2).sum(axis=0) - swing)
        return float(self.energies(near, above)[0].sum() + kinetic.sum())

    def _set_forces_near(self, near: NDArray[np.bool_], new_cells: NDArray[np.int64]) -> float:
        """Set the forces that hold nodes of the mask `near` (sites,), as they are now; returns the work, J, in the next
        half kick of interpolated accelerations that differ from those of the forces."""
        which = near[self.nodes.sites]
        rows, holds, row_of = self.nodes.rows[which], self.drive.holds, np.full(self.node_count, -1)
        row_of[rows] = np.arange(len(rows))
        numbering, reach, seam = self.full_body.fine_lattice.numbering, self.full_body.fine_lattice.reach, self.seam
        density, force = np.zeros((2, 2 * self.node_count, 3))
        near, every = mask_near_cells(numbering, new_cells, reach + 2), np.ones(len(self.coarse.tiles.node), np.bool_)
        self._place_border()
        sum_some(self.fine.tiles, self.fine_u, self.state.second, density, self.state.dissipated, near)
        sum_some(self.coarse.tiles, self.coarse_u, self.state.second, force, self.state.dissipated, every)
        fine_force, coarse_force = (np.zeros(array.shape) for array in (seam.fine_forces, seam.coarse_forces))
        pieces.add_bond_piece_forces(self.fine_u, self.coarse_u, seam.pieces, fine_force, coarse_force)
        add_ground_spring_forces(self.fine_u, self.coarse_u, seam.ground, fine_force, coarse_force)
        self._pass_on(density, coarse_force)
        moving_rows = self.nodes.rows
        total = force[moving_rows] + self.gather(coarse_force, fine_force).T
        force = (density[moving_rows] + total / self.volume[moving_rows, None])[which] + self.zone_drive.force[rows]
        speed, second = self.gather(self.coarse.v[0], self.fine.v[0])[:, which].T, self.state.second[rows]
        excess = self.rho[rows, None] * (second + self.damping[rows, None] * speed) - force
        held = row_of[holds.node]
        known = held >= 0
        self.held_force[known] = force[held[known], holds.axis[known]]
        excess[held[known], holds.axis[known]] = 0.0
        way = self.time_step * (speed + self.time_step / 2 * second)
        return float(np.sum(self.volume[rows, None] * excess / 2 * way))

    def _place_border(self) -> None:
        """Place the nodes on the border where coarse nodes have them."""
        interpolate_border_displacements(self.seam.border, self.coarse_u, self.fine_u)

    def _pass_on(self, densities: NDArray[np.float64], coarse_values: NDArray[np.float64]) -> None:
        """Add what nodes on the border have per volume, `densities` (2 n, w), to values (w, q) of coarse places."""
        border, margin = self.seam.border, self.full_body.fine_sites.margin
        of_border = densities[self.fine.tiles.node[border.place - margin]] * border.volume[:, None]
        for axis, values in enumerate(coarse_values):
            shares = border.weights * of_border[:, axis, None]
            values += np.bincount(border.coarse_places.ravel(), shares.ravel(), len(values))

    def energies(
        self, sites: NDArray[np.bool_] | None = None, coarse_sites: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energies (n,), J, of nodes: stored, and dissipated by softening so far.

        They are those of bonds, springs and pieces from fine nodes of `sites` (sites,), or coarse ones of
        `coarse_sites`, and others in their tiles; None: of all.
        """
        sites = np.ones(len(self.node_kinds), np.bool_) if sites is None else sites
        tiles, springs, seam = self.fine.tiles, self.coarse.tiles, self.seam
        which = np.arange(len(springs.kind))
        if coarse_sites is not None:
            which = np.flatnonzero(coarse_sites.reshape(-1, ROW).any(axis=1))
        density, spent = np.zeros((2, 2 * self.node_count))
        self._place_border()
        sum_energies(tiles, tiles, self.fine_u, density, spent, 0, len(tiles.kind), sites)
        energy = np.zeros(self.node_count)
        coarse_springs.add_spring_energies(springs, self.coarse_u, energy, which)
        fine_energy, coarse_energy = (np.zeros(array.shape[1]) for array in (seam.fine_forces, seam.coarse_forces))
        pieces.add_bond_piece_energies(self.fine_u, self.coarse_u, seam.pieces, sites, fine_energy, coarse_energy)
        self._pass_on(density[:, None], coarse_energy[None])
        rows = self.nodes.rows
        energy[rows] += self.gather(coarse_energy[None], fine_energy[None])[0] + density[rows] * self.volume[rows]
        grounded = self.ground_springs
        np.add.at(energy, grounded.node, grounded.value * self.displacements_at_ground_springs() ** 2 / 2)
        return energy, spent[: self.node_count] * self.volume

    def zone_summary(self) -> ZoneSummary:
        """Summary of the fine zone."""
        share = np.count_nonzero(self.cell_kinds == FINE) / self.full_body.solid_cell_count
        largest, peak = float(self.largest_strain[0]), self.least_peak_strain
        stretch = largest / (1 + np.sqrt(1 + largest))
        return ZoneSummary(self.refinement_energy, float(share), float(stretch / (np.sqrt(1 + peak) - 1)))

    def kinetic_energy_and_momentum(self) -> NDArray[np.float64]:
        """Kinetic energy, J, and momentum (3,), N s."""
        mass = (self.rho * self.volume)[self.nodes.rows]
        speed = self.gather(self.coarse.v[0], self.fine.v[0]).astype(np.float64)
        return np.append((mass / 2 * (speed**2).sum(axis=0)).sum(), (mass * speed).sum(axis=1))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Arrays for a checkpoint, from which a run continues bit by bit."""
        step, source, target = (column.copy() for column in self.fine.broken())
        return {
            **self.fine.checkpoint_arrays(),
            **{name: getattr(self.state, name)[self.nodes.rows] for name in STATE},
            "value": self.gather(self.coarse.u[0], self.fine.u[0]),
            "rate": self.gather(self.coarse.v[0], self.fine.v[0]),
            "cells": self.cell_kinds.copy(),
            "zone_books": np.array([self.refinement_energy, self.largest_strain[0], self.time]),
            **({"zone_swelling_work": np.array([self.swelling_work])} if self.full_body.swells else {}),
            "zone_held_force": self.held_force.copy(),
            "break_step": step,
            "break_source": source,
            "break_target": target,
        }

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint, at the start of a run. Raises CheckpointError."""
        cells = like(checkpoint, "cells", self.cell_kinds)
        is_new = (self.cell_kinds == COARSE) & (cells == FINE)
        if not ((cells == self.cell_kinds) | is_new).all():
            raise CheckpointError("cells are not those of the start; coarse ones may only become fine")
        step = entry(checkpoint, "break_step", (None,), np.int64, 1)
        ends = (
            entry(checkpoint, f"break_{end}", step.shape, np.int64, 0, self.node_count - 1)
            for end in ("source", "target")
        )
        broken = Broken(step, *ends)
        self.cell_kinds[:] = cells
        if is_new.any():
            self._derive_nodes(np.flatnonzero(is_new))
        self.fine.restore(checkpoint, broken)
        self._removed = 0
        self._remove_broken_bonds_of_full_body()
        for name in STATE:
            values, rows = getattr(self.state, name), self.nodes.rows
            values[rows] = entry(checkpoint, name, values[rows].shape, values.dtype)
        for name, both in (("value", (self.coarse.u[0], self.fine.u[0])), ("rate", (self.coarse.v[0], self.fine.v[0]))):
            self.scatter(entry(checkpoint, name, (3, len(self.nodes.rows)), np.dtype(self.kind)), *both)
        books = entry(checkpoint, "zone_books", (3,), float).tolist()
        self.refinement_energy, self.largest_strain[0], self.time = books
        if self.full_body.swells:
            self.swelling_work = float(entry(checkpoint, "zone_swelling_work", (1,), float)[0])
        self.held_force[:] = like(checkpoint, "zone_held_force", self.held_force)
        self.zone_drive = self._create_drive()

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        lattices = [(each.tiles, each.sites, each.u, each.v, *each.broken()) for each in (self.fine, self.coarse)]
        marches = [march.arrays for march in (*(self._marches or ()), *(self._free_marches or ()))]
        return bytes_of_arrays(*vars(self).values(), *lattices, *marches)
