"""Surface correction: changes of bonds near free surfaces and prescribed layers, made before a model is solved.

Only conductances change, so that any operator can use it. It needs the bonds of some rows and the conductance of a bond
of any length (`pdsolve.diffusion.walls.Bonds`), and is independent of kernels, lattices and time. The result is a
symmetric change of conductance for each pair, so that masses balance as before. No conductance falls below 0. Forward
Euler therefore stays within the range of prescribed and initial values, up to 1 / max of a node's outflow.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs, chosen
from pdsolve.diffusion.walls import ALIKE, FLAT, Array, Bonds, Edges, Rows, beside, parts_of, summed, walls
from pdsolve.lattice.flux_operator import links_between
from pdsolve.laws.bond_arrays import Links

LEAST, MOST = 0.25, 10.0  # eigenvalues of M


class _Images(NamedTuple):
    """Some of b bonds, which have an image of their target behind a wall, m of them."""

    at: Rows  # (m,) of the bonds
    wall: int  # of their source
    conductance: Array  # (m,) 1/(s m^d)
    way: Array  # (m, d) m, from the source to the image
    back: Array  # (m, d) m, from the target to the image of the source
    sign: Array  # (m,) of the image: -1 at a prescribed value, 1 where nothing goes through
    enters: Array  # (m,) m: what the wall gives to the source in a field that rises by 1 in a metre


class Surfaces:
    """The surfaces of n nodes with volumes (n,), m^d, of which the `free` (n,) are not prescribed, and of `edges`."""

    def __init__(self, bonds: Bonds, volume: Array, free: NDArray[np.bool_], edges: Edges) -> None:
        self._bonds, self._volume, self._free, self._edges = bonds, volume, free, edges
        self._walls = walls(bonds, free, edges)  # the first where values are prescribed, the others of exchanges
        self._walled = np.any([np.isfinite(wall.depth) for wall in self._walls], axis=0)
        self._I = np.eye(bonds.position.shape[1])
        self._M = np.tile(self._I, (len(volume), 1, 1))  # (n, d, d)

    def correction(self, has_partial_family: NDArray[np.bool_]) -> tuple[Links, Array, Array, Rows]:
        """Directed bonds (b,) with what is added to their conductances (b,), 1/(s m^d), and what comes to nodes (w, n)
        for each mol/m^3 at the edge of each of their walls, 1/s, with the number (w, n) of that edge.

        The bonds of nodes with `has_partial_family` (n,) may differ in energy from those of a full lattice; M of the
        others is I.
        """
        bonds, free = self._bonds, self._free
        for rows in parts_of(np.flatnonzero(free & has_partial_family)):
            self._M[rows] = self._tensors(rows)
        uneven = (np.abs(self._M - self._I) > FLAT).any(axis=(1, 2))
        enters = np.zeros((len(self._walls), len(free)))
        changes = [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))]
        for rows in parts_of(np.flatnonzero(free & (self._walled | beside(bonds, bonds.position[uneven])))):
            source, target, change, enters[:, rows] = self._changes(rows)
            changes.append((source, target, change))
        source, target, change = (np.concatenate(column) for column in zip(*changes, strict=True))
        outward = ~free[target]
        source, target = np.concatenate([source, target[outward]]), np.concatenate([target, source[outward]])
        change = np.concatenate([change, change[outward]])
        order = np.lexsort((target, source))
        # All nodes of an exchange together take what its whole extent lets through
        share, edges = np.zeros(len(self._edges.extent)), self._edges
        for entering, wall in zip(enters[1:], self._walls[1:], strict=True):
            has_wall = wall.edge >= 0
            np.add.at(share, wall.edge[has_wall], (entering * self._volume / bonds.diffusivity)[has_wall])
        extents = np.where(share > 0, edges.extent, 1.0)
        for entering, wall in zip(enters[1:], self._walls[1:], strict=True):
            way = wall.depth + wall.beyond * np.where(share > 0, share / extents, 1.0)[wall.edge]
            entering /= np.maximum(way, edges.nearest * bonds.delta)
        edge = np.stack([wall.edge for wall in self._walls])
        return links_between(source[order], target[order], len(free)), change[order], enters, edge

    def _images(self, pairs: Pairs) -> Iterator[_Images]:
        """The images of the targets of bonds (b,)."""
        bonds, (source, target, _) = self._bonds, pairs
        free, on_edge = self._free[target], self._edges.nodes
        xi = bonds.position[target] - bonds.position[source]
        for a, near in enumerate(self._walls):
            facing = [(near.normal[source] * far.normal[target]).sum(axis=1) for far in self._walls]
            for b, far in enumerate(self._walls):
                if (a == 0) != (b == 0):
                    continue
                if a == 0:
                    has_image = (free & (facing[0] > 0)) | (on_edge[target] & np.isfinite(near.depth[source]))
                else:
                    has_image = free & (facing[b] > ALIKE) & (facing[b] >= np.max(facing[1:], axis=0))
                at = np.flatnonzero(has_image)
                if not len(at):
                    continue
                i, j, length = chosen(pairs, at)
                p, q = (np.where(on_edge[end], 0.0, wall.depth[end]) for wall, end in ((near, i), (far, j)))
                away = np.sqrt(length**2 + 4 * p * q)
                sign = np.full(len(at), -1.0)
                if a > 0:
                    L, M = near.beyond[i], far.beyond[j]
                    sign = ((L - p) / (L + p) + (M - q) / (M + q)) / 2
                apart = away > FLAT * bonds.delta[i]  # a node on its wall is its own image
                g = np.where(apart, bonds.conductance(Pairs(i, j, np.where(apart, away, 1.0))), 0.0)
                way, back = xi[at] + 2 * q[:, None] * near.normal[i], 2 * p[:, None] * far.normal[j] - xi[at]
                yield _Images(at, a, g, way, back, sign, p + q + sign * (q - p))

    def _are_separated_by_layer(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Whether a prescribed layer separates the two ends of pairs (b,): each is behind the other's wall."""
        i, j, _ = pairs
        wall, xi = self._walls[0], self._bonds.position[j] - self._bonds.position[i]
        ahead = (wall.normal[i] * xi).sum(axis=1) > wall.depth[i]
        return np.asarray(ahead & (-(wall.normal[j] * xi).sum(axis=1) > wall.depth[j]))

    def _tensors(self, rows: Rows) -> Array:
        """M (r, d, d) of these nodes; of nodes before a wall from their bonds to free nodes and to the images of
        these."""
        bonds, D = self._bonds, self._bonds.diffusivity
        pairs, g = bonds.of(rows)
        crosses_wall = ~(self._free | self._edges.nodes)[pairs.target] | self._are_separated_by_layer(pairs)
        counts = ~(np.isfinite(self._walls[0].depth)[pairs.source] & crosses_wall)
        before, alone = chosen(pairs, self._walled[pairs.source] & counts), rows[self._walled[rows]]
        both = zip(before, (alone, alone, np.zeros(len(alone))), strict=True)
        mirrored = Pairs(*(np.concatenate(two) for two in both))
        images = list(self._images(mirrored))
        i, j = (
            np.concatenate([end[counts], *(image_end[image.at] for image in images)])
            for end, image_end in zip(pairs[:2], mirrored[:2], strict=True)
        )
        xi = (bonds.position[pairs.target] - bonds.position[pairs.source])[counts]
        xi = np.concatenate([xi, *(image.way for image in images)])
        square = (xi**2).sum(axis=1)
        n = xi / np.sqrt(np.where(square > 0, square, 1.0))[:, None]
        g = np.concatenate([g[counts], *(image.conductance for image in images)])
        energy = g * self._volume[j] * square * (1 / D[i] + 1 / D[j]) / 4
        # M with sum(energy (n . M n) n n) = I over the bonds of each row, eigenvalues from `LEAST` to `MOST`; I without
        # bonds
        d = n.shape[1]
        entries = list(combinations_with_replacement(range(d), 2))
        twice = np.array([1.0 if a == b else 2.0 for a, b in entries])
        products = np.stack([n[:, a] * n[:, b] for a, b in entries], axis=1)
        matrices = summed(rows, i, energy[:, None, None] * products[:, :, None] * (products * twice)[:, None, :])
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

    def _weights(self, i: Rows, j: Rows, *ways: Array) -> Array:
        """Factors n . (M_i + M_j) n / 2 (b,) of bonds from i to j; `ways` (b, d) are their vectors from either end."""
        halves = []
        for end, way in zip((i, j), ways, strict=True):
            square = (way**2).sum(axis=1)
            halves.append(np.einsum("ba,bac,bc->b", way, self._M[end], way) / np.where(square > 0, square, 1.0))
        return np.asarray((halves[0] + halves[1]) / 2)

    def _changes(self, rows: Rows) -> tuple[Rows, Rows, Array, Array]:
        """Changed bonds of these free nodes: source, target, change of conductance; and what comes through each of
        their walls (w, r): 1/s for each mol/m^3 at the first one, m/s for each mol/m^4 of slope at those of
        exchanges."""
        pairs, g = self._bonds.of(rows)
        i, j, _ = pairs
        xi, free, V = self._bonds.position[j] - self._bonds.position[i], self._free[j], self._volume[j]
        new = g * self._weights(i, j, xi, -xi)
        guess = np.zeros((len(self._walls), len(rows)))
        for image in self._images(pairs):
            a, b = i[image.at], j[image.at]
            conductance = image.conductance * self._weights(a, b, image.way, image.back)
            new[image.at] += image.sign * conductance
            guess[image.wall] += summed(rows, a, conductance * self._volume[b] * image.enters)
        new = np.where(free & ~self._are_separated_by_layer(pairs), np.where(g > 0, np.maximum(new, 0.0), new), 0.0)
        pull = summed(rows, i, (new * V)[:, None] * xi)
        share = summed(rows, i, np.where(free, 0.0, np.abs(g)) * V)
        least = summed(rows, i, np.where(free, 0.0, g) * V)  # of a layer whose nodes hold the value
        normals = np.stack([wall.normal[rows] for wall in self._walls], axis=2)  # (r, d, w)
        entering = np.maximum(-(pull[:, :, None] * normals).sum(axis=1).T, 0.0)
        several = np.flatnonzero((normals != 0).any(axis=1).sum(axis=1) > 1)
        if len(several):
            first = guess[:, several].T
            missing = -pull[several] - np.einsum("rdw,rw->rd", normals[several], first)
            change = np.einsum("rwd,rd->rw", np.linalg.pinv(normals[several], rcond=ALIKE / 2), missing)
            entering[:, several] = np.maximum(first + change, 0.0).T
        enters, wall = np.asarray(entering), self._walls[0]
        enters[0] = np.maximum(enters[0] / wall.depth[rows], least)
        at_edge = wall.edge[rows] >= 0
        factor = (np.where(at_edge, least, enters[0]) / np.where(share > 0, share, 1.0))[np.searchsorted(rows, i)]
        new = np.where(free, new, factor * np.abs(g))
        changed = np.abs(new - g) > FLAT * np.abs(g)
        enters[0] = np.where(at_edge, enters[0], 0.0)
        return i[changed], j[changed], (new - g)[changed], enters
