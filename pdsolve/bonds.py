"""Bonds: what a scheme makes of a model, in one list or some rows at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.areas import thesis_areas
from pdmesh.neighbours import Pairs, row_chunks
from pdsolve.model import Model


class Bonds(NamedTuple):
    """Bonds ready for the kernels, those of node i at start[i]:start[i + 1]; b of them, n nodes."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: NDArray[np.floating]  # (b, 2) reference vector to the neighbour, m
    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,) stretch of the largest force; where it is the limit, the bond is brittle
    limit: NDArray[np.floating]  # (b,) stretch at which the bond is gone; both infinite where it must not break


class Assembly(NamedTuple):
    """The whole list of bonds of n nodes."""

    bonds: Bonds
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included


class Part(NamedTuple):
    """The bonds of k consecutive nodes from row `first` on; neighbours are rows of the whole grid."""

    first: int
    bonds: Bonds
    family: NDArray[np.int64]  # (k,) as in Assembly


class Filling(NamedTuple):
    """How a scheme fills the bonds of a model with n nodes."""

    area: NDArray[np.float64]  # (n,) m^2
    part: Callable[[NDArray[np.int64]], Part]  # the bonds of these consecutive rows

    def parts(self) -> Iterator[Part]:
        """All bonds, some rows at a time."""
        return (self.part(rows) for rows in row_chunks(len(self.area)))

    def whole(self) -> Assembly:
        """All bonds in one list."""
        return listed(self.parts(), self.area)


def listed(parts: Iterable[Part], area: NDArray[np.float64]) -> Assembly:
    """All parts in one list."""
    every = list(parts)
    counts = np.concatenate([np.diff(part.bonds.start) for part in every])
    columns = (np.concatenate(column) for column in zip(*(part.bonds[1:] for part in every), strict=True))
    bonds = Bonds(np.concatenate([[0], np.cumsum(counts)]), *columns)
    return Assembly(bonds, area, np.concatenate([part.family for part in every]))


def part_of(
    position: NDArray[np.float64],
    held: NDArray[np.bool_],
    rows: NDArray[np.int64],
    pairs: Pairs,
    intact: NDArray[np.bool_],
    stiffness: NDArray[np.float64],
    limits: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> Part:
    """The pairs (b,) of these rows that lie in the plate as bonds, less those a pre-crack cuts.

    `intact` (b,) are those that no pre-crack cuts; `stiffness` (b,), N/m^3, and `limits`, peak and limit (b,), are as
    in Bonds, but for the nodes `held` (n,), whose bonds do not break. `position` (n, 2) in m.
    """
    lasting = held[pairs.source] | held[pairs.target]
    peak, limit = (np.where(lasting, np.inf, bound) for bound in limits)
    source, target, first = pairs.source[intact], pairs.target[intact], int(rows[0])
    bonds = Bonds(
        start=np.searchsorted(source, np.append(rows, rows[-1] + 1)),
        neighbour=target.astype(np.int32),
        xi=position[target] - position[source],
        stiffness=stiffness[intact],
        peak=peak[intact],
        limit=limit[intact],
    )
    return Part(first, bonds, np.bincount(pairs.source - first, minlength=len(rows)))


def areas(model: Model, usual: Literal["cells", "eq19"]) -> NDArray[np.float64]:
    """Areas (n,), m^2, by the model's rule, or by the `usual` one of a scheme.

    Exact cells are those of the grid file; where it has none, the spacing squared stands for them.
    """
    grid, rule = model.grid, model.settings.area_rule or usual
    if rule == "eq19":
        return thesis_areas(grid.position, grid.delta, model.horizons)
    if rule == "square" or grid.areas is None:
        return grid.delta**2
    return grid.areas


def ends(bonds: Bonds, numbers: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (k,) of both nodes of the bonds with these numbers (k,)."""
    return np.searchsorted(bonds.start, numbers, side="right") - 1, bonds.neighbour[numbers].astype(np.int64)


def find(bonds: Bonds, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers (k,) of the bonds from `source` (k,) to `target` (k,), which are there."""
    nodes = len(bonds.start) - 1
    key = np.repeat(np.arange(nodes), np.diff(bonds.start)) * nodes + bonds.neighbour
    return np.searchsorted(key, source * nodes + target)
