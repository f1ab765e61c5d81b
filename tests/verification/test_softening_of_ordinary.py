"""What bonds of the ordinary solid would spend if they softened: a measurement on a patch, of no law of the solver.

Two halves of a lattice move apart. The forces that resist a change of shape lose the share d of a bond that has
softened, linearly by its opening. The dilatation counts softened bonds wholly, or by 1 - d.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]

E, F_T, G_F, H, M = 30e9, 3e6, 100.0, 0.01, 3  # Pa, Pa, J/m^2, m, spacings
PLACE = np.arange(-14, 14)  # columns of nodes; the halves part at 0


class Apart(NamedTuple):
    """What has become of a patch, once all bonds across the crack are gone."""

    spent: float  # energy, over G_f
    stress: float  # across the crack, over f_t


def nothing(d: Array) -> Array:
    """Shares of bonds in the dilatation: none, so that they are springs."""
    return 0 * d


def wholly(d: Array) -> Array:
    """Shares of bonds in the dilatation: all, softened or not."""
    return 1 + 0 * d


def intact(d: Array) -> Array:
    """Shares of bonds in the dilatation: what is left of them."""
    return 1 - d


def moved_apart(share: Callable[[Array], Array], nu: float, transverse: float) -> Apart:
    """Plane stress, m = 3, l_ch 33 spacings. Along the crack there is a strain `transverse`, over s0.

    w_c is that of springs with the stiffness of the forces that resist a change of shape; they spend G_f.
    """
    a, b = (index.ravel() for index in np.mgrid[-M : M + 1, -M : M + 1])
    near = (np.hypot(a, b) > 0) & (np.hypot(a, b) <= M)
    a, b = a[near], b[near]
    length, there = H * np.hypot(a, b), PLACE[:, None] + a
    here = PLACE[:, None] >= 0
    crossing, one_way = here != (there >= 0), ~here & (there >= 0)
    back = [int(np.flatnonzero((a == -i) & (b == -j))[0]) for i, j in zip(a, b, strict=True)]
    other = np.clip(there - PLACE[0], 0, len(PLACE) - 1), back
    mu, K, moment = E / 2 / (1 + nu), E / 2 / (1 - nu), (H * length) @ (H * length)
    D, S, s0 = 2 * H**2 * length / moment, 4 * H**2 / moment, F_T / (1.3 - 0.2 * (1 / 3 - nu)) / E
    C = 4 * mu * S * length * one_way * H  # of both ends, for each height of the crack
    w_c = (G_F - s0**2 * (C * length).sum() / 2) / (s0 * C.sum() / 2)
    kappa, openings = np.zeros(there.shape), 3 * w_c * np.linspace(0, 1, 300) ** 2
    stored, stress = [], []
    for w in openings:
        e = (w * (1.0 * (there >= 0) - here) * a * H + transverse * s0 * (b * H) ** 2) / length
        kappa = np.where(crossing, np.maximum(kappa, e / length), 0.0)
        left = np.clip(1 - (kappa - s0) * length / w_c, 0, 1)
        d = np.where(kappa > s0, 1 - left * s0 / np.maximum(kappa, s0), 0.0)
        theta = (share(d) * D * e).sum(axis=1, keepdims=True)
        rest = e - theta * length / 2
        p = K * theta - mu * ((1 - d) * S * length * rest).sum(axis=1, keepdims=True)
        t = share(d) * D * p + 2 * mu * (1 - d) * S * rest
        stored.append(float((K * theta[:, 0] ** 2 / 2 + mu * ((1 - d) * S * rest**2).sum(axis=1))[M:-M].sum()) * H)
        stress.append(float(((t + t[other]) * (a * H / length) * one_way).sum()) * H)
    assert d[crossing].min() == 1
    work = float(np.trapezoid(stress, openings))
    return Apart((work - stored[-1] + stored[0]) / G_F, stress[-1] / F_T)


@pytest.mark.parametrize("transverse", [-1.0, 0.0, 1.0])
def test_springs_spend_the_same_whatever_the_strain_along_the_crack(transverse: float) -> None:
    found = moved_apart(nothing, 0.18, transverse)
    assert found.spent == pytest.approx(1.0, abs=1e-4)  # measured: 1e-5
    assert found.stress == 0


def test_a_dilatation_of_softened_bonds_still_pulls_across_a_crack() -> None:
    """At an opening of 3 w_c, where all bonds are gone."""
    assert moved_apart(wholly, 0.18, 0.0).stress == pytest.approx(29.3, abs=0.1)


@pytest.mark.parametrize(
    ("nu", "expected"), [(0.18, [0.926, 0.969, 1.028]), (1 / 3, [0.980, 0.989, 1.011]), (0.4, [1.007, 0.999, 1.003])]
)
def test_what_bonds_of_ordinary_spend_depends_on_the_strain_along_the_crack(nu: float, expected: list[float]) -> None:
    """It is s0, 0 and -s0. So what a bond spends is no function of its own stretch."""
    found = [moved_apart(intact, nu, transverse) for transverse in (1.0, 0.0, -1.0)]
    assert [each.stress for each in found] == [0, 0, 0]
    assert [each.spent for each in found] == pytest.approx(expected, abs=2e-3)
