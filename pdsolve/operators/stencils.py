"""Stencils of the linear peridynamic operator on a lattice, by weighted least squares: in the plane and in space.

Where a neighbourhood is whole, L u = int_H c(xi) (xi x xi) / |xi|^3 (u(x + xi) - u(x)) dV, or for diffusion
int_H k(xi) (u(x + xi) - u(x)) dV. With u(x + xi) = p(xi)^T a, p all monomials up to the second order, and a from
weighted least squares at chosen nodes of the neighbourhood, it is a sum over these nodes: L u = sum_k theta_k u_k with
theta_k = sum_m J_m [A^-1 B]_mk, J_m the operator of the monomial m alone. Odd monomials and the constant give nothing,
and with calibrated constants J depends on neither profile nor horizon: it is made of 2 C11 and 2 C66, or is 2 D. So
quadratics are exact, and waves have the dispersion of the stencil, not that of the horizon.

Source: A. Shojaei, A. Hermann, C. J. Cyron, P. Seleson, S. A. Silling, Comput. Methods Appl. Mech. Eng. 391 (2022)
114544; G. Ongaro, A. Shojaei, F. Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J. Fract. 244 (2023).

    xi      (k, d) offsets of nodes, in spacings         J       (s, w, w) of monomials of second order, w components
    theta   (k, w, w) times the spacing squared          alpha   reach of the Gaussian weight over that of the nodes

What a sum over nodes does to a wave exp(i k.x) is -S(k); it is stable only where S has no negative eigenvalue. Unit
weights, and wide ones, have: they are refused.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF

PARTS = {2: 4, 3: 3}  # auxiliary spacings in a horizon: 49 nodes of a disc, 123 of a ball
ALPHAS = (0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2)  # tried in turn
SOFT = 0.9  # of the smallest eigenvalue of the longest waves: a stencil that has less for others is not taken
WAVES = {2: 60, 3: 24}  # looked at along each axis: a multiple of those that sublattices have
NEGATIVE = 1e-12  # of the largest eigenvalue: less is round-off
COMPACT = 2.0  # spacings: reach of the stencil that ties sublattices together
NEAR, SHARE = 0.3, 0.05  # its alpha, and how much of it there is


class StencilError(ValueError):
    """An unstable stencil, or one with too few nodes; one sentence."""


class Stencil(NamedTuple):
    """A sum over nodes of a lattice; see the table above."""

    xi: NDArray[np.int64]
    theta: NDArray[np.float64]
    least: float  # of all waves but those of no change: smallest eigenvalue of S, times the spacing squared
    most: float  # the largest


def ball(radius: float, dimension: int) -> NDArray[np.int64]:
    """Lattice points (k, d) within `radius` spacings of the origin, in order, including it."""
    reach = np.arange(-int(radius * (1 + ROUND_OFF)), int(radius * (1 + ROUND_OFF)) + 1)
    points = np.stack(np.meshgrid(*dimension * [reach], indexing="ij"), axis=-1).reshape(-1, dimension)
    return np.asarray(points[(points**2).sum(axis=1) <= (radius * (1 + ROUND_OFF)) ** 2])


def chosen(ratio: float, dimension: int, parts: int | None = None) -> NDArray[np.int64]:
    """Nodes (k, d) of a family of horizon over spacing `ratio` nearest to those of an auxiliary lattice.

    It has `parts` spacings in a horizon. Of equally near nodes all are taken, so that the stencil is symmetric.
    """
    parts = parts or PARTS[dimension]
    family, nearest = ball(ratio, dimension), set()
    for place in ball(parts, dimension) * (ratio / parts):
        away = np.linalg.norm(family - place, axis=1)
        nearest |= set(map(tuple, family[away <= away.min() + ROUND_OFF * ratio].tolist()))
    return np.array(sorted(nearest), dtype=np.int64)


def monomials(dimension: int) -> NDArray[np.int64]:
    """Exponents (m, d): of 1, x, y, ..., x^2, y^2, ..., x y, ..."""
    axes = np.eye(dimension, dtype=np.int64)
    mixed = [axes[i] + axes[j] for i, j in itertools.combinations(range(dimension), 2)]
    return np.array([np.zeros(dimension, dtype=np.int64), *axes, *2 * axes, *mixed])


def coefficients(xi: NDArray[np.int64], alpha: float | None) -> NDArray[np.float64]:
    """A^-1 B (m, k): coefficients of all monomials from nodal values, in spacings; `alpha` None: unit weights.

    Raises StencilError for too few nodes.
    """
    powers, reach = monomials(xi.shape[1]), np.sqrt((xi**2).sum(axis=1).max())
    p = np.prod((xi[:, None, :] / reach) ** powers, axis=2)
    w = np.ones(len(xi)) if alpha is None else np.exp(-(xi**2).sum(axis=1) / (alpha * reach) ** 2)
    if np.linalg.matrix_rank(p) < len(powers):
        raise StencilError(f"stencil: {len(xi)} nodes are too few for all {len(powers)} monomials; use more")
    # by the root of the weights, as squares of them would cost half of the digits
    root = np.sqrt(w)
    matrix = np.linalg.pinv(root[:, None] * p) * root
    return np.asarray(matrix / reach ** powers.sum(axis=1)[:, None])


def elastic(c11: float, c66: float, dimension: int) -> NDArray[np.float64]:
    """J of a solid of bonds, Pa: of x^2 diag(2 C11, 2 C66, ...), of x y 2 C66 in (1, 2) and (2, 1)."""
    J = [2 * c66 * np.eye(dimension) for _ in range(dimension)]
    for axis in range(dimension):
        J[axis][axis, axis] = 2 * c11
    for i, j in itertools.combinations(range(dimension), 2):
        mixed = np.zeros((dimension, dimension))
        mixed[i, j] = mixed[j, i] = 2 * c66
        J.append(mixed)
    return np.array(J)


def diffusion(diffusivity: float, dimension: int) -> NDArray[np.float64]:
    """J of diffusion, m^2/s: 2 D of squares, nothing of mixed monomials."""
    J = np.zeros((len(monomials(dimension)) - 1 - dimension, 1, 1))
    J[:dimension] = 2 * diffusivity
    return J


def stencil(xi: NDArray[np.int64], J: NDArray[np.float64], alpha: float | None) -> Stencil:
    """The stencil of these nodes and weights. Raises StencilError if it is not stable."""
    return _checked(*_summed(xi, J, alpha), f"alpha {alpha}" if alpha else "unit weights")


def stencil_of(ratio: float, J: NDArray[np.float64], dimension: int) -> Stencil:
    """The stencil for a horizon over spacing `ratio`, with the widest stable weight. Raises StencilError.

    Stability includes a margin: no wave may be much softer than the longest ones. Nodes two and more spacings apart
    belong to independent sublattices. A share of a compact stencil, also exact for quadratics, couples them. (Including
    nearest nodes in the stencil would make the symbol negative.)
    """
    usual = PARTS[dimension]
    # an auxiliary lattice that coincides with nodes if possible
    xi = chosen(ratio, dimension, next((n for n in (usual, 3) if ratio >= n and ratio % n == 0), usual))
    apart = int(np.gcd.reduce(xi, axis=None))
    waves = 2 * np.pi / WAVES[dimension] * np.eye(dimension)  # the longest ones considered
    for alpha in ALPHAS:
        try:
            candidate = stencil(xi // apart, J, alpha)
        except StencilError as error:
            refused = error
            continue
        if candidate.least < SOFT * np.linalg.eigvalsh(symbols(candidate.xi, candidate.theta, waves)).min():
            refused = StencilError(
                f"stencil: {len(xi)} nodes with alpha {alpha} are soft to some wave; use a smaller alpha"
            )
        elif apart == 1:
            return candidate
        else:
            parts = (1 - SHARE, *_summed(xi, J, alpha)), (SHARE, *_summed(ball(COMPACT, dimension), J, NEAR))
            offsets = np.unique(np.concatenate([part_offsets for _, part_offsets, _ in parts]), axis=0)
            number = {tuple(offset): k for k, offset in enumerate(offsets.tolist())}
            theta = np.zeros((len(offsets), *J.shape[1:]))
            for share, part_offsets, sums in parts:
                theta[[number[tuple(offset)] for offset in part_offsets.tolist()]] += share * sums
            return _checked(offsets, theta, f"alpha {alpha}")
    raise refused


def longest(stencil: Stencil, spacing: float, rho: float) -> float:
    """The longest stable step, s, for the motion of a solid of density `rho`."""
    return float(2 * spacing * np.sqrt(rho / stencil.most))


def _summed(
    xi: NDArray[np.int64], J: NDArray[np.float64], alpha: float | None
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    rows, d = coefficients(xi, alpha), xi.shape[1]
    return xi, np.einsum("mab,mk->kab", J, rows[1 + d :])


def symbols(xi: NDArray[np.int64], theta: NDArray[np.float64], waves: NDArray[np.float64]) -> NDArray[np.float64]:
    """S (q, w, w) of waves (q, d), in radians per spacing, times the spacing squared."""
    return np.asarray(-np.einsum("qk,kab->qab", np.cos(waves @ xi.T), theta))


def _checked(xi: NDArray[np.int64], theta: NDArray[np.float64], words: str) -> Stencil:
    """The stencil with its eigenvalues for waves of all lengths. Raises StencilError if it is not stable."""
    d = xi.shape[1]
    along = 2 * np.pi / WAVES[d] * np.arange(WAVES[d])
    half = along[: WAVES[d] // 2 + 1]  # S(-k) = S(k)
    waves = np.stack(np.meshgrid(half, *(d - 1) * [along], indexing="ij"), axis=-1).reshape(-1, d)[1:]
    eigenvalues = np.linalg.eigvalsh(symbols(xi, theta, waves))
    least, most = float(eigenvalues.min()), float(eigenvalues.max())
    if least < -NEGATIVE * most:
        raise StencilError(
            f"stencil: {len(xi)} nodes with {words} have a symbol of {least / most:.2g} of its largest value for"
            " some wave, which is below 0: it is not stable"
        )
    return Stencil(xi, theta, least, most)
