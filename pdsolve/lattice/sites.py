"""Where nodes are in a lattice: of a row, of a plate or of a body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import offsets
from pdmesh.model.node_grid import Grid
from pdsolve.codegen.vector_code import ROW

OFF_PLACE = 1e-6  # spacings: how far a node may be from its place in the lattice
LEAST_FILLED = 0.2  # nodes over sites of the box around them; less is better listed


class Sites(NamedTuple):
    """Where n nodes are in the box around them, which has d axes and t tiles of sites."""

    site: NDArray[np.int32]  # (n,) with x fastest, the margin before the first included
    node: NDArray[np.int32]  # (16 t,) row of a site's node, or -1; without margins
    sides: tuple[int, ...]  # sites along each axis
    margin: int  # sites before the first and behind the last
    spacing: float  # m
    ways: NDArray[np.int64]  # (k, d) steps of offsets along each axis, in the order of their sites

    @property
    def tiles(self) -> int:
        """Number of tiles of the box."""
        return len(self.node) // ROW

    @property
    def size(self) -> int:
        """Number of sites, those of both margins included."""
        return len(self.node) + 2 * self.margin

    @property
    def steps(self) -> NDArray[np.int64]:
        """The offsets (k,) as sites from one to the other."""
        return np.asarray(self.ways @ strides_of(self.sides))


def strides_of(sides: tuple[int, ...]) -> NDArray[np.int64]:
    """Places (d,) from one to the next along each axis of a box."""
    return np.cumprod((1, *sides[:-1]))


def sites_of(grid: Grid, reach: float, whole_rows: bool = False) -> Sites | None:
    """The sites of a grid's nodes, which see each other up to `reach` spacings; None if `place_nodes` has none."""
    spacing = float(grid.delta[0])
    if (grid.delta != spacing).any():
        return None
    return place_nodes(grid.position, spacing, np.rint(offsets(reach, grid.dimension)).astype(np.int64), whole_rows)


def place_nodes(
    position: NDArray[np.float64],
    spacing: float,
    ways: NDArray[np.int64],
    whole_rows: bool = False,
    separate_rows: bool = False,
) -> Sites | None:
    """The sites of nodes at `position` (n, d), m, whose neighbours are at `ways` (k, d).

    None if they are no lattice, or so few in a row that two ways to a neighbour pass as many sites. `whole_rows`: rows
    along x are whole tiles. `separate_rows`: so many empty sites are between them that no way passes from one to
    another.
    """
    sides: list[int] = []
    site, stride, filled = np.zeros(len(position), dtype=np.int64), 1, float(len(position))
    for along, reach in zip(position.T, np.abs(ways).max(axis=0).tolist(), strict=True):
        along = (along - along.min()) / spacing
        place = np.rint(along)
        if np.abs(along - place).max() > OFF_PLACE:
            return None
        multiple = ROW if whole_rows and not sides else 1
        side = -(-(int(place.max()) + 1) // multiple) * multiple
        filled /= side
        sides.append(side + reach if separate_rows and len(sides) + 1 < len(ways.T) else side)
        site += stride * place.astype(np.int64)
        stride *= sides[-1]
    if filled < LEAST_FILLED:
        return None
    ways = ways[np.lexsort(ways.T)]
    steps = ways @ strides_of(tuple(sides))
    if len(np.unique(steps)) < len(steps):
        return None
    node = np.full(-(-stride // ROW) * ROW, -1, dtype=np.int32)
    node[site] = np.arange(len(site))
    if np.count_nonzero(node >= 0) < len(site):
        return None
    margin = -(-int(np.abs(steps).max()) // ROW) * ROW
    return Sites((site + margin).astype(np.int32), node, tuple(sides), margin, spacing, ways)
