"""Nodes as arrays, and selections of them by ids or by a box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmesh.model.document import Lattice
from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_fields import FieldColumn
from pdmesh.model.svg_picture import svg

TIE = 1e-9  # relative difference of distances that are equal but for round-off
SLACK = 1e-9  # of a node's spacing: how far beside a box it is still in it


class Positioned(Protocol):
    """Nodes with positions, as a grid and as results have them."""

    @property
    def ids(self) -> NDArray[np.int64]:
        """The ids of the nodes, (n,), each different."""

    @property
    def position(self) -> NDArray[np.float64]:
        """The reference positions (n, d) of the nodes, m."""

    @property
    def delta(self) -> NDArray[np.float64]:
        """The spacings (n,) of the nodes, m."""


def rows_of(nodes: Positioned, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows (k,) of the nodes with these ids (k,), which must be there."""
    order = np.argsort(nodes.ids)
    return np.asarray(order[np.searchsorted(nodes.ids, ids, sorter=order)], dtype=np.int64)


def in_box(nodes: Positioned, box: ArrayLike) -> NDArray[np.bool_]:
    """Mask (n,) of the nodes in a box or on its edge; a box is its low corner, then its high one, m."""
    low, high = np.reshape(np.asarray(box, dtype=float), (2, nodes.position.shape[1]))
    slack = SLACK * nodes.delta[:, None]
    return np.asarray(((nodes.position >= low - slack) & (nodes.position <= high + slack)).all(axis=1))


def selected(nodes: Positioned, ids: Sequence[int] | None, box: ArrayLike | None) -> NDArray[np.bool_]:
    """Mask (n,) of the nodes of a condition or region: those with its ids or, without ids, those in its box."""
    if ids is not None:
        return np.isin(nodes.ids, np.array(ids, dtype=np.int64))
    assert box is not None
    return in_box(nodes, box)


class Bodies(NamedTuple):
    """The bodies of n nodes."""

    number: NDArray[np.int64]  # (n,) 0: of the first body
    names: tuple[str, ...]  # from number 0 on
    rigid: tuple[int, ...] = ()  # numbers of those whose nodes have no bonds

    def parted(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of rows that no bond joins: of different bodies, or of one that is rigid."""
        apart = self.number[source] != self.number[target]
        return np.asarray(apart | np.isin(self.number[source], self.rigid) if self.rigid else apart)

    def moving_as_one(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of rows that are in the same rigid body."""
        return np.asarray((self.number[source] == self.number[target]) & np.isin(self.number[source], self.rigid))


@dataclass(frozen=True)
class Grid:
    """A checked grid as arrays, n nodes in the file's order, in d = 2 or 3 dimensions."""

    ids: NDArray[np.int64]  # (n,) unique
    position: NDArray[np.float64]  # (n, d) m
    delta: NDArray[np.float64]  # (n,) spacing, m
    border: NDArray[np.bool_]  # (n,) at the edge of the plate or of a hole
    hole_id: NDArray[np.int64]  # (n,) -1 where none
    cracks: NDArray[np.float64]  # (k, 4) segments x0, y0, x1, y1, or (k, 9) triangles x0, y0, z0, ..., z2, m
    outline: tuple[NDArray[np.float64], ...] = ()  # rings (p, 2), m; of a body (3, 3), triangles of its surface
    holes: tuple[NDArray[np.float64], ...] = ()  # rings (p, 2), m
    areas: NDArray[np.float64] | None = None  # (n,) m^2; of a body volumes, m^3
    source: str = ""
    parameters: tuple[tuple[str, float | str], ...] = ()
    drawing: str = ""
    lattice: Lattice | None = None  # what the nodes are all of, where they are
    bodies: Bodies | None = None  # None: all nodes are of one
    fields: tuple[FieldColumn, ...] = ()  # constants of the material by node

    def __post_init__(self) -> None:
        """Convert numbers to the types above; arrays of those types are kept."""
        for name in self._converted():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, np.asarray(value, dtype=np.float64))
        for name in ("outline", "holes"):
            rings = tuple(np.asarray(ring, dtype=np.float64) for ring in getattr(self, name))
            object.__setattr__(self, name, rings)

    def _converted(self) -> tuple[str, ...]:
        """The names of arrays of numbers that are there."""
        return ("position", "delta", "cracks", "areas")

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def field_quantities(self) -> tuple[str, ...]:
        """The constants of the material that differ by node."""
        return tuple(column.quantity for column in self.fields)

    def part(self, rows: NDArray[np.int64]) -> Grid:
        """The grid of the nodes in `rows`, with the shapes of all; it has no bodies."""
        return Grid(
            ids=self.ids[rows],
            position=self.position[rows],
            delta=self.delta[rows],
            border=self.border[rows],
            hole_id=self.hole_id[rows],
            areas=None if self.areas is None else self.areas[rows],
            fields=self._fields_at(rows),
            **self._shapes(),
        )

    def _fields_at(self, rows: NDArray[np.int64] | slice) -> tuple[FieldColumn, ...]:
        """The fields of the nodes in `rows`."""
        return tuple(column._replace(values=column.values[rows]) for column in self.fields)

    def _shapes(self) -> dict[str, Any]:
        names = ("cracks", "outline", "holes", "source", "parameters", "drawing", "lattice")
        return {name: getattr(self, name) for name in names}

    def missing(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """The ids among these (k,) that no node has."""
        return ids[~np.isin(ids, self.ids)]

    def rows_of(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """The rows (k,) of the nodes with these ids (k,); -1 where no node has the id."""
        order = np.argsort(self.ids, kind="stable")
        at = np.searchsorted(self.ids, ids, sorter=order)
        rows = order[np.minimum(at, len(order) - 1)]
        return np.where(self.ids[rows] == ids, rows, -1)

    def chosen(self, ids: Sequence[int] | None, box: ArrayLike | None) -> NDArray[np.int64]:
        """The rows of the nodes with these ids or, without ids, of those in a box."""
        return np.flatnonzero(selected(self, ids, box))

    def nearest(self, places: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distances (k,), m, and rows (k,) of the nodes nearest to `places` (k, d); of several the first."""
        points = np.reshape(np.asarray(places, dtype=float), (-1, self.dimension))
        if not len(points):
            return np.zeros(0), np.zeros(0, dtype=np.int64)
        tree = tree_of(self.position)
        distance = tree.query(points)[0]
        near = tree.query_ball_point(points, distance * (1 + TIE))
        return distance, np.array([min(rows) for rows in near], dtype=np.int64)

    @property
    def dimension(self) -> int:
        """2 for a plate, 3 for a body in space."""
        return int(self.position.shape[1])

    @property
    def cells(self) -> NDArray[np.float64]:
        """Area (n,), m^2, or in a body volume, m^3, of each node; full cells if the file has none."""
        return self.delta**self.dimension if self.areas is None else self.areas

    @property
    def size(self) -> float:
        """Area of all cells, m^2, or volume, m^3."""
        return float(self.cells.sum())

    @property
    def finest_spacings(self) -> NDArray[np.float64]:
        """The smallest spacing of each body, m."""
        if self.bodies is None:
            return np.asarray(np.min(self.delta, initial=np.inf, keepdims=True))
        finest = np.full(len(self.bodies.names), np.inf)
        np.minimum.at(finest, self.bodies.number, self.delta)
        return finest

    @property
    def rigid(self) -> NDArray[np.bool_]:
        """Mask (n,) of the nodes of rigid bodies."""
        if self.bodies is None:
            return np.zeros(len(self), dtype=np.bool_)
        return np.isin(self.bodies.number, self.bodies.rigid)

    @property
    def faces(self) -> NDArray[np.float64]:
        """Triangles (t, 3, 3) of a body's surface, m."""
        return np.array(self.outline).reshape(-1, 3, 3)

    def window(self, first: int, last: int) -> Grid:
        """The grid of the rows `first` to `last` - 1, as a list of nodes."""
        of_nodes = ("ids", "position", "delta", "border", "hole_id")
        rows = {name: getattr(self, name)[first:last] for name in of_nodes}
        areas = None if self.areas is None else self.areas[first:last]
        bodies = None if self.bodies is None else self.bodies._replace(number=self.bodies.number[first:last])
        fields = self._fields_at(slice(first, last))
        return replace(self, **rows, areas=areas, bodies=bodies, fields=fields, lattice=None)

    def _repr_svg_(self) -> str | None:
        """SVG for a notebook: the plate and its nodes; None for a body in space."""
        if self.dimension == 3:
            return None
        rings, cracks = [*self.outline, *self.holes], self.cracks.reshape(-1, 2, 2)
        return svg(rings, cracks, self.position, self.delta, self.border)
