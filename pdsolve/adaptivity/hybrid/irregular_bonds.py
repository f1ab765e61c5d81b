"""Bonds of nodes without a regular full family: at edges, faces of pre-cracks and interfaces.

The scheme makes these bonds for that part of the plate, so that fine nodes equal those of a uniform run. Nodes of a
rectangle that lie in the same way to all edges and pre-cracks that are near share their bonds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROWS
from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate, split_rows_into_ranges
from pdsolve.bonds.assembly import Paired, Part, stiffness_bound
from pdsolve.model import Model
from pdsolve.numerics.dilation import in_square
from pdsolve.schemes.average_horizon import Rule
from pdsolve.zone.cells import BELOW, LEFT
from pdsolve.zone.node_models import model_of_rows
from pdsolve.zone.springs import Springs, double_green_strain_from_stretch
from pdsolve.zone.start_cells import count_full_cubes_around_nodes

KEPT = 8  # parts whose pairs are held in memory; those of others are looked for twice
WIDE = 2**20  # places that are looked at together, with those around them
SAME = 1e-9  # of its area: an outline that encloses so much of a rectangle is that
ROUND_OFF = 1e-12  # relative: stiffnesses this near to those of a full lattice are those


class IrregularBonds(NamedTuple):
    """k bonds of s nodes, in the order of a full family; those of r of them, whose bonds are all that differ."""

    grid_rows: NDArray[np.int64]  # (s,) rows of the grid
    bond_row_of_node: NDArray[np.int64]  # (s,) of the r
    stiffness: NDArray[np.float64]  # (r, k) stiffness, N/m^2; 0 without a bond
    limit_row_of_bond_row: NDArray[np.int32]  # (r,) which of the limits a node's bonds have
    peak_strain: NDArray[np.float64]  # (j, k) e, of j different nodes
    limit_strain: NDArray[np.float64]
    family_size: NDArray[np.int64]  # (r,) bonds that count in damage
    stiffness_bound: NDArray[np.float64]  # (r,) as in `Operator`


def compute_irregular_bonds(plate: HybridPlate, springs: tuple[Springs, ...]) -> IrregularBonds:
    """Bonds of all nodes near irregular places; `springs` holds those of each material."""
    reach = int(np.abs(springs[0].family_dx).max())
    places, is_close = _places_near_irregular_families(plate, reach)
    rows = plate.grid_rows_at(places)
    order = np.argsort(rows)
    sorted_rows, wanted = rows[order], is_close[order]
    first, which = np.unique(find_first_row_with_equal_bonds(plate, sorted_rows[wanted], reach), return_inverse=True)
    nothing, count = np.zeros((0, len(springs[0].family_dx))), len(first)
    kind, family, sums = np.zeros(count, np.int32), np.zeros(count, np.int64), np.zeros((count, nothing.shape[1]))
    irregular_bonds = IrregularBonds(sorted_rows[wanted], which, sums, kind, nothing, nothing, family, np.zeros(count))
    if not count:
        return irregular_bonds
    numbers = np.flatnonzero(wanted)
    parts = _create_representative_bonds_in_chunks(model_of_rows(plate.model, sorted_rows), numbers, first, which)
    limits = _store_irregular_bonds(plate, parts, sorted_rows, numbers[first], springs, irregular_bonds)
    return irregular_bonds._replace(peak_strain=limits[:, 0].copy(), limit_strain=limits[:, 1].copy())


def _places_near_irregular_families(plate: HybridPlate, reach: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Places (k,) of the nodes within three of a family's reaches of an irregular place, and which are within two."""
    stride, rows = plate.numbering.fine.strides[1], plate.numbering.fine.place_count // plate.numbering.fine.strides[1]
    places, is_close = [], []
    for low, high in split_rows_into_ranges(rows, stride, WIDE):
        first = max(low - 3 * reach, 0)
        odd, strip = (
            _mask_places_with_irregular_families(plate, reach, first, min(high + 3 * reach, rows)),
            np.s_[low - first : high - first],
        )
        near = np.flatnonzero(plate.mask_nodes_in_lattice_rows(low, high) & in_square(odd, 3 * reach)[strip])
        places.append(near + low * stride)
        is_close.append(in_square(odd, 2 * reach)[strip].ravel()[near])
    return np.concatenate(places), np.concatenate(is_close)


def _mask_places_with_irregular_families(
    plate: HybridPlate, reach: int, first_row: int, end_row: int
) -> NDArray[np.bool_]:
    """Mask of places in rows `first_row` to `end_row` - 1 without a node or a whole cell, at an interface, or next to a
    pre-crack."""
    numbering = plate.numbering
    first, last = max(first_row - 1, 0), min(end_row + 1, numbering.fine.place_count // numbering.fine.strides[1])
    odd = np.abs(plate.area_shares_in_lattice_rows(first, last) - 1) > ROUND_OFF
    odd |= count_full_cubes_around_nodes(~odd) < 4
    if plate.model.settings.regions:
        field = plate.material_numbers_in_lattice_rows(first, last)
        for axis in (0, 1):
            interface = np.diff(field, axis=axis) != 0
            odd |= np.pad(interface, [(0, int(a == axis)) for a in (0, 1)])
    odd = odd[first_row - first : end_row - first]
    around = reach + 1
    near = np.zeros((end_row - first_row + 2 * around, numbering.fine.strides[1]), dtype=bool)
    for x0, y0, x1, y1 in plate.precrack_segments:
        share = np.linspace(0, 1, 2 + int(4 * np.hypot(x1 - x0, y1 - y0)))
        x, y = np.round(x0 + share * (x1 - x0)).astype(int), np.round(y0 + share * (y1 - y0)).astype(int)
        row = y + BELOW - first_row + around
        inside = (
            (x >= 0)
            & (x < numbering.fine.counts[0])
            & (y >= 0)
            & (y < numbering.fine.counts[1])
            & (row >= 0)
            & (row < len(near))
        )
        near[row[inside], LEFT + x[inside]] = True
    if near.any():
        odd |= in_square(near, around)[around:-around]
    return odd


def _create_representative_bonds_in_chunks(
    model: Model, rows: NDArray[np.int64], representatives: NDArray[np.int64], representative_index: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], Part]]:
    """Bonds of the `representatives` of these rows, some at a time: those of nodes near irregular places, beyond which
    nothing is corrected. `representative_index` (s,) of the first each of the rows (s,) is like."""
    rule, chunks = Rule(model), np.array_split(rows[representatives], -(-len(representatives) // ROWS))
    lack = np.ones((len(model.grid), 2))
    chunk_pairs: list[Paired | None] = []
    for chunk in chunks:
        paired = rule.looked(rule.neighbours.pairs(chunk))
        lack[chunk] = rule.lack(chunk, paired)
        chunk_pairs.append(paired if len(chunk_pairs) < KEPT else None)
    lack[rows] = lack[rows[representatives[representative_index]]]
    for number, chunk in enumerate(chunks):
        paired, chunk_pairs[number] = chunk_pairs[number] or rule.looked(rule.neighbours.pairs(chunk)), None
        yield chunk, rule.part(chunk, paired, lack)


def _store_irregular_bonds(
    plate: HybridPlate,
    parts: Iterable[tuple[NDArray[np.int64], Part]],
    sorted_rows: NDArray[np.int64],
    numbers: NDArray[np.int64],
    springs: tuple[Springs, ...],
    irregular_bonds: IrregularBonds,
) -> NDArray[np.float64]:
    """Store in `irregular_bonds` the bonds that a scheme makes of part of the plate; `sorted_rows` are its rows, of
    which those with the numbers `numbers` are. Returns their different peaks and limits (j, 2, k)."""
    reach = int(np.abs(springs[0].family_dx).max()) + 1
    number = np.full((2 * reach + 1, 2 * reach + 1), -1)
    number[springs[0].family_dy + reach, springs[0].family_dx + reach] = np.arange(len(springs[0].family_dx))
    full = np.array([material_springs.spring_table[:, 5] for material_springs in springs])
    material, area = plate.model.material_of, plate.area_shares_of_grid_rows(sorted_rows) * plate.spacing**2
    number_by_limits: dict[bytes, int] = {}
    for chunk, part in parts:
        bonds, slot = part.bonds, np.searchsorted(numbers, chunk)
        at = np.repeat(np.arange(len(chunk)), np.diff(bonds.start))
        source, xi = chunk[at], bonds.xi
        step = np.round(xi / plate.spacing).astype(np.int64)
        k, row = number[step[:, 1] + reach, step[:, 0] + reach], sorted_rows[source]
        stiffness = bonds.stiffness * area[source] / np.hypot(*xi.T)
        usual = full[material[row], k]
        irregular_bonds.stiffness[slot[at], k] = np.where(
            np.abs(stiffness - usual) < ROUND_OFF * usual, usual, stiffness
        )
        limits = np.zeros((len(chunk), 2, full.shape[1]))
        limits[at, 0, k], limits[at, 1, k] = (
            double_green_strain_from_stretch(bonds.peak),
            double_green_strain_from_stretch(bonds.limit),
        )
        irregular_bonds.limit_row_of_bond_row[slot] = _number_distinct_limits(limits, number_by_limits)
        irregular_bonds.family_size[slot] = part.family[chunk - part.first]
        irregular_bonds.stiffness_bound[slot] = stiffness_bound(bonds, bonds.stiffness, True)
    return np.frombuffer(b"".join(number_by_limits)).reshape(-1, 2, full.shape[1])


def _number_distinct_limits(limits: NDArray[np.float64], number_by_limits: dict[bytes, int]) -> NDArray[np.int64]:
    """Number (n,) of each of these (n, 2, k) in `number_by_limits`, to which new ones are added; few differ."""
    bits = limits.reshape(len(limits), -1).view(np.int64)
    _, first, which = np.unique(bits @ np.arange(1, 2 * bits.shape[1], 2), return_index=True, return_inverse=True)
    if (bits != bits[first[which]]).any():  # two have the same sum
        first, which = np.arange(len(bits)), np.arange(len(bits))
    numbers = np.zeros(len(first), dtype=np.int64)
    for index in np.argsort(first).tolist():
        numbers[index] = number_by_limits.setdefault(limits[first[index]].tobytes(), len(number_by_limits))
    return np.asarray(numbers[which])


def find_first_row_with_equal_bonds(plate: HybridPlate, rows: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Number (s,) of the first of these rows (s,) of the grid with the same bonds, and neighbours with the same bonds,
    but for round-off, in families of this `reach`, h."""
    every = np.arange(len(rows))
    if not _is_uncut_rectangle_of_one_material(plate):
        return every
    far, (nx, ny) = 2 * reach + 2, plate.node_counts
    y, x = np.divmod(rows, nx)
    kind = np.zeros(len(rows), dtype=np.int64)
    for away in (x, nx - 1 - x, y, ny - 1 - y):
        kind = (far + 1) * kind + np.minimum(away, far)
    at = np.column_stack([x, y]) + np.array(plate.first_node_indices)
    for crack in plate.precrack_segments:
        start, way = crack[:2], crack[2:] - crack[:2]
        share = np.clip((at - start) @ way / max(float(way @ way), np.finfo(float).tiny), 0.0, 1.0)
        near = np.flatnonzero(np.hypot(*(at - start - share[:, None] * way).T) < 1.5 * far)
        crack_position = np.zeros(len(rows), dtype=np.int64)
        crack_position[near] = 1 + (
            _number_positions_relative_to_crack(at[near], crack, 2 * far) if (crack[:2] == crack[2:]).any() else near
        )
        kind = np.unique(kind, return_inverse=True)[1] * (1 + crack_position.max(initial=0)) + crack_position
    _, first, which = np.unique(kind, return_index=True, return_inverse=True)
    return np.asarray(first[which])


def _number_positions_relative_to_crack(
    places: NDArray[np.int64], crack: NDArray[np.float64], far: int
) -> NDArray[np.int64]:
    """A number for each of these places (k, 2) that tells how they lie to a crack along an axis, up to `far` from its
    ends."""
    numbers = np.zeros(len(places), dtype=np.int64)
    for end in (crack[:2], crack[2:]):
        for away in np.clip(places - np.floor(end).astype(np.int64), -far, far).T:
            numbers = (2 * far + 1) * numbers + away + far
    return numbers


def _is_uncut_rectangle_of_one_material(plate: HybridPlate) -> bool:
    """Whether nodes, of one material, fill a rectangle from which nothing is cut."""
    grid = plate.model.grid
    if plate.listed_nodes is not None or plate.model.settings.regions or len(grid.holes) or grid.bodies is not None:
        return False
    rings = [np.asarray(ring) for ring in grid.outline]
    if len(rings) != 1:
        return not rings
    x, y = rings[0].T
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    return bool(abs(area - np.ptp(x) * np.ptp(y)) < SAME * area)
