"""Who sees whom: families by distance, less the bonds that a crack, a hole or the outline cuts.

Candidate bonds are directed pairs (source, target) of rows of the grid, sorted by source, then target.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdmesh.areas import thesis_areas
from pdmesh.grid import Grid
from pdsolve.conditions import unbreakable
from pdsolve.lattice import ROUND_OFF
from pdsolve.model import Model

SLACK = 1e-6  # of a spacing: a bond along an edge does not leave the plate
LOOKS = 24  # places along a bond where the nodes are asked whether it is inside the plate
COVERED = 0.75  # spacings from the nearest node; the middle of a square of nodes is 0.707 away from them


class Pairs(NamedTuple):
    """Directed candidate bonds."""

    source: NDArray[np.int64]  # (b,) row of the node whose family it is
    target: NDArray[np.int64]  # (b,) row of the neighbour
    length: NDArray[np.float64]  # (b,) |xi|, m


class Bonds(NamedTuple):
    """Bonds ready for the kernels, those of node i at start[i]:start[i + 1]; b of them, n nodes."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: NDArray[np.floating]  # (b, 2) reference vector to the neighbour, m
    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,) stretch of the largest force; where it is the limit, the bond is brittle
    limit: NDArray[np.floating]  # (b,) stretch at which the bond is gone; both infinite where it must not break


class Assembly(NamedTuple):
    """What a scheme makes of a model; n nodes."""

    bonds: Bonds
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included


def pairs_within(position: NDArray[np.float64], reach: NDArray[np.float64]) -> Pairs:
    """All directed pairs of `position` (n, 2) with |xi| <= `reach` (n,) of the source, both in m."""
    tree = cKDTree(position)
    found = []
    for radius in np.unique(reach):
        rows = np.flatnonzero(reach == radius)
        near = cKDTree(position[rows]).sparse_distance_matrix(tree, radius * (1 + ROUND_OFF), output_type="ndarray")
        found.append((rows[near["i"]], near["j"], near["v"]))
    source, target, length = (np.concatenate(column) for column in zip(*found, strict=True))
    return _sorted(source, target, length, len(position))


def chosen(pairs: Pairs, which: NDArray[np.bool_]) -> Pairs:
    """Those of the pairs (b,) that are marked."""
    return Pairs(pairs.source[which], pairs.target[which], pairs.length[which])


def both_ways(pairs: Pairs, nodes: int) -> Pairs:
    """The same pairs, each with its reverse: whoever is seen sees back."""
    source = np.concatenate([pairs.source, pairs.target])
    target = np.concatenate([pairs.target, pairs.source])
    return _sorted(source, target, np.concatenate([pairs.length, pairs.length]), nodes)


def _sorted(source: NDArray[np.int64], target: NDArray[np.int64], length: NDArray[np.float64], nodes: int) -> Pairs:
    key = source * nodes + target
    _, first = np.unique(key, return_index=True)
    first = first[source[first] != target[first]]
    return Pairs(source[first], target[first], length[first])


def assembled(
    model: Model,
    pairs: Pairs,
    stiffness: NDArray[np.float64],
    peak: NDArray[np.float64],
    limit: NDArray[np.float64],
    area: NDArray[np.float64],
) -> Assembly:
    """The pairs (b,) that lie in the plate as bonds, less those a pre-crack cuts.

    `stiffness` (b,), N/m^3, `peak` and `limit` (b,) as in Bonds, but for nodes whose conditions keep their bonds
    from breaking.
    """
    grid = model.grid
    nodes = len(grid)
    intact = ~cut_by_cracks(grid, pairs)
    held = unbreakable(model)
    lasting = held[pairs.source] | held[pairs.target]
    peak, limit = np.where(lasting, np.inf, peak), np.where(lasting, np.inf, limit)
    source, target = pairs.source[intact], pairs.target[intact]
    bonds = Bonds(
        start=np.searchsorted(source, np.arange(nodes + 1)),
        neighbour=target.astype(np.int32),
        xi=grid.position[target] - grid.position[source],
        stiffness=stiffness[intact],
        peak=peak[intact],
        limit=limit[intact],
    )
    return Assembly(bonds, area, np.bincount(pairs.source, minlength=nodes))


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


def inside_plate(grid: Grid, pairs: Pairs) -> NDArray[np.bool_]:
    """Which pairs (b,) see each other without leaving the outline or meeting a hole.

    Without an outline the nodes say where the plate is: a bond of a node marked as border or as near a hole must
    not pass through a place that no node's cell covers.
    """
    if not grid.outline:
        return ~_through_the_void(grid, pairs)
    plate = shapely.union_all([shapely.Polygon(ring) for ring in grid.outline])
    plate = plate.difference(shapely.union_all([shapely.Polygon(ring) for ring in grid.holes]))
    around = shapely.box(*plate.bounds).buffer(grid.delta.max())
    void = around.difference(plate).buffer(-SLACK * float(grid.delta.min()), join_style="mitre")
    return ~_meet(grid, pairs, void)


def _through_the_void(grid: Grid, pairs: Pairs) -> NDArray[np.bool_]:
    marked = grid.border | (grid.hole_id >= 0)
    asked = np.flatnonzero(marked[pairs.source] | marked[pairs.target])
    void = np.zeros(len(pairs.source), dtype=bool)
    if not len(asked):
        return void
    i, j = np.sort(np.column_stack([pairs.source[asked], pairs.target[asked]]), axis=1).T
    widest = np.maximum(grid.delta[i], grid.delta[j])
    tree = cKDTree(grid.position)
    for share in np.linspace(0, 1, LOOKS + 2)[1:-1]:
        distance, _ = tree.query(grid.position[i] + share * (grid.position[j] - grid.position[i]))
        void[asked] |= distance > COVERED * widest
    return void


def cut_by_cracks(grid: Grid, pairs: Pairs) -> NDArray[np.bool_]:
    """Which pairs (b,) a pre-crack separates; touching its tip counts, and does not depend on round-off."""
    ends = grid.cracks.reshape(-1, 2, 2)
    way = np.diff(ends, axis=1)
    length = np.hypot(way[..., :1], way[..., 1:])
    longer = SLACK * float(grid.delta.min()) * way / np.where(length > 0, length, 1.0)
    return _meet(grid, pairs, shapely.multilinestrings(ends + longer * np.array([[-1.0], [1.0]])))


def _meet(grid: Grid, pairs: Pairs, obstacle: shapely.Geometry) -> NDArray[np.bool_]:
    """Which pairs (b,) have a segment that meets the obstacle; (i, j) and (j, i) give the same answer."""
    met = np.zeros(len(pairs.source), dtype=bool)
    if obstacle.is_empty or not len(met):
        return met
    shapely.prepare(obstacle)
    farthest = pairs.length.max() * (1 + ROUND_OFF)
    near = shapely.dwithin(obstacle, shapely.points(grid.position), farthest)
    asked = np.flatnonzero(near[pairs.source])
    ends = np.sort(np.column_stack([pairs.source[asked], pairs.target[asked]]), axis=1)
    met[asked] = shapely.intersects(obstacle, shapely.linestrings(grid.position[ends]))
    return met
