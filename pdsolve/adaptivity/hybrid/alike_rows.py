"""Finds the different rows of 16 fine nodes of a plate, strip by strip, without arrays of all nodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.coarse_cells import Plate, strips
from pdsolve.adaptivity.hybrid.irregular_bonds import Irregular
from pdsolve.adaptivity.hybrid.node_rows import NodeRows
from pdsolve.conditions import damping, unbreakable
from pdsolve.operators.simd_lattice.lanes import ROW

USUAL, EMPTY = 0, 1  # entries of the first two rows


class _Fields(NamedTuple):
    """Constants of nodes, as in `NodeRows`."""

    mass: NDArray[np.float64]
    material: NDArray[np.uint8]
    own: NDArray[np.int32]
    no_fail: NDArray[np.bool_]
    bits: NDArray[np.uint64]
    damping: NDArray[np.float64]


def node_rows(plate: Plate, found: Irregular, half: int) -> NodeRows:
    """The rows of a plate with these irregular nodes, where half a family has `half` bonds."""
    usual, damps = _usual(plate, half), bool(damping(plate.model).any())
    columns: list[list[NDArray[Any]]] = [[np.tile(one, (2, ROW))] for one in usual]
    for column, nothing in zip(columns, (0, 0, -1, False, 0, 0), strict=True):
        column[0][EMPTY] = nothing
    entries, count = [], 2
    for fields in _strips(plate, found, half):
        same = [(values == one).reshape(-1, ROW) for values, one in zip(fields, usual, strict=True)]
        entry = np.where(np.logical_and.reduce(same).all(axis=1), USUAL, -1).astype(np.int32)
        entry[(fields.mass == 0).reshape(-1, ROW).all(axis=1)] = EMPTY
        new = np.flatnonzero(entry < 0)
        entry[new], count = count + np.arange(len(new)), count + len(new)
        entries.append(entry)
        for column, values in zip(columns, fields, strict=True):
            column.append(values.reshape(-1, ROW)[new])
    *kept, slowed = map(np.concatenate, columns)
    return NodeRows(np.concatenate(entries), *kept, slowed if damps else None)


def _usual(plate: Plate, half: int) -> _Fields:
    """What a node deep in a plate has, () each."""
    run, dense = plate.model.settings.run, np.array(plate.model.materials[0].rho)
    every = np.uint64((1 << half) - 1)
    return _Fields(dense * plate.h**2, np.uint8(0), np.int32(-1), np.False_, every, np.float64(run.damping))


def _strips(plate: Plate, found: Irregular, half: int) -> Iterator[_Fields]:
    """The constants of all places, strip by strip."""
    rho = np.array([one.rho for one in plate.model.materials])
    slowed, lasts = damping(plate.model), unbreakable(plate.model)
    place, bits = plate.places_of(found.node), _bits(found, half)
    order = np.argsort(place)
    for low, high in strips(plate.at.places // plate.at.stride, plate.at.stride):
        rows, material = plate.rows_in(low, high).ravel(), plate.materials_in(low, high).ravel()
        first, there = low * plate.at.stride, rows >= 0
        mass = plate.areas_in(low, high).ravel() * rho[material] * plate.h**2
        some = order[slice(*np.searchsorted(place, (first, first + len(rows)), sorter=order))]
        fields = _Fields(
            mass=mass,
            material=material,
            own=np.full(len(rows), -1, dtype=np.int32),
            no_fail=there & lasts[rows],
            bits=np.where(there, np.uint64((1 << half) - 1), np.uint64(0)),
            damping=np.where(there, slowed[rows], 0.0),
        )
        fields.own[place[some] - first], fields.bits[place[some] - first] = some, bits[some]
        yield fields


def _bits(found: Irregular, half: int) -> NDArray[np.uint64]:
    """Bonds (s,) of irregular nodes at the start, a bit for each in the first half of a family."""
    bits = np.zeros(len(found.node), dtype=np.uint64)
    for k in range(half):
        bits |= np.where(found.springs[:, k] > 0, np.uint64(1) << np.uint64(k), np.uint64(0))
    return bits
