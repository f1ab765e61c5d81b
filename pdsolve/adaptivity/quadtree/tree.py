"""A tree of cells: each node of a model is a square cell, which can split into four, recursively.

A cell is a root (a row of the model's grid), a level and a path: two bits for each level, whether it is the right and
whether it is the upper one of its four. Leaves are ordered by root, then by path, so that unchanged nodes keep their
order. A node's id identifies its cell: roots have the grid's ids, all other cells follow the largest of these.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import InitialVelocity
from pdmesh.model.visibility import plate_of
from pdsolve.bonds.assembly import areas
from pdsolve.conditions import mask_nodes_with_conditions
from pdsolve.model import Model

WHOLE = 1e-9  # of a cell: areas this near to its square's are that
TOGETHER = 1e-6  # of a plate: the areas of all its leaves are this near to its own


class QuadtreeCells(NamedTuple):
    """n cells of the tree."""

    root_row: NDArray[np.int64]  # (n,) row of the model's grid
    level: NDArray[np.int64]  # (n,) how often it was split
    path: NDArray[np.int64]  # (n,) from the root: two bits for each level, that of the first level is the highest

    def select(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> QuadtreeCells:
        """The cells of these rows."""
        return QuadtreeCells(*(column[rows] for column in self))

    def parents(self) -> QuadtreeCells:
        """The parent of each cell."""
        return QuadtreeCells(self.root_row, self.level - 1, self.path >> 2)

    def quarters(self) -> QuadtreeCells:
        """The four quarters (4 n,) of each cell, consecutively."""
        root, level, path = (np.repeat(column, 4) for column in self)
        return QuadtreeCells(root, level + 1, 4 * path + np.tile(np.arange(4), len(self.root_row)))


def concatenate_cell_sets(*cell_sets: QuadtreeCells) -> QuadtreeCells:
    """Several sets of cells as one."""
    return QuadtreeCells(*(np.concatenate(column) for column in zip(*cell_sets, strict=True)))


class Quadtree:
    """All cells into which the nodes of a model can split."""

    def __init__(self, model: Model) -> None:
        """`model` has nodes of one spacing, and no condition or region with a box."""
        self.model, self.levels = model, model.settings.run.split.levels
        grid = model.grid
        self.spacing, self.count = float(grid.delta[0]), len(grid)
        self.sides = np.asarray(self.spacing / 2.0 ** np.arange(self.levels + 1))  # m, of cells of each level
        self.horizons = model.settings.horizon.ratio * self.sides  # m, likewise
        self.area = areas(model, "cells")
        self.pinned = mask_nodes_with_conditions(model)  # which stay whole
        self._by_id = np.argsort(grid.ids)
        self._first = int(grid.ids.max()) + 1
        self._shares = self._area_shares_of_cut_roots()

    def roots(self) -> QuadtreeCells:
        """The cells of the model's own nodes."""
        nothing = np.zeros(self.count, dtype=np.int64)
        return QuadtreeCells(np.arange(self.count), nothing, nothing)

    def sort_order(self, cells: QuadtreeCells) -> NDArray[np.int64]:
        """The order that sorts leaves."""
        return np.lexsort((cells.path << (2 * (self.levels - cells.level)), cells.root_row))

    def node_ids(self, cells: QuadtreeCells) -> NDArray[np.int64]:
        """The ids (n,) of the nodes of these cells."""
        path_number = cells.root_row * 4**cells.level + cells.path
        return np.where(
            cells.level > 0, self._first_id_of_level[cells.level] + path_number, self.model.grid.ids[cells.root_row]
        )

    def cells_of_ids(self, ids: NDArray[np.int64]) -> QuadtreeCells:
        """QuadtreeCells of the nodes with these ids (n,)."""
        level = np.searchsorted(self._first_id_of_level, ids, side="right") - 1
        level = np.where(ids < self._first, 0, level)
        number = ids - self._first_id_of_level[level]
        at = np.searchsorted(self.model.grid.ids, ids, sorter=self._by_id).clip(max=self.count - 1)
        root = np.where(level == 0, self._by_id[at], number // 4**level)
        return QuadtreeCells(root, level, np.where(level == 0, 0, number % 4**level))

    def leaves_with_node_ids_or_none(self, ids: NDArray[np.int64]) -> QuadtreeCells | None:
        """Leaves of the nodes with these ids (n,), in this order; None if they are not all leaves of a plate."""
        if not len(ids) or ids.min() < self.model.grid.ids.min() or ids.max() >= self._end_id:
            return None
        cells = self.cells_of_ids(ids)
        begin, size = cells.path << (2 * (self.levels - cells.level)), 4 ** (self.levels - cells.level)
        begin = begin + cells.root_row * 4**self.levels
        apart = (begin[1:] >= (begin + size)[:-1]).all()  # in order and none within another
        mine = np.array_equal(self.node_ids(cells), ids) and not ((cells.level > 0) & self.pinned[cells.root_row]).any()
        if not (apart and mine):
            return None
        area, total_area = self.areas(cells), self.areas(self.roots()).sum()
        return cells if (area > 0).all() and abs(area.sum() - total_area) <= TOGETHER * total_area else None

    @property
    def _end_id(self) -> int:
        """An id larger than any in use."""
        return int(self._first_id_of_level[-1] + self.count * 4**self.levels) if self.levels else self._first

    @cached_property
    def _first_id_of_level(self) -> NDArray[np.int64]:
        """First id (levels + 1,) of each level; the entry for roots is unused."""
        sizes = self.count * 4 ** np.arange(1, self.levels + 1)
        return np.concatenate([[self._first], self._first + np.concatenate([[0], np.cumsum(sizes)[:-1]])])

    def centre_offsets(self, cells: QuadtreeCells) -> NDArray[np.float64]:
        """Vectors (n, 2) from the centre of each cell's root to that of the cell, in spacings."""
        vectors = np.zeros((len(cells.root_row), 2))
        for level in range(1, self.levels + 1):
            digit = cells.path >> np.maximum(2 * (cells.level - level), 0)
            for axis in (0, 1):
                step = (2.0 * (digit >> axis & 1) - 1) / 2 ** (level + 1)
                vectors[:, axis] += np.where(level <= cells.level, step, 0.0)
        return vectors

    def centres(self, cells: QuadtreeCells) -> NDArray[np.float64]:
        """Centres (n, 2) of cells, m."""
        return np.asarray(self.model.grid.position[cells.root_row] + self.spacing * self.centre_offsets(cells))

    def areas(self, cells: QuadtreeCells) -> NDArray[np.float64]:
        """Area (n,) of each cell inside the plate, m^2; 0 for a cell that is no node, as its centre is outside."""
        area = self.area[cells.root_row] / 4.0**cells.level
        for level, (number, share) in self._shares.items():
            odd = np.flatnonzero((cells.level == level) & (number[cells.root_row] >= 0))
            area[odd] = self.area[cells.root_row[odd]] * share[number[cells.root_row[odd]], cells.path[odd]]
        return area

    def _area_shares_of_cut_roots(self) -> dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]]:
        """For each level, the roots cut by an edge: their index (roots,), -1 for others, and area shares (odd,
        4^level)."""
        grid = self.model.grid
        is_full = np.abs(self.area / self.spacing**2 - 1) < WHOLE
        odd, plate = np.flatnonzero(~is_full), plate_of(grid, self.model.name)
        if plate is None or not len(odd):
            return {}
        import shapely

        number = np.full(self.count, -1)
        number[odd] = np.arange(len(odd))
        cells, before, shares = self.roots().select(odd), np.ones(len(odd)), {}
        around = plate.buffer(WHOLE * self.spacing, join_style="mitre")
        shapely.prepare(around)
        for level in range(1, self.levels + 1):
            cells = cells.quarters()
            middle, half = self.centres(cells), self.spacing / 2 ** (level + 1)
            squares = shapely.box(*(middle - half).T, *(middle + half).T)
            inside = shapely.contains_xy(around, middle)
            part = np.where(inside, shapely.area(shapely.intersection(squares, plate)), 0.0).reshape(-1, 4)
            total = part.sum(axis=1, keepdims=True)
            part = part / np.where(total > 0, total, 1.0)
            before = (before[:, None] * part).ravel()
            shares[level] = number, before.reshape(len(odd), -1)
        return shares

    def select_cells_with_area(self, cells: QuadtreeCells) -> QuadtreeCells:
        """The cells with a share of the plate."""
        return cells.select(self.areas(cells) > 0)

    def mask_splittable(self, cells: QuadtreeCells) -> NDArray[np.bool_]:
        """Mask (n,) of cells that can be split."""
        can = (cells.level < self.levels) & ~self.pinned[cells.root_row]
        candidates = np.flatnonzero(can)
        can[candidates] = self.areas(cells.select(candidates).quarters()).reshape(-1, 4).any(axis=1)
        return can

    def model_of_leaves(self, cells: QuadtreeCells) -> Model:
        """The model whose nodes are these leaves, in order."""
        settings, ids = self.model.settings, self.node_ids(cells)
        regions = []
        for region in settings.regions:
            in_region = np.isin(cells.root_row, self.model.selected(region))
            regions.append(msgspec.structs.replace(region, nodes=tuple(ids[in_region].tolist()), box=None))
        now = tuple(condition for condition in settings.conditions if not isinstance(condition, InitialVelocity))
        settings = msgspec.structs.replace(settings, area_rule="cells", conditions=now, regions=tuple(regions))
        grid = dataclasses.replace(
            self.model.grid.part(cells.root_row),
            ids=ids,
            position=self.centres(cells),
            delta=np.asarray(self.spacing / 2.0**cells.level),
            areas=self.areas(cells),
            lattice=None,
        )
        return Model(grid, settings, self.model.name)
