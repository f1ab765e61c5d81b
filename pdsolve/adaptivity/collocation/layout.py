"""A plate on one lattice: its fine nodes, the coarse ones among them, and what does not change in a run.

Nodes are numbered row by row, with margins as wide as a family, so that a neighbour is a constant number of places on;
16 of them in a row are computed together. Every second node of every second row is a coarse one too.

    p       place of a node                          ix, iy   its column and row, from the lower left corner
    u, v    (2, places)                              h        spacing of fine nodes; that of coarse ones is 2 h

A fine bond is a spring as in `pdsolve.adaptivity.hybrid.springs`; at edges and faces of pre-cracks it has the
correction of surfaces that `pdsolve.schemes.average_horizon` gives it, computed when it is needed: with 1792 bonds a
node there is no room to keep it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import InitialVelocity
from pdmesh.model.neighbours import Pairs
from pdmesh.model.visibility import Sight
from pdsolve.adaptivity.hybrid.coarse_cells import check_no_precrack_on_node, count_full_squares_around_places
from pdsolve.adaptivity.hybrid.precracks import is_visible, lengthen_cracks
from pdsolve.adaptivity.hybrid.springs import STIFFNESS, Springs, double_green_strain_from_stretch
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import unbreakable
from pdsolve.laws.calls import bind
from pdsolve.laws.pair import no_bonds
from pdsolve.laws.pair_laws import brittle
from pdsolve.model import Model, ModelError
from pdsolve.numerics.dilation import in_square
from pdsolve.operators.stencils import Stencil

WHOLE, CUT, EDGE, KNOWN = range(4)  # rows: of full families, of those with cut bonds, of those at edges; the last ones
# with stiffnesses that are kept, as many rows have the same
SAME = 1e-12  # relative: areas this near to a whole cell are one
OFF = 1e-6  # spacings: nodes this far from the lattice are not on it


class Numbering(NamedTuple):
    """Numbering of places."""

    nx: int  # columns
    ny: int  # rows
    left_margin: int  # idle places before each row, a multiple of 16
    row_margin: int  # idle rows below and above
    row_stride: int  # places from a node to the one above, likewise
    place_count: int


class LatticeConstants(NamedTuple):
    """Constant arrays for compiled code; k bonds in a full family."""

    bond_law: Any  # columns of no bonds, by whose type the law's functions are compiled
    numbering: Numbering
    spacing: float  # m
    rho: float  # kg/m^3
    dt: float  # s
    spring_table: NDArray[np.float64]  # (k, 8) springs, as in `Springs`, but stiffnesses over the area of a cell, N/m^4
    squared_direction_components: NDArray[np.float64]  # (k, 2) n_x^2 and n_y^2
    neighbour_offsets: NDArray[np.int64]  # (k,) places to the neighbour
    cell_area_share: NDArray[np.float64]  # (1, places) area of a node's cell over h^2, 0 without one
    surface_correction: NDArray[np.float64]  # (2, places) of energy in uniform stretch along x and y, as in the scheme
    edge_row_stiffness_index: NDArray[
        np.int64
    ]  # (places / 16,) of rows at edges whose stiffnesses are kept: which; -1 of others
    edge_row_stiffness: NDArray[np.float64]  # (patterns * k, 1, 16) these, N/m^4
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
    cut_bond_bits: NDArray[np.uint16]  # (places / 16, k) a bit for each bond that is cut or broken
    precrack_cut_counts_of_places: NDArray[np.int64]  # (places,) bonds that pre-cracks cut
    has_full_family: NDArray[np.bool_]  # (places,) nodes whose family is whole and uncut
    has_condition: NDArray[np.bool_]  # (places,) nodes that are loaded, held or do not break


def create_numbering_and_places(model: Model, reach: int, error_hint: str) -> tuple[Numbering, NDArray[np.int64]]:
    """Places (n,) of a model's nodes, with margins for families `reach` spacings wide. Raises ModelError."""
    grid = model.grid
    if (grid.delta != grid.delta[0]).any():
        raise ModelError(f"{model.name}: $.nodes has several spacings; use one, {error_hint}")
    steps = (grid.position - grid.position.min(axis=0)) / float(grid.delta[0])
    column, row = np.round(steps).astype(np.int64).T
    if np.abs(steps - np.column_stack([column, row])).max() > OFF:
        raise ModelError(f"{model.name}: $.nodes has nodes on no lattice; put them on one, {error_hint}")
    nx, ny, left_margin = int(column.max()) + 1, int(row.max()) + 1, ROW * -(-reach // ROW)
    stride = ROW * -(-(left_margin + nx + reach) // ROW)
    numbering = Numbering(nx, ny, left_margin, reach, stride, (ny + 2 * reach) * stride + 2 * ROW)
    return numbering, (row + reach) * stride + left_margin + column


def create_constants_and_plate(
    model: Model, springs: Springs, numbering: Numbering, place_of_grid_row: NDArray[np.int64], stencil: Stencil
) -> tuple[LatticeConstants, CollocationPlate]:
    """Constant arrays of a plate, before its time step is chosen. Raises GridError, ModelError."""
    h, material = float(model.grid.delta[0]), model.materials[0]
    n = springs.spring_table[:, :2] * np.sqrt(springs.spring_table[:, 4:5])
    ways = springs.family_dy * numbering.row_stride + springs.family_dx
    row = np.full(numbering.place_count, -1, dtype=np.int32)
    row[place_of_grid_row] = np.arange(len(place_of_grid_row))
    area = _node_areas(model, numbering, place_of_grid_row, row)
    area_share, no_fail = np.zeros((1, numbering.place_count)), np.zeros(numbering.place_count, dtype=np.bool_)
    share = area / h**2
    area_share[0, place_of_grid_row] = np.where(np.abs(share - 1) < SAME, 1.0, share)
    no_fail[place_of_grid_row] = unbreakable(model)
    xi = 2 * h * stencil.xi.astype(float)
    square = np.maximum((xi**2).sum(axis=1), h**2)
    table = springs.spring_table.copy()
    table[:, STIFFNESS] /= h**2
    theta = stencil.theta / (4 * h**2)
    bind(brittle.LAW)
    lattice = LatticeConstants(
        bond_law=no_bonds(brittle.LAW),
        numbering=numbering,
        spacing=h,
        rho=material.rho,
        dt=0.0,
        spring_table=table,
        squared_direction_components=np.ascontiguousarray(n**2),
        neighbour_offsets=ways,
        cell_area_share=area_share,
        surface_correction=np.ones((2, numbering.place_count)),
        edge_row_stiffness_index=np.full(numbering.place_count // ROW, -1),
        edge_row_stiffness=np.zeros((0, 1, ROW)),
        no_fail=no_fail,
        limit_double_green_strain=float(double_green_strain_from_stretch(springs.limit_stretch)),
        coarse_stencil_place_offsets=2 * (stencil.xi[:, 1] * numbering.row_stride + stencil.xi[:, 0]),
        stencil_stiffness=np.column_stack([theta[:, 0, 0], theta[:, 0, 1], theta[:, 1, 1]]),
        stencil_vector_constants=np.column_stack([2 * xi / square[:, None], 1 / square]),
    )
    cut = np.zeros((numbering.place_count // ROW, len(ways)), dtype=np.uint16)
    hidden = _cut_bonds_across_holes(model, lattice, springs, row, cut)
    cracks = (model.grid.cracks - np.tile(model.grid.position.min(axis=0), 2)) / h
    check_no_precrack_on_node(model, cracks, numbering.nx - 1, numbering.ny - 1)
    cracks = lengthen_cracks(cracks)
    near = _mask_near_edges_and_cracks(area_share[0], numbering, cracks) & (row >= 0)
    near |= hidden
    full_family = (row >= 0) & ~near
    near_places, precrack_cut_counts_of_places, has_condition = (
        np.flatnonzero(near),
        np.zeros(numbering.place_count, dtype=np.int64),
        no_fail.copy(),
    )
    _cut_bonds_across_precracks(lattice, cut, near_places, cracks, precrack_cut_counts_of_places)
    _store_surface_correction_and_full_families(lattice, cut, near_places, full_family)
    for condition in model.settings.conditions:
        if not isinstance(condition, InitialVelocity):
            has_condition[place_of_grid_row[model.selected(condition)]] = True
    return lattice, CollocationPlate(
        model, place_of_grid_row, row, area, cut, precrack_cut_counts_of_places, full_family, has_condition
    )


def _node_areas(
    model: Model, numbering: Numbering, place_of_grid_row: NDArray[np.int64], grid_row_at_place: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Areas (n,) of nodes, m^2: those of the grid, or else a quarter of each adjacent square between nodes."""
    if model.grid.areas is not None:
        return model.grid.areas
    around = count_full_squares_around_places(
        (grid_row_at_place[: numbering.place_count - 2 * ROW] >= 0).reshape(-1, numbering.row_stride)
    ).ravel()[place_of_grid_row]
    return np.asarray(float(model.grid.delta[0]) ** 2 / 4 * around)


def dilate_mask(marked: NDArray[np.bool_], numbering: Numbering, reach: int) -> NDArray[np.bool_]:
    """Mask (places,) of places at most `reach` columns and rows from a marked one."""
    field = marked[: numbering.place_count - 2 * ROW].reshape(-1, numbering.row_stride)
    near = np.zeros(numbering.place_count, dtype=np.bool_)
    near[: field.size] = in_square(field, reach).ravel()
    return near


def classify_rows(lattice: LatticeConstants, cut_bond_bits: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Kind of each row of 16 places."""
    at_edge = np.where(lattice.edge_row_stiffness_index >= 0, KNOWN, EDGE)
    return np.where(mask_edge_rows(lattice), at_edge, np.where(cut_bond_bits.any(axis=1), CUT, WHOLE)).astype(np.uint8)


def mask_edge_rows(lattice: LatticeConstants) -> NDArray[np.bool_]:
    """Mask (places / 16,) of rows with bonds that are not those of a full family."""
    odd = (lattice.cell_area_share[0] != 1) | (lattice.surface_correction != 1).any(axis=0)
    edge_rows = np.asarray(
        dilate_mask(odd, lattice.numbering, lattice.numbering.row_margin).reshape(-1, ROW).any(axis=1)
    )
    edge_rows[-2:] = True
    return edge_rows


def _mask_near_edges_and_cracks(
    area_share: NDArray[np.float64], numbering: Numbering, cracks: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask of places within a family's reach of a missing or partial cell, or of a pre-crack."""
    odd = area_share != 1
    for x0, y0, x1, y1 in cracks:
        share = np.linspace(0, 1, 2 + int(4 * np.hypot(x1 - x0, y1 - y0)))
        x, y = np.round(x0 + share * (x1 - x0)).astype(int), np.round(y0 + share * (y1 - y0)).astype(int)
        inside = (x >= 0) & (x < numbering.nx) & (y >= 0) & (y < numbering.ny)
        odd[(y[inside] + numbering.row_margin) * numbering.row_stride + numbering.left_margin + x[inside]] = True
    return dilate_mask(odd, numbering, numbering.row_margin + 1)


def _cut_bonds_across_holes(
    model: Model,
    lattice: LatticeConstants,
    springs: Springs,
    grid_row_at_place: NDArray[np.int32],
    cut_bond_bits: NDArray[np.uint16],
) -> NDArray[np.bool_]:
    """Remove the bonds that a hole or the outline separates; returns a mask (places,) of their nodes."""
    numbering, hidden = lattice.numbering, np.zeros(lattice.numbering.place_count, dtype=np.bool_)
    inner = np.zeros(numbering.place_count, dtype=np.bool_)
    field = inner[: numbering.place_count - 2 * ROW].reshape(-1, numbering.row_stride)
    field[
        numbering.row_margin : numbering.row_margin + numbering.ny,
        numbering.left_margin : numbering.left_margin + numbering.nx,
    ] = True
    missing = inner & (grid_row_at_place < 0)
    if not missing.any():
        return hidden  # a rectangle, which no bond leaves
    around = np.flatnonzero(dilate_mask(missing, numbering, numbering.row_margin) & (grid_row_at_place >= 0))
    around = around[np.argsort(grid_row_at_place[around])]
    sight = Sight(model.grid, model.name)
    for k in range(len(lattice.neighbour_offsets) // 2):
        neighbours = around + lattice.neighbour_offsets[k]
        in_plate = grid_row_at_place[neighbours] >= 0
        i, j = (
            grid_row_at_place[around[in_plate]].astype(np.int64),
            grid_row_at_place[neighbours[in_plate]].astype(np.int64),
        )
        length = np.full(len(i), float(np.hypot(*springs.spring_table[k, :2])))
        parted = ~sight.inside(Pairs(i, j, length))
        for ends, spring in (
            (around[in_plate][parted], k),
            (neighbours[in_plate][parted], k + len(lattice.neighbour_offsets) // 2),
        ):
            np.bitwise_or.at(cut_bond_bits, (ends // ROW, spring), (1 << (ends % ROW)).astype(np.uint16))
            hidden[ends] = True
    return hidden


@cached_njit(error_model="numpy")
def _cut_bonds_across_precracks(lattice, cut_bond_bits, places, cracks, precrack_cut_counts_of_places):  # type: ignore[no-untyped-def]
    """Cut and count the bonds of these nodes that cross a pre-crack."""
    numbering = lattice.numbering
    for p in places:
        ix, iy = p % numbering.row_stride - numbering.left_margin, p // numbering.row_stride - numbering.row_margin
        for k in range(len(lattice.neighbour_offsets)):
            if lattice.cell_area_share[0, p + lattice.neighbour_offsets[k]] == 0 or is_bond_cut(cut_bond_bits, p, k):
                continue
            x, y = (
                ix + np.round(lattice.spring_table[k, 0] / lattice.spacing),
                iy + np.round(lattice.spring_table[k, 1] / lattice.spacing),
            )
            if not is_visible(cracks, ix, iy, x, y):
                mark_bond_cut(cut_bond_bits, p, k)
                precrack_cut_counts_of_places[p] += 1


@cached_njit(error_model="numpy")
def _store_surface_correction_and_full_families(lattice, cut_bond_bits, places, full_family):  # type: ignore[no-untyped-def]
    """Store the energy of a full family over that of these nodes, and mark the nodes with a whole family."""
    full_x, full_y = 0.0, 0.0
    for k in range(len(lattice.neighbour_offsets)):
        energy = lattice.spring_table[k, 5] / lattice.spring_table[k, 4]
        full_x += energy * lattice.squared_direction_components[k, 0] ** 2
        full_y += energy * lattice.squared_direction_components[k, 1] ** 2
    for p in places:
        held_x, held_y, is_full = 0.0, 0.0, lattice.cell_area_share[0, p] == 1
        for k in range(len(lattice.neighbour_offsets)):
            share = lattice.cell_area_share[0, p + lattice.neighbour_offsets[k]]
            if share == 0 or is_bond_cut(cut_bond_bits, p, k):
                is_full = False
                continue
            is_full &= share == 1
            energy = share * lattice.spring_table[k, 5] / lattice.spring_table[k, 4]
            held_x += energy * lattice.squared_direction_components[k, 0] ** 2
            held_y += energy * lattice.squared_direction_components[k, 1] ** 2
        full_family[p] = is_full
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
