"""Where the nodes of a body are in a cubic lattice."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import offsets
from pdmesh.model.node_grid import Grid
from pdsolve.codegen.vector_code import ROW

OFF_PLACE = 1e-6  # spacings: how far a node may be from its place in the lattice
LEAST_FILLED = 0.25  # nodes over sites of the box around them; less is better listed


class Sites(NamedTuple):
    """Where n nodes are in the box around them, which has t tiles of sites."""

    site: NDArray[np.int32]  # (n,) with x fastest, the margin before the first included
    node: NDArray[np.int32]  # (16 t,) row of a site's node, or -1; without margins
    sides: tuple[int, int, int]  # sites along each axis
    margin: int  # sites before the first and behind the last
    spacing: float  # m
    ways: NDArray[np.int64]  # (k, 3) steps of offsets along x, y and z, in the order of their sites

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
        return np.asarray(self.ways @ _stride(self.sides))


def _stride(sides: tuple[int, int, int]) -> NDArray[np.int64]:
    return np.array([1, sides[0], sides[0] * sides[1]])


def sites_of(grid: Grid, reach: float, whole_rows: bool = False) -> Sites | None:
    """The sites of a body's nodes, which see each other up to `reach` spacings; None if they are no lattice, or
    so few in a row that two ways to a neighbour pass as many sites. `whole_rows`: rows along x are whole tiles."""
    spacing = float(grid.delta[0])
    if (grid.delta != spacing).any():
        return None
    sides: list[int] = []
    site, stride = np.zeros(len(grid), dtype=np.int64), 1
    for along in grid.position.T:
        along = (along - along.min()) / spacing
        place = np.rint(along)
        if np.abs(along - place).max() > OFF_PLACE:
            return None
        multiple = ROW if whole_rows and not sides else 1
        sides.append(-(-(int(place.max()) + 1) // multiple) * multiple)
        site += stride * place.astype(np.int64)
        stride *= sides[-1]
        if len(grid) < LEAST_FILLED * stride and len(sides) == 3:
            return None
    box = (sides[0], sides[1], sides[2])
    ways = np.rint(offsets(reach, 3)).astype(np.int64)
    ways = ways[np.lexsort(ways.T)]
    steps = ways @ _stride(box)
    if len(np.unique(steps)) < len(steps):
        return None
    node = np.full(-(-stride // ROW) * ROW, -1, dtype=np.int32)
    node[site] = np.arange(len(site))
    if np.count_nonzero(node >= 0) < len(site):
        return None
    margin = -(-int(np.abs(steps).max()) // ROW) * ROW
    return Sites((site + margin).astype(np.int32), node, box, margin, spacing, ways)
