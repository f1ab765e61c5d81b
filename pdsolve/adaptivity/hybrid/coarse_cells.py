"""The lattice of a model for the hybrid method, which models it supports, and which cells can be coarse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Lattice as Nodes
from pdmesh.model.whole_lattice import WholeLattice
from pdsolve.model import Model
from pdsolve.numerics.dilation import in_disc
from pdsolve.zone.cells import (
    AROUND,
    BELOW,
    COARSE,
    EMPTY,
    FINE,
    LEFT,
    RING,
    TIPS,
    VOID,
    ZoneNumbering,
    create_plate_numbering,
    lattice_coordinates,
    place_number_at,
)
from pdsolve.zone.prescribed_motion import nodes_kept_fine_by_prescribed_motion
from pdsolve.zone.refusals import check_one_spacing, create_unsupported_error
from pdsolve.zone.start_cells import (
    count_full_cubes_around_nodes,
    mask_cells_around_nodes,
    mask_cubes_with_nodes_at_all_corners,
    mask_occupied_and_uncut_cells,
)

OFF = 1e-6  # spacings: nodes this far from the lattice are not on it
CLEARANCE = 1e-3  # spacings: a pre-crack this near to a node passes through it
STRIP = 2**16  # fine places that are looked at together


class GridAndLatticeRows(NamedTuple):
    """Where the n nodes of a grid are on a lattice, one by one."""

    place_of_grid_row: NDArray[np.int64]  # (n,) fine place of each row of the grid
    grid_row_at_place: NDArray[np.int32]  # (places,) row of the grid at each fine place, -1 without a node
    cell_area_share: NDArray[np.float64]  # (n,) of the cells of nodes, over h^2


class HybridPlate(NamedTuple):
    """Nodes on a lattice: all of a rectangle, or those that are listed."""

    model: Model
    numbering: ZoneNumbering
    spacing: float  # m
    origin: NDArray[np.float64]  # (2,) lower left corner, m
    precrack_segments: NDArray[np.float64]  # (k, 4) in spacings from the corner
    first_node_indices: tuple[int, int]  # column and row of the first node
    node_counts: tuple[int, int]  # columns and rows of nodes
    listed_nodes: (
        GridAndLatticeRows | None
    )  # None: nodes are all of a rectangle, row by row, with parts of cells at its edges

    @property
    def fine_places(self) -> NDArray[np.int64]:
        """Fine place (n,) of each row of the grid."""
        return self.places_of_grid_rows(np.arange(len(self.model.grid)))

    @property
    def plate_area_over_cell_area(self) -> float:
        """Area of the plate over h^2."""
        if self.listed_nodes is not None:
            return float(self.listed_nodes.cell_area_share.sum())
        return float(np.prod(np.array(self.node_counts) - 1))

    def places_of_grid_rows(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine places (k,) of rows of the grid."""
        if self.listed_nodes is not None:
            return self.listed_nodes.place_of_grid_row[rows]
        y, x = np.divmod(rows, self.node_counts[0])
        return np.asarray(
            place_number_at(self.numbering.fine, (x + self.first_node_indices[0], y + self.first_node_indices[1]))
        )

    def grid_rows_at(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the grid at fine places (k,) with nodes."""
        if self.listed_nodes is not None:
            return self.listed_nodes.grid_row_at_place[places].astype(np.int64)
        x, y = lattice_coordinates(self.numbering.fine, places)
        return np.asarray((y - self.first_node_indices[1]) * self.node_counts[0] + x - self.first_node_indices[0])

    def grid_rows_or_minus_one_at(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the grid at fine places (k,), -1 without a node."""
        return np.where(self.has_node(places), self.grid_rows_at(places), -1)

    def area_shares_of_grid_rows(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Areas (k,) of the cells of rows of the grid, over h^2."""
        if self.listed_nodes is not None:
            return self.listed_nodes.cell_area_share[rows]
        y, x = np.divmod(rows, self.node_counts[0])
        return np.asarray(
            _cell_shares_along_side(self.node_counts[1])[y] * _cell_shares_along_side(self.node_counts[0])[x]
        )

    def has_node(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (k,) of the fine places with a node."""
        if self.listed_nodes is not None:
            return np.asarray(self.listed_nodes.grid_row_at_place[places] >= 0)
        x, y = lattice_coordinates(self.numbering.fine, places)
        x, y = x - self.first_node_indices[0], y - self.first_node_indices[1]
        return np.asarray((y >= 0) & (y < self.node_counts[1]) & (x >= 0) & (x < self.node_counts[0]))

    def grid_rows_of_lattice_rows(self, first_row: int, end_row: int) -> NDArray[np.int64]:
        """Rows (end_row - first_row, stride) of the grid at the fine places of these rows, -1 without a node."""
        places = np.arange(first_row * self.numbering.fine.strides[1], end_row * self.numbering.fine.strides[1])
        return self.grid_rows_or_minus_one_at(places).reshape(-1, self.numbering.fine.strides[1])

    def mask_nodes_in_lattice_rows(self, first_row: int, end_row: int) -> NDArray[np.bool_]:
        """Whether there are nodes at these places, as in `grid_rows_of_lattice_rows`."""
        if self.listed_nodes is not None:
            return (
                self.listed_nodes.grid_row_at_place.reshape(-1, self.numbering.fine.strides[1])[first_row:end_row] >= 0
            )
        (x, y), (nx, ny) = self.first_node_indices, self.node_counts
        row, column = np.arange(first_row, end_row) - BELOW - y, np.arange(self.numbering.fine.strides[1]) - LEFT - x
        return np.asarray(np.logical_and.outer((row >= 0) & (row < ny), (column >= 0) & (column < nx)))

    def area_shares_in_lattice_rows(self, first_row: int, end_row: int) -> NDArray[np.float64]:
        """Areas of the cells of nodes at these places over h^2, 0 without a node, as in `grid_rows_of_lattice_rows`."""
        if self.listed_nodes is not None:
            rows = self.listed_nodes.grid_row_at_place.reshape(-1, self.numbering.fine.strides[1])[first_row:end_row]
            return np.where(rows >= 0, self.listed_nodes.cell_area_share[rows], 0.0)
        (x, y), (nx, ny) = self.first_node_indices, self.node_counts
        along, across = (
            np.zeros(self.numbering.fine.strides[1]),
            np.zeros(self.numbering.fine.shape[0]),
        )
        along[LEFT + x : LEFT + x + nx], across[BELOW + y : BELOW + y + ny] = (
            _cell_shares_along_side(nx),
            _cell_shares_along_side(ny),
        )
        return np.asarray(np.multiply.outer(across[first_row:end_row], along))

    def material_numbers_in_lattice_rows(self, first_row: int, end_row: int) -> NDArray[np.uint8]:
        """Numbers of the materials of nodes at these places, 0 without one, as in `grid_rows_of_lattice_rows`."""
        materials = np.zeros((end_row - first_row, self.numbering.fine.strides[1]), dtype=np.uint8)
        if self.model.settings.regions:
            rows = self.grid_rows_of_lattice_rows(first_row, end_row)
            materials[rows >= 0] = self.model.material_of[rows[rows >= 0]]
        return materials


@dataclass(frozen=True)
class CellAreas:
    """Areas of the cells of a plate's nodes, m^2, computed for those that are asked for."""

    plate: HybridPlate

    def __getitem__(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Areas (k,) of rows (k,) of the grid."""
        return self.plate.area_shares_of_grid_rows(rows) * self.plate.spacing**2


def split_rows_into_ranges(row_count: int, stride: int, places_per_range: int = STRIP) -> Iterator[tuple[int, int]]:
    """Ranges of rows of `stride` places, about `places_per_range` places each: first row, one after the last."""
    high = max(2, places_per_range // stride)
    return ((low, min(low + high, row_count)) for low in range(0, row_count, high))


def _cell_shares_along_side(count: int) -> NDArray[np.float64]:
    """Shares (count,) of whole cells along a side of a rectangle: a half at either end."""
    shares = np.ones(count)
    shares[[0, -1]] = 0.5
    return shares


def create_hybrid_plate(model: Model) -> HybridPlate:
    """The lattice of a model's nodes. Raises ModelError, in one sentence, for an unsupported model."""
    check_one_spacing(model)
    grid, h = model.grid, float(model.grid.delta[0])
    if isinstance(grid, WholeLattice):
        return _create_rectangular_plate(model, grid.lattice)
    return _create_listed_plate(model, h, grid.position.min(axis=0))


def _origin_of_cell_lattice(model: Model, h: float, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corner of the lattice of cells: the plate's edge is one of its lines wherever that can be."""
    if not len(model.grid.outline):
        return origin
    corner = np.min([ring.min(axis=0) for ring in model.grid.outline], axis=0)
    return np.asarray(origin - h * (np.round((origin - corner) / h) % 2))


def _create_rectangular_plate(model: Model, lattice: Nodes) -> HybridPlate:
    """The plate of all nodes of a lattice."""
    h, ends = lattice.spacing, model.grid.part(np.array([0, len(model.grid) - 1])).position
    origin = _origin_of_cell_lattice(model, h, ends[0])
    (x, y), last = np.round((ends - origin) / h).astype(int).tolist()
    nx, ny = (max(4, side + side % 2) for side in last)
    numbering = create_plate_numbering(nx, ny)
    cracks = (model.grid.cracks - np.tile(origin, 2)) / h
    check_no_precrack_on_node(model, cracks, nx, ny)
    return HybridPlate(model, numbering, h, origin, cracks, (x, y), (lattice.columns, lattice.rows), None)


def _create_listed_plate(model: Model, h: float, origin: NDArray[np.float64]) -> HybridPlate:
    grid, origin = model.grid, _origin_of_cell_lattice(model, h, origin)
    steps = (grid.position - origin) / h
    column, row = np.round(steps).astype(np.int64).T
    if np.abs(steps - np.column_stack([column, row])).max() > OFF:
        raise create_unsupported_error(model, "$.nodes", "on no lattice", "those that pdmesh build makes of a drawing")
    nx, ny = (max(4, int(side.max()) + int(side.max()) % 2) for side in (column, row))
    numbering = create_plate_numbering(nx, ny)
    cracks = (grid.cracks - np.tile(origin, 2)) / h
    check_no_precrack_on_node(model, cracks, nx, ny)
    place = place_number_at(numbering.fine, (column, row))
    rows = np.full(numbering.fine.place_count, -1, dtype=np.int32)
    rows[place] = np.arange(len(place))
    if grid.areas is not None:
        areas = grid.areas / h**2
    else:  # a quarter of each adjacent square between nodes
        areas = count_full_cubes_around_nodes((rows >= 0).reshape(numbering.fine.shape)).ravel()[place] / 4
    listed = GridAndLatticeRows(place, rows, areas)
    return HybridPlate(model, numbering, h, origin, cracks, (0, 0), (nx + 1, ny + 1), listed)


def initial_cell_kinds(
    plate: HybridPlate, reach: int, steep_content_rows: NDArray[np.int64] | None = None
) -> NDArray[np.uint8]:
    """Initial cells (c,): fine near tips of pre-cracks, where an outline cuts cells, around the nodes
    `steep_content_rows` (rows of the grid), and where a motion is prescribed that coarse cells do not have; coarse
    elsewhere.

    An edge along a line between cells cuts none, except at re-entrant corners.
    """
    numbering = plate.numbering
    in_plate, good = _mask_occupied_and_uncut_plate_cells(plate)
    cells = np.where(in_plate, np.uint8(FINE), np.uint8(VOID))
    cells[good] = COARSE
    cut = in_plate & ~good
    if cut.any():
        cells[in_disc(cut, (reach + RING + 1) / 2) & good] = FINE
        cells[in_disc(cut, (reach + 2) / 2) & ~in_plate & ~good] = EMPTY
    cells = np.pad(cells, AROUND, constant_values=VOID)
    lookups = plate.places_of_grid_rows, plate.grid_rows_or_minus_one_at
    unfit_nodes = nodes_kept_fine_by_prescribed_motion(plate.model, numbering.fine, *lookups)
    cells[mask_cells_around_nodes(numbering, unfit_nodes) & (cells == COARSE)] = FINE
    if steep_content_rows is not None and len(steep_content_rows):
        steep_nodes = lattice_coordinates(numbering.fine, plate.places_of_grid_rows(steep_content_rows))
        beside_steep = mask_cells_around_nodes(numbering, np.column_stack(steep_nodes))
        cells[in_disc(beside_steep, (reach + RING + 1) / 2) & (cells == COARSE)] = FINE
    for tip_x, tip_y in precrack_tips(plate).tolist():
        low_x, low_y = (max(int(tip) // 2 - TIPS, 0) + AROUND for tip in (tip_x, tip_y))
        near_tip = cells[low_y:-AROUND, low_x:-AROUND][: 2 * TIPS, : 2 * TIPS]
        y, x = np.indices(near_tip.shape) + np.array([low_y - AROUND, low_x - AROUND])[:, None, None]
        away_x, away_y = (np.maximum(np.abs(tip - 2 * cell - 1) - 1, 0) for tip, cell in ((tip_x, x), (tip_y, y)))
        near_tip[(np.hypot(away_x, away_y) < TIPS) & (near_tip == COARSE)] = FINE
    return cells.ravel()


def _mask_occupied_and_uncut_plate_cells(plate: HybridPlate) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks (rows, columns) of the cells with some of the plate, and of those that are whole."""
    numbering = plate.numbering
    in_plate, is_whole = np.zeros((2, *numbering.cells.counts[::-1]), dtype=bool)
    for low, high in split_rows_into_ranges(len(in_plate), numbering.fine.strides[1]):  # of cells
        first = BELOW + 2 * low - 1
        last = first + 2 * (high - low) + 3
        has_node, areas = plate.mask_nodes_in_lattice_rows(first, last), plate.area_shares_in_lattice_rows(first, last)
        in_plate[low:high], is_whole[low:high] = mask_occupied_and_uncut_cells(
            has_node, areas, (1, LEFT), in_plate[low:high].shape
        )
    return in_plate, is_whole


def count_node_squares_in_cells(plate: HybridPlate) -> NDArray[np.uint8]:
    """Number (c,) of squares with a node at all four corners, in each cell."""
    numbering = plate.numbering
    counts = np.zeros(numbering.cells.counts[::-1], dtype=np.uint8)
    for low, high in split_rows_into_ranges(len(counts), numbering.fine.strides[1]):
        full_squares = mask_cubes_with_nodes_at_all_corners(
            plate.mask_nodes_in_lattice_rows(BELOW + 2 * low, BELOW + 2 * high + 1)
        )[:-1, LEFT : LEFT + 2 * counts.shape[1]]
        counts[low:high] = full_squares.reshape(high - low, 2, -1, 2).sum(axis=(1, 3))
    return np.pad(counts, AROUND).ravel()


def precrack_tips(plate: HybridPlate) -> NDArray[np.float64]:
    """Ends (k, 2) of pre-cracks that lie inside the plate and on no other segment, in spacings."""
    ends = plate.precrack_segments.reshape(-1, 2)
    inner = ((ends > 1e-6) & (ends < np.array(plate.numbering.fine.counts) - 1 - 1e-6)).all(axis=1)
    alone = np.array([np.sum(np.abs(ends - end).max(axis=1) < 1e-6) == 1 for end in ends], dtype=bool)
    return ends[inner & alone]


def check_no_precrack_on_node(model: Model, cracks: NDArray[np.float64], nx: int, ny: int) -> None:
    """Raise ModelError if a pre-crack passes through a node."""
    for number, (x0, y0, x1, y1) in enumerate(cracks):
        long = float(np.hypot(x1 - x0, y1 - y0))
        share = np.linspace(0, 1, max(2, int(8 * long)))
        near = np.unique(np.round(np.column_stack([x0 + share * (x1 - x0), y0 + share * (y1 - y0)])), axis=0)
        near = near[((near >= 0) & (near <= (nx, ny))).all(axis=1)]
        way = np.array([x1 - x0, y1 - y0]) / max(long, OFF)
        along = np.clip((near - (x0, y0)) @ way, 0, long)
        away = np.hypot(*(near - (x0, y0) - along[:, None] * way).T)
        if away.min(initial=1.0) < CLEARANCE:
            raise create_unsupported_error(
                model, f"$.notch[{number}]", "on a node", "places between nodes, as pdmesh build has them"
            )
