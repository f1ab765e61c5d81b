"""Penalty forces of pairs of surface nodes with a normal field, and Coulomb friction: compiled loops.

The normal N of a node is minus the sum of the unit vectors to its nearest nodes that bonds join to it: 0 inside a body,
it points out of a face. The n of a pair is that of the flatter node or, of two alike, (N_i - N_j) / |N_i - N_j|, or the
line between two loose nodes: at a corner N is that of neither face. With r from i to j, g = r . n, t = r - g n and the
depth p = max(d - g, 0) its energy is k w(t) f p^2 / 2. The weights w of the nodes that a node meets add up to 1
wherever it is over a flat face, so that nodes do not interlock: in the plane w = 1 - |t| / h. f is 0 for normals that
point the same way, 1 where they face each other. d is the distance of touch or, for nodes that began nearer, what it
was then. The force is the gradient of the energy at a constant n; it is equal and opposite.

Friction: a spring as stiff as that of the pair, which slips where it is longer than mu p.

    x, u   (n, d) places and displacements, m    k        (p,) stiffness of a pair, N/m
    h      (p,) reach of a pair's weight, m      touch    (p,) distance of touch, m
    slip   (p, d) of friction's spring, m        drag     (p, d) its force on j one step ago, N
    out    (n, d) force densities, N/m^3         spent    (n,) minus work of friction's springs, J
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER

LOOSE = 0.5  # length of a normal that is none
FACING, ASKEW = 0.3, 0.8  # cosine of two normals below which they face each other, above which they do not
FLAT, FLAT_IN_SPACE = 5, 17  # nearest nodes of one in a flat face: of 8 in the plane, of 26 in space
WIDE = 2.0  # spacings: reach of a weight in space
IN_SPACE = 0.75 / np.pi  # (1 - t^2 / 4 h^2)^2 summed over a square lattice of spacing h, inverted; to 1.5 %
ROUND_OFF = 1e-12  # of a spacing


class Nodes(NamedTuple):
    """Nodes and the nearest nodes that bonds join to them."""

    x: NDArray[np.float64]  # (n, d) m
    volume: NDArray[np.float64]  # (n,) m^d
    start: NDArray[np.int64]  # (n + 1,)
    near: NDArray[np.int32]  # (b,)
    intact: NDArray[np.bool_]  # (b,)


class PairList(NamedTuple):
    """Pairs of nodes that may touch, p of them, in order."""

    i: NDArray[np.int64]  # (p,)
    j: NDArray[np.int64]  # (p,)
    k: NDArray[np.float64]  # (p,) N/m
    h: NDArray[np.float64]  # (p,) m
    touch: NDArray[np.float64]  # (p,) m
    slip: NDArray[np.float64]  # (p, d) m
    drag: NDArray[np.float64]  # (p, d) N
    rows: NDArray[np.int64]  # (m,) of the nodes of all pairs
    first: NDArray[np.int64]  # (p,) number of i among them
    second: NDArray[np.int64]  # (p,) number of j
    normals: NDArray[np.float64]  # (m, d + 2) their normals now, how far from flat they are, and whether that is known


@njit(**INNER)
def _apart(nodes, u, i, j, moved):  # type: ignore[no-untyped-def]
    """The way (x, y, z) from node i to node j, m; z is 0 in the plane."""
    x, y, z = nodes.x[j, 0] - nodes.x[i, 0], nodes.x[j, 1] - nodes.x[i, 1], 0.0
    space = nodes.x.shape[1] == 3
    if space:
        z = nodes.x[j, 2] - nodes.x[i, 2]
    if moved:
        x += np.float64(u[j, 0]) - np.float64(u[i, 0])
        y += np.float64(u[j, 1]) - np.float64(u[i, 1])
        if space:
            z += np.float64(u[j, 2]) - np.float64(u[i, 2])
    return x, y, z


@njit(**INNER)
def normal(nodes, u, i, moved, found):  # type: ignore[no-untyped-def]
    """Set `found` (d,) to the normal of node i, in the reference unless `moved`; returns how far it is from flat."""
    x, y, z, count = 0.0, 0.0, 0.0, 0
    for b in range(nodes.start[i], nodes.start[i + 1]):
        if nodes.intact[b]:
            along, across, up = _apart(nodes, u, i, nodes.near[b], moved)
            square = along * along + across * across + up * up
            inverse, count = 1.0 / np.sqrt(square) if square > 0 else 0.0, count + 1
            x -= along * inverse
            y -= across * inverse
            z -= up * inverse
    found[0], found[1] = x, y
    if nodes.x.shape[1] == 3:
        found[2] = z
    return abs(count - (FLAT if nodes.x.shape[1] == 2 else FLAT_IN_SPACE))


@njit(**INNER)
def _between(r, first, second, bent, other):  # type: ignore[no-untyped-def]
    """The normal (x, y, z) of a pair `r` apart with these normals, all (x, y, z), and how much they face.

    `bent` and `other` are how far the nodes are from flat.
    """
    x, y, z = 0.0, 0.0, 0.0
    if bent <= other:
        x, y, z = first
    if other <= bent:
        x, y, z = x - second[0], y - second[1], z - second[2]
    length, away, dot = x * x + y * y + z * z, _dot(r, r), _dot(first, second)
    one, two, facing = _dot(first, first), _dot(second, second), 1.0
    if one >= LOOSE * LOOSE and two >= LOOSE * LOOSE:
        facing = min(max((ASKEW - dot / np.sqrt(one * two)) / (ASKEW - FACING), 0.0), 1.0)
    if length < LOOSE * LOOSE:
        root = np.sqrt(away)
        return r[0] / root, r[1] / root, r[2] / root, facing
    root = np.sqrt(length)
    return x / root, y / root, z / root, facing


@njit(**INNER)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**INNER)
def _weight(t, h, d):  # type: ignore[no-untyped-def]
    """Weight of a pair at a distance t along the face, and its derivative, 1/m."""
    if d == 2:
        return (1.0 - t / h, -1.0 / h) if t < h else (0.0, 0.0)
    q = 1.0 - (t / (WIDE * h)) ** 2
    return (IN_SPACE * q * q, -4.0 * IN_SPACE * q * t / (WIDE * h) ** 2) if q > 0 else (0.0, 0.0)


@njit(**INNER)
def _pressed(nodes, pairs, u, q, slack, vectors):  # type: ignore[no-untyped-def]
    """Stiffness k w f, N/m, depth p, m, and pull along the face, N, of pair q; `vectors` (2, 3) become n and t / |t|.

    All are 0 where the nodes are farther apart than the distance of touch and the `slack`, m.
    """
    d, touch, h = nodes.x.shape[1], pairs.touch[q], pairs.h[q]
    r, reach = _apart(nodes, u, pairs.i[q], pairs.j[q], True), h * (1.0 if d == 2 else WIDE)
    square = _dot(r, r)
    if square >= reach * reach + (touch + slack) ** 2:
        return 0.0, 0.0, 0.0
    first, bent = _learned(nodes, pairs, u, pairs.first[q])
    second, other = _learned(nodes, pairs, u, pairs.second[q])
    x, y, z, facing = _between(r, first, second, bent, other)
    gap = r[0] * x + r[1] * y + r[2] * z
    if facing == 0.0 or gap >= touch + slack or gap <= 0.0:
        return 0.0, 0.0, 0.0
    t = np.sqrt(max(square - gap * gap, 0.0))
    w, slope = _weight(t, h, d)
    depth, far = touch - gap, t > ROUND_OFF * h
    if w == 0.0 or depth <= -slack:
        return 0.0, 0.0, 0.0
    vectors[0, 0], vectors[0, 1], vectors[0, 2] = x, y, z
    vectors[1, 0] = (r[0] - gap * x) / t if far else 0.0
    vectors[1, 1] = (r[1] - gap * y) / t if far else 0.0
    vectors[1, 2] = (r[2] - gap * z) / t if far else 0.0
    return pairs.k[q] * w * facing, depth, pairs.k[q] * facing * slope / 2 * depth * depth


@njit(**INNER)
def _learned(nodes, pairs, u, number):  # type: ignore[no-untyped-def]
    """The normal (x, y, z) of a node of the pairs, and how far from flat it is: found once a step."""
    found, d = pairs.normals, nodes.x.shape[1]
    if found[number, d + 1] == 0.0:
        found[number, d] = normal(nodes, u, pairs.rows[number], True, found[number])
        found[number, d + 1] = 1.0
    z = found[number, 2] if d == 3 else 0.0
    return (found[number, 0], found[number, 1], z), found[number, d]


@cached_njit(error_model="numpy")
def nearer(nodes, pairs):  # type: ignore[no-untyped-def]
    """Let pairs touch at the gap that they had in the reference, if it was less; never those that were back to back."""
    nothing, d, ends = np.zeros((1, 3)), nodes.x.shape[1], np.zeros((2, 3))
    for q in range(len(pairs.i)):
        reach = pairs.h[q] * (1.0 if d == 2 else WIDE)
        near = reach * reach + pairs.touch[q] ** 2
        gap = _gap_before(nodes, nothing, pairs.i[q], pairs.j[q], near, ends)
        pairs.touch[q] = max(min(pairs.touch[q], gap), 0.0)


@njit(**INNER)
def _gap_before(nodes, u, i, j, near, ends):  # type: ignore[no-untyped-def]
    """The gap between two nodes in the reference, m, of bonds as they are now; infinite farther than root `near`, m^2.

    It is negative between nodes that are back to back. `ends` (2, 3), the third column 0 in the plane, is work space.
    """
    r = _apart(nodes, u, i, j, False)
    if _dot(r, r) >= near:
        return np.inf
    bent, other = normal(nodes, u, i, False, ends[0]), normal(nodes, u, j, False, ends[1])
    first, second = (ends[0, 0], ends[0, 1], ends[0, 2]), (ends[1, 0], ends[1, 1], ends[1, 2])
    x, y, z, _ = _between(r, first, second, bent, other)
    return r[0] * x + r[1] * y + r[2] * z


@cached_njit(error_model="numpy")
def add_forces(nodes, pairs, u, v, mu, dt, out, spent):  # type: ignore[no-untyped-def]
    """Add the forces of all pairs; friction's springs go on by a step of `dt` s, where it is not 0."""
    d = nodes.x.shape[1]
    vectors, force, along = np.empty((2, 3)), np.empty(3), np.empty(3)
    pairs.normals[:, d + 1] = 0.0
    for q in range(len(pairs.i)):
        i, j = pairs.i[q], pairs.j[q]
        stiffness, depth, pull = _pressed(nodes, pairs, u, q, 0.0, vectors)
        if depth == 0.0 and mu == 0.0:
            continue
        n, way = vectors[0], vectors[1]
        for a in range(d):
            force[a] = stiffness * depth * n[a] - pull * way[a]
        if mu > 0.0:
            _rub(pairs, v, mu, dt, q, stiffness, depth, n, along, spent)
            for a in range(d):
                force[a] += pairs.drag[q, a]
        if depth > 0.0:
            for a in range(d):
                out[i, a] -= force[a] / nodes.volume[i]
                out[j, a] += force[a] / nodes.volume[j]


@njit(**INNER)
def _rub(pairs, v, mu, dt, q, stiffness, depth, n, along, spent):  # type: ignore[no-untyped-def]
    """Take friction's spring of pair q through a step, and book its work by the trapezoidal rule."""
    i, j, d, across, length = pairs.i[q], pairs.j[q], v.shape[1], 0.0, 0.0
    for a in range(d):
        along[a] = np.float64(v[j, a]) - np.float64(v[i, a])
    work = 0.0
    for a in range(d):
        work += pairs.drag[q, a] * along[a] * dt / 2
        pairs.slip[q, a] = pairs.slip[q, a] + dt * along[a] if depth > 0.0 else 0.0
        across += pairs.slip[q, a] * n[a]
    if depth > 0.0:
        for a in range(d):
            pairs.slip[q, a] -= across * n[a]
            length += pairs.slip[q, a] * pairs.slip[q, a]
        length = np.sqrt(length)
        if length > mu * depth:
            for a in range(d):
                pairs.slip[q, a] *= mu * depth / length
    for a in range(d):
        pairs.drag[q, a] = -stiffness * pairs.slip[q, a] if depth > 0.0 else 0.0
        work += pairs.drag[q, a] * along[a] * dt / 2
    spent[i] -= work / 2
    spent[j] -= work / 2


@cached_njit(error_model="numpy")
def pressed_pairs(nodes, pairs, u, held, rubbed, found):  # type: ignore[no-untyped-def]
    """Add the energies, J, of pairs to their nodes, and set `found` (p, 2 + d): stiffness, depth and normal."""
    d, vectors = nodes.x.shape[1], np.empty((2, 3))
    pairs.normals[:, d + 1] = 0.0
    for q in range(len(pairs.i)):
        stiffness, depth, _ = _pressed(nodes, pairs, u, q, 0.0, vectors)
        found[q, 0], found[q, 1] = stiffness, depth
        normal_energy, spring = stiffness * depth * depth / 2, 0.0
        for a in range(d):
            found[q, 2 + a] = vectors[0, a] if depth > 0.0 else 0.0
            spring += stiffness * pairs.slip[q, a] * pairs.slip[q, a] / 2
        for node in (pairs.i[q], pairs.j[q]):
            held[node] += (normal_energy + spring) / 2
            rubbed[node] += spring / 2


@cached_njit(error_model="numpy")
def geometry(nodes, pairs, u, slack, found):  # type: ignore[no-untyped-def]
    """Set `found` (p, 1 + d): stiffness, 0 of those farther apart than touch and `slack`, m, and normal of pairs."""
    d, vectors = nodes.x.shape[1], np.empty((2, 3))
    pairs.normals[:, d + 1] = 0.0
    for q in range(len(pairs.i)):
        found[q, 0], _, _ = _pressed(nodes, pairs, u, q, slack, vectors)
        for a in range(d):
            found[q, 1 + a] = vectors[0, a] if found[q, 0] > 0.0 else 0.0


@cached_njit(error_model="numpy")
def surface_nodes(nodes, found):  # type: ignore[no-untyped-def]
    """Set the mask `found` (n,) of nodes that lack bonds to one side, or nearly all."""
    d, vector, nothing = nodes.x.shape[1], np.empty(3), np.zeros((1, 3))
    for i in range(len(nodes.x)):
        normal(nodes, nothing, i, False, vector)
        square, count = 0.0, 0
        for a in range(d):
            square += vector[a] * vector[a]
        for b in range(nodes.start[i], nodes.start[i + 1]):
            count += nodes.intact[b]
        found[i] = square > LOOSE * LOOSE or count < 2 * d


@cached_njit(error_model="numpy")
def farthest(u, before, rows):  # type: ignore[no-untyped-def]
    """The square of the largest way, m^2, of these rows (k,) since they were at `before` (k, d)."""
    most = 0.0
    for at in range(len(rows)):
        square = 0.0
        for a in range(before.shape[1]):
            way = np.float64(u[rows[at], a]) - before[at, a]
            square += way * way
        most = max(most, square)
    return most
