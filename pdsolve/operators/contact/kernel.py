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
def _apart(nodes, u, i, j, a, moved):  # type: ignore[no-untyped-def]
    """Component a of the way from node i to node j, m."""
    way = nodes.x[j, a] - nodes.x[i, a]
    return way + (np.float64(u[j, a]) - np.float64(u[i, a])) if moved else way


@njit(**INNER)
def normal(nodes, u, i, moved, found):  # type: ignore[no-untyped-def]
    """Set `found` (d,) to the normal of node i, in the reference unless `moved`; returns how far it is from flat."""
    d, count = nodes.x.shape[1], 0
    for a in range(d):
        found[a] = 0.0
    for b in range(nodes.start[i], nodes.start[i + 1]):
        if nodes.intact[b]:
            j, square, count = nodes.near[b], 0.0, count + 1
            for a in range(d):
                square += _apart(nodes, u, i, j, a, moved) ** 2
            inverse = 1.0 / np.sqrt(square) if square > 0 else 0.0
            for a in range(d):
                found[a] -= _apart(nodes, u, i, j, a, moved) * inverse
    return abs(count - (FLAT if d == 2 else FLAT_IN_SPACE))


@njit(**INNER)
def _between(r, first, second, bent, other, n):  # type: ignore[no-untyped-def]
    """Set n (d,) to the normal of a pair `r` (d,) apart with these normals (d,); returns how much they face.

    `bent` and `other` are how far the nodes are from flat.
    """
    d, length, away, one, two, dot = len(r), 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(d):
        n[a] = first[a] if bent <= other else 0.0
        n[a] -= second[a] if other <= bent else 0.0
        length += n[a] * n[a]
        away += r[a] * r[a]
        one += first[a] * first[a]
        two += second[a] * second[a]
        dot += first[a] * second[a]
    loose = one < LOOSE * LOOSE or two < LOOSE * LOOSE
    facing = 1.0
    if not loose:
        facing = min(max((ASKEW - dot / np.sqrt(one * two)) / (ASKEW - FACING), 0.0), 1.0)
    if length < LOOSE * LOOSE:
        for a in range(d):
            n[a] = r[a] / np.sqrt(away)
    else:
        for a in range(d):
            n[a] /= np.sqrt(length)
    return facing


@njit(**INNER)
def _weight(t, h, d):  # type: ignore[no-untyped-def]
    """Weight of a pair at a distance t along the face, and its derivative, 1/m."""
    if d == 2:
        return (1.0 - t / h, -1.0 / h) if t < h else (0.0, 0.0)
    q = 1.0 - (t / (WIDE * h)) ** 2
    return (IN_SPACE * q * q, -4.0 * IN_SPACE * q * t / (WIDE * h) ** 2) if q > 0 else (0.0, 0.0)


@njit(**INNER)
def _pressed(nodes, pairs, u, q, slack, vectors):  # type: ignore[no-untyped-def]
    """Stiffness k w f, N/m, depth p, m, and pull along the face, N, of pair q; `vectors` are n, t / |t| and work space.

    All are 0 where the nodes are farther apart than the distance of touch and the `slack`, m.
    """
    i, j, d = pairs.i[q], pairs.j[q], nodes.x.shape[1]
    n, way, r = vectors[0, :d], vectors[1, :d], vectors[2, :d]
    square, reach = 0.0, pairs.h[q] * (1.0 if d == 2 else WIDE)
    for a in range(d):
        r[a] = nodes.x[j, a] - nodes.x[i, a] + (np.float64(u[j, a]) - np.float64(u[i, a]))
        square += r[a] * r[a]
    if square >= reach * reach + (pairs.touch[q] + slack) ** 2:
        return 0.0, 0.0, 0.0
    one, two = pairs.first[q], pairs.second[q]
    _learn(nodes, pairs, u, one)
    _learn(nodes, pairs, u, two)
    first, second = pairs.normals[one], pairs.normals[two]
    facing = _between(r, first, second, first[d], second[d], n)
    gap = 0.0
    for a in range(d):
        gap += r[a] * n[a]
    if facing == 0.0 or gap >= pairs.touch[q] + slack or gap <= 0.0:
        return 0.0, 0.0, 0.0
    t = np.sqrt(max(square - gap * gap, 0.0))
    w, slope = _weight(t, pairs.h[q], d)
    for a in range(d):
        way[a] = (r[a] - gap * n[a]) / t if t > ROUND_OFF * pairs.h[q] else 0.0
    depth = pairs.touch[q] - gap
    if w == 0.0 or depth <= -slack:
        return 0.0, 0.0, 0.0
    return pairs.k[q] * w * facing, depth, pairs.k[q] * facing * slope / 2 * depth * depth


@njit(**INNER)
def _learn(nodes, pairs, u, number):  # type: ignore[no-untyped-def]
    """Find the normal of a node of the pairs, and how far from flat it is, if that is not known yet."""
    found, d = pairs.normals[number], nodes.x.shape[1]
    if found[d + 1] == 0.0:
        found[d] = normal(nodes, u, pairs.rows[number], True, found)
        found[d + 1] = 1.0


@cached_njit(error_model="numpy")
def nearer(nodes, pairs):  # type: ignore[no-untyped-def]
    """Let pairs touch at the gap that they had in the reference, if it was less; never those that were back to back."""
    vectors, nothing, d = np.empty((6, 3)), np.zeros((1, 3)), nodes.x.shape[1]
    for q in range(len(pairs.i)):
        reach = pairs.h[q] * (1.0 if d == 2 else WIDE)
        near = reach * reach + pairs.touch[q] ** 2
        pairs.touch[q] = max(
            min(pairs.touch[q], _gap_before(nodes, nothing, pairs.i[q], pairs.j[q], near, vectors)), 0.0
        )


@njit(**INNER)
def _gap_before(nodes, u, i, j, near, vectors):  # type: ignore[no-untyped-def]
    """The gap between two nodes in the reference, m, of bonds as they are now; infinite farther than root `near`, m^2.

    It is negative between nodes that are back to back.
    """
    d = nodes.x.shape[1]
    r, first, second, n = vectors[2, :d], vectors[3, :d], vectors[4, :d], vectors[5, :d]
    square = 0.0
    for a in range(d):
        r[a] = nodes.x[j, a] - nodes.x[i, a]
        square += r[a] * r[a]
    if square >= near:
        return np.inf
    bent, other = normal(nodes, u, i, False, first), normal(nodes, u, j, False, second)
    _between(r, first, second, bent, other, n)
    gap = 0.0
    for a in range(d):
        gap += r[a] * n[a]
    return gap


@cached_njit(error_model="numpy")
def add_forces(nodes, pairs, u, v, mu, dt, out, spent):  # type: ignore[no-untyped-def]
    """Add the forces of all pairs; friction's springs go on by a step of `dt` s, where it is not 0."""
    d = nodes.x.shape[1]
    vectors, force, along = np.empty((6, 3)), np.empty(3), np.empty(3)
    pairs.normals[:, d + 1] = 0.0
    for q in range(len(pairs.i)):
        i, j = pairs.i[q], pairs.j[q]
        stiffness, depth, pull = _pressed(nodes, pairs, u, q, 0.0, vectors)
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
    d, vectors = nodes.x.shape[1], np.empty((6, 3))
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
    d, vectors = nodes.x.shape[1], np.empty((6, 3))
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
