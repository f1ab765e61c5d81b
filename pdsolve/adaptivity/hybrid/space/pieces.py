"""Forces and energies of clipped bonds.

Pieces are springs between points. A point is a node, or moves with up to four. Pieces with the same near end lie beside
each other and are summed eight at a time; points are numbered as the pieces name them, so that what a piece reads was
read shortly before. Pieces with the same two ends are one spring.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.arrangement import (
    BondPieceEndPoints,
    ClippedBondPiece,
    FineLattice,
    coordinates_of_blockwise_place_number,
    create_bond_piece_end_points,
)
from pdsolve.adaptivity.hybrid.space.clipped_pieces import add_forces_of_eight_bond_pieces
from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.rows_of_four import TOGETHER
from pdsolve.numerics.memory import aligned
from pdsolve.zone.cells import floor_divide, place_number_at

SHARED = 4  # pieces of a point, at least, in the first guess


class BondPieceGroupsOfEight(NamedTuple):
    """Springs in g groups of eight with one near end; a group that is not full has springs without stiffness."""

    near_end_site: NDArray[np.int32]  # (g,) fine site of the near end, or of one less than a spacing from it
    near_point: NDArray[np.int32]  # (g,) point at the near end
    far_point: NDArray[np.int32]  # (8 g,) point at the far end
    xi_row: NDArray[np.int32]  # (8 g,) row of xi
    stiffness: NDArray[np.float64]  # (8 g,) N/m
    # (8 g,) least e at which bonds soften or break over that of its own; 0 if it never breaks
    limit_strain_ratio: NDArray[np.float64]


class GroupedBondPieceSprings(NamedTuple):
    """The springs of pieces between q points, which move with nodes."""

    points: BondPieceEndPoints  # with fine places of nodes, or -1 - coarse places
    groups: BondPieceGroupsOfEight
    xi: NDArray[np.float64]  # (d, 4) xi, m, 1 / |xi|^2
    point_displacements: NDArray[np.float64]  # (q, 4) room for the displacements of points; see `clipped_pieces`
    point_forces: NDArray[np.float64]  # (q, 4) room for their forces
    largest_scaled_strains: NDArray[np.float64]  # (8,) room for the largest e times `limit_strain_ratio`
    # (q, 4) how far points are off where nodes move them, m, and minus half the strain of free ones; None: none swells
    point_swelling: NDArray[np.float64] | None


class PlaceHashTable(NamedTuple):
    """Numbers of places: a hash table whose size is a power of 2, and what is found."""

    places_by_hash: NDArray[np.int64]  # (size,) place, -1 without one
    numbers_by_hash: NDArray[np.int32]  # (size,)
    place_of_number: NDArray[np.int64]  # (size / 2,) by number
    last_near_end: NDArray[np.int32]  # (size / 2,) scratch: the last of the near ends from which a piece has led there
    last_piece: NDArray[np.int64]  # (size / 2,) scratch: that piece


def create_grouped_bond_piece_springs(
    fine: FineLattice,
    node_kinds: NDArray[np.uint8],
    encode_places: Callable[[NDArray[np.int32]], NDArray[np.int64]],
    pieces: NDArray[ClippedBondPiece],
    swells: bool,
) -> GroupedBondPieceSprings:
    """The springs of pieces, which may swell.

    `node_kinds` (sites,) are those of fine nodes, and `encode_places` says where the nodes at fine sites are: their
    places on the fine lattice, or -1 less those on the coarse one.
    """
    count = len(pieces)
    room = count + (TOGETHER - 1) * (np.count_nonzero(np.diff(pieces["near_end_place"])) + 1) if count else 0
    group_count, entry_count = room // TOGETHER, room // TOGETHER * TOGETHER
    groups = BondPieceGroupsOfEight(
        *np.empty((2, group_count), np.int32), *np.empty((2, entry_count), np.int32), *np.empty((2, entry_count))
    )
    size = 1 << max(4, count // SHARED).bit_length() + 1
    while True:
        half = size // 2
        numbers = PlaceHashTable(
            np.full(size, -1, np.int64),
            np.empty(size, np.int32),
            np.empty(half, np.int64),
            np.full(half, -1, np.int32),
            np.empty(half, np.int64),
        )
        points, used = group_bond_pieces_by_near_end(fine, pieces, numbers, groups)
        if points >= 0:
            break
        size *= 2
    ends = create_bond_piece_end_points(fine, node_kinds, numbers.place_of_number[:points])
    places = encode_places(ends.interpolation_nodes)
    u, force = (aligned(np.zeros((points, 4))) for _ in range(2))
    return GroupedBondPieceSprings(
        ends._replace(interpolation_nodes=places.astype(np.int32)),
        BondPieceGroupsOfEight._make(column[: used * len(column) // max(group_count, 1)] for column in groups),
        fine.distinct_piece_xi,
        u,
        force,
        np.zeros(TOGETHER),
        np.zeros((points, 4)) if swells else None,
    )


@cached_njit(error_model="numpy")
def group_bond_pieces_by_near_end(fine, pieces, place_table, groups):  # type: ignore[no-untyped-def]
    """Put pieces into groups; the numbers of points and of groups, or -1 if there are more points than numbers."""
    count, m, run, i, unit = 0, 0, -1, 0, fine.part_ends.units_per_spacing
    for n in range(len(pieces)):
        piece, place = pieces[n], pieces[n].near_end_place
        if n == 0 or place != pieces[n - 1].near_end_place:
            m = _pad_last_group_with_zero_stiffness(groups, m, i)
            i, count = _find_or_add_place_number(place_table, place, count)
            run += 1
        j, count = _find_or_add_place_number(place_table, piece.far_end_place, count)
        if count > len(place_table.place_of_number) - 2:
            return -1, 0
        if place_table.last_near_end[j] == run:
            at = place_table.last_piece[j]
            least = max(groups.limit_strain_ratio[at], piece.limit_strain_ratio)
            groups.stiffness[at] += piece.stiffness
            groups.limit_strain_ratio[at] = least
            continue
        if m % TOGETHER == 0:
            groups.near_point[m // TOGETHER] = i
            x = floor_divide(coordinates_of_blockwise_place_number(fine.numbering, unit, place), unit)
            groups.near_end_site[m // TOGETHER] = place_number_at(fine.numbering.fine, x)
        place_table.last_near_end[j], place_table.last_piece[j] = run, m
        groups.far_point[m], groups.xi_row[m] = j, fine.xi_row_of_piece_kind[piece.piece_kind]
        groups.stiffness[m] = piece.stiffness
        groups.limit_strain_ratio[m] = piece.limit_strain_ratio
        m += 1
    return count, _pad_last_group_with_zero_stiffness(groups, m, i) // TOGETHER


@njit(**INNER)
def _pad_last_group_with_zero_stiffness(groups, spring_count, near_point):  # type: ignore[no-untyped-def]
    """Fill the last group with springs without stiffness; the entries used then."""
    while spring_count % TOGETHER:
        groups.far_point[spring_count], groups.xi_row[spring_count] = near_point, 0
        groups.stiffness[spring_count] = groups.limit_strain_ratio[spring_count] = 0.0
        spring_count += 1
    return spring_count


@njit(**INNER)
def _find_or_add_place_number(place_table, place, count):  # type: ignore[no-untyped-def]
    """The number of a place, a new one if it has none; and how many there are then."""
    mask = np.uint64(len(place_table.places_by_hash) - 1)
    away = (np.uint64(place) >> np.uint64(4)) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(20)
    at = (away << np.uint64(4) | np.uint64(place) & np.uint64(15)) & mask  # places beside each other stay so
    while place_table.places_by_hash[at] not in (-1, place):
        at = (at + np.uint64(1)) & mask
    if place_table.places_by_hash[at] < 0:
        place_table.places_by_hash[at], place_table.numbers_by_hash[at], place_table.place_of_number[count] = (
            place,
            count,
            place,
        )
        count += 1
    return place_table.numbers_by_hash[at], count


@cached_njit(nogil=True, error_model="numpy")
def add_bond_piece_forces(fine_u, coarse_u, pieces, fine_force, coarse_force):  # type: ignore[no-untyped-def]
    """Add the forces of `pieces` on nodes, N, to `fine_force` (3, m) and `coarse_force` (3, q), at displacements of
    both lattices.

    Returns the largest e of those that could break.
    """
    _set_point_displacements(fine_u, coarse_u, pieces)
    u, sums, groups, points = pieces.point_displacements, pieces.point_forces, pieces.groups, pieces.points
    xi, far, rows = pieces.xi, groups.far_point, groups.xi_row
    k, least = groups.stiffness, groups.limit_strain_ratio
    sums[:] = 0
    pieces.largest_scaled_strains[:] = 0
    for g in range(len(groups.near_point)):
        near = np.int64(groups.near_point[g])
        add_forces_of_eight_bond_pieces(
            u,
            sums,
            xi,
            far,
            rows,
            k,
            least,
            pieces.largest_scaled_strains,
            TOGETHER * g,
            near,
            pieces.point_swelling,
        )
    for q in range(len(points.interpolation_node_count)):
        for m in range(points.interpolation_node_count[q]):
            place, share = points.interpolation_nodes[q, m], points.interpolation_weights[q, m]
            for axis in range(3):
                if place >= 0:
                    fine_force[axis, place] += share * sums[q, axis]
                else:
                    coarse_force[axis, -1 - place] += share * sums[q, axis]
    largest = 0.0
    for e in pieces.largest_scaled_strains:
        largest = max(largest, e)
    return largest


@njit(**INNER)
def _set_point_displacements(fine_u, coarse_u, pieces):  # type: ignore[no-untyped-def]
    """Fill in the displacements of the points."""
    points, u = pieces.points, pieces.point_displacements
    for q in range(len(points.interpolation_node_count)):
        for axis in range(3):
            displacement = 0.0
            for m in range(points.interpolation_node_count[q]):
                place, share = points.interpolation_nodes[q, m], points.interpolation_weights[q, m]
                displacement += share * (fine_u[axis, place] if place >= 0 else coarse_u[axis, -1 - place])
            u[q, axis] = displacement
    _add_swelling(u, pieces.point_swelling)


@overloaded(INNER)
def _add_swelling(u, swelling):  # type: ignore[no-untyped-def]
    """Add how far points are off, and set the last column, where pieces swell."""
    if is_none(swelling):
        return lambda u, swelling: None

    def add(u, swelling):  # type: ignore[no-untyped-def]
        u[:, 3] = 0.0
        u += swelling

    return add


@cached_njit(nogil=True, error_model="numpy")
def add_bond_piece_energies(fine_u, coarse_u, pieces, site_mask, fine_energy, coarse_energy):  # type: ignore[no-untyped-def]
    """Add the energies of pieces, J, to those of fine (m,) and coarse places (q,), half to each end; of those with
    their near ends at fine sites of `site_mask` (sites,) alone."""
    _set_point_displacements(fine_u, coarse_u, pieces)
    energy, u, groups, points = pieces.point_forces, pieces.point_displacements, pieces.groups, pieces.points
    energy[:] = 0
    for n in range(len(groups.stiffness)):
        i, j, row, e = groups.near_point[n // TOGETHER], groups.far_point[n], pieces.xi[groups.xi_row[n]], 0.0
        if not site_mask[groups.near_end_site[n // TOGETHER]] or groups.stiffness[n] == 0:
            continue
        for axis in range(3):
            eta = u[j, axis] - u[i, axis] + (u[i, 3] + u[j, 3]) * row[axis]
            e += row[3] * eta * (2 * row[axis] + eta)
        stretch = e / (np.sqrt(1 + e) + 1)
        end_energy = groups.stiffness[n] / row[3] * stretch * stretch / 4
        energy[i, 0] += end_energy
        energy[j, 0] += end_energy
    for q in range(len(points.interpolation_node_count)):
        for m in range(points.interpolation_node_count[q]):
            place, share = points.interpolation_nodes[q, m], points.interpolation_weights[q, m] * energy[q, 0]
            if place >= 0:
                fine_energy[place] += share
            else:
                coarse_energy[-1 - place] += share
