"""Walls: the planes at which nodes see a prescribed value, or an exchange with the outside.

Faces are the places, areas and normals of edges. The wall of a node is the mean of the faces that face it, nearer ones
counting more. A wall at which a value is prescribed is that of all prescribed faces around a node. Faces of exchanges
make a wall for each direction that they face in, so that a node in a corner has two or three.

An exchange of the coefficient h leaves the slope h (T - T_outside) / D at its wall: in a field that is linear along the
normal, T_outside stands `beyond` = D / h behind it (Robin's condition).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs, row_chunks, tree_of

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

FLAT = 1e-9  # of M and of conductances: what is round-off
ADJACENT = 1.2  # of their size: how far apart nodes are whose cells share a face
STEEP = 3  # the power of its distance with which a face counts less
NEAREST = 0.25  # of a spacing: the least distance from a node to the wall
ALIKE = 0.5  # cosine: faces within that angle are one wall of an exchange
ON_FACE = 1e-3  # of a spacing: nodes that are nearer to a face of an exchange are on it


class Bonds(Protocol):
    """The bonds of n nodes to correct."""

    position: Array  # (n, d) m, along the axes that the nodes extend along
    delta: Array  # (n,) m, spacing
    reach: Array  # (n,) m, largest distance of a neighbour
    diffusivity: Array  # (n,) m^2/s

    def of(self, rows: Rows) -> tuple[Pairs, Array]:
        """Bonds (b,) of these nodes, which increase, and their conductances (b,), 1/(s m^d)."""

    def conductance(self, pairs: Pairs) -> Array:
        """Conductance that bonds (b,) of these lengths between these nodes would have."""


class Faces(NamedTuple):
    """Faces of free cells with a prescribed value or an exchange, or next to prescribed cells, f of them."""

    middle: Array  # (f, d) m
    normal: Array  # (f, d) out of the free cell
    area: Array  # (f,) m^(d - 1)
    edge: Rows  # (f,) number of the edge that is held there, -1 where cells are
    beyond: Array  # (f,) m, D over the coefficient of an exchange; 0 where a value is prescribed

    def chosen(self, which: NDArray[np.bool_]) -> Faces:
        """The faces selected by a mask (f,)."""
        return Faces._make(column[which] for column in self)


class Edges(NamedTuple):
    """Edges with a prescribed value or an exchange, e of them."""

    nodes: NDArray[np.bool_]  # (n,) held nodes that are on one
    faces: Faces  # of free cells at one
    extent: Array  # (e,) m^(d - 1), through which an exchange goes; 0 where a value is prescribed
    nearest: float  # of a spacing: the least distance from a node to the outside of an exchange


class Wall(NamedTuple):
    """One wall of each of n nodes."""

    normal: Array  # (n, d) towards it; 0 without a wall
    depth: Array  # (n,) m to it; infinite without a wall
    edge: Rows  # (n,) number of the edge that it is, -1 where it is that of held cells
    beyond: Array  # (n,) m, see `Faces`
    near: Array  # (n,) m, to the nearest of its faces; infinite without a wall

    def without(self, which: NDArray[np.bool_]) -> Wall:
        """The wall without that of the nodes `which` (n,)."""
        none = no_wall(*self.normal.shape)
        return Wall(*(np.where(which, lacks.T, has.T).T for has, lacks in zip(self, none, strict=True)))


def no_wall(nodes: int, dimension: int) -> Wall:
    """Nodes without a wall."""
    far = np.full(nodes, np.inf)
    return Wall(np.zeros((nodes, dimension)), far, np.full(nodes, -1), np.zeros(nodes), far.copy())


def parts_of(rows: Rows) -> Iterator[Rows]:
    """Rows in parts that stay near the processor."""
    return (rows[chunk] for chunk in row_chunks(len(rows)))


def beside(bonds: Bonds, places: Array) -> NDArray[np.bool_]:
    """Mask (n,) of nodes that may be bonded to one at these places (k, d)."""
    if not len(places):
        return np.zeros(len(bonds.position), dtype=bool)
    farthest = float(bonds.reach.max())
    far, _ = tree_of(places).query(bonds.position, distance_upper_bound=farthest * (1 + FLAT))
    return np.asarray(np.isfinite(far))


def summed(rows: Rows, source: Rows, values: Array) -> Array:
    """Sums (r, ...) of values (b, ...) over the bonds of each row; rows increase."""
    at, flat = np.searchsorted(rows, source), values.reshape(len(values), math.prod(values.shape[1:]))
    sums = [np.bincount(at, column, minlength=len(rows)) for column in flat.T.astype(float)]
    return np.stack(sums, axis=-1, dtype=np.float64).reshape(len(rows), *values.shape[1:])


def walls(bonds: Bonds, free: NDArray[np.bool_], edges: Edges) -> list[Wall]:
    """The wall of each node at which values are prescribed, and after it those of exchanges; nodes `free` (n,) are not
    prescribed.

    Of two that face in one direction the nearer one counts.
    """
    is_prescribed = edges.faces.beyond == 0
    prescribed, exchanged = edges.faces.chosen(is_prescribed), edges.faces.chosen(~is_prescribed)
    rows = np.flatnonzero(free & (beside(bonds, bonds.position[~free]) | beside(bonds, prescribed.middle)))
    # Prescribed edges, and the faces between free nodes of these rows and prescribed cells beside them
    face_groups = [prescribed]
    for part_rows in parts_of(rows):
        i, j, length = bonds.of(part_rows)[0]
        size = bonds.delta[i] + bonds.delta[j]
        face = np.flatnonzero(~free[j] & (length <= ADJACENT * size / 2))
        free_node, prescribed_node = i[face], j[face]
        share = np.where(edges.nodes[prescribed_node], 1.0, bonds.delta[free_node] / size[face])[:, None]  # of the way
        middle = bonds.position[free_node] * (1 - share) + bonds.position[prescribed_node] * share
        area = np.minimum(bonds.delta[free_node], bonds.delta[prescribed_node]) ** (bonds.position.shape[1] - 1)
        normal = (bonds.position[prescribed_node] - bonds.position[free_node]) / length[face, None]
        face_groups.append(Faces(middle, normal, area, np.full(len(face), -1), np.zeros(len(face))))
    faces = Faces(*(np.concatenate(column) for column in zip(*face_groups, strict=True)))
    wall_list = [_wall_of(bonds, rows if len(faces.area) else rows[:0], partial(_prescribed, bonds, faces, free))]
    rows = np.flatnonzero(free & beside(bonds, exchanged.middle))
    while len(exchanged.area) and len(wall_list) <= bonds.position.shape[1]:
        wall = _wall_of(bonds, rows, partial(_exchanging, bonds, exchanged, [other.normal for other in wall_list[1:]]))
        if not np.isfinite(wall.depth).any():
            break
        first = wall_list[0]
        same = (wall.normal * first.normal).sum(axis=1) > ALIKE
        wall_list[0] = first.without(same & (wall.near < first.near))
        wall_list.append(wall.without(same & (wall.near >= first.near)))
    return wall_list


def _wall_of(bonds: Bonds, rows: Rows, wall_of_rows: Callable[[Rows], Wall]) -> Wall:
    """The wall of all nodes, of which these rows may have one."""
    wall = no_wall(*bonds.position.shape)
    for part in parts_of(rows):
        for column, of_rows in zip(wall, wall_of_rows(part), strict=True):
            column[part] = of_rows
    return wall


class _Near(NamedTuple):
    """Faces within reach of r rows, nearest first of each row."""

    at: Rows  # (b,) of the rows
    face: Rows  # (b,)
    length: Array  # (b,) m
    away: Array  # (b, d) m, from the node
    normal: Array  # (b, d) of the face

    def first(self, rows: int) -> Rows:
        """Where the nearest face of each row is in this list; anywhere for a row that has none."""
        return np.asarray(np.searchsorted(self.at, np.arange(rows)).clip(max=len(self.at) - 1))

    def from_nearest(self, rows: int) -> Array:
        """Cosines (b,) of the angles between each face and the nearest one of its row."""
        return np.asarray((self.normal * self.normal[self.first(rows)][self.at]).sum(axis=1))


def _near(bonds: Bonds, faces: Faces, rows: Rows) -> _Near:
    tree, farthest = tree_of(faces.middle), float(bonds.reach[rows].max())
    near = tree_of(bonds.position[rows]).sparse_distance_matrix(tree, farthest, output_type="ndarray")
    order = np.lexsort((near["j"], near["v"], near["i"]))
    at, face, length = near["i"][order], near["j"][order], near["v"][order]
    return _Near(at, face, length, faces.middle[face] - bonds.position[rows[at]], faces.normal[face])


def _prescribed(bonds: Bonds, faces: Faces, free: NDArray[np.bool_], rows: Rows) -> Wall:
    """Walls of rows from faces at which values are prescribed."""
    near = _near(bonds, faces, rows)
    if not len(near.at):  # in reach of these rows; others may have more
        return no_wall(len(rows), bonds.position.shape[1])
    visible = ((near.normal * near.away).sum(axis=1) > 0) & (near.from_nearest(len(rows)) > -FLAT)
    wall = _mean_wall(near, faces, visible, near.length, NEAREST * bonds.delta[rows])
    pairs, _ = bonds.of(rows)
    bonded = np.bincount(np.searchsorted(rows, pairs.source), ~free[pairs.target], minlength=len(rows)) > 0
    return wall.without(~bonded & (wall.edge < 0))


def _exchanging(bonds: Bonds, faces: Faces, earlier: Sequence[Array], rows: Rows) -> Wall:
    """Walls of rows from faces of exchanges that face otherwise than `earlier` walls of all nodes, (n, d) each."""
    near, delta = _near(bonds, faces, rows), bonds.delta[rows]
    visible = (near.normal * near.away).sum(axis=1) > -ON_FACE * delta[near.at]
    for normal in earlier:
        visible &= (near.normal * normal[rows[near.at]]).sum(axis=1) <= ALIKE
    near = _Near(*(column[visible] for column in near))
    if not len(near.at):
        return no_wall(len(rows), bonds.position.shape[1])
    length = np.maximum(near.length, ON_FACE * delta[near.at])
    return _mean_wall(near, faces, near.from_nearest(len(rows)) > ALIKE, length, 0 * delta)


def _mean_wall(near: _Near, faces: Faces, counts: NDArray[np.bool_], length: Array, least_depth: Array) -> Wall:
    """The walls of r rows: means of the faces that count (b,), nearer ones by their `length` (b,) more."""
    rows = len(least_depth)
    weight = np.where(counts, faces.area[near.face] / length**STEEP, 0.0)
    normal = summed(np.arange(rows), near.at, weight[:, None] * near.normal)
    total, size = summed(np.arange(rows), near.at, weight), np.sqrt((normal**2).sum(axis=1))
    has_wall, first = size > FLAT * total, near.first(rows)
    normal = np.where(has_wall[:, None], normal / np.where(has_wall, size, 1.0)[:, None], 0.0)
    depth = summed(np.arange(rows), near.at, weight * (normal[near.at] * near.away).sum(axis=1))
    depth = np.maximum(depth / np.where(has_wall, total, 1.0), least_depth)
    nearest = near.face[first]
    return Wall(normal, depth, faces.edge[nearest], faces.beyond[nearest], near.length[first]).without(~has_wall)
