"""Gradients fitted to the differences of a family, the strain from them, and Hooke's stress, in d = 2 or 3 dimensions.

The gradient H of a node is the weighted least-squares fit of eta = H xi to its bonds: xi is the bond, eta the
difference of values, the weight the neighbour's area, in a body its volume, over |xi|. It is exact for affine values,
at edges too. Symmetric tensors are (n, 3) in the order xx, yy, xy, in space (n, 6) with zz, xz, yz after these.

Curved gradients are fitted together with curvatures, so that they are exact for quadratic values at edges too: the
values of a family are fitted by w = H xi + xi' C xi / 2, with the same weights. At a node whose family is
even, the gradient is that of the fit without C. At an edge the latter is that of a place within the body, a third of a
horizon below the edge: too warm, where an edge is cooled.

Only families beside an edge along an axis are fitted so. At the steps of an edge across the rows of a lattice the
strains of the outermost bonds differ from row to row, which curvatures make worse: the hoop stress at the rim of a hot
disc is 4 % more than the exact one without them, and was 12 % less with them.
"""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BLOCK = 1 << 14  # nodes at a time, so that memory stays small
FLAT = 1e-6  # det / trace^d of a family's shape below which its bonds lie on a line or plane; a full one has d^-d
PAIRS = ((0, 0), (1, 1), (0, 1), (2, 2), (0, 2), (1, 2))
Array = NDArray[np.float64]
CURVED_BLOCK = 1 << 13  # nodes at a time
EVEN = 1e-6  # mean bond over the horizon: a family so even needs no curvature
WORST = 1e6  # condition of the equations: a family with a worse one has too few bonds for curvatures


def pairs_of(d: int) -> tuple[tuple[int, int], ...]:
    """The components of a symmetric tensor in d dimensions, in order."""
    return PAIRS[: d * (d + 1) // 2]


def gradients_of(
    position: NDArray[np.float64],
    area: NDArray[np.float64],
    values: NDArray[np.float64],
    start: NDArray[np.int64],
    neighbour: NDArray[np.int64],
    rows: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """The gradient (r, k, d) of nodal values (n, k), fitted to bonds; NaN where no bonds span the d dimensions.

    Nodes are at `position` (n, d), m, with areas (n,), m^2, or volumes, m^3. The bonds of `rows` (r,), by default all,
    lead to `neighbour` (b,); those of the i-th of them are start[i]:start[i + 1].
    """
    rows, d = np.arange(len(position)) if rows is None else rows, position.shape[1]
    gradients = np.full((len(rows), values.shape[1], d), np.nan)
    for first in range(0, len(rows), BLOCK):
        last = min(first + BLOCK, len(rows))
        near, count = neighbour[start[first] : start[last]], np.diff(start[first : last + 1])
        local_row, source = np.repeat(np.arange(last - first), count), np.repeat(rows[first:last], count)
        xi = (position[near] - position[source]).T
        weight = area[near] / reduce(np.hypot, xi)

        def total(
            product: NDArray[np.float64], row: NDArray[np.int64] = local_row, nodes: int = last - first
        ) -> NDArray:  # type: ignore[type-arg]
            return np.bincount(row, product, minlength=nodes).astype(float)  # of none, bincount makes integers

        shape = np.empty((d, d, last - first))
        for a, b in pairs_of(d):
            shape[a, b] = shape[b, a] = total(weight * xi[a] * xi[b])
        adjugate, det = _adjugate(shape)
        det[det <= FLAT * sum(shape[a, a] for a in range(d)) ** d] = np.nan
        for k in range(values.shape[1]):
            eta = weight * (values[near, k] - values[source, k])
            moment = [total(eta * x) for x in xi]
            for a in range(d):
                gradients[first:last, k, a] = sum(moment[b] * adjugate[a][b] for b in range(d)) / det
    return gradients


def _adjugate(shape: NDArray[np.float64]) -> tuple[list[list[NDArray[np.float64]]], NDArray[np.float64]]:
    """The adjugates of symmetric matrices (d, d, n), entry by entry, and their determinants (n,)."""
    if len(shape) == 2:
        (xx, xy), (_, yy) = shape
        return [[yy, -xy], [-xy, xx]], xx * yy - xy * xy
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = shape
    first = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy]
    mixed = xy * xz - xx * yz
    entries = [first, [first[1], xx * zz - xz * xz, mixed], [first[2], mixed, xx * yy - xy * xy]]
    return entries, xx * first[0] + xy * first[1] + xz * first[2]


def green(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Green's strain from displacement gradients (n, d, d)."""
    d, H = gradient.shape[-1], gradient.transpose(1, 2, 0)
    normal = [H[a, a] + sum(H[k, a] * H[k, a] for k in range(d)) / 2 for a in range(d)]
    return np.column_stack(
        [
            normal[a] if a == b else sum((H[k, a] * H[k, b] for k in range(d)), H[a, b] + H[b, a]) / 2
            for a, b in pairs_of(d)
        ]
    )


class Stiffness(NamedTuple):
    """The elastic constants of nodes, for stress from strain."""

    E: NDArray[np.float64]  # (n,) Young's modulus, Pa
    nu: NDArray[np.float64]  # (n,) Poisson's ratio of the material's model
    plane: str  # stress, strain or space
    C: NDArray[np.float64] | None = None  # (n, 13) of orthotropic nodes, Pa; NaN: of isotropic ones

    def at(self, rows: NDArray[np.int64]) -> Stiffness:
        """The constants of nodes `rows` (k,)."""
        return Stiffness(self.E[rows], self.nu[rows], self.plane, None if self.C is None else self.C[rows])

    def differs_from(self, row: int) -> NDArray[np.bool_]:
        """Whether nodes (n,) have other constants than the node `row`."""
        differs: NDArray[np.bool_] = (self.E[row] != self.E) | (self.nu != self.nu[row])
        if self.C is None:
            return differs
        C = np.nan_to_num(self.C)
        return np.asarray(differs | (C[row] != C).any(axis=1))


def hooke(
    strain: NDArray[np.float64], elastic: Stiffness, free: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """Stress, Pa, from strains: (n, 4), xx, yy, xy, zz, of (n, 3) in the plane, and (n, 6) of (n, 6) in space.

    `free` (n,) is the strain of no stress in a free body.
    """
    modulus, nu, plane = elastic[:3]
    if elastic.C is not None:
        isotropic = hooke(strain, elastic._replace(C=None), free)
        return np.where(np.isnan(elastic.C[:, :1]), isotropic, _stress_of_plies(strain, elastic))
    within = (1 + nu) * free if plane == "strain" else free
    within = within + within**2 / 2  # Green's
    if strain.shape[1] == 6:
        normal = np.array([a == b for a, b in PAIRS], dtype=float)
        strain = strain - np.reshape(within, (-1, 1)) * normal
        pressure = modulus * nu / ((1 + nu) * (1 - 2 * nu)) * (strain @ normal)
        return np.asarray(pressure[:, None] * normal + (modulus / (1 + nu))[:, None] * strain)
    xx, yy, xy = strain[:, 0] - within, strain[:, 1] - within, strain[:, 2]
    if plane == "stress":
        factor, out = modulus / (1 - nu**2), 0 * nu
        sxx, syy = factor * (xx + nu * yy), factor * (yy + nu * xx)
    else:
        factor, out = modulus / ((1 + nu) * (1 - 2 * nu)), nu
        sxx, syy = factor * ((1 - nu) * xx + nu * yy), factor * ((1 - nu) * yy + nu * xx)
    szz = out * (sxx + syy) - (0.0 if plane == "stress" else modulus * free)
    return np.column_stack([sxx, syy, modulus / (1 + nu) * xy, szz])


def _stress_of_plies(strain: NDArray[np.float64], elastic: Stiffness) -> NDArray[np.float64]:
    """The stress of `hooke` of orthotropic nodes."""
    assert elastic.C is not None
    C11, C12, C13, C16, C22, C23, C26, C33, C36, C44, C45, C55, C66 = elastic.C.T
    xx, yy, xy = strain.T[:3]
    if strain.shape[1] == 6:
        zz, xz, yz = strain.T[3:]
    else:
        zz = _thinning_of_plies(strain, elastic.C) if elastic.plane == "stress" else 0 * xx
        xz = yz = 0 * xx
    in_plane = (
        C11 * xx + C12 * yy + C13 * zz + 2 * C16 * xy,
        C12 * xx + C22 * yy + C23 * zz + 2 * C26 * xy,
        C16 * xx + C26 * yy + C36 * zz + 2 * C66 * xy,
        C13 * xx + C23 * yy + C33 * zz + 2 * C36 * xy,
    )
    if strain.shape[1] == 6:
        return np.column_stack([*in_plane, 2 * (C55 * xz + C45 * yz), 2 * (C45 * xz + C44 * yz)])
    return np.column_stack(in_plane)


def _thinning_of_plies(strain: NDArray[np.float64], C: NDArray[np.float64]) -> NDArray[np.float64]:
    """The strain zz (n,) of orthotropic nodes in plane stress."""
    return np.asarray(-(C[:, 2] * strain[:, 0] + C[:, 5] * strain[:, 1] + 2 * C[:, 8] * strain[:, 2]) / C[:, 7])


def thinning(
    strain: NDArray[np.float64], elastic: Stiffness, free: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """The out-of-plane strain zz (n,) that accompanies in-plane strains (n, 3); `free` is that of `hooke`."""
    if elastic.plane != "stress":
        return np.zeros(len(strain))
    nu = elastic.nu
    if elastic.C is not None:
        isotropic = thinning(strain, elastic._replace(C=None), free)
        return np.where(np.isnan(elastic.C[:, 0]), isotropic, _thinning_of_plies(strain, elastic.C))
    return (strain[:, 0] + strain[:, 1] - 2 * free) * (-nu / (1 - nu)) + free


def curved_gradients_of(
    position: Array, area: Array, values: Array, start: NDArray[np.int64], neighbour: NDArray[np.int64]
) -> Array:
    """The gradient (n, k, d) of nodal values (n, k); arguments are those of `gradients_of`.

    Elsewhere, and where bonds are too few for curvatures, it is that of the fit without them; NaN as there.
    """
    gradients, d = gradients_of(position, area, values, start, neighbour), position.shape[1]
    source = np.repeat(np.arange(len(position)), np.diff(start))
    xi = position[neighbour] - position[source]
    length = np.sqrt((xi**2).sum(axis=1))
    mean = np.column_stack([np.bincount(source, xi[:, a] / length, len(position)) for a in range(d)])
    uneven = np.flatnonzero((np.abs(mean) > EVEN * np.diff(start)[:, None]).sum(axis=1) == 1)
    for first in range(0, len(uneven), CURVED_BLOCK):
        rows = uneven[first : first + CURVED_BLOCK]
        bonds = np.flatnonzero(np.isin(source, rows))
        at, scale = np.searchsorted(rows, source[bonds]), float(length[bonds].mean())
        x, weight = xi[bonds] / scale, area[neighbour[bonds]] / length[bonds]
        terms = np.column_stack([x, *(x[:, a] * x[:, b] for a, b in pairs_of(d))])
        eta = values[neighbour[bonds]] - values[source[bonds]]
        moment_matrix, right = (_moments(at, weight, terms, factors, len(rows)) for factors in (terms, eta))
        good = np.linalg.cond(moment_matrix) < WORST
        gradients[rows[good]] = np.linalg.solve(moment_matrix[good], right[good])[:, :d].transpose(0, 2, 1) / scale
    return gradients


def _moments(at: NDArray[np.int64], weight: Array, terms: Array, factors: Array, count: int) -> Array:
    """Sums (count, t, o) over bonds of weight times a term (b, t) and another value (b, o)."""
    sums = np.empty((count, terms.shape[1], factors.shape[1]))
    for a, term in enumerate(terms.T):
        for b, value in enumerate(factors.T):
            sums[:, a, b] = np.bincount(at, weight * term * value, count)
    return sums
