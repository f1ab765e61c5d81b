"""Why smooth edges in bending are too strong: lattices of cohesive bonds yield before their peak."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from pdmesh.model.cohesive_softening import critical_opening, first_stretch
from pdmesh.model.document import Material
from pdmesh.model.lattice_calibration import calibrated_family

CONCRETE = Material(E=32e9, rho=2400, G0=105, law="cohesive", f_t=3.9e6, shape="exponential", micromodulus="constant")
PEAKS = {10e-3: (1.22, 1.41), 5e-3: (1.31, 1.45), 2.5e-3: (1.35, 1.48), 1.25e-3: (1.38, 1.50)}  # over s0 E


def force(stretch: NDArray[np.float64], length: NDArray[np.float64], opening: float) -> NDArray[np.float64]:
    """Force over stiffness of bonds (k,) that soften exponentially, by the guide's formula."""
    s0 = first_stretch(CONCRETE)
    t = np.clip((stretch - s0) * length / opening, 0, 1)
    left = np.exp(-8)
    return np.where(stretch <= s0, stretch, s0 * (np.exp(-8 * t) - left) / (1 - left))


@pytest.mark.parametrize("h", PEAKS)
def test_peaks_of_a_lattice(h: float) -> None:
    """A uniform pull with free sides, and two halves moved apart, over s0 E: both grow as bonds become shorter."""
    xi, c = calibrated_family(CONCRETE, 3.0)
    across = np.hypot(*xi.T)
    n, length, s0 = xi / across[:, None], across * h, first_stretch(CONCRETE)
    opening = float(critical_opening(CONCRETE, 3.0, np.array([3 * h]))[0])

    def stress(along: float, beside: float) -> NDArray[np.float64]:
        stretch = along * n[:, 0] ** 2 + beside * n[:, 1] ** 2
        return np.asarray((c * across / 2 * force(stretch, length, opening)) @ n**2)

    pull = []
    for along in np.geomspace(0.9 * s0, 8 * s0, 60):
        beside = brentq(lambda y, along=along: stress(along, y)[1], -along, along)
        pull.append(stress(along, beside)[0])
    apart = [
        float((c * force(w * n[:, 0] / length, length, opening) * n[:, 0] * np.maximum(xi[:, 0], 0)).sum())
        for w in np.geomspace(s0 * h, opening, 200)
    ]
    unit = s0 * CONCRETE.E
    assert (max(pull) / unit, max(apart) / unit) == pytest.approx(PEAKS[h], abs=0.012)
    assert pull[0] / unit == pytest.approx(0.9 * 1.046, abs=0.003)  # elastic, with the lattice's own E
