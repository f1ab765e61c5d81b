"""Prepares a model for a moving fine zone."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialVelocity, Source, Velocity
from pdsolve import conditions
from pdsolve.adaptivity.hybrid.arrays import Entry, LatticeConstants, ZoneEntries, create_plate_zone
from pdsolve.adaptivity.hybrid.coarse_cells import CellAreas, HybridPlate, create_plate, initial_cells
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.adaptivity.hybrid.far_cells import add_far_cells
from pdsolve.adaptivity.hybrid.irregular_bonds import IrregularBonds, find_irregular_bonds
from pdsolve.adaptivity.hybrid.irregular_rows import create_node_rows
from pdsolve.adaptivity.hybrid.lattice import AROUND, BELOW, FINE, LEFT
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.precracks import lengthen_cracks, record_precrack_cuts
from pdsolve.adaptivity.hybrid.springs import (
    Springs,
    coarse_springs,
    divide_bonds,
    e_from_stretch,
    springs_of_materials,
)
from pdsolve.conditions import drive, initial_velocity
from pdsolve.laws.calls import bind
from pdsolve.laws.pair import no_bonds
from pdsolve.laws.pair_laws import bilinear
from pdsolve.model import Model
from pdsolve.numerics.memory import give_back
from pdsolve.operators.simd_lattice.layout import aligned

ROOM = 64  # rows of fine nodes beyond those of the start, at least


def create_hybrid_operator_and_stable_step(
    model: Model, mode: str, precision: str, choose_step: Callable[[Model, float], float], threads: int = 1
) -> tuple[HybridOperator, float]:
    """The operator at the start, and the surely stable step, s; `choose_step` chooses the step.

    Raises ModelError for a model that the method does not support.
    """
    swells, steep = model.swells, rows_of_steep_content(model)
    model = model.moving_part() if swells else model
    plate = create_plate(model, mode)
    springs = springs_of_materials(model.materials, model.settings.horizon.ratio, plate.h)
    irregular_bonds = find_irregular_bonds(plate, springs)
    give_back()
    bound = float(np.sqrt(2 / max(_stiffness_over_density(plate, springs, irregular_bonds))))
    kind = np.dtype(precision).type
    lattice = create_lattice_constants(plate, springs, irregular_bonds, choose_step(model, bound), kind)
    record_precrack_cuts(lattice)
    cut = np.append(irregular_bonds.family_size - np.count_nonzero(irregular_bonds.stiffness, axis=1), 0)
    cells = initial_cells(plate, lattice.reach, steep_rows=steep)
    area = CellAreas(plate)
    plate_drive = drive(model, area, True, np.float64)
    rows = ROOM + 6 * int(np.count_nonzero(cells == FINE))
    damps = lattice.node_rows.damping is not None
    loads, holds = _create_entries(plate, plate_drive.loads, 4), _create_entries(plate, plate_drive.holds, 1)
    loads.entries["value"] *= area[plate_drive.loads.node]
    loads = loads._replace(entries=loads.entries[loads.entries["value"] != 0])
    if not swells and kind is np.float64:
        cells = add_far_cells(plate, lattice, cells, np.concatenate([loads.entries["place"], holds.entries["place"]]))
    zone = create_plate_zone(
        plate.numbering, cells, len(lattice.offsets), rows, lattice.limits_vary, threads, swells, damps, dtype=kind
    )._replace(loads=loads, holds=holds)
    hybrid = HybridEngine(plate, lattice, zone, plate_drive)
    begins_sequence = any(isinstance(condition, InitialVelocity | Velocity) for condition in model.settings.conditions)
    hybrid.start(initial_velocity(model) if begins_sequence else None)
    return HybridOperator(hybrid, cut), bound


def rows_of_steep_content(model: Model) -> NDArray[np.int64]:
    """Rows of the nodes at which a content that swells a plate may leap within a spacing: it is held, exchanged or
    supplied through an edge there. A coarse cell would know no more than its mean."""
    condition_rows = [np.zeros(0, dtype=np.int64)]
    for condition in model.settings.conditions if model.swells else ():
        if isinstance(condition, Concentration | Exchange) or (
            isinstance(condition, Source) and condition.flux is not None
        ):
            condition_rows.append(model.selected(condition))
    return np.unique(np.concatenate(condition_rows))


def create_lattice_constants(
    plate: HybridPlate,
    springs: tuple[Springs, ...],
    irregular_bonds: IrregularBonds,
    dt: float,
    kind: type[np.floating] = np.float64,
) -> LatticeConstants:
    """Constant arrays for steps of `dt`, s; the effects of pre-cracks on the coarse lattice are not yet recorded."""
    numbering, model, h = plate.numbering, plate.model, plate.h
    kappa = model.settings.run.hybrid.kappa
    first = springs[0]
    coarse = coarse_springs(first, h)
    bounds = np.array(
        [
            [
                e_from_stretch(material_springs.peak),
                e_from_stretch(material_springs.limit),
                e_from_stretch(kappa * material_springs.peak),
            ]
            for material_springs in springs
        ]
    )
    cell, mix = _coarse_cell_constants(plate, springs)
    bind(bilinear.LAW)
    return LatticeConstants(
        law=no_bonds(bilinear.LAW),  # a brittle bond is one whose peak is its limit
        numbering=numbering,
        h=h,
        dx=first.dx,
        dy=first.dy,
        spring_table=aligned(first.table.astype(kind)),
        offsets=first.dy * numbering.stride + first.dx,
        coarse_dx=coarse.dx,
        coarse_dy=coarse.dy,
        coarse_spring_table=aligned(coarse.table.astype(kind)),
        coarse_offsets=coarse.dy * numbering.coarse_stride + coarse.dx,
        far_spring_table=aligned(coarse_springs(first, 2 * h).table.astype(kind)),
        far_offsets=coarse.dy * numbering.far_stride + coarse.dx,
        bond_parts=divide_bonds(first),
        reach=int(np.abs(first.dx).max()),
        limits_vary=len(springs) > 1 or first.peak < first.limit,
        dt=dt,
        node_rows=create_node_rows(plate, irregular_bonds, springs),
        material_stiffness=np.array([material_springs.table[:, 5] for material_springs in springs]),
        e_bounds=bounds,
        least_e_bounds=bounds.min(axis=0),
        irregular_stiffness=irregular_bonds.stiffness,
        irregular_limit_row=irregular_bonds.limit_row,
        irregular_peak_e=irregular_bonds.peak,
        irregular_limit_e=irregular_bonds.limit,
        cell_constants=cell,
        constants_of_cell=mix,
        cut_spring_bits=np.zeros(numbering.coarse_places, dtype=np.uint8),
        edge_cut_share=np.zeros((2, numbering.coarse_places)),
        cut_cells=np.zeros(numbering.cells, dtype=np.bool_),
        cracks=lengthen_cracks(plate.cracks),
    )


def _coarse_cell_constants(
    plate: HybridPlate, springs: tuple[Springs, ...]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """k1, k2 and a quarter of the mass (3, m) of coarse cells, and which of these each cell (c,) has.

    They are means of the cell's nodes, weighted by their areas in it.
    """
    numbering, rho = plate.numbering, [material.rho for material in plate.model.materials]
    material_constants = np.array(
        [
            [material_springs.c11 - material_springs.c66, material_springs.c66, plate.h**2 * dense]
            for material_springs, dense in zip(springs, rho, strict=True)
        ]
    )
    if len(springs) == 1:
        return np.ascontiguousarray(material_constants.T), np.zeros(numbering.cells, dtype=np.int32)
    cell_means = np.zeros((numbering.ny // 2, numbering.nx // 2, 3))
    field = plate.material_numbers_in(0, numbering.places // numbering.stride)
    for (y, part_y), (x, part_x) in itertools.product(enumerate((0.25, 0.5, 0.25)), repeat=2):
        node_places = np.s_[BELOW + y : BELOW + y + numbering.ny - 1 : 2, LEFT + x : LEFT + x + numbering.nx - 1 : 2]
        cell_means += part_x * part_y * material_constants[field[node_places]]
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
                material_springs.table[:, 0],
                material_springs.table[:, 1],
                material_springs.table[:, 4],
                material_springs.table[:, 5] / plate.h**2,
            )
            a, b, c = ((k * inverse * term).sum() for term in (x * x, y * y, x * y))
            inside.append(((a + b) / 2 + np.hypot((a - b) / 2, c)) / rho[number])
    return np.concatenate(
        [inside, irregular_bonds.stiffness_bound[irregular_bonds.bond_row] / rho[irregular_materials]]
    )


def _create_entries(plate: HybridPlate, condition_entries: conditions.Entries, nodes_per_entry: int) -> ZoneEntries:
    """Entries with room for at most `nodes_per_entry` nodes each."""
    entries, room = np.zeros(len(condition_entries.node), Entry.fields()), nodes_per_entry * len(condition_entries.node)
    entries["place"], entries["axis"] = plate.places_of(condition_entries.node), condition_entries.axis
    entries["profile"], entries["kind"], entries["value"] = (
        condition_entries.profile,
        condition_entries.kind,
        condition_entries.value,
    )
    return ZoneEntries(entries, np.zeros((room, 2), dtype=np.int64), np.zeros(room))
