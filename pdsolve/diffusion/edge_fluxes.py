r"""Fluxes and exchange through edges, handed on to the nodes beside them so that linear fields stay exact.

Nodes near a free edge lack bonds. In a linear field that rises by 1 in a metre along the inward normal n they gain
R . n with R_i = V_i sum_j g_ij V_j (x_j - x_i), m^(d+1)/s. It is 0 inside a body and adds up to D A over an edge of the
extent A. A flux that is shared out as R . n has the exact linear field for its equilibrium; one that acts on the outer
row alone leaves that row off by about q h / D. An exchange that changes a field within a spacing is a prescribed value
instead, at a wall that is D / coefficient outside, where the slope at the edge leads (Robin's condition). Symbols:

    A   extent of the edge, m^(d-1)        z   depth of a node below the edge, m
    D   diffusivity, m^2/s                 w   share of a node in the flux
    H   exchange between the outside and the nodes, 1 / (1 / coefficient + sum(w z) / D), m/s
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

CLEAR = 0.2  # of D A, by which the sum of R . n may miss it at a free edge
BESIDE = 0.5  # of a spacing: how near to the next cell's place a node is that makes an edge one inside a body


class Cloud(NamedTuple):
    """Nodes, and what they gain in linear fields."""

    position: Array  # (n, d) m
    volume: Array  # (n,) m^d
    delta: Array  # (n,) m
    reach: Array  # (n,) m, of bonds
    diffusivity: Array  # (n,) m^2/s
    gain: Array  # (n, d) R


class Spread(NamedTuple):
    """Shares of a flux."""

    rows: Rows  # (k,)
    share: Array  # (k,) of the whole flux; they add up to 1, less what goes through walls
    resistance: Array  # (k,) s/m, between the edge and where the flux arrives


def parts(volume: Array, delta: Array) -> tuple[Array, Array]:
    """The part of an edge (k,) beside each of its cells, whose sum is 1, and their depths (k,) times its extent, m^d.

    Cells of nested spacings are as deep as they are wide.
    """
    finer = delta.max() / delta
    area = volume * finer
    return area / area.sum(), area.sum() / finer


def outward(
    position: Array, delta: Array, reach: Array, rows: Rows
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Outward unit normals (k, d) of an edge at its nodes, whether (k,) no node is beyond it, and whether one of these
    nodes is."""
    tree = tree_of(position)
    gain = np.zeros(position.shape)
    for row, near in zip(rows, tree.query_ball_point(position[rows], reach[rows]), strict=True):
        gain[row] = position[near].mean(axis=0) - position[row]
    normal = -_normals(position[rows], gain[rows], reach[rows])
    distance, next_one = tree.query(position[rows] + normal * delta[rows, None])
    free = np.asarray(distance > BESIDE * delta[rows])
    return normal, free, ~free & np.isin(next_one, rows)


def over_cells(cloud: Cloud, rows: Rows, walled: NDArray[np.bool_]) -> Spread:
    """Shares in proportion to the parts of the edge beside these cells, but for those `walled` (k,)."""
    part, _ = parts(cloud.volume[rows], cloud.delta[rows])
    return Spread(rows[~walled], part[~walled], np.zeros(int((~walled).sum())))


def beside_edge(cloud: Cloud, rows: Rows, extent: float, walled: NDArray[np.bool_]) -> Spread:
    """Shares of a flux through an edge of that extent, whose nodes `rows` are, but for those `walled` (k,).

    Each of these hands the part of its own cell on to the nodes that it is the nearest to, or keeps it if that part of
    the edge is not free.
    """
    D, normal = cloud.diffusivity[rows], _normals(cloud.position[rows], cloud.gain[rows], cloud.reach[rows])
    part, depth = parts(cloud.volume[rows], cloud.delta[rows])
    reach = 2 * float(cloud.reach[rows].max())
    distance, owner = tree_of(cloud.position[rows]).query(cloud.position, distance_upper_bound=reach)
    near = np.flatnonzero(np.isfinite(distance))
    owner = owner[near]
    way = ((cloud.position[near] - cloud.position[rows[owner]]) * normal[owner]).sum(axis=1)
    w = (cloud.gain[near] * normal[owner]).sum(axis=1) * (way > -cloud.delta[near] / 2)
    total_weight = np.bincount(owner, w, len(rows))
    free = np.abs(total_weight - D * extent * part) < CLEAR * D * extent * part
    hands = (free & ~walled)[owner] & (w != 0)
    near, owner, way = near[hands], owner[hands], way[hands]
    w = w[hands] / total_weight[owner]
    z = depth[owner] / extent - cloud.delta[rows[owner]] / 2 + way
    resistance = np.maximum(np.bincount(owner, w * z, len(rows)), 0.0) / D
    closed_rows = np.flatnonzero(~free & ~walled)
    return Spread(
        np.concatenate([near, rows[closed_rows]]),
        np.concatenate([part[owner] * w, part[closed_rows]]),
        np.concatenate([resistance[owner], np.zeros(len(closed_rows))]),
    )


def _normals(x: Array, inward: Array, reach: Array) -> Array:
    """Inward unit normals (k, d) of an edge at its nodes x: across the line or plane of their neighbours."""
    around = tree_of(x).query_ball_point(x, reach)
    normals = np.zeros(inward.shape)
    for at, neighbours in enumerate(around):
        _, axes = np.linalg.eigh(np.cov(x[neighbours].T, bias=True).reshape(inward.shape[1], -1))
        normals[at] = axes[:, 0] if len(neighbours) > 1 else inward[at]
    normals *= np.where((normals * inward).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return np.asarray(normals / np.maximum(np.sqrt((normals**2).sum(axis=1)), np.finfo(float).tiny)[:, None])
