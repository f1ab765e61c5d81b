"""Prepares a model for a moving fine zone."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialVelocity, Source, Velocity
from pdsolve import conditions
from pdsolve.adaptivity.hybrid.arrays import (
    LatticeConstants,
    LoadOrPrescribedMotion,
    LoadsOrPrescribedMotions,
    allocate_zeros,
    create_plate_zone,
)
from pdsolve.adaptivity.hybrid.clipped_bonds import stretch_from_double_green_strain
from pdsolve.adaptivity.hybrid.coarse_cells import CellAreas, HybridPlate, create_hybrid_plate, initial_cell_kinds
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.adaptivity.hybrid.far_cells import coarsen_cells_away_from_cracks_edges_and_loads
from pdsolve.adaptivity.hybrid.irregular_bonds import IrregularBonds, compute_irregular_bonds
from pdsolve.adaptivity.hybrid.irregular_rows import create_node_constants
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.precracks import lengthen_cracks, record_precrack_cuts
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import conditions_of, drive, has_conditions, initial_velocity
from pdsolve.lattice.row_histories import History, create_history
from pdsolve.laws.calls import bind
from pdsolve.laws.pair import no_bonds
from pdsolve.laws.pair_laws import bilinear
from pdsolve.model import Model
from pdsolve.numerics.memory import aligned, give_back
from pdsolve.operators.ground_supports import springs_of_components
from pdsolve.zone.bond_law import law_of_zone, stretch_that_makes_cells_fine
from pdsolve.zone.bond_parts import divide_bonds_at_cell_borders
from pdsolve.zone.cells import AROUND, FINE
from pdsolve.zone.refusals import check_straight_at_rest
from pdsolve.zone.springs import (
    Springs,
    coarse_springs,
    create_springs_of_materials,
    double_green_strain_from_stretch,
)

_stretch = getattr(stretch_from_double_green_strain, "py_func", stretch_from_double_green_strain)
ROOM = 64  # rows of fine nodes beyond those of the start, at least


def create_hybrid_operator_and_stable_step(
    model: Model, precision: str, choose_time_step: Callable[[Model, float], float], threads: int = 1
) -> tuple[HybridOperator, float]:
    """The operator at the start, and the surely stable step, s; `choose_time_step` chooses the step.

    Raises ModelError for a model that the method does not support.
    """
    swells, steep = model.swells, rows_with_content_jumps(model)
    model = model.moving_part() if swells else model
    plate = create_hybrid_plate(model)
    springs = create_springs_of_materials(model.materials, model.settings.horizon.ratio, plate.spacing)
    irregular_bonds = compute_irregular_bonds(plate, springs)
    give_back()
    area = CellAreas(plate)
    ground_springs = springs_of_components(model, area)
    support = (ground_springs.value / model.rho[ground_springs.node]).max(initial=0.0) / 2
    bound = float(np.sqrt(2 / (max(_stiffness_over_density(plate, springs, irregular_bonds)) + support)))
    kind = np.dtype(precision).type
    lattice = create_lattice_constants(plate, springs, irregular_bonds, choose_time_step(model, bound), kind)
    record_precrack_cuts(lattice)
    cut = np.append(irregular_bonds.family_size - np.count_nonzero(irregular_bonds.stiffness, axis=1), 0)
    cells = initial_cell_kinds(plate, lattice.family_reach, steep_content_rows=steep)
    plate_drive = drive(model, area, True, np.float64)
    rows = ROOM + 6 * int(np.count_nonzero(cells == FINE))
    damps = lattice.node_constants.damping is not None
    loads, holds, supports = (
        _create_loads_or_prescribed_motions(plate, plate_drive.loads, 4),
        _create_loads_or_prescribed_motions(plate, plate_drive.holds, 1),
        _create_loads_or_prescribed_motions(plate, ground_springs, 4),
    )
    supports.entries["value"] *= area[ground_springs.node]
    loads.entries["value"] *= area[plate_drive.loads.node]
    loads = loads._replace(entries=loads.entries[loads.entries["value"] != 0])
    if not swells and kind is np.float64:
        cells = coarsen_cells_away_from_cracks_edges_and_loads(
            plate, lattice, cells, np.concatenate([each.entries["fine_place"] for each in (loads, holds, supports)])
        )
    zone = create_plate_zone(
        plate.numbering,
        cells,
        len(lattice.neighbour_offsets),
        rows,
        lattice.softens_or_limits_vary,
        threads,
        swells,
        damps,
        dtype=kind,
    )._replace(loads=loads, holds=holds, supports=supports)
    zone = zone._replace(history=_create_history(lattice, model, rows, kind))
    hybrid = HybridEngine(plate, lattice, zone, plate_drive)
    begins_sequence = has_conditions(model.settings, InitialVelocity, Velocity)
    hybrid.initialize_motion_and_forces(initial_velocity(model) if begins_sequence else None)
    return HybridOperator(hybrid, cut), bound


def _create_history(lattice: LatticeConstants, model: Model, rows: int, kind: type[np.floating]) -> History:
    """What so many rows of fine nodes know of their law besides stiffnesses: nothing of a bilinear one."""
    law = law_of_zone(model)
    if law is bilinear.LAW:
        return None
    peak, limit = (_stretch(e[0]) for e in (lattice.material_peak_strain, lattice.material_limit_strain))
    return create_history(law, peak, limit, lambda: allocate_zeros(rows, len(lattice.family_dx), ROW, dtype=kind))


def rows_with_content_jumps(model: Model) -> NDArray[np.int64]:
    """Rows of the nodes at which a content that swells a body may leap within a spacing: it is held, exchanged or
    supplied through an edge there. A coarse cell would know no more than its mean."""
    if not model.swells:
        return np.zeros(0, dtype=np.int64)
    fluxes = [(number, source) for number, source in conditions_of(model.settings, Source) if source.flux is not None]
    jumps = [*conditions_of(model.settings, Concentration, Exchange), *fluxes]
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(model.selected(each) for _, each in jumps)]))


def create_lattice_constants(
    plate: HybridPlate,
    springs: tuple[Springs, ...],
    irregular_bonds: IrregularBonds,
    dt: float,
    kind: type[np.floating] = np.float64,
) -> LatticeConstants:
    """Constant arrays for steps of `dt`, s; the effects of pre-cracks on the coarse lattice are not yet recorded."""
    numbering, model, h = plate.numbering, plate.model, plate.spacing
    first = springs[0]
    coarse = coarse_springs(first, h)
    peak, limit = (
        np.array([getattr(material_springs, name) for material_springs in springs])
        for name in ("peak_stretch", "limit_stretch")
    )
    cell, mix = _coarse_cell_kinds_and_their_constants(plate, springs)
    law = law_of_zone(model)
    bind(law)
    columns = no_bonds(law)
    kappa = model.settings.run.hybrid.kappa
    hot = [stretch_that_makes_cells_fine(columns, *ends, kappa=kappa) for ends in zip(peak, limit, strict=True)]
    check_straight_at_rest(model, min(hot))
    bounds = np.asarray(double_green_strain_from_stretch(np.column_stack([peak.min(axis=1), limit.min(axis=1), hot])))
    return LatticeConstants(
        empty_law_columns=columns,
        numbering=numbering,
        spacing=h,
        family_dx=first.family_dx,
        family_dy=first.family_dy,
        spring_table=aligned(first.spring_table.astype(kind)),
        neighbour_offsets=first.family_dy * numbering.fine.strides[1] + first.family_dx,
        coarse_dx=coarse.family_dx,
        coarse_dy=coarse.family_dy,
        coarse_spring_table=aligned(coarse.spring_table.astype(kind)),
        coarse_neighbour_offsets=coarse.family_dy * numbering.coarse.strides[1] + coarse.family_dx,
        coarsest_spring_table=aligned(coarse_springs(first, 2 * h).spring_table.astype(kind)),
        coarsest_neighbour_offsets=coarse.family_dy * numbering.far.strides[1] + coarse.family_dx,
        bond_parts=divide_bonds_at_cell_borders(np.column_stack([first.family_dx, first.family_dy])),
        family_reach=int(np.abs(first.family_dx).max()),
        softens_or_limits_vary=len(springs) > 1 or law is not bilinear.LAW or bool((peak < limit).any()),
        dt=dt,
        node_constants=create_node_constants(plate, irregular_bonds, springs),
        material_bond_stiffness=np.array([material_springs.spring_table[:, 5] for material_springs in springs]),
        material_peak_strain=double_green_strain_from_stretch(peak),
        material_limit_strain=double_green_strain_from_stretch(limit),
        strain_bounds=bounds,
        least_strain_bounds=bounds.min(axis=0),
        irregular_bond_stiffness=irregular_bonds.stiffness,
        irregular_limit_row=irregular_bonds.limit_row_of_bond_row,
        irregular_peak_strain=irregular_bonds.peak_strain,
        irregular_limit_strain=irregular_bonds.limit_strain,
        coarse_cell_constants=cell,
        constants_index_of_cell=mix,
        cut_coarse_spring_bits=np.zeros(numbering.coarse.place_count, dtype=np.uint8),
        edge_cut_position=np.zeros((2, numbering.coarse.place_count)),
        is_cell_cut=np.zeros(numbering.cells.place_count, dtype=np.bool_),
        precrack_segments=lengthen_cracks(plate.precrack_segments),
    )


def _coarse_cell_kinds_and_their_constants(
    plate: HybridPlate, springs: tuple[Springs, ...]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """k1, k2 and a quarter of the mass (3, m) of coarse cells, and which of these each cell (c,) has.

    They are means of the cell's nodes, weighted by their areas in it.
    """
    numbering, rho = plate.numbering, [material.rho for material in plate.model.materials]
    material_constants = np.array(
        [
            [material_springs.c11 - material_springs.c66, material_springs.c66, plate.spacing**2 * dense]
            for material_springs, dense in zip(springs, rho, strict=True)
        ]
    )
    if len(springs) == 1:
        return np.ascontiguousarray(material_constants.T), np.zeros(numbering.cells.place_count, dtype=np.int32)
    cell_means = np.zeros((*numbering.cells.counts[::-1], 3))
    material_numbers = plate.material_numbers_in_lattice_rows(0, numbering.fine.shape[0])[numbering.fine.inner]
    for (y, part_y), (x, part_x) in itertools.product(enumerate((0.25, 0.5, 0.25)), repeat=2):
        nodes = material_numbers[y : y + 2 * len(cell_means) - 1 : 2, x : x + 2 * cell_means.shape[1] - 1 : 2]
        cell_means += part_x * part_y * material_constants[nodes]
    cells, mix = np.unique(cell_means.reshape(-1, 3), axis=0, return_inverse=True)
    around = np.pad(mix.reshape(cell_means.shape[:2]).astype(np.int32), AROUND)
    return np.ascontiguousarray(cells.T), around.ravel()


def _stiffness_over_density(
    plate: HybridPlate, springs: tuple[Springs, ...], irregular_bonds: IrregularBonds
) -> NDArray[np.float64]:
    """A bound of stiffness over density, 1/s^2, over nodes at edges and nodes of a full lattice."""
    model = plate.model
    rho, every = np.array([material.rho for material in model.materials]), [len(model.grid)]
    if len(springs) > 1:
        every = np.bincount(model.material_of, minlength=len(springs)).tolist()
    irregular_materials = model.material_of[irregular_bonds.grid_rows]
    usual, inside = every - np.bincount(irregular_materials, minlength=len(springs)), []
    for number, material_springs in enumerate(springs):
        if usual[number]:
            x, y, inverse, k = (
                material_springs.spring_table[:, 0],
                material_springs.spring_table[:, 1],
                material_springs.spring_table[:, 4],
                material_springs.spring_table[:, 5] / plate.spacing**2,
            )
            a, b, c = ((k * inverse * term).sum() for term in (x * x, y * y, x * y))
            inside.append(((a + b) / 2 + np.hypot((a - b) / 2, c)) / rho[number])
    return np.concatenate(
        [inside, irregular_bonds.stiffness_bound[irregular_bonds.bond_row_of_node] / rho[irregular_materials]]
    )


def _create_loads_or_prescribed_motions(
    plate: HybridPlate, condition_entries: conditions.Entries, nodes_per_entry: int
) -> LoadsOrPrescribedMotions:
    """Entries with room for at most `nodes_per_entry` nodes each."""
    entries, room = (
        np.zeros(len(condition_entries.node), LoadOrPrescribedMotion.fields()),
        nodes_per_entry * len(condition_entries.node),
    )
    entries["fine_place"], entries["axis"] = plate.places_of_grid_rows(condition_entries.node), condition_entries.axis
    entries["profile"], entries["prescribed_kind"], entries["value"] = (
        condition_entries.profile,
        condition_entries.kind,
        condition_entries.value,
    )
    return LoadsOrPrescribedMotions(entries, np.zeros((room, 2), dtype=np.int64), np.zeros(room))
