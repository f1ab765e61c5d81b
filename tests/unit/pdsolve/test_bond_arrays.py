"""One deformed bond, compiled, of nodes that swell and of those that do not."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from pdsolve.laws.bond_arrays import List, SwollenList, deformed


@njit
def stretched(bonds, value):  # type: ignore[no-untyped-def]
    bond = deformed(bonds, value, 0, 1, 0)
    return bond.eta, bond.stretch, bond.elongation


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bond_stretches_from_its_swollen_length(dimension: int) -> None:
    """By the mean of its ends' strains, along each axis."""
    xi, u = np.array([3.0, 4.0, 12.0])[:dimension], np.array([0.03, -0.02, 0.05])[:dimension]
    arrays = np.array([0, 1]), np.array([1], dtype=np.int32), tuple(np.array([x]) for x in xi)
    length, value = np.array([np.linalg.norm(xi)]), np.stack([0 * u, u])
    for bonds, eta in (
        (List(*arrays, length), u),
        (SwollenList(*arrays, length, np.array([0.01, 0.03])), u - 0.02 * xi),
    ):
        found, stretch, elongation = stretched(bonds, value)
        assert found == pytest.approx(tuple(eta), rel=1e-12)
        assert elongation == pytest.approx(np.linalg.norm(xi + eta) - length[0], rel=1e-10)
        assert stretch == pytest.approx(elongation / length[0], rel=1e-10)
