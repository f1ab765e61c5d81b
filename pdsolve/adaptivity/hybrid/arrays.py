"""Arrays of a hybrid run, constant and variable."""

from __future__ import annotations

import mmap
import sys
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.node_constants import NodeConstants
from pdsolve.codegen.record import Record
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.row_histories import History, with_entries
from pdsolve.zone.bond_parts import BondPartsInCells
from pdsolve.zone.cells import ZoneNumbering


class LatticeConstants(NamedTuple):
    """The constant arrays of a hybrid plate: lattice, springs, masses and limits of bonds."""

    empty_law_columns: Any  # columns of no bonds, by whose type the law's functions are compiled
    numbering: ZoneNumbering
    spacing: float  # m
    family_dx: NDArray[np.int64]  # (k,) fine family
    family_dy: NDArray[np.int64]
    spring_table: NDArray[np.float64]  # (k, 8)
    neighbour_offsets: NDArray[np.int64]  # (k,)
    coarse_dx: NDArray[np.int64]  # (8,)
    coarse_dy: NDArray[np.int64]
    coarse_spring_table: NDArray[np.float64]  # (8, 8) of the first material
    coarse_neighbour_offsets: NDArray[np.int64]  # (8,)
    coarsest_spring_table: NDArray[np.float64]  # (8, 8), likewise of cells of 4 h, which are of one material
    coarsest_neighbour_offsets: NDArray[np.int64]  # (8,)
    bond_parts: BondPartsInCells
    family_reach: int  # h, of the family along an axis
    softens_or_limits_vary: (
        bool  # whether bonds soften, or differ in what breaks them; then `fine.threshold_strain` is in use
    )
    dt: float  # s
    node_constants: NodeConstants  # constants of fine nodes
    material_bond_stiffness: NDArray[np.float64]  # (materials, k) stiffness of a bond in a full lattice
    material_peak_strain: NDArray[np.float64]  # (materials, k) e of the peaks of bonds in a full lattice
    material_limit_strain: NDArray[np.float64]
    strain_bounds: NDArray[
        np.float64
    ]  # (materials, 3) least e of peak and limit, and of a coarse bond that makes cells fine
    least_strain_bounds: NDArray[np.float64]  # (3,) the least of each
    irregular_bond_stiffness: NDArray[np.float64]  # (., k)
    irregular_limit_row: NDArray[np.int32]  # (.,) row in `irregular_peak_strain` and `irregular_limit_strain`
    irregular_peak_strain: NDArray[np.float64]  # (j, k) e
    irregular_limit_strain: NDArray[np.float64]
    coarse_cell_constants: NDArray[
        np.float64
    ]  # (3, m) k1 and k2 of a coarse cell, N/m^2, and a quarter of its mass, kg/m
    constants_index_of_cell: NDArray[np.int32]  # (c,) which of these each cell has
    cut_coarse_spring_bits: NDArray[
        np.uint8
    ]  # (q,) coarse bonds that no pre-crack cuts, of the first four springs: inverted
    edge_cut_position: NDArray[np.float64]  # (2, q) where a pre-crack cuts the edge to the east, and to the north; or 0
    is_cell_cut: NDArray[np.bool_]  # (c,) cells that a pre-crack crosses
    precrack_segments: NDArray[np.float64]  # (j, 4) segments in fine spacings


class LatticeNodes(NamedTuple):
    """Nodes of one lattice, and their rows of 16."""

    u: NDArray[np.float64]  # (2, 2, n) displacements now and one step on, in turn, m
    v: NDArray[np.float64]  # (2, n) velocity, m/s
    f: NDArray[np.float64]  # (2, n) forces besides the springs', of a touched row in the end all, N/m
    mass: NDArray[np.float64]  # (n,) kg/m
    inverse_mass: NDArray[np.float64]  # (n,) 1 / mass; 0 where nothing is to move
    node_kinds: NDArray[np.uint8]  # (n,)
    active_rows: NDArray[np.int64]  # those with a node that is not idle, in order
    stiffness_index_of_row: NDArray[
        np.int32
    ]  # (n / 16,) index in `row_stiffness`; -1 or -2 - index: all is as in the table
    row_stiffness: NDArray[np.float64]  # (., k, 16) stiffnesses
    spring_lane_masks: NDArray[np.uint16]  # (., 2, k) lanes with a spring and with half; see the next
    uses_spring_lane_masks: NDArray[
        np.bool_
    ]  # (.,) whether springs of a row are all those of the table, half of them or none
    threshold_strain: NDArray[np.float64]  # (., k, 16) e up to which nothing happens to a bond, where bonds are varied
    has_extra_forces: NDArray[np.bool_]  # (n / 16,) whether there are forces besides those of springs
    has_large_stretch: NDArray[
        np.uint8
    ]  # (n / 16,) how far stretches went; of coarse rows whether one comes near the bound
    negative_half_swelling: (
        NDArray[np.float64] | None
    )  # (n,) minus half the free strain, of idle nodes too; None: none swells
    damping: NDArray[np.float64] | None  # (2, n) 1/s, of each component, 0 of held ones; None: nothing is damped
    damped_energy: NDArray[np.float64] | None  # (n,) J/m, taken from a node by damping so far


class BondPieceSpring(Record):
    """The remaining piece of a clipped bond as a spring."""

    owner_node: int  # the lower node of the bond
    xi_x: float  # from its first end to its second one, m
    xi_y: float
    inverse_square: float  # 1 / |xi|^2, 1/m^2
    stiffness: float  # N/m^2
    is_breakable: float  # 1, or 0 if it is to last
    swelling_x: float  # added to the displacement between its ends, where nodes swell, m
    swelling_y: float


class BondPieceEnd(Record):
    """An end of a piece: a fine node, or a place that moves with two coarse nodes."""

    first_node: int
    second_node: int  # -1: the end is the fine node `first_node`
    second_weight: float


class ClippedBondPieces(NamedTuple):
    """The remaining pieces of clipped bonds, ordered by their owners."""

    springs: NDArray[BondPieceSpring]  # (p,)
    ends: NDArray[BondPieceEnd]  # (p, 2)


class BorderNode(Record):
    """A node on the border, which moves with two coarser ones: a fine one with coarse ones, or a coarse one with far
    ones."""

    border_node: int
    first_coarser_node: int
    second_coarser_node: int
    second_weight: float
    swelling_x: float  # how far it is off the line between those, where nodes swell, m
    swelling_y: float


NEWLY, LONG = 1, 2


class LoadOrPrescribedMotion(Record):
    """A load on a component of a fine node, a spring from it to the ground, or a component whose motion is
    prescribed."""

    fine_place: int  # fine
    axis: int  # of the component
    profile: int  # of its factor over time
    prescribed_kind: int  # of holds: DISPLACEMENT, VELOCITY or ACCELERATION
    node_moves: int  # of holds: by itself since before the last step (`LONG`), or since then (`NEWLY`), or not (0)
    value: float  # N/m, m, m/s or m/s^2 at factor 1; of a spring its stiffness, N/m^2
    mean_speed_since_last_step: float  # of holds: mean velocity since the last step, m/s
    speed_at_last_step: float  # of holds: velocity at the last step, m/s
    force_on_prescribed_component: float  # of holds: on the component at the last step, N/m


PRESCRIBED_COLUMNS = (
    "value",
    "mean_speed_since_last_step",
    "speed_at_last_step",
    "force_on_prescribed_component",
)  # of a checkpoint


class LoadsOrPrescribedMotions(NamedTuple):
    """Loads, springs to the ground or held components: entries of all fine nodes, and of the nodes that move."""

    entries: NDArray[LoadOrPrescribedMotion]  # (e,)
    node_and_entry: NDArray[np.int64]  # (., 2) fine place, or -1 - coarse place; and entry
    node_share: NDArray[np.float64]  # (.,) of the entry's value that this node has


class BreakEvents(NamedTuple):
    """Broken bonds, in order: directed ones; with collocation one of each two."""

    step: NDArray[np.int32]
    node: NDArray[np.int64]
    bond_number: NDArray[np.int32]
    force_at_break: NDArray[
        np.float64
    ]  # force with which it broke over |xi|, N/m^2; with collocation over its stiffness
    stretch_growth_at_break: NDArray[np.float64]  # of its stretch in that step


class ZoneCounts(Record):
    """How many entries of the arrays of a zone are in use. Checkpoints hold the first `STORED`, in this order."""

    active_fine_rows: int  # of 16 places with a node that is not idle, in `fine.active_rows`
    active_coarse_rows: int  # likewise, in `coarse.active_rows`
    clipped_pieces: int  # of clipped bonds
    border_nodes: int  # fine nodes on the border of coarse cells
    broken_bonds: int  # directed ones, in `break_events`
    node_loads: int  # shares of nodes that move, in `loads.node_and_entry`
    prescribed_components: int  # held components of nodes that move, in `holds.node_and_entry`
    damaged_nodes: int  # in `damaged_nodes` of the zone
    cell_changes: int  # how often cells have become others since all nodes were numbered
    refined_damaged_nodes: int  # how many of the damaged nodes have fine cells around them
    used_stiffness_rows: int  # rows of `fine.row_stiffness` that are taken
    new_cells: int  # in `new_cells` of the zone
    affected_fine_nodes: int  # in `affected_fine_nodes` of the zone
    affected_coarse_nodes: int  # in `affected_coarse_nodes` of the zone
    lacks_array_room: int  # 1 where the arrays are too short for what comes next, or 0
    active_coarsest_rows: int  # of 16 places, in `far.active_rows`
    tied_nodes: int  # coarse nodes on the border of far cells
    affected_coarsest_nodes: int  # nodes 4 h apart, in `affected_coarsest_nodes` of the zone
    node_supports: int  # shares of nodes that move, in `supports.node_and_entry`


STORED = 10


class EnergyTotals(Record):
    """Energies since the start, and stretches of clipped bonds. Checkpoints hold them in this order."""

    work: float  # J/m, of loads and of what holds nodes
    dissipated_energy: float  # J/m, by bonds
    refinement_energy: float  # J/m, that making cells fine has added
    clipped_strain: float  # largest e of clipped bonds that may break, at the last forces
    largest_clipped_strain: float  # the largest of those so far


class PlateZone(NamedTuple):
    """The variable arrays of a hybrid plate: cells, bonds, nodes, loads and books."""

    cell_kinds: NDArray[np.uint8]  # (c,)
    broken_bond_bits: NDArray[np.uint64]  # (n,) bonds that have broken, of the first half of the family. Never cleared
    fine: LatticeNodes
    coarse: LatticeNodes
    far: LatticeNodes  # 4 h apart
    history: History  # what the law of fine bonds needs beside their stiffnesses
    tied_coarse_nodes: NDArray[BorderNode]  # coarse nodes on the border of cells of 4 h, which move with far ones
    clipped_pieces: ClippedBondPieces
    spare_clipped_pieces: ClippedBondPieces
    border_nodes: NDArray[BorderNode]
    break_events: BreakEvents
    node_dissipation: NDArray[np.float64]  # (n,) J/m, by the bonds of a fine node so far
    is_damaged: NDArray[np.bool_]  # (n,) fine nodes one of whose bonds has softened or broken
    damaged_nodes: NDArray[np.int64]  # (n,) those, in order
    loads: LoadsOrPrescribedMotions
    holds: LoadsOrPrescribedMotions
    supports: LoadsOrPrescribedMotions  # springs to the ground
    is_node_marked: NDArray[np.bool_]  # (n,) scratch, False
    new_cells: NDArray[np.int64]  # scratch: cells that are to be fine
    affected_fine_nodes: NDArray[np.int64]  # scratch: fine nodes that change with new cells
    affected_coarse_nodes: NDArray[np.int64]  # scratch: coarse nodes, likewise
    affected_coarsest_nodes: NDArray[np.int64]  # scratch: nodes 4 h apart, likewise
    counts: ZoneCounts
    totals: EnergyTotals
    lane_sums: NDArray[np.float64]  # (threads, .) scratch of the vector code
    job_counters: NDArray[np.int64]  # (64,) what has been handed out to threads; see `hybrid.forces`
    breaking_rows: NDArray[np.int64]  # (threads, .) where bonds are to break
    breaking_row_counts: NDArray[np.int64]  # (8 threads,) how many, of each thread at a multiple of 8


def allocate_lattice_node_arrays(
    place_count: int,
    spring_count: int,
    stiffness_rows: int,
    dtype: Any,
    softens_or_limits_vary: bool = False,
    swells: bool = False,
    damps: bool = False,
) -> LatticeNodes:
    """Idle nodes of precision `dtype`, with room for `stiffness_rows` rows of stiffnesses, in memory that is taken
    as it is written."""
    rows = place_count // ROW
    zeros = partial(allocate_zeros, dtype=dtype)
    return LatticeNodes(
        u=zeros(2, 2, place_count),
        v=zeros(2, place_count),
        f=zeros(2, place_count),
        mass=zeros(place_count),
        inverse_mass=zeros(place_count),
        node_kinds=allocate_zeros(place_count, dtype=np.uint8),
        active_rows=allocate_zeros(rows, dtype=np.int64),
        stiffness_index_of_row=np.full(rows, -1, dtype=np.int32),
        row_stiffness=zeros(stiffness_rows, spring_count, ROW),
        spring_lane_masks=allocate_zeros(stiffness_rows, 2, spring_count, dtype=np.uint16),
        uses_spring_lane_masks=allocate_zeros(stiffness_rows, dtype=np.bool_),
        threshold_strain=zeros(stiffness_rows if softens_or_limits_vary else 0, spring_count, ROW),
        has_extra_forces=allocate_zeros(rows, dtype=np.bool_),
        has_large_stretch=allocate_zeros(rows, dtype=np.uint8),
        negative_half_swelling=zeros(place_count) if swells else None,
        damping=zeros(2, place_count) if damps else None,
        damped_energy=allocate_zeros(place_count) if damps else None,
    )


def allocate_zeros(*shape: int, dtype: Any = np.float64) -> NDArray[Any]:
    """Zeros aligned to 64 bytes in small pages, which are taken as they are written.

    NumPy asks for large pages, all of which the edges of a plate touch.
    """
    count, size = int(np.prod(shape)), np.dtype(dtype).itemsize
    private = {} if sys.platform == "win32" else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS}
    pages = mmap.mmap(-1, max(count * size, 1), **private)
    return np.frombuffer(pages, dtype, count).reshape(shape)


def create_plate_zone(
    numbering: ZoneNumbering,
    cells: NDArray[np.uint8],
    spring_count: int,
    row_count: int,
    softens_or_limits_vary: bool = False,
    threads: int = 1,
    swells: bool = False,
    damps: bool = False,
    *,
    dtype: Any = np.float64,
) -> PlateZone:
    """A plate with these cells (c,) and idle nodes of precision `dtype`; it has room for `row_count` fine rows."""
    piece = ROW * row_count * spring_count // 4
    nothing = LoadsOrPrescribedMotions(
        np.zeros(0, LoadOrPrescribedMotion.fields()), np.zeros((0, 2), np.int64), np.zeros(0)
    )

    def pieces() -> ClippedBondPieces:
        return ClippedBondPieces(np.zeros(piece, BondPieceSpring.fields()), np.zeros((piece, 2), BondPieceEnd.fields()))

    events, nodes = ROW * row_count * spring_count, ROW * row_count
    return PlateZone(
        cell_kinds=cells,
        broken_bond_bits=allocate_zeros(numbering.fine.place_count, dtype=np.uint64),
        fine=allocate_lattice_node_arrays(
            numbering.fine.place_count, spring_count, row_count, dtype, softens_or_limits_vary, swells, damps
        ),
        coarse=allocate_lattice_node_arrays(
            numbering.coarse.place_count, 8, numbering.coarse.place_count // ROW, dtype, swells=swells, damps=damps
        ),
        far=allocate_lattice_node_arrays(
            numbering.far.place_count, 8, numbering.far.place_count // ROW, dtype, swells=swells, damps=damps
        ),
        history=None,
        tied_coarse_nodes=allocate_zeros(numbering.coarse.place_count, dtype=BorderNode.fields()),
        clipped_pieces=pieces(),
        spare_clipped_pieces=pieces(),
        border_nodes=allocate_zeros(nodes, dtype=BorderNode.fields()),
        break_events=BreakEvents(
            np.zeros(events, np.int32), np.zeros(events, np.int64), np.zeros(events, np.int32), *np.zeros((2, events))
        ),
        node_dissipation=allocate_zeros(numbering.fine.place_count),
        is_damaged=allocate_zeros(numbering.fine.place_count, dtype=np.bool_),
        damaged_nodes=allocate_zeros(numbering.fine.place_count, dtype=np.int64),
        loads=nothing,
        holds=nothing,
        supports=nothing,
        is_node_marked=allocate_zeros(numbering.fine.place_count, dtype=np.bool_),
        new_cells=allocate_zeros(numbering.cells.place_count, dtype=np.int64),
        affected_fine_nodes=allocate_zeros(numbering.fine.place_count, dtype=np.int64),
        affected_coarse_nodes=allocate_zeros(numbering.coarse.place_count, dtype=np.int64),
        affected_coarsest_nodes=allocate_zeros(numbering.far.place_count, dtype=np.int64),
        counts=ZoneCounts.of(),
        totals=EnergyTotals.of(),
        lane_sums=allocate_zeros(threads, 3 * ROW, dtype=dtype),
        job_counters=np.zeros(64, dtype=np.int64),
        breaking_rows=allocate_zeros(threads, 2 * numbering.fine.place_count // ROW, dtype=np.int64),
        breaking_row_counts=np.zeros(8 * threads, dtype=np.int64),
    )


def double_array_lengths(zone: PlateZone) -> PlateZone:
    """The zone in arrays with room for twice as many entries."""
    fine, counts = zone.fine, zone.counts

    def double_array_length(array: Any, used: int) -> NDArray[Any]:
        more = allocate_zeros(2 * len(array), *array.shape[1:], dtype=array.dtype)
        more[:used] = array[:used]
        return more

    rows = counts.used_stiffness_rows + 1  # the next one may have been begun
    return zone._replace(
        fine=fine._replace(
            row_stiffness=double_array_length(fine.row_stiffness, rows),
            threshold_strain=double_array_length(fine.threshold_strain, rows),
            spring_lane_masks=double_array_length(fine.spring_lane_masks, rows),
            uses_spring_lane_masks=double_array_length(fine.uses_spring_lane_masks, rows),
        ),
        history=with_entries(zone.history, lambda entries: double_array_length(entries, rows)),
        clipped_pieces=ClippedBondPieces(
            *(double_array_length(array, counts.clipped_pieces) for array in zone.clipped_pieces)
        ),
        spare_clipped_pieces=ClippedBondPieces(*(double_array_length(array, 0) for array in zone.spare_clipped_pieces)),
        border_nodes=double_array_length(zone.border_nodes, counts.border_nodes),
        break_events=BreakEvents(*(double_array_length(array, counts.broken_bonds) for array in zone.break_events)),
    )
