"""All nodes of a lattice, whose arrays are made when they are first asked for.

A plate with a moving fine zone has few of the nodes of its lattice: those who ask for some nodes only make no arrays of
all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmesh.model.document import Lattice
from pdmesh.model.node_arrays import SLACK, TIE, Grid


def places(first: float, spacing: float, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Positions, m, of lattice columns or rows (k,), counted from `first`; mirrored ones are bitwise mirrored."""
    decimals = 9 - int(np.floor(np.log10(spacing)))
    return np.asarray(np.round(first + numbers * spacing, decimals) + 0.0)


class WholeLattice(Grid):
    """A grid of all n nodes of a lattice, with ids 1 to n, the first axis changing fastest."""

    lattice: Lattice

    def __new__(cls, lattice: Lattice | None, **more: Any) -> Grid:  # type: ignore[misc]
        """A grid that lists its nodes if it is not to be those of a lattice any more."""
        return super().__new__(cls) if lattice is not None else Grid(lattice=None, **more)

    def __init__(self, lattice: Lattice, **more: Any) -> None:
        """`more` are other fields of `Grid`, which are kept; arrays of all nodes that are not among them are made."""
        nodes = math.prod(lattice.counts)
        usual = {"delta": np.broadcast_to(lattice.spacing, nodes), "hole_id": np.broadcast_to(np.int64(-1), nodes)}
        for name, value in {"lattice": lattice, **usual, **more}.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def __reduce__(self) -> tuple[Any, ...]:
        """How copies and other processes make it anew."""
        usual = [name for name in ("delta", "hole_id") if not any(self.__dict__[name].strides)]
        listed = {name: values for name, values in self.__dict__.items() if name not in usual}
        return partial(WholeLattice, **listed), ()

    def _converted(self) -> tuple[str, ...]:
        return tuple(name for name in super()._converted() if name in self.__dict__)

    @property
    def _listed(self) -> bool:
        """Whether arrays of all nodes have been made or given."""
        return not {"ids", "position"}.isdisjoint(self.__dict__)

    def __len__(self) -> int:
        return len(self.delta)

    @property
    def dimension(self) -> int:
        """2 for a plate, 3 for a body in space."""
        return len(self.lattice.counts)

    @cached_property
    def ids(self) -> NDArray[np.int64]:
        """The ids (n,), from 1."""
        return np.arange(1, len(self) + 1)

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """The places (n, d), m."""
        counts = self.lattice.counts
        coordinates = np.empty((*counts[::-1], len(counts)))
        for axis, along in enumerate(self._lines()):
            coordinates[..., axis] = along.reshape(-1, *(1,) * axis)
        return coordinates.reshape(-1, len(counts))

    @cached_property
    def border(self) -> NDArray[np.bool_]:
        """Mask (n,) of the nodes at the edge."""
        mask = np.ones(self.lattice.counts[::-1], dtype=np.bool_)
        mask[(slice(1, -1),) * self.dimension] = False
        return mask.ravel()

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """The areas (n,), m^2: in a rectangle half at edges, a quarter at corners; of a box volumes, m^3."""
        h, d = self.lattice.spacing, self.dimension
        if d == 3:
            return np.broadcast_to(h**3, len(self))
        cell_areas = np.full(self.lattice.counts[::-1], h**2)
        for side in (cell_areas[0], cell_areas[-1], cell_areas[:, 0], cell_areas[:, -1]):
            side /= 2
        return cell_areas.ravel()

    @property
    def size(self) -> float:
        """Area of all cells, m^2, or volume, m^3; no array of all is made."""
        if "areas" in self.__dict__ or self.dimension == 3:
            return super().size
        return math.prod(count - 1 for count in self.lattice.counts) * self.lattice.spacing**2

    def _lines(self) -> list[NDArray[np.float64]]:
        """Positions along each axis, m."""
        starts_and_counts = zip(self.lattice.origin, self.lattice.counts, strict=True)
        return [places(first, self.lattice.spacing, np.arange(count)) for first, count in starts_and_counts]

    def part(self, rows: NDArray[np.int64]) -> Grid:
        """The grid of the nodes in `rows`; no arrays of all nodes are made."""
        if self._listed:
            return super().part(rows)
        at = np.unravel_index(rows, self.lattice.counts[::-1])[::-1]
        ends = [(index == 0) | (index == count - 1) for index, count in zip(at, self.lattice.counts, strict=True)]
        cells = np.full(len(rows), self.lattice.spacing**self.dimension)
        if self.dimension == 2:
            cells = cells / np.where(ends[0], 2, 1) / np.where(ends[1], 2, 1)
        hole_id = self.hole_id  # a number that all have takes no memory
        hole_id = hole_id[rows] if any(hole_id.strides) else np.broadcast_to(hole_id[0], len(rows))
        return Grid(
            ids=rows + 1,
            position=np.column_stack([along[index] for along, index in zip(self._lines(), at, strict=True)]),
            delta=self.delta[rows],
            border=np.logical_or.reduce(ends),
            hole_id=hole_id,
            areas=cells,
            fields=self._fields_at(rows),
            **self._shapes(),
        )

    def window(self, first: int, last: int) -> Grid:
        """The grid of the rows `first` to `last` - 1, as a list of nodes."""
        return super().window(first, last) if self._listed else replace(self.part(np.arange(first, last)), lattice=None)

    def nearest(self, places: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distances (k,), m, and rows (k,) of the nodes nearest to `places` (k, d)."""
        if self._listed:
            return super().nearest(places)
        points = np.reshape(np.asarray(places, dtype=float), (-1, self.dimension))
        column_pairs = []  # for each axis, the columns on either side of each place
        for along, place in zip(self._lines(), points.T, strict=True):
            after = np.searchsorted(along, place)
            column_pairs.append(np.column_stack([after - 1, after]).clip(0, len(along) - 1))
        corners = np.array(list(product((0, 1), repeat=self.dimension)))
        at = [columns[:, corners[:, axis]] for axis, columns in enumerate(column_pairs)]  # (k, corners) each
        rows = np.ravel_multi_index(tuple(at[::-1]), self.lattice.counts[::-1])
        apart = [along[index] - place[:, None] for along, index, place in zip(self._lines(), at, points.T, strict=True)]
        distance = np.sqrt(sum(offset**2 for offset in apart))
        as_near = distance <= distance.min(axis=1, keepdims=True) * (1 + TIE)
        return distance.min(axis=1), np.where(as_near, rows, len(self)).min(axis=1)

    def missing(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """The ids among these (k,) that no node has."""
        return super().missing(ids) if self._listed else ids[(ids < 1) | (ids > len(self))]

    def rows_of(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """The rows (k,) of the nodes with these ids (k,); -1 where no node has the id."""
        return super().rows_of(ids) if self._listed else np.where((ids < 1) | (ids > len(self)), -1, ids - 1)

    def chosen(self, ids: Sequence[int] | None, box: ArrayLike | None) -> NDArray[np.int64]:
        """The rows of the nodes with these ids or, without ids, of those in a box."""
        if self._listed:
            return super().chosen(ids, box)
        if ids is not None:
            return np.asarray(np.unique(np.array(ids, dtype=np.int64)) - 1)
        low, high = np.reshape(np.asarray(box, dtype=float), (2, self.dimension))
        slack = SLACK * self.lattice.spacing
        inside = [
            np.flatnonzero((along >= first - slack) & (along <= last + slack))
            for along, first, last in zip(self._lines(), low, high, strict=True)
        ]
        rows = inside[-1]
        for along, count in zip(inside[-2::-1], self.lattice.counts[-2::-1], strict=True):
            rows = (rows[:, None] * count + along).ravel()
        return np.asarray(rows, dtype=np.int64)
