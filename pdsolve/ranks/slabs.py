"""Slabs: which consecutive rows of a grid each rank owns, and the window of rows that it needs to make their bonds."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, ROWS, Neighbours
from pdsolve.lattice.layout import LANES
from pdsolve.model import Model, ModelError

BESIDE = 2  # reaches: corrections of a bond depend on the families of both its ends

SAMPLED = 8  # rows for one whose bonds are counted
GOLDEN = (math.sqrt(5) - 1) / 2  # whose multiples fall into step with no line of nodes


class Slab(NamedTuple):
    """The rows of one rank, as those of the whole grid."""

    first: int  # of its own
    last: int  # after its own
    begin: int  # of its window, which begins with a block
    end: int
    chunks: tuple[int, int]  # the rows looked at together in one process that have its own among them
    nodes: int  # of the whole grid


def slabs_of(model: Model, ranks: int, unit: int = LANES) -> list[Slab]:
    """The slabs of a model, of about as many bonds each, cut between so many rows. Raises ModelError for fewer of these
    units than ranks."""
    grid, nodes, slabs = model.grid, len(model.grid), []
    units = -(-nodes // unit)
    if units < ranks:
        raise ModelError(
            f"{model.name}: $.nodes: {nodes} on {ranks} ranks are too few; use at least {unit} a rank: fewer ranks"
        )
    cuts = [min(unit * at, nodes) for at in cuts_of(costs_of(model, unit), ranks)]
    widest = float(grid.delta.max())
    around = BESIDE * (model.settings.horizon.ratio * widest + widest)
    for first, last in pairwise(cuts):
        chunks = first // ROWS * ROWS, min(-(-last // ROWS) * ROWS, nodes)
        own_positions = grid.window(*chunks).position
        near = grid.chosen(None, [*(own_positions.min(axis=0) - around), *(own_positions.max(axis=0) + around)])
        begin, end = int(near[0]), int(near[-1]) + 1
        if grid.lattice is not None and grid.dimension == 3:
            # The fewest layers of a box that fill blocks and tiles: the window then has those of the whole
            layer = grid.lattice.columns * grid.lattice.rows
            begin -= begin % (LANES // math.gcd(LANES, layer) * layer)
        else:
            begin = max(begin // LANES - 1, 0) * LANES
        slabs.append(Slab(first, last, begin, min((-(-end // LANES) + 1) * LANES, nodes), chunks, nodes))
    return slabs


def cuts_of(costs: NDArray[np.float64], ranks: int) -> list[int]:
    """Where (ranks + 1) consecutive units of these costs (k,) are cut, one unit at least a rank."""
    cumulative, cuts = np.concatenate([[0.0], np.cumsum(costs)]), [0]
    for rank in range(1, ranks):
        nearest = int(np.abs(cumulative - cumulative[-1] * rank / ranks).argmin())
        cuts.append(min(max(nearest, cuts[-1] + 1), len(costs) - (ranks - rank)))
    return [*cuts, len(costs)]


def costs_of(model: Model, unit: int) -> NDArray[np.float64]:
    """About how many bonds (k,) so many rows each have, from one row in SAMPLED; on one lattice, how many rows."""
    grid, nodes = model.grid, len(model.grid)
    units = -(-nodes // unit)
    if grid.lattice is not None:
        return np.minimum(unit, nodes - unit * np.arange(units)).astype(float)
    horizons = model.horizons
    around = Neighbours(grid.position, grid.delta, horizons, mutual=True)
    number = np.arange(-(-nodes // SAMPLED))
    rows = np.minimum(SAMPLED * number + (SAMPLED * (number * GOLDEN % 1)).astype(np.int64), nodes - 1)
    bonds = np.zeros(units)
    for sample in np.array_split(rows, -(-len(rows) // ROWS)):
        pairs = around.pairs(sample)
        # those at the very end of a horizon are in it or not by round-off
        near = pairs.length < (1 - ROUND_OFF) * (horizons[pairs.source] + horizons[pairs.target]) / 2
        bonds += np.bincount(pairs.source[near] // unit, minlength=units)
    return bonds * SAMPLED


def starts_of(slabs: list[Slab]) -> NDArray[np.int64]:
    """The first rows (ranks + 1,) of slabs, and the number of all nodes."""
    return np.array([*(slab.first for slab in slabs), slabs[-1].last], dtype=np.int64)
