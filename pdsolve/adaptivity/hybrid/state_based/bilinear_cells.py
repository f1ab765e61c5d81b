"""Forces and energies of coarse cells: bilinear ones of four nodes, of the fine lattice's own elasticity.

A cell of side H has the Green strain E of its middle and the energy  H^2 (K (tr E)^2 / 2 + mu |dev E|^2)  of it. What
is bilinear, h = u_1 - u_2 + u_3 - u_4, adds (C11 + C66) |h|^2 / 24, that of the exact integral. Both are objective.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER

SLOPE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])  # of the shape functions, H = 1; round the cell
TWIST = np.array([1.0, -1.0, 1.0, -1.0])
PAIRS = np.array([[0, 1], [1, 2], [3, 2], [0, 3], [0, 2], [1, 3]])  # corners along edges and diagonals


@njit(**INNER)
def twisting(bulk, shear):  # type: ignore[no-untyped-def]
    """Stiffness, N/m^2, of |h|^2 / 2; K and 2 mu, Pa."""
    c11, c66 = bulk + shear / 2, shear / 2
    return (c11 + c66) / 12


@njit(**INNER)
def _gradient(u, nodes, side, f):  # type: ignore[no-untyped-def]
    """Fill in the deformation gradient f (2, 2) of a cell's middle; returns E_xx, E_yy, E_xy and h."""
    hx = hy = 0.0
    f[0, 0] = f[1, 1] = 1.0
    f[0, 1] = f[1, 0] = 0.0
    for n in range(4):
        x, y = u[nodes[n], 0], u[nodes[n], 1]
        hx, hy = hx + TWIST[n] * x, hy + TWIST[n] * y
        for axis in range(2):
            f[0, axis] += x * SLOPE[n, axis] / side
            f[1, axis] += y * SLOPE[n, axis] / side
    a, b, c, d = f[0, 0] - 1, f[0, 1], f[1, 0], f[1, 1] - 1  # without the digits that 1 takes
    return a + (a * a + c * c) / 2, d + (b * b + d * d) / 2, (b + c + a * b + c * d) / 2, hx, hy


@cached_njit(nogil=True, error_model="numpy")
def pull_cells(cells, side, bulk, shear, u, force):  # type: ignore[no-untyped-def]
    """Add the forces of `cells` (c, 4) on nodes, N per unit thickness, at displacements u (n, 2); K and 2 mu, Pa."""
    f, twist = np.empty((2, 2)), twisting(bulk, shear)
    for c in range(len(cells)):
        xx, yy, xy, hx, hy = _gradient(u, cells[c], side, f)
        p = bulk * (xx + yy)
        sxx, syy, sxy = p + shear * (xx - yy) / 2, p + shear * (yy - xx) / 2, shear * xy
        for n in range(4):
            gx, gy = SLOPE[n] * side
            tx, ty = sxx * gx + sxy * gy, sxy * gx + syy * gy
            force[cells[c, n], 0] -= f[0, 0] * tx + f[0, 1] * ty + twist * hx * TWIST[n]
            force[cells[c, n], 1] -= f[1, 0] * tx + f[1, 1] * ty + twist * hy * TWIST[n]


@cached_njit(nogil=True, error_model="numpy")
def hold_cells(cells, side, bulk, shear, u, held):  # type: ignore[no-untyped-def]
    """Add the energies of cells (c, 4), J per unit thickness, to `held` (n,), a quarter to each corner."""
    f, twist = np.empty((2, 2)), twisting(bulk, shear)
    for c in range(len(cells)):
        xx, yy, xy, hx, hy = _gradient(u, cells[c], side, f)
        stored = bulk * (xx + yy) ** 2 / 2 + shear * ((xx - yy) ** 2 / 2 + 2 * xy * xy) / 2
        energy = side * side * stored + twist * (hx * hx + hy * hy) / 2
        for n in range(4):
            held[cells[c, n]] += energy / 4


@cached_njit(nogil=True, error_model="numpy")
def stretched(cells, side, u, lasts, limit, found):  # type: ignore[no-untyped-def]
    """Mark in `found` (n,) nodes of edges and diagonals of cells that are stretched beyond a limit; `lasts` (n,) are
    nodes whose bonds do not break."""
    for c in range(len(cells)):
        for n in range(len(PAIRS)):
            i, j = cells[c, PAIRS[n, 0]], cells[c, PAIRS[n, 1]]
            x, y = (SLOPE[PAIRS[n, 1]] - SLOPE[PAIRS[n, 0]]) * side
            now = np.hypot(x + u[j, 0] - u[i, 0], y + u[j, 1] - u[i, 1])
            if now > (1 + limit) * np.hypot(x, y) and not (lasts[i] or lasts[j]):
                found[i] = found[j] = True


def of_gradients(cells: NDArray[np.int64], side: float, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """The deformation gradients (c, 2, 2) of the middles of cells (c, 4)."""
    return np.asarray(np.eye(2) + np.einsum("cna,nb->cab", u[cells], SLOPE) / side)
