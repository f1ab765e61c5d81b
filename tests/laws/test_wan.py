"""What the control by the solid's own elasticity adds where a node turns, against the slope of its energy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import polar

from pdsolve.laws import wan

Z = np.array([[3.0, 0.4], [0.4, 2.0]])  # C : K^-1 of a family that is not the same in all directions
STEP = 1e-6  # of the differences, of bonds of about unit length


def gradient(eta: NDArray[np.float64], xi: NDArray[np.float64], w: NDArray[np.float64]) -> NDArray[np.float64]:
    """H (2, 2) of bonds (k, 2) that have displaced by `eta` (k, 2)."""
    return (w[:, None] * eta).T @ xi @ np.linalg.inv((w[:, None] * xi).T @ xi)


def energy(eta: NDArray[np.float64], xi: NDArray[np.float64], w: NDArray[np.float64]) -> float:
    """Half the sum of w z . R Z R^T z, R by SciPy."""
    H = gradient(eta, xi, w)
    R, z = polar(np.eye(2) + H)[0], eta - xi @ H.T
    return float(np.einsum("k,ki,ij,kj->", w, z, R @ Z @ R.T, z) / 2)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_control_of_a_turned_node_is_the_slope_of_its_energy(angle: float) -> None:
    """In the plane, from its sums, at a stretch of a few tenths and with bonds that do not follow the gradient."""
    random = np.random.default_rng(4)
    xi, w = random.uniform(-1, 1, (9, 2)), random.uniform(0.5, 1.5, 9)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    F = R @ np.array([[1.3, 0.2], [0.2, 0.9]])
    eta = xi @ (F - np.eye(2)).T + 0.1 * random.standard_normal((9, 2))
    H, A, S = gradient(eta, xi, w), (w[:, None] * eta).T @ xi, (w[:, None] * eta).T @ eta
    sums = (*A.ravel().tolist(), S[0, 0], S[0, 1], S[1, 1])
    P, turned = wan._turned_in_the_plane(
        sums, tuple(H.ravel().tolist()), (0.0, 0.0, 0.0, 0.0), tuple(Z.ravel().tolist())
    )
    P, turned = np.reshape(P, (2, 2)), np.reshape(turned, (2, 2))
    found = w[:, None] * ((eta - xi @ H.T) @ turned.T + xi @ np.linalg.inv((w[:, None] * xi).T @ xi) @ P.T)
    slope = np.empty_like(eta)
    for place in np.ndindex(eta.shape):
        up, down = eta.copy(), eta.copy()
        up[place] += STEP
        down[place] -= STEP
        slope[place] = (energy(up, xi, w) - energy(down, xi, w)) / (2 * STEP)
    assert found == pytest.approx(slope, abs=1e-8)  # measured 2e-10
    assert np.abs(P).max() > 1e-4  # measured 5e-4 and 1e-2: the part through R is there
