"""Surface correction: changes of bonds near free surfaces and prescribed layers, made before a model is solved.

Only conductances change, so that any operator can use it. It needs the bonds of some rows and the conductance of a bond
of any length (`Bonds` below), and is independent of kernels, lattices and time. The result is a symmetric change of
conductance for each pair, so that masses balance as before. No conductance falls below 0. Forward Euler therefore stays
within the range of prescribed and initial values, up to 1 / max of a node's outflow.

**Free surfaces**, holes, cracks, cut cells, interfaces of spacings: a bond in direction n is multiplied by n . (M_i +
M_j) n / 2. The tensor M_i gives the bonds of node i alone the energy of a full lattice in every linear field: 1/2 sum(g
V (n . M_i n) xi xi) = D I. Summed over a body of any shape this is exact, apart from the limits `LEAST` and `MOST` on
the eigenvalues of M_i: a strip conducts D.

**Prescribed layers**: the value is prescribed where the layer begins, not at its nodes. Beyond that wall, the field is
the odd mirror image of the field before it (method of images). Two free nodes at distances p and q from the wall lose
the conductance of a bond of length sqrt(xi^2 + 4 p q), the distance to the image. A node is bonded to the wall so that
a linear field with the prescribed value there has no rate. A layer may be thinner than a horizon; nodes on both sides
of it are not stored. The wall consists of the faces between free and prescribed cells. The wall of a node is the mean
of the faces that face it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs, chosen
from pdsolve.diffusion.walls import ALIKE, FLAT, Bonds, Edges, Wall, beside, parts_of, summed, walls

LEAST, MOST = 0.25, 10.0  # eigenvalues of M


class Change(NamedTuple):
    """Changes of conductances, directed, sorted by source."""

    source: NDArray[np.int64]  # (b,)
    target: NDArray[np.int64]  # (b,)
    conductance: NDArray[np.float64]  # (b,) 1/(s m^d), to be added
    to_edge: NDArray[np.float64]  # (w, n) 1/s: what comes to a node for each mol/m^3 at the edge of each of its walls
    edge: NDArray[np.int64]  # (w, n) the number of that edge


class _Known(NamedTuple):
    """Nodal data of n nodes."""

    volume: NDArray[np.float64]  # (n,) m^d
    free: NDArray[np.bool_]  # (n,) not held
    on_edge: NDArray[np.bool_]  # (n,) held where they are: the wall goes through them
    walls: list[Wall]  # the first where values are prescribed, the others of exchanges
    tensor: NDArray[np.float64]  # (n, d, d) M

    def walled(self) -> NDArray[np.bool_]:
        """Mask (n,) of nodes before a wall."""
        return np.asarray(np.any([np.isfinite(wall.depth) for wall in self.walls], axis=0))


def correction(
    bonds: Bonds, volume: NDArray[np.float64], free: NDArray[np.bool_], edges: Edges, lacking: NDArray[np.bool_]
) -> Change:
    """Changes for nodes with volumes (n,), m^d, of which the `free` (n,) are not prescribed, and for `edges`.

    The bonds of nodes `lacking` (n,) may differ in energy from those of a full lattice; M of the others is I.
    """
    n, d = bonds.position.shape
    node_properties = _Known(volume, free, edges.nodes, walls(bonds, free, edges), np.tile(np.eye(d), (n, 1, 1)))
    for rows in parts_of(np.flatnonzero(free & lacking)):
        node_properties.tensor[rows] = _tensors(bonds, node_properties, rows)
    uneven = (np.abs(node_properties.tensor - np.eye(d)) > FLAT).any(axis=(1, 2))
    enters = np.zeros((len(node_properties.walls), n))
    changes: list[list[NDArray[Any]]] = [[np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)]]
    for rows in parts_of(np.flatnonzero(free & (node_properties.walled() | beside(bonds, bonds.position[uneven])))):
        *changed, enters[:, rows] = _changes(bonds, node_properties, rows)
        changes.append(changed)
    source, target, change = (np.concatenate(column) for column in zip(*changes, strict=True))
    outward = ~free[target]
    source, target = np.concatenate([source, target[outward]]), np.concatenate([target, source[outward]])
    change = np.concatenate([change, change[outward]])
    order = np.lexsort((target, source))
    to_edge = np.stack([enters[0], *_exchanged(bonds, node_properties, edges, enters[1:])])
    edge = np.stack([wall.edge for wall in node_properties.walls])
    return Change(source[order], target[order], change[order], to_edge, edge)


def _exchanged(
    bonds: Bonds, node_properties: _Known, edges: Edges, enters: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """What comes to nodes (n,), 1/s, for each mol/m^3 outside, by walls; `enters` (w, n), m/s, for each mol/m^4 there.

    All nodes of an exchange together take what its whole extent lets through.
    """
    share = np.zeros(len(edges.extent))
    for entering, wall in zip(enters, node_properties.walls[1:], strict=True):
        np.add.at(
            share, wall.edge[wall.edge >= 0], (entering * node_properties.volume / bonds.diffusivity)[wall.edge >= 0]
        )
    extents = np.where(share > 0, edges.extent, 1.0)
    for entering, wall in zip(enters, node_properties.walls[1:], strict=True):
        way = wall.depth + wall.beyond * np.where(share > 0, share / extents, 1.0)[wall.edge]
        yield entering / np.maximum(way, edges.nearest * bonds.delta)


class _Images(NamedTuple):
    """Some of b bonds, which have an image of their target behind a wall, m of them."""

    at: NDArray[np.int64]  # (m,) of the bonds
    wall: int  # of their source
    conductance: NDArray[np.float64]  # (m,) 1/(s m^d)
    way: NDArray[np.float64]  # (m, d) m, from the source to the image
    back: NDArray[np.float64]  # (m, d) m, from the target to the image of the source
    sign: NDArray[np.float64]  # (m,) of the image: -1 at a prescribed value, 1 where nothing goes through
    enters: NDArray[np.float64]  # (m,) m: what the wall gives to the source in a field that rises by 1 in a metre


def _images(bonds: Bonds, node_properties: _Known, pairs: Pairs) -> Iterator[_Images]:
    """The images of the targets of bonds (b,)."""
    xi = bonds.position[pairs.target] - bonds.position[pairs.source]
    for a, near_wall in enumerate(node_properties.walls):
        facing = [
            (near_wall.normal[pairs.source] * far_wall.normal[pairs.target]).sum(axis=1)
            for far_wall in node_properties.walls
        ]
        for b, far_wall in enumerate(node_properties.walls):
            if (a == 0) != (b == 0):
                continue
            if a == 0:
                has_image = node_properties.free[pairs.target] & (facing[0] > 0)
                has_image |= node_properties.on_edge[pairs.target] & np.isfinite(near_wall.depth[pairs.source])
            else:
                has_image = (
                    node_properties.free[pairs.target] & (facing[b] > ALIKE) & (facing[b] >= np.max(facing[1:], axis=0))
                )
            if not has_image.any():
                continue
            at = np.flatnonzero(has_image)
            i, j, length = chosen(pairs, at)
            p, q = (
                np.where(node_properties.on_edge[end], 0.0, w.depth[end]) for w, end in ((near_wall, i), (far_wall, j))
            )
            far = np.sqrt(length**2 + 4 * p * q)
            sign = np.full(len(at), -1.0)
            if a > 0:
                L, M = near_wall.beyond[i], far_wall.beyond[j]
                sign = ((L - p) / (L + p) + (M - q) / (M + q)) / 2
            apart = far > FLAT * bonds.delta[i]  # a node on its wall is its own image
            g = np.where(apart, bonds.conductance(Pairs(i, j, np.where(apart, far, 1.0))), 0.0)
            normal, back = near_wall.normal[i], far_wall.normal[j]
            ways = xi[at] + 2 * q[:, None] * normal, 2 * p[:, None] * back - xi[at]
            yield _Images(at, a, g, *ways, sign, p + q + sign * (q - p))


def _parted(bonds: Bonds, node_properties: _Known, pairs: Pairs) -> NDArray[np.bool_]:
    """Whether a prescribed layer separates the two ends of pairs (b,): each is behind the other's wall."""
    i, j, _ = pairs
    wall = node_properties.walls[0]
    xi = bonds.position[j] - bonds.position[i]
    ahead = (wall.normal[i] * xi).sum(axis=1) > wall.depth[i]
    return np.asarray(ahead & (-(wall.normal[j] * xi).sum(axis=1) > wall.depth[j]))


def _tensors(bonds: Bonds, node_properties: _Known, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """M (r, d, d) of these nodes; of nodes before a wall from their bonds to free nodes and to the images of these."""
    pairs, g = bonds.of(rows)
    walled, at_prescribed_wall = node_properties.walled(), np.isfinite(node_properties.walls[0].depth)
    is_walled = walled[pairs.source]
    is_counted = ~at_prescribed_wall[pairs.source] | (
        (node_properties.free | node_properties.on_edge)[pairs.target] & ~_parted(bonds, node_properties, pairs)
    )
    before = chosen(pairs, np.flatnonzero(is_walled & is_counted))
    alone = rows[walled[rows]]
    image_sources = Pairs(
        *(np.concatenate(two) for two in zip(before, (alone, alone, np.zeros(len(alone))), strict=True))
    )
    images = list(_images(bonds, node_properties, image_sources))
    i, j = (
        np.concatenate([end[is_counted], *(image_end[image_batch.at] for image_batch in images)])
        for end, image_end in zip(pairs[:2], image_sources[:2], strict=True)
    )
    xi = (bonds.position[pairs.target] - bonds.position[pairs.source])[is_counted]
    xi = np.concatenate([xi, *(image_batch.way for image_batch in images)])
    D = bonds.diffusivity
    square = (xi**2).sum(axis=1)
    n = xi / np.sqrt(np.where(square > 0, square, 1.0))[:, None]
    mirrored = np.concatenate([g[is_counted], *(image_batch.conductance for image_batch in images)])
    energy = mirrored * node_properties.volume[j] * square * (1 / D[i] + 1 / D[j]) / 4
    return _solved(rows, i, n, energy)


def _solved(
    rows: NDArray[np.int64], source: NDArray[np.int64], n: NDArray[np.float64], energy: NDArray[np.float64]
) -> NDArray[np.float64]:
    """M (r, d, d) with sum(energy (n . M n) n n) = I over the bonds of each row, eigenvalues from `LEAST` to `MOST`.

    I for a row without bonds.
    """
    d = n.shape[1]
    entries = list(combinations_with_replacement(range(d), 2))
    twice = np.array([1.0 if a == b else 2.0 for a, b in entries])
    products = np.stack([n[:, a] * n[:, b] for a, b in entries], axis=1)
    matrices = summed(rows, source, energy[:, None, None] * products[:, :, None] * (products * twice)[:, None, :])
    right = np.array([float(a == b) for a, b in entries])
    good = np.linalg.cond(matrices) < 1 / FLAT
    matrices[~good] = np.eye(len(entries))
    coefficients = np.linalg.solve(matrices, np.tile(right[:, None], (len(rows), 1, 1)))[:, :, 0]
    tensor = np.empty((len(rows), d, d))
    for number, (a, b) in enumerate(entries):
        tensor[:, a, b] = tensor[:, b, a] = coefficients[:, number]
    value, axes = np.linalg.eigh(tensor)
    bounded = np.clip(value, LEAST, MOST)
    tensor = np.where(np.abs(tensor - np.eye(d)) < FLAT, np.eye(d), tensor)
    changed = (bounded != value).any(axis=1)
    tensor[changed] = np.einsum("rac,rc,rbc->rab", axes[changed], bounded[changed], axes[changed])
    return tensor


def _weights(
    node_properties: _Known, i: NDArray[np.int64], j: NDArray[np.int64], *ways: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Factors n . (M_i + M_j) n / 2 (b,) of bonds from i to j; `ways` (b, d) are their vectors from either end."""
    halves = []
    for end, way in zip((i, j), ways, strict=True):
        square = (way**2).sum(axis=1)
        halves.append(
            np.einsum("ba,bac,bc->b", way, node_properties.tensor[end], way) / np.where(square > 0, square, 1.0)
        )
    return np.asarray((halves[0] + halves[1]) / 2)


def _changes(
    bonds: Bonds, node_properties: _Known, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Changed bonds of these free nodes: source, target, change of conductance; and what comes through each of their
    walls (w, r): 1/s for each mol/m^3 at the first one, m/s for each mol/m^4 of slope at those of exchanges."""
    pairs, g = bonds.of(rows)
    i, j, _ = pairs
    xi, free = bonds.position[j] - bonds.position[i], node_properties.free[j]
    new = g * _weights(node_properties, i, j, xi, -xi)
    guess = np.zeros((len(node_properties.walls), len(rows)))
    for image_batch in _images(bonds, node_properties, pairs):
        a, b = i[image_batch.at], j[image_batch.at]
        image = image_batch.conductance * _weights(node_properties, a, b, image_batch.way, image_batch.back)
        new[image_batch.at] += image_batch.sign * image
        guess[image_batch.wall] += summed(rows, a, image * node_properties.volume[b] * image_batch.enters)
    new = np.where(free & ~_parted(bonds, node_properties, pairs), np.where(g > 0, np.maximum(new, 0.0), new), 0.0)
    pull = summed(rows, i, (new * node_properties.volume[j])[:, None] * xi)
    prescribed_conductance = np.where(free, 0.0, np.abs(g)) * node_properties.volume[j]
    share = summed(rows, i, prescribed_conductance)
    least = summed(rows, i, np.where(free, 0.0, g) * node_properties.volume[j])  # of a layer whose nodes hold the value
    enters = _entering(node_properties, rows, pull, guess)
    wall = node_properties.walls[0]
    enters[0] = np.maximum(enters[0] / wall.depth[rows], least)
    at_edge = wall.edge[rows] >= 0
    each_held = (np.where(at_edge, least, enters[0]) / np.where(share > 0, share, 1.0))[np.searchsorted(rows, i)]
    new = np.where(free, new, each_held * np.abs(g))
    changed = np.abs(new - g) > FLAT * np.abs(g)
    enters[0] = np.where(at_edge, enters[0], 0.0)
    return i[changed], j[changed], (new - g)[changed], enters


def _entering(
    node_properties: _Known, rows: NDArray[np.int64], pull: NDArray[np.float64], guess: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What walls (w, r) give to nodes in a field that rises by 1 in a metre away from each, m/s.

    Their sum along the normals is minus what bonds give, `pull` (r, d), so that linear fields are exact. Where several
    walls leave that open, they give what `guess` (w, r), of their images, says.
    """
    normals = np.stack([wall.normal[rows] for wall in node_properties.walls], axis=2)  # (r, d, w)
    entering = np.maximum(-(pull[:, :, None] * normals).sum(axis=1).T, 0.0)
    several = np.flatnonzero((normals != 0).any(axis=1).sum(axis=1) > 1)
    if len(several):
        several_normals, first = normals[several], guess[:, several].T
        missing = -pull[several] - np.einsum("rdw,rw->rd", several_normals, first)
        change = np.einsum("rwd,rd->rw", np.linalg.pinv(several_normals, rcond=ALIKE / 2), missing)
        entering[:, several] = np.maximum(first + change, 0.0).T
    return np.asarray(entering)
