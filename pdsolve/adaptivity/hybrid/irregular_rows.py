"""Finds the rows of 16 fine nodes of a plate that are neither usual nor empty, strip by strip, without arrays of all
nodes. Each of them has an entry of its own, also where two are equal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Absorb
from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate, split_rows_into_ranges
from pdsolve.adaptivity.hybrid.irregular_bonds import IrregularBonds
from pdsolve.adaptivity.hybrid.node_constants import NodeConstants
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import damping, has_conditions, unbreakable
from pdsolve.zone.springs import STIFFNESS, Springs

USUAL, EMPTY = 0, 1  # entries of the first two rows


class _ConstantsOfPlaces(NamedTuple):
    """Constants of nodes, as in `NodeConstants`."""

    mass: NDArray[np.float64]
    material: NDArray[np.uint8]
    irregular_bond_row: NDArray[np.int32]
    no_fail: NDArray[np.bool_]
    initial_bond_bits: NDArray[np.uint64]
    damping: NDArray[np.float64]


def create_node_constants(
    plate: HybridPlate, irregular_bonds: IrregularBonds, springs: tuple[Springs, ...]
) -> NodeConstants:
    """The rows of a plate with these irregular nodes; `springs` are those of each material in a full lattice."""
    full_family_bits = _bits_of_existing_bonds(np.array([one.spring_table[:, STIFFNESS] for one in springs]))
    model, run = plate.model, plate.model.settings.run
    usual_values = model.materials[0].rho * plate.spacing**2, 0, -1, False, full_family_bits[0], run.damping
    kinds = np.float64, np.uint8, np.int32, np.bool_, np.uint64, np.float64
    # What a node deep in a plate has
    usual = _ConstantsOfPlaces(*(np.array(value, dtype=kind) for value, kind in zip(usual_values, kinds, strict=True)))
    slowed = None  # where nothing is damped
    if run.damping or has_conditions(model.settings, Absorb):
        node_damping = damping(model)
        slowed = node_damping if node_damping.any() else None
    columns: list[list[NDArray[Any]]] = [[np.tile(one, (2, ROW))] for one in usual]
    for column, nothing in zip(columns, (0, 0, -1, False, 0, 0), strict=True):
        column[0][EMPTY] = nothing
    entries, count = [], 2
    for fields in _iterate_node_constants_by_strips(plate, irregular_bonds, full_family_bits, slowed):
        same = np.logical_and.reduce([values == one for values, one in zip(fields, usual, strict=True)])
        entry = np.where(same.reshape(-1, ROW).all(axis=1), USUAL, -1).astype(np.int32)
        entry[(fields.mass == 0).reshape(-1, ROW).all(axis=1)] = EMPTY
        new = np.flatnonzero(entry < 0)
        entry[new], count = count + np.arange(len(new)), count + len(new)
        entries.append(entry)
        for column, values in zip(columns, tuple[NDArray[Any], ...](fields), strict=True):
            column.append(values.reshape(-1, ROW)[new])
    row_fields = _ConstantsOfPlaces(*(np.concatenate(column) for column in columns))
    return NodeConstants(np.concatenate(entries), *row_fields[:5], None if slowed is None else row_fields.damping)


def _iterate_node_constants_by_strips(
    plate: HybridPlate,
    irregular_bonds: IrregularBonds,
    full_family_bits: NDArray[np.uint64],
    node_damping: NDArray[np.float64] | None,
) -> Iterator[_ConstantsOfPlaces]:
    """The constants of all places, strip by strip; `full_family_bits` are the bonds of each material in a full lattice.

    `node_damping` (n,) is the damping of all nodes, 1/s.
    """
    rho = np.array([constants.rho for constants in plate.model.materials])
    lasts = unbreakable(plate.model)
    place, bits = (
        plate.places_of_grid_rows(irregular_bonds.grid_rows),
        _bits_of_existing_bonds(irregular_bonds.stiffness),
    )
    order = np.argsort(place)
    for low, high in split_rows_into_ranges(
        plate.numbering.fine.place_count // plate.numbering.fine.strides[1], plate.numbering.fine.strides[1]
    ):
        rows, material = (
            plate.grid_rows_of_lattice_rows(low, high).ravel(),
            plate.material_numbers_in_lattice_rows(low, high).ravel(),
        )
        first, has_node = low * plate.numbering.fine.strides[1], rows >= 0
        mass = plate.area_shares_in_lattice_rows(low, high).ravel() * rho[material] * plate.spacing**2
        in_strip = order[slice(*np.searchsorted(place, (first, first + len(rows)), sorter=order))]
        fields = _ConstantsOfPlaces(
            mass=mass,
            material=material,
            irregular_bond_row=np.full(len(rows), -1, dtype=np.int32),
            no_fail=has_node & lasts[rows],
            initial_bond_bits=np.where(has_node, full_family_bits[material], np.uint64(0)),
            damping=np.zeros(len(rows)) if node_damping is None else np.where(has_node, node_damping[rows], 0.0),
        )
        irregular_rows = irregular_bonds.bond_row_of_node[in_strip]
        fields.irregular_bond_row[place[in_strip] - first], fields.initial_bond_bits[place[in_strip] - first] = (
            irregular_rows,
            bits[irregular_rows],
        )
        yield fields


def _bits_of_existing_bonds(springs: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Bonds (r,) that there are, of springs (r, k): a bit for each in the first half of a family."""
    bits = np.zeros(len(springs), dtype=np.uint64)
    for k in range(springs.shape[1] // 2):
        bits |= np.where(springs[:, k] > 0, np.uint64(1) << np.uint64(k), np.uint64(0))
    return bits
