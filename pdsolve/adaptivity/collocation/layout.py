"""A plate on one lattice: its fine nodes, the coarse ones among them, and what does not change in a run.

Nodes are numbered row by row, with margins as wide as a family, so that a neighbour is a constant number of places on;
16 of them in a row are computed together. Every second node of every second row is a coarse one too.

    p       place of a node                          ix, iy   its column and row, from the lower left corner
    u, v    (2, places)                              h        spacing of fine nodes; that of coarse ones is 2 h

A fine bond is a spring as in `pdsolve.zone.springs`; at edges and faces of pre-cracks it has the
correction of surfaces that `pdsolve.schemes.average_horizon` gives it, computed when it is needed: with 1792 bonds a
node there is no room to keep it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs
from pdmesh.model.visibility import Sight
from pdsolve.adaptivity.hybrid.coarse_cells import check_no_precrack_on_node
from pdsolve.adaptivity.hybrid.precracks import is_visible, lengthen_cracks
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import mask_nodes_with_conditions, unbreakable
from pdsolve.laws.calls import bind
from pdsolve.laws.pair import no_bonds
from pdsolve.laws.pair_laws import brittle
from pdsolve.model import Model
from pdsolve.numerics.dilation import in_square
from pdsolve.operators.stencils import Stencil
from pdsolve.zone.refusals import create_unsupported_error
from pdsolve.zone.springs import STIFFNESS, Springs, double_green_strain_from_stretch
from pdsolve.zone.start_cells import count_full_cubes_around_nodes

ALONG_X, ALONG_Y = 6, 7  # columns of `spring_table`
SAME = 1e-12  # relative: areas this near to a whole cell are one
OFF = 1e-6  # spacings: nodes this far from the lattice are not on it


class PlateNumbering(NamedTuple):
    """PlateNumbering of places."""

    nx: int  # columns
    ny: int  # rows
    left_margin: int  # idle places before each row, a multiple of 16
    row_margin: int  # idle rows below and above
    row_stride: int  # places from a node to the one above, likewise
    place_count: int


class LatticeConstants(NamedTuple):
    """Constant arrays for compiled code; k bonds in a full family."""

    empty_law_columns: Any  # columns of no bonds, by whose type the law's functions are compiled
    numbering: PlateNumbering
    spacing: float  # m
    rho: float  # kg/m^3
    dt: float  # s
    spring_table: NDArray[np.float64]  # (k, 8) as in `Springs`, but stiffnesses over the area of a cell, N/m^4; then
    # n_x^2 and n_y^2 of their directions
    neighbour_offsets: NDArray[np.int64]  # (k,) places to the neighbour
    cell_area_share: NDArray[np.float64]  # (1, places) area of a node's cell over h^2, 0 without one
    surface_correction: NDArray[np.float64]  # (2, places) of energy in uniform stretch along x and y, as in the scheme
    row_stiffness: NDArray[np.float64]  # (r, k, 16) stiffnesses of rows, see `row_stiffness`, N/m^4
    no_fail: NDArray[np.bool_]  # (places,) nodes whose bonds do not break
    limit_double_green_strain: float  # e above which a bond breaks
    coarse_stencil_place_offsets: NDArray[np.int64]  # (s,) places from a coarse node to those of its stencil
    stencil_stiffness: NDArray[np.float64]  # (s, 3) xx, xy and yy, N/m^4
    stencil_vector_constants: NDArray[np.float64]  # (s, 3) 2 xi / |xi|^2 and 1 / |xi|^2 of the stencil's nodes


class CollocationPlate(NamedTuple):
    """The n nodes of a model on the lattice."""

    model: Model
    place_of_grid_row: NDArray[np.int64]  # (n,) of each row of the grid
    grid_row_at_place: NDArray[np.int32]  # (places,) of the grid, -1 without a node
    node_areas: NDArray[np.float64]  # (n,) of nodes, m^2
    cut_bond_bits: NDArray[np.uint16]  # (places / 16, k) a bit for each bond that is cut or without a node at
    # either end
    precrack_cut_counts_of_places: NDArray[np.int64]  # (places,) bonds that pre-cracks cut
    has_full_family: NDArray[np.bool_]  # (places,) nodes whose family is whole and uncut
    has_condition: NDArray[np.bool_]  # (places,) nodes that are loaded, held or do not break
    stiffness_index_of_row: NDArray[np.int32]  # (places / 16,) which of `row_stiffness` a row has, see there


def create_numbering_and_places(model: Model, reach: int) -> tuple[PlateNumbering, NDArray[np.int64]]:
    """Places (n,) of a model's nodes, with margins for families `reach` spacings wide. Raises ModelError."""
    grid = model.grid
    steps = (grid.position - grid.position.min(axis=0)) / float(grid.delta[0])
    column, row = np.round(steps).astype(np.int64).T
    if np.abs(steps - np.column_stack([column, row])).max() > OFF:
        raise create_unsupported_error(model, "$.nodes", "on no lattice", "nodes on one")
    nx, ny, left_margin = int(column.max()) + 1, int(row.max()) + 1, ROW * -(-reach // ROW)
    stride = ROW * -(-(left_margin + nx + reach) // ROW)
    numbering = PlateNumbering(nx, ny, left_margin, reach, stride, (ny + 2 * reach) * stride + 2 * ROW)
    return numbering, (row + reach) * stride + left_margin + column


def create_constants_and_plate(
    model: Model, springs: Springs, numbering: PlateNumbering, place_of_grid_row: NDArray[np.int64], stencil: Stencil
) -> tuple[LatticeConstants, CollocationPlate]:
    """Constant arrays of a plate, before its time step is chosen. Raises GridError, ModelError."""
    h, material = float(model.grid.delta[0]), model.materials[0]
    ways = springs.family_dy * numbering.row_stride + springs.family_dx
    row = np.full(numbering.place_count, -1, dtype=np.int32)
    row[place_of_grid_row] = np.arange(len(place_of_grid_row))
    if model.grid.areas is not None:
        area = model.grid.areas
    else:  # a quarter of each adjacent square between nodes
        has_node = (row[: numbering.place_count - 2 * ROW] >= 0).reshape(-1, numbering.row_stride)
        area = np.asarray(h**2 / 4 * count_full_cubes_around_nodes(has_node).ravel()[place_of_grid_row])
    area_share, no_fail = np.zeros((1, numbering.place_count)), np.zeros(numbering.place_count, dtype=np.bool_)
    share = area / h**2
    area_share[0, place_of_grid_row] = np.where(np.abs(share - 1) < SAME, 1.0, share)
    no_fail[place_of_grid_row] = unbreakable(model)
    xi = 2 * h * stencil.xi.astype(float)
    square = np.maximum((xi**2).sum(axis=1), h**2)
    table = springs.spring_table.copy()
    table[:, STIFFNESS] /= h**2
    table[:, ALONG_X : ALONG_Y + 1] = (table[:, :2] * np.sqrt(table[:, 4:5])) ** 2
    theta = stencil.theta / (4 * h**2)
    bind(brittle.LAW)
    lattice = LatticeConstants(
        empty_law_columns=no_bonds(brittle.LAW),
        numbering=numbering,
        spacing=h,
        rho=material.rho,
        dt=0.0,
        spring_table=table,
        neighbour_offsets=ways,
        cell_area_share=area_share,
        surface_correction=np.ones((2, numbering.place_count)),
        row_stiffness=np.zeros((0, len(ways), ROW)),
        no_fail=no_fail,
        limit_double_green_strain=float(double_green_strain_from_stretch(springs.limit_stretch.min())),
        coarse_stencil_place_offsets=2 * (stencil.xi[:, 1] * numbering.row_stride + stencil.xi[:, 0]),
        stencil_stiffness=np.column_stack([theta[:, 0, 0], theta[:, 0, 1], theta[:, 1, 1]]),
        stencil_vector_constants=np.column_stack([2 * xi / square[:, None], 1 / square]),
    )
    return lattice, _create_plate(model, lattice, place_of_grid_row, row, area)


def _create_plate(
    model: Model,
    lattice: LatticeConstants,
    place_of_grid_row: NDArray[np.int64],
    grid_row_at_place: NDArray[np.int32],
    node_areas: NDArray[np.float64],
) -> CollocationPlate:
    """The plate of a lattice, whose corrections at edges it stores. Raises GridError, ModelError."""
    numbering, has_node = lattice.numbering, grid_row_at_place >= 0
    cut_bond_bits = np.zeros((numbering.place_count // ROW, len(lattice.neighbour_offsets)), dtype=np.uint16)
    for k, way in enumerate(lattice.neighbour_offsets):  # margins have no nodes, so that none is beyond the ends
        lacks_end = ~(has_node & np.roll(has_node, -way))
        cut_bond_bits[:, k] = np.packbits(lacks_end, bitorder="little").view(np.uint16)
    _cut_bonds_across_holes(model, lattice, grid_row_at_place, cut_bond_bits)
    cracks = (model.grid.cracks - np.tile(model.grid.position.min(axis=0), 2)) / lattice.spacing
    check_no_precrack_on_node(model, cracks, numbering.nx - 1, numbering.ny - 1)
    cracks = lengthen_cracks(cracks)
    # places within a family's reach of a missing or partial cell, or of a pre-crack
    odd = lattice.cell_area_share[0] != 1
    for x0, y0, x1, y1 in cracks:
        share = np.linspace(0, 1, 2 + int(4 * np.hypot(x1 - x0, y1 - y0)))
        x, y = np.round(x0 + share * (x1 - x0)).astype(int), np.round(y0 + share * (y1 - y0)).astype(int)
        inside = (x >= 0) & (x < numbering.nx) & (y >= 0) & (y < numbering.ny)
        odd[(y[inside] + numbering.row_margin) * numbering.row_stride + numbering.left_margin + x[inside]] = True
    near = dilate_mask(odd, numbering, numbering.row_margin + 1) & has_node
    near_places, cut_counts = np.flatnonzero(near), np.zeros(numbering.place_count, dtype=np.int64)
    has_full_family, has_condition = has_node & ~near, lattice.no_fail.copy()
    has_condition[place_of_grid_row] |= mask_nodes_with_conditions(model)
    _cut_bonds_across_precracks(lattice, cut_bond_bits, near_places, cracks, cut_counts)
    _store_surface_correction_and_full_families(lattice, cut_bond_bits, near_places, has_full_family)
    return CollocationPlate(
        model=model,
        place_of_grid_row=place_of_grid_row,
        grid_row_at_place=grid_row_at_place,
        node_areas=node_areas,
        cut_bond_bits=cut_bond_bits,
        precrack_cut_counts_of_places=cut_counts,
        has_full_family=has_full_family,
        has_condition=has_condition,
        stiffness_index_of_row=np.zeros(0, dtype=np.int32),
    )


def reshape_to_lattice(values: NDArray[Any], numbering: PlateNumbering) -> NDArray[Any]:
    """View (ny, nx) of values (places,) at the places of the lattice."""
    rows = values[: numbering.place_count - 2 * ROW].reshape(-1, numbering.row_stride)
    rows = rows[numbering.row_margin : numbering.row_margin + numbering.ny]
    return rows[:, numbering.left_margin : numbering.left_margin + numbering.nx]


def dilate_mask(marked: NDArray[np.bool_], numbering: PlateNumbering, reach: int) -> NDArray[np.bool_]:
    """Mask (places,) of places at most `reach` columns and rows from a marked one."""
    field = marked[: numbering.place_count - 2 * ROW].reshape(-1, numbering.row_stride)
    near = np.zeros(numbering.place_count, dtype=np.bool_)
    near[: field.size] = in_square(field, reach).ravel()
    return near


def mask_rows_without_full_families(lattice: LatticeConstants) -> NDArray[np.bool_]:
    """Mask (places / 16,) of rows with bonds that are not those of a full family."""
    odd = (lattice.cell_area_share[0] != 1) | (lattice.surface_correction != 1).any(axis=0)
    edge_rows = np.asarray(
        dilate_mask(odd, lattice.numbering, lattice.numbering.row_margin).reshape(-1, ROW).any(axis=1)
    )
    edge_rows[-2:] = True
    return edge_rows


def _cut_bonds_across_holes(
    model: Model, lattice: LatticeConstants, grid_row_at_place: NDArray[np.int32], cut_bond_bits: NDArray[np.uint16]
) -> None:
    """Cut the bonds that a hole or the outline separates."""
    numbering, ways = lattice.numbering, lattice.neighbour_offsets
    missing = np.zeros(numbering.place_count, dtype=np.bool_)
    reshape_to_lattice(missing, numbering)[:] = reshape_to_lattice(grid_row_at_place, numbering) < 0
    if not missing.any():
        return  # a rectangle, which no bond leaves
    around = np.flatnonzero(dilate_mask(missing, numbering, numbering.row_margin) & (grid_row_at_place >= 0))
    around = around[np.argsort(grid_row_at_place[around])]
    sight, half = Sight(model.grid, model.name), len(ways) // 2
    for k in range(half):
        near = around[grid_row_at_place[around + ways[k]] >= 0]
        i, j = (grid_row_at_place[ends].astype(np.int64) for ends in (near, near + ways[k]))
        length = np.full(len(i), float(np.hypot(*lattice.spring_table[k, :2])))
        parted = near[~sight.inside(Pairs(i, j, length))]
        mark_bonds_cut(cut_bond_bits, parted, np.full(len(parted), k))
        mark_bonds_cut(cut_bond_bits, parted + ways[k], np.full(len(parted), k + half))


def mark_bonds_cut(cut_bond_bits: NDArray[np.uint16], places: NDArray[np.int64], k: NDArray[np.integer]) -> None:
    """Mark bonds `k` (b,) of nodes at `places` (b,) as cut."""
    np.bitwise_or.at(cut_bond_bits, (places // ROW, k), (1 << (places % ROW)).astype(np.uint16))


@cached_njit(error_model="numpy")
def _cut_bonds_across_precracks(lattice, cut_bond_bits, places, cracks, precrack_cut_counts_of_places):  # type: ignore[no-untyped-def]
    """Cut and count the bonds of these nodes that cross a pre-crack."""
    numbering = lattice.numbering
    for p in places:
        ix, iy = p % numbering.row_stride - numbering.left_margin, p // numbering.row_stride - numbering.row_margin
        for k in range(len(lattice.neighbour_offsets)):
            if is_bond_cut(cut_bond_bits, p, k):
                continue
            x, y = (
                ix + np.round(lattice.spring_table[k, 0] / lattice.spacing),
                iy + np.round(lattice.spring_table[k, 1] / lattice.spacing),
            )
            if not is_visible(cracks, ix, iy, x, y):
                mark_bond_cut(cut_bond_bits, p, k)
                precrack_cut_counts_of_places[p] += 1


@cached_njit(error_model="numpy")
def _store_surface_correction_and_full_families(lattice, cut_bond_bits, places, has_full_family):  # type: ignore[no-untyped-def]
    """Store the energy of a full family over that of these nodes, and mark the nodes with a whole family."""
    full_x, full_y = 0.0, 0.0
    for k in range(len(lattice.neighbour_offsets)):
        energy = lattice.spring_table[k, 5] / lattice.spring_table[k, 4]
        full_x += energy * lattice.spring_table[k, ALONG_X] ** 2
        full_y += energy * lattice.spring_table[k, ALONG_Y] ** 2
    for p in places:
        held_x, held_y, is_full = 0.0, 0.0, lattice.cell_area_share[0, p] == 1
        for k in range(len(lattice.neighbour_offsets)):
            share = lattice.cell_area_share[0, p + lattice.neighbour_offsets[k]]
            if is_bond_cut(cut_bond_bits, p, k):
                is_full = False
                continue
            is_full &= share == 1
            energy = share * lattice.spring_table[k, 5] / lattice.spring_table[k, 4]
            held_x += energy * lattice.spring_table[k, ALONG_X] ** 2
            held_y += energy * lattice.spring_table[k, ALONG_Y] ** 2
        has_full_family[p] = is_full
        if not is_full:
            lattice.surface_correction[0, p] = full_x / held_x if held_x > 0 else 1.0
            lattice.surface_correction[1, p] = full_y / held_y if held_y > 0 else 1.0


@cached_njit(error_model="numpy")
def is_bond_cut(cut_bond_bits, p, k):  # type: ignore[no-untyped-def]
    """Whether bond k of a node is cut or broken."""
    return (np.int64(cut_bond_bits[p // 16, k]) >> (p % 16)) & 1 != 0


@cached_njit(error_model="numpy")
def mark_bond_cut(cut_bond_bits, p, k):  # type: ignore[no-untyped-def]
    """Mark bond k of node p as cut."""
    cut_bond_bits[p // 16, k] = np.uint16(np.int64(cut_bond_bits[p // 16, k]) | (1 << (p % 16)))


def list_bonds(
    lattice: LatticeConstants,
    cut_bond_bits: NDArray[np.uint16],
    is_target: NDArray[np.bool_],
    places: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Intact bonds (b,) of some places to the places that are a target: index of the place, and bond number."""
    node, k = np.zeros((2, count_bonds(lattice, cut_bond_bits, is_target, places).sum()), dtype=np.int64)
    _count_and_list_bonds(lattice, cut_bond_bits, is_target, places, node, k)
    return node, k


def count_bonds(
    lattice: LatticeConstants,
    cut_bond_bits: NDArray[np.uint16],
    is_target: NDArray[np.bool_],
    places: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Numbers (n,) of such bonds of some places."""
    nothing = np.zeros(0, dtype=np.int64)
    return np.asarray(_count_and_list_bonds(lattice, cut_bond_bits, is_target, places, nothing, nothing))


@cached_njit(error_model="numpy")
def _count_and_list_bonds(lattice, cut_bond_bits, is_target, places, node, bond_number):  # type: ignore[no-untyped-def]
    """Count such bonds of each of some places (n,), and list them as far as there is room."""
    counts, count = np.zeros(len(places), dtype=np.int64), 0
    for n in range(len(places)):
        for k in range(len(lattice.neighbour_offsets)):
            if is_target[places[n] + lattice.neighbour_offsets[k]] and not is_bond_cut(cut_bond_bits, places[n], k):
                if count < len(node):
                    node[count], bond_number[count] = n, k
                counts[n] += 1
                count += 1
    return counts
