"""Penalty forces of pairs of surface nodes with a normal field, and Coulomb friction: compiled loops.

The normal N of a node is minus the sum of the vectors to its nearest nodes that bonds join to it, over their lengths in
the reference: 0 inside a body, it points out of a face. The n of a pair is that of the flatter node or, of two alike,
(N_i - N_j) / |N_i - N_j|, or the line between two loose nodes: at a corner N is that of neither face. With r from i to
j, g = r . n, t = r - g n and the depth p = max(d - g, 0) its energy is k w(t) f p^2 / 2. The weights w of the nodes
that a node meets add up to 1 over a flat face, so that nodes do not interlock: in the plane w = 1 - |t| / h. f is 0
for normals that point the same way, 1 where they face each other. d is the distance of touch or, for nodes that began
nearer, what it was then; g is less by how much deeper than half a spacing the nodes of two bodies lie under their drawn
surfaces, see `pdsolve.operators.contact.drawn_faces`. The force is the gradient of the energy at a constant n; it is
equal and opposite.

Friction: a spring as stiff as that of the pair, which slips where it is longer than mu p.

Restitution e below 1: the force is k w f p up to the largest depth P, and falls from there with the slope k w f / e^2;
of the energy k w f P^2 / 2 the share e^2 comes back (O. R. Walton, R. L. Braun, J. Rheol. 30, 1986, 949-980).

    x, u   (n, d) places and displacements, m    k        (p,) stiffness of a pair, N/m
    h      (p,) reach of a pair's weight, m      touch    (p,) distance of touch, m
    slip   (p, d) of friction's spring, m        drag     (p, d) its force on j one step ago, N
    out    (n, d) force densities, N/m^3         spent    (n,) minus work of friction's springs, J
    most   (p,) largest depth of this touch, m   short    (p,) what the force is less than k w f p, N
    lost   (n,) minus work of what it is less, J
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit

LOOSE = 0.5  # length of a normal that is none
FACING, ASKEW = 0.3, 0.8  # cosine of two normals below which they face each other, above which they do not
FLAT, FLAT_IN_SPACE = 5, 17  # nearest nodes of one in a flat face: of 8 in the plane, of 26 in space
WIDE = 2.0  # spacings: reach of a weight in space
IN_SPACE = 0.75 / np.pi  # (1 - t^2 / 4 h^2)^2 summed over a square lattice of spacing h, inverted; to 1.5 %
KINK = 1e-6  # of a spacing: nodes that near to where the weight has a kink do not pull along the face
ROUND_OFF = 1e-12  # of a spacing


class Nodes(NamedTuple):
    """Nodes and the nearest nodes that bonds join to them."""

    x: NDArray[np.float64]  # (n, d) m
    start: NDArray[np.int64]  # (n + 1,)
    near: NDArray[np.int32]  # (b,)
    inverse: NDArray[np.float64]  # (b,) 1 over the length, 1/m
    intact: NDArray[np.bool_]  # (b,)


class Faces(NamedTuple):
    """Nodes of pairs, m of them, and the nearest nodes that bonds still join to them, b in all."""

    rows: NDArray[np.int64]  # (m,)
    start: NDArray[np.int64]  # (m + 1,)
    near: NDArray[np.int64]  # (b,) rows
    inverse: NDArray[np.float64]  # (b,) 1 over the reference length, 1/m
    still: NDArray[np.float64]  # (m, 3) normals in the reference, z 0 in the plane
    bent: NDArray[np.float64]  # (m,) how far from flat
    now: NDArray[np.float64]  # (m, 3) normals now
    known: NDArray[np.bool_]  # (m,) which of these are


class PairList(NamedTuple):
    """Pairs of nodes that may touch, p of them, in order."""

    i: NDArray[np.int64]  # (p,)
    j: NDArray[np.int64]  # (p,)
    k: NDArray[np.float64]  # (p,) N/m
    h: NDArray[np.float64]  # (p,) m
    touch: NDArray[np.float64]  # (p,) m
    beyond: NDArray[np.float64]  # (p,) m, how much deeper than half a spacing both are under their drawn surfaces
    apart: NDArray[np.float64]  # (p, 3) from i to j in the reference, m, z 0 in the plane
    slip: NDArray[np.float64]  # (p, d) m
    drag: NDArray[np.float64]  # (p, d) N
    most: NDArray[np.float64]  # (p,) m
    short: NDArray[np.float64]  # (p,) N
    first: NDArray[np.int64]  # (p,) number of i among the nodes of faces
    second: NDArray[np.int64]  # (p,) number of j
    faces: Faces


class Pushes(NamedTuple):
    """Pairs of n nodes, what their forces need, and how far nodes may move before others are to be found."""

    pairs: PairList
    each: NDArray[np.float64]  # (n,) 1 over the volume of a node, 1/m^d
    rows: NDArray[np.int64]  # (k,) of surface nodes
    before: NDArray[np.float64]  # (k, d) m, where they were when pairs were found
    limit: float  # m^2, square of the way
    mu: float  # coefficient of friction
    e: float  # coefficient of restitution
    friction_energy: NDArray[np.float64]  # (n,) see `spent` above, J
    lost: NDArray[np.float64]  # (n,) J


@njit(forceinline=True, **INNER)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True, **INNER)
def _three(values, row):  # type: ignore[no-untyped-def]
    return values[row, 0], values[row, 1], values[row, 2]


@cached_njit(error_model="numpy")
def learn_faces(nodes, faces):  # type: ignore[no-untyped-def]
    """Set the normals of the reference, and how far nodes are from flat."""
    d, vector = nodes.x.shape[1], np.zeros(3)
    for m in range(len(faces.rows)):
        faces.bent[m] = normal(nodes, faces.rows[m], vector)
        if faces.start[m] < faces.start[m + 1]:
            for a in range(d):
                faces.still[m, a] = vector[a]


@njit(forceinline=True, **INNER)
def normal(nodes, i, vector):  # type: ignore[no-untyped-def]
    """Set `vector` (d,) to the normal of node i in the reference; returns how far it is from flat."""
    d, count = nodes.x.shape[1], 0
    for a in range(d):
        vector[a] = 0.0
    for b in range(nodes.start[i], nodes.start[i + 1]):
        if nodes.intact[b]:
            j, count = nodes.near[b], count + 1
            for a in range(d):
                vector[a] -= (nodes.x[j, a] - nodes.x[i, a]) * nodes.inverse[b]
    return abs(count - (FLAT if d == 2 else FLAT_IN_SPACE))


@njit(forceinline=True, **INNER)
def _normal_now(faces, u, m):  # type: ignore[no-untyped-def]
    """The normal (x, y, z) of the m-th node of the faces, found once a step."""
    if not faces.known[m]:
        i, space = faces.rows[m], u.shape[1] == 3
        x, y, z = _three(faces.still, m)
        ux, uy, uz = np.float64(u[i, 0]), np.float64(u[i, 1]), np.float64(u[i, 2]) if space else 0.0
        for b in range(faces.start[m], faces.start[m + 1]):
            j, inverse = faces.near[b], faces.inverse[b]
            x -= (np.float64(u[j, 0]) - ux) * inverse
            y -= (np.float64(u[j, 1]) - uy) * inverse
            if space:
                z -= (np.float64(u[j, 2]) - uz) * inverse
        faces.now[m, 0], faces.now[m, 1], faces.now[m, 2] = x, y, z
        faces.known[m] = True
    return _three(faces.now, m)


@njit(forceinline=True, **INNER)
def _between(r, first, second, bent_first, bent_second):  # type: ignore[no-untyped-def]
    """A vector (x, y, z) along the normal of a pair `r` apart with these normals, all (x, y, z), and its square.

    `bent_first` and `bent_second` are how far the nodes are from flat.
    """
    x, y, z = 0.0, 0.0, 0.0
    if bent_first <= bent_second:
        x, y, z = first
    if bent_second <= bent_first:
        x, y, z = x - second[0], y - second[1], z - second[2]
    square = x * x + y * y + z * z
    if square < LOOSE * LOOSE:
        return r[0], r[1], r[2], _dot(r, r)
    return x, y, z, square


@njit(forceinline=True, **INNER)
def _facing(first, second):  # type: ignore[no-untyped-def]
    """How much two normals face each other, 0 to 1."""
    dot = _dot(first, second)
    if dot <= 0.0:
        return 1.0
    first_square, second_square = _dot(first, first), _dot(second, second)
    if first_square < LOOSE * LOOSE or second_square < LOOSE * LOOSE:
        return 1.0
    return min(max((ASKEW - dot / np.sqrt(first_square * second_square)) / (ASKEW - FACING), 0.0), 1.0)


@njit(forceinline=True, **INNER)
def _weight(t, h, d):  # type: ignore[no-untyped-def]
    """Weight of a pair at a distance t along the face, and its derivative over t, 1/m^2: 0 where it has a kink."""
    if d == 2:
        slope = -1.0 / (h * t) if KINK * h < t < (1.0 - KINK) * h else 0.0
        return (1.0 - t / h, slope) if t < h else (0.0, 0.0)
    q = 1.0 - (t / (WIDE * h)) ** 2
    return (IN_SPACE * q * q, -4.0 * IN_SPACE * q / (WIDE * h) ** 2) if q > 0 else (0.0, 0.0)


@njit(forceinline=True, **INNER)
def _pressed(pairs, u, q, slack):  # type: ignore[no-untyped-def]
    """Stiffness k w f, N/m, depth p, m, n, and pull along the face (x, y, z), N, of pair q.

    All are 0 where the nodes are farther apart than the distance of touch and the `slack`, m.
    """
    nothing = (0.0, 0.0, 0.0)
    d, i, j, far, h = u.shape[1], pairs.i[q], pairs.j[q], pairs.touch[q] + slack, pairs.h[q]
    beyond = pairs.beyond[q]
    x, y, z = _three(pairs.apart, q)
    x += np.float64(u[j, 0]) - np.float64(u[i, 0])
    y += np.float64(u[j, 1]) - np.float64(u[i, 1])
    if d == 3:
        z += np.float64(u[j, 2]) - np.float64(u[i, 2])
    r, square, reach = (x, y, z), x * x + y * y + z * z, h * (1.0 if d == 2 else WIDE)
    if square >= reach * reach + (far + abs(beyond)) ** 2:
        return 0.0, 0.0, nothing, nothing
    first_face, second_face, faces = pairs.first[q], pairs.second[q], pairs.faces
    first, second = _normal_now(faces, u, first_face), _normal_now(faces, u, second_face)
    x, y, z, length = _between(r, first, second, faces.bent[first_face], faces.bent[second_face])
    along = r[0] * x + r[1] * y + r[2] * z
    near = along - beyond * np.sqrt(length) if beyond != 0.0 else along  # of half a spacing under both surfaces
    if near * near >= far * far * length or square * length - along * along >= reach * reach * length:
        return 0.0, 0.0, nothing, nothing
    if near <= 0.0:
        pairs.touch[q] = 0.0
        return 0.0, 0.0, nothing, nothing
    facing, inverse = _facing(first, second), 1.0 / np.sqrt(length)
    x, y, z, gap = x * inverse, y * inverse, z * inverse, along * inverse
    across = r[0] - gap * x, r[1] - gap * y, r[2] - gap * z
    w, slope = _weight(np.sqrt(_dot(across, across)), h, d)
    if facing == 0.0 or w == 0.0:
        return 0.0, 0.0, nothing, nothing
    depth, k = pairs.touch[q] - gap + beyond, pairs.k[q] * facing
    pull = k * slope / 2 * depth * depth
    return k * w, depth, (x, y, z), (across[0] * pull, across[1] * pull, across[2] * pull)


@cached_njit(error_model="numpy")
def nearer(pairs):  # type: ignore[no-untyped-def]
    """Let pairs touch at the gap that they had in the reference, if it was less; never those that were back to back."""
    d, faces = pairs.slip.shape[1], pairs.faces
    for q in range(len(pairs.i)):
        reach, r = pairs.h[q] * (1.0 if d == 2 else WIDE), _three(pairs.apart, q)
        if _dot(r, r) < reach * reach + (pairs.touch[q] + abs(pairs.beyond[q])) ** 2:
            first_face, second_face = pairs.first[q], pairs.second[q]
            first, second = _three(faces.still, first_face), _three(faces.still, second_face)
            x, y, z, length = _between(r, first, second, faces.bent[first_face], faces.bent[second_face])
            gap = (r[0] * x + r[1] * y + r[2] * z) / np.sqrt(length) - pairs.beyond[q]
            pairs.touch[q] = max(min(pairs.touch[q], gap), 0.0)


@cached_njit(error_model="numpy")
def ease(pairs, u, pair_energy, lost):  # type: ignore[no-untyped-def]
    """Let pairs touch nearer where they would hold more than the energies `pair_energy` (p,), J: none comes of nothing.

    Nodes that were inside a body until its bonds broke are often nearer than the distance of touch. What a pair holds
    less than before is added to what its nodes have `lost` (n,), J.
    """
    pairs.faces.known[:] = False
    for q in range(len(pairs.i)):
        stiffness, depth, _, _ = _pressed(pairs, u, q, 0.0)
        now = stiffness * depth * depth / 2
        if now > pair_energy[q]:
            more = depth - np.sqrt(2.0 * pair_energy[q] / stiffness)
            if more > ROUND_OFF * pairs.h[q]:
                pairs.touch[q] -= more
                pairs.most[q] = max(pairs.most[q] - more, 0.0)
        elif pair_energy[q] - now > ROUND_OFF * pair_energy[q]:
            lost[pairs.i[q]] += (pair_energy[q] - now) / 2
            lost[pairs.j[q]] += (pair_energy[q] - now) / 2


@cached_njit(error_model="numpy")
def add_forces(pairs, inverse_volume, u, v, mu, e, dt, out, friction_energy, lost):  # type: ignore[no-untyped-def]
    """Add the forces of all pairs; friction's springs and depths go on by a step of `dt` s.

    `inverse_volume` (n,) is 1 over the volume of a node, 1/m^d.
    """
    _push(pairs, inverse_volume, u, v, mu, e, dt, out, friction_energy, lost)


@njit(**INNER)
def push_anew(pushes, u, v, dt, out):  # type: ignore[no-untyped-def]
    """Set the forces of `add_forces` on the nodes of pairs; returns False where pairs are to be found anew."""
    if _farthest(u, pushes.before, pushes.rows) > pushes.limit:
        return False
    for i in pushes.pairs.faces.rows:
        for a in range(u.shape[1]):
            out[i, a] = 0.0
    _push(pushes.pairs, pushes.each, u, v, pushes.mu, pushes.e, dt, out, pushes.friction_energy, pushes.lost)
    return True


@njit(**INNER)
def _push(pairs, inverse_volume, u, v, mu, e, dt, out, friction_energy, lost):  # type: ignore[no-untyped-def]
    """The forces of `add_forces`."""
    d = u.shape[1]
    pairs.faces.known[:] = False
    if mu == 0.0 and e == 1.0:
        _push_alone(pairs, inverse_volume, u, out)
        return
    for q in range(len(pairs.i)):
        i, j = pairs.i[q], pairs.j[q]
        stiffness, depth, n, pull = _pressed(pairs, u, q, 0.0)
        felt = _give(pairs, v, e, dt, q, stiffness, depth, n, lost) if e < 1.0 else depth
        if mu > 0.0:
            _rub(pairs, v, mu, dt, q, stiffness, felt, n, friction_energy)
        if depth > 0.0:
            push, inverse_i, inverse_j = stiffness * felt, inverse_volume[i], inverse_volume[j]
            for a in range(d):
                force = push * n[a] - pull[a] + (pairs.drag[q, a] if mu > 0.0 else 0.0)
                out[i, a] -= force * inverse_i
                out[j, a] += force * inverse_j


@njit(**INNER)
def _push_alone(pairs, inverse_volume, u, out):  # type: ignore[no-untyped-def]
    """The forces of `add_forces` without friction and restitution."""
    for m in range(len(pairs.faces.rows)):
        _normal_now(pairs.faces, u, m)
    for q in range(len(pairs.i)):
        stiffness, depth, n, pull = _pressed(pairs, u, q, 0.0)
        if depth > 0.0:
            i, j = pairs.i[q], pairs.j[q]
            push, inverse_i, inverse_j = stiffness * depth, inverse_volume[i], inverse_volume[j]
            for a in range(u.shape[1]):
                force = push * n[a] - pull[a]
                out[i, a] -= force * inverse_i
                out[j, a] += force * inverse_j


@njit(forceinline=True, **INNER)
def _give(pairs, v, e, dt, q, stiffness, depth, n, lost):  # type: ignore[no-untyped-def]
    """Take the largest depth of pair q through a step; returns the depth whose force acts, m.

    What the force is less than the spring's is booked by the trapezoidal rule.
    """
    i, j, along = pairs.i[q], pairs.j[q], 0.0
    for a in range(v.shape[1]):
        along += (np.float64(v[j, a]) - np.float64(v[i, a])) * n[a]
    pairs.most[q] = max(pairs.most[q], depth) if depth > 0.0 else 0.0
    felt, before = 0.0, pairs.short[q]
    if depth > 0.0:
        felt = min(depth, max(depth - (1.0 - e * e) * pairs.most[q], 0.0) / (e * e))
    pairs.short[q] = stiffness * (depth - felt) if depth > 0.0 else 0.0
    work = (before + pairs.short[q]) * along * dt / 2
    lost[i] += work / 2
    lost[j] += work / 2
    return felt


@njit(forceinline=True, **INNER)
def _rub(pairs, v, mu, dt, q, stiffness, depth, n, friction_energy):  # type: ignore[no-untyped-def]
    """Take friction's spring of pair q through a step, and book its work by the trapezoidal rule."""
    i, j, d, across, square, work = pairs.i[q], pairs.j[q], v.shape[1], 0.0, 0.0, 0.0
    for a in range(d):
        along = np.float64(v[j, a]) - np.float64(v[i, a])
        work += pairs.drag[q, a] * along * dt / 2
        pairs.slip[q, a] = pairs.slip[q, a] + dt * along if depth > 0.0 else 0.0
        across += pairs.slip[q, a] * n[a]
    for a in range(d):
        pairs.slip[q, a] -= across * n[a]
        square += pairs.slip[q, a] * pairs.slip[q, a]
    cut = mu * depth / np.sqrt(square) if square > (mu * depth) ** 2 else 1.0
    for a in range(d):
        pairs.slip[q, a] *= cut
        pairs.drag[q, a] = -stiffness * pairs.slip[q, a]
        work += pairs.drag[q, a] * (np.float64(v[j, a]) - np.float64(v[i, a])) * dt / 2
    friction_energy[i] -= work / 2
    friction_energy[j] -= work / 2


@cached_njit(error_model="numpy")
def pressed_pairs(pairs, u, node_energy, rubbed, pair_state):  # type: ignore[no-untyped-def]
    """Add the energies, J, of pairs to their nodes, and set `pair_state` (p, 2 + d): stiffness, depth and normal."""
    d = u.shape[1]
    pairs.faces.known[:] = False
    for q in range(len(pairs.i)):
        stiffness, depth, n, _ = _pressed(pairs, u, q, 0.0)
        pair_state[q, 0], pair_state[q, 1] = stiffness, depth
        normal_energy, spring = stiffness * depth * depth / 2, 0.0
        for a in range(d):
            pair_state[q, 2 + a] = n[a]
            spring += stiffness * pairs.slip[q, a] * pairs.slip[q, a] / 2
        for node in (pairs.i[q], pairs.j[q]):
            node_energy[node] += (normal_energy + spring) / 2
            rubbed[node] += spring / 2


@cached_njit(error_model="numpy")
def geometry(pairs, u, slack, pair_geometry):  # type: ignore[no-untyped-def]
    """Set `pair_geometry` (p, 1 + d): stiffness, 0 if farther apart than touch and `slack`, m, and normal of pairs."""
    pairs.faces.known[:] = False
    for q in range(len(pairs.i)):
        pair_geometry[q, 0], _, n, _ = _pressed(pairs, u, q, slack)
        for a in range(u.shape[1]):
            pair_geometry[q, 1 + a] = n[a]


@cached_njit(error_model="numpy")
def facing_to(faces, u, towards, facing):  # type: ignore[no-untyped-def]
    """Set `facing` (m,) to how much the normals of these nodes face vectors (m, 3), 0 to 1."""
    faces.known[:] = False
    for m in range(len(faces.rows)):
        facing[m] = _facing(_normal_now(faces, u, m), _three(towards, m))


@cached_njit(error_model="numpy")
def surface_nodes(nodes, surface):  # type: ignore[no-untyped-def]
    """Set the mask `surface` (n,) of nodes that lack bonds to one side, or nearly all."""
    d, vector = nodes.x.shape[1], np.empty(3)
    for i in range(len(nodes.x)):
        normal(nodes, i, vector)
        square, count = 0.0, 0
        for a in range(d):
            square += vector[a] * vector[a]
        for b in range(nodes.start[i], nodes.start[i + 1]):
            count += nodes.intact[b]
        surface[i] = square > LOOSE * LOOSE or count < 2 * d


@cached_njit(error_model="numpy")
def farthest(u, before, rows):  # type: ignore[no-untyped-def]
    """The square of the largest way, m^2, of these rows (k,) since they were at `before` (k, d)."""
    return _farthest(u, before, rows)


@njit(**INNER)
def _farthest(u, before, rows):  # type: ignore[no-untyped-def]
    most = 0.0
    for at in range(len(rows)):
        square = 0.0
        for a in range(before.shape[1]):
            way = np.float64(u[rows[at], a]) - before[at, a]
            square += way * way
        most = max(most, square)
    return most
