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
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of
from pdmesh.model.neighbours import ROWS, Pairs, chosen

LEAST, MOST = 0.25, 10.0  # eigenvalues of M
FLAT = 1e-9  # of M and of conductances: what is round-off
ADJACENT = 1.2  # of their size: how far apart nodes are whose cells share a face
STEEP = 3  # the power of its distance with which a face counts less
NEAREST = 0.25  # of a spacing: the least distance from a node to the wall


class Bonds(Protocol):
    """The bonds of n nodes to correct."""

    position: NDArray[np.float64]  # (n, d) m, along the axes that the nodes extend along
    delta: NDArray[np.float64]  # (n,) m, spacing
    reach: NDArray[np.float64]  # (n,) m, largest distance of a neighbour
    diffusivity: NDArray[np.float64]  # (n,) m^2/s

    def of(self, rows: NDArray[np.int64]) -> tuple[Pairs, NDArray[np.float64]]:
        """Bonds (b,) of these nodes, which increase, and their conductances (b,), 1/(s m^d)."""

    def conductance(self, pairs: Pairs) -> NDArray[np.float64]:
        """Conductance that bonds (b,) of these lengths between these nodes would have."""


class Change(NamedTuple):
    """Changes of conductances, directed, sorted by source."""

    source: NDArray[np.int64]  # (b,)
    target: NDArray[np.int64]  # (b,)
    conductance: NDArray[np.float64]  # (b,) 1/(s m^d), to be added
    to_edge: NDArray[np.float64]  # (n,) 1/s: what comes to a node for each mol/m^3 at an edge that is held
    edge: NDArray[np.int64]  # (n,) the number of that edge


class Faces(NamedTuple):
    """Faces of free cells with a prescribed value or next to prescribed cells, f of them."""

    middle: NDArray[np.float64]  # (f, d) m
    normal: NDArray[np.float64]  # (f, d) out of the free cell
    area: NDArray[np.float64]  # (f,) m^(d - 1)
    edge: NDArray[np.int64]  # (f,) number of the edge that is held there, -1 where cells are

    def chosen(self, which: NDArray[np.bool_]) -> Faces:
        """The faces selected by a mask (f,)."""
        return Faces(self.middle[which], self.normal[which], self.area[which], self.edge[which])


class Held(NamedTuple):
    """Edges with a prescribed value."""

    nodes: NDArray[np.bool_]  # (n,) held nodes that are on one
    faces: Faces  # of free cells at one


def nothing(dimension: int) -> Faces:
    """An empty set of faces."""
    return Faces(np.zeros((0, dimension)), np.zeros((0, dimension)), np.zeros(0), np.zeros(0, dtype=np.int64))


class _Known(NamedTuple):
    """Nodal data of n nodes."""

    volume: NDArray[np.float64]  # (n,) m^d
    free: NDArray[np.bool_]  # (n,) not held
    on_edge: NDArray[np.bool_]  # (n,) held where they are: the wall goes through them
    normal: NDArray[np.float64]  # (n, d) towards the wall
    depth: NDArray[np.float64]  # (n,) m to the wall; infinite where no held node is in the family
    edge: NDArray[np.int64]  # (n,) number of the edge that the wall is, -1 where it is that of held cells
    tensor: NDArray[np.float64]  # (n, d, d) M


def correction(
    bonds: Bonds, volume: NDArray[np.float64], free: NDArray[np.bool_], held: Held, lacking: NDArray[np.bool_]
) -> Change:
    """Changes for nodes with volumes (n,), m^d, of which the `free` (n,) are not prescribed, and for prescribed edges.

    The bonds of nodes `lacking` (n,) may differ in energy from those of a full lattice; M of the others is I.
    """
    n, d = bonds.position.shape
    edges = held.faces
    known = _Known(
        volume, free, held.nodes, np.zeros((n, d)), np.full(n, np.inf), np.full(n, -1), np.tile(np.eye(d), (n, 1, 1))
    )
    beside = _beside(bonds, bonds.position[~free]) | _beside(bonds, edges.middle)
    faces = _faces(bonds, known, edges, np.flatnonzero(free & beside))
    for some in _parts(np.flatnonzero(free & beside)) if len(faces.area) else ():
        known.normal[some], known.depth[some], known.edge[some] = _walls(bonds, faces, free, some)
    for some in _parts(np.flatnonzero(free & lacking)):
        known.tensor[some] = _tensors(bonds, known, some)
    uneven = (np.abs(known.tensor - np.eye(d)) > FLAT).any(axis=(1, 2))
    to_edge = np.zeros(n)
    found: list[list[NDArray[Any]]] = [[np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)]]
    for some in _parts(np.flatnonzero(free & (np.isfinite(known.depth) | _beside(bonds, bonds.position[uneven])))):
        *changed, to_edge[some] = _changes(bonds, known, some)
        found.append(changed)
    source, target, change = (np.concatenate(column) for column in zip(*found, strict=True))
    outward = ~free[target]
    source, target = np.concatenate([source, target[outward]]), np.concatenate([target, source[outward]])
    change = np.concatenate([change, change[outward]])
    order = np.lexsort((target, source))
    return Change(source[order], target[order], change[order], to_edge, known.edge)


def _parts(rows: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    return (rows[first : first + ROWS] for first in range(0, len(rows), ROWS))


def _beside(bonds: Bonds, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of nodes that may be bonded to one at these places (k, d)."""
    if not len(places):
        return np.zeros(len(bonds.position), dtype=bool)
    farthest = float(bonds.reach.max())
    far, _ = tree_of(places).query(bonds.position, distance_upper_bound=farthest * (1 + FLAT))
    return np.asarray(np.isfinite(far))


def _summed(rows: NDArray[np.int64], source: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums (r, ...) of values (b, ...) over the bonds of each row; rows increase."""
    at, flat = np.searchsorted(rows, source), values.reshape(len(values), -1)
    sums = [np.bincount(at, column, minlength=len(rows)) for column in flat.T.astype(float)]
    return np.stack(sums, axis=-1, dtype=np.float64).reshape(len(rows), *values.shape[1:])


def _faces(bonds: Bonds, known: _Known, edges: Faces, rows: NDArray[np.int64]) -> Faces:
    """Prescribed edges, and the faces between free nodes of these rows and prescribed cells beside them."""
    found = [edges]
    for some in _parts(rows):
        i, j, length = bonds.of(some)[0]
        size = bonds.delta[i] + bonds.delta[j]
        face = np.flatnonzero(~known.free[j] & (length <= ADJACENT * size / 2))
        one, other = i[face], j[face]
        share = np.where(known.on_edge[other], 1.0, bonds.delta[one] / size[face])[:, None]  # of the way to the other
        middle = bonds.position[one] * (1 - share) + bonds.position[other] * share
        area = np.minimum(bonds.delta[one], bonds.delta[other]) ** (bonds.position.shape[1] - 1)
        normal = (bonds.position[other] - bonds.position[one]) / length[face, None]
        found.append(Faces(middle, normal, area, np.full(len(face), -1)))
    return Faces(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _walls(
    bonds: Bonds, faces: Faces, free: NDArray[np.bool_], rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Normals (r, d), distances (r,), m, and edges (r,) of the nodes' walls; infinite distance without a wall."""
    tree, farthest = tree_of(faces.middle), float(bonds.reach[rows].max())
    near = tree_of(bonds.position[rows]).sparse_distance_matrix(tree, farthest, output_type="ndarray")
    at, face, length = near["i"], near["j"], near["v"]
    order = np.lexsort((face, length, at))
    at, face, length = at[order], face[order], length[order]
    away = faces.middle[face] - bonds.position[rows[at]]
    nearest = face[np.searchsorted(at, np.arange(len(rows))).clip(max=len(face) - 1)]
    alike = (faces.normal[face] * faces.normal[nearest][at]).sum(axis=1) > -FLAT
    seen = ((faces.normal[face] * away).sum(axis=1) > 0) & alike
    weight = np.where(seen, faces.area[face] / length**STEEP, 0.0)
    total = np.bincount(at, weight, minlength=len(rows))
    normal = _summed(np.arange(len(rows)), at, weight[:, None] * faces.normal[face])
    size = np.sqrt((normal**2).sum(axis=1))
    pairs, _ = bonds.of(rows)
    bonded = np.bincount(np.searchsorted(rows, pairs.source), ~free[pairs.target], minlength=len(rows)) > 0
    some = (bonded | (faces.edge[nearest] >= 0)) & (size > FLAT * total)
    normal = np.where(some[:, None], normal / np.where(some, size, 1.0)[:, None], 0.0)
    depth = np.bincount(at, weight * (normal[at] * away).sum(axis=1), minlength=len(rows))
    depth = np.maximum(depth / np.where(some, total, 1.0), NEAREST * bonds.delta[rows])
    return normal, np.where(some, depth, np.inf), np.where(some, faces.edge[nearest], -1)


def _images(
    bonds: Bonds, known: _Known, pairs: Pairs
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Conductances (b,) of bonds to the images of their targets, and these bonds seen from either end (b, d), m."""
    i, j, length = pairs
    xi = bonds.position[j] - bonds.position[i]
    one, other = known.normal[i], known.normal[j]
    on = known.on_edge[j]
    some = (known.free[j] & ((one * other).sum(axis=1) > 0)) | (on & np.isfinite(known.depth[i]))
    p, q = (np.where(some & ~known.on_edge[end], known.depth[end], 0.0) for end in (i, j))
    far = np.sqrt(length**2 + 4 * p * q)
    g = np.where(some, bonds.conductance(Pairs(i, j, np.where(some, far, 1.0))), 0.0)
    return g, xi + 2 * q[:, None] * one, 2 * p[:, None] * other - xi


def _parted(bonds: Bonds, known: _Known, pairs: Pairs) -> NDArray[np.bool_]:
    """Whether a prescribed layer separates the two ends of pairs (b,): each is behind the other's wall."""
    i, j, _ = pairs
    xi = bonds.position[j] - bonds.position[i]
    ahead = (known.normal[i] * xi).sum(axis=1) > known.depth[i]
    return np.asarray(ahead & (-(known.normal[j] * xi).sum(axis=1) > known.depth[j]))


def _tensors(bonds: Bonds, known: _Known, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """M (r, d, d) of these nodes; of nodes before a wall from their bonds to free nodes and to the images of these."""
    pairs, g = bonds.of(rows)
    walled = np.isfinite(known.depth)
    own = walled[pairs.source]
    kept = ~own | ((known.free | known.on_edge)[pairs.target] & ~_parted(bonds, known, pairs))
    before = chosen(pairs, np.flatnonzero(own & kept))
    alone = rows[walled[rows]]
    seen = Pairs(*(np.concatenate(two) for two in zip(before, (alone, alone, np.zeros(len(alone))), strict=True)))
    mirrored, way, _ = _images(bonds, known, seen)
    i, j = (np.concatenate([end[kept], other]) for end, other in zip(pairs[:2], seen[:2], strict=True))
    xi = np.concatenate([(bonds.position[pairs.target] - bonds.position[pairs.source])[kept], way])
    D = bonds.diffusivity
    square = (xi**2).sum(axis=1)
    n = xi / np.sqrt(np.where(square > 0, square, 1.0))[:, None]
    energy = np.concatenate([g[kept], mirrored]) * known.volume[j] * square * (1 / D[i] + 1 / D[j]) / 4
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
    left = _summed(rows, source, energy[:, None, None] * products[:, :, None] * (products * twice)[:, None, :])
    right = np.array([float(a == b) for a, b in entries])
    good = np.linalg.cond(left) < 1 / FLAT
    left[~good] = np.eye(len(entries))
    found = np.linalg.solve(left, np.tile(right[:, None], (len(rows), 1, 1)))[:, :, 0]
    tensor = np.empty((len(rows), d, d))
    for number, (a, b) in enumerate(entries):
        tensor[:, a, b] = tensor[:, b, a] = found[:, number]
    value, axes = np.linalg.eigh(tensor)
    bounded = np.clip(value, LEAST, MOST)
    tensor = np.where(np.abs(tensor - np.eye(d)) < FLAT, np.eye(d), tensor)
    changed = (bounded != value).any(axis=1)
    tensor[changed] = np.einsum("rac,rc,rbc->rab", axes[changed], bounded[changed], axes[changed])
    return tensor


def _weights(
    known: _Known, i: NDArray[np.int64], j: NDArray[np.int64], *ways: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Factors n . (M_i + M_j) n / 2 (b,) of bonds from i to j; `ways` (b, d) are their vectors from either end."""
    halves = []
    for end, way in zip((i, j), ways, strict=True):
        square = (way**2).sum(axis=1)
        halves.append(np.einsum("ba,bac,bc->b", way, known.tensor[end], way) / np.where(square > 0, square, 1.0))
    return np.asarray((halves[0] + halves[1]) / 2)


def _changes(
    bonds: Bonds, known: _Known, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Changed bonds of these free nodes: source, target, change of conductance; and conductances to edges (r,), 1/s."""
    pairs, g = bonds.of(rows)
    i, j, _ = pairs
    xi, free = bonds.position[j] - bonds.position[i], known.free[j]
    image, way, back = _images(bonds, known, pairs)
    new = g * _weights(known, i, j, xi, -xi) - image * _weights(known, i, j, way, back)
    new = np.where(free & ~_parted(bonds, known, pairs), np.where(g > 0, np.maximum(new, 0.0), new), 0.0)
    pull = _summed(rows, i, (new * known.volume[j])[:, None] * xi)
    held = np.where(free, 0.0, np.abs(g)) * known.volume[j]
    share = _summed(rows, i, held)
    least = _summed(rows, i, np.where(free, 0.0, g) * known.volume[j])  # of a layer whose nodes hold the value
    to_wall = np.maximum(-(pull * known.normal[rows]).sum(axis=1) / known.depth[rows], least)
    at_edge = known.edge[rows] >= 0
    each = (np.where(at_edge, least, to_wall) / np.where(share > 0, share, 1.0))[np.searchsorted(rows, i)]
    new = np.where(free, new, each * np.abs(g))
    changed = np.abs(new - g) > FLAT * np.abs(g)
    return i[changed], j[changed], (new - g)[changed], np.where(at_edge, to_wall, 0.0)
