"""Solutions with old factors: what they leave, and when factors are made anew."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from pdsolve.steppers import reused_factors
from pdsolve.steppers.reused_factors import LEFT, ReusedFactorSolver


def chain(softening: float, springs: int, all_by: float = 0.0) -> csr_array:
    """A chain of 401 springs, some in its middle softer by random shares, up to this one."""
    each = np.full(401, 1.0 - all_by)
    middle = slice(200 - springs // 2, 200 + (springs + 1) // 2)
    each[middle] -= softening * np.random.default_rng(2).random(springs)
    return diags_array([-each[1:-1], each[:-1] + each[1:], -each[1:-1]], offsets=[-1, 0, 1]).tocsr()


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize(
    ("softening", "springs", "all_by", "made"),
    [(0.9, 20, 0.0, 1), (3.0, 20, 0.0, 1), (0.9, 20, 1e-4, 1), (0.3, 401, 0.0, 2), (1.2, 401, 0.0, 2)],
)
def test_reused_factors_leave_little_or_are_made_anew(
    softening: float, springs: int, all_by: float, made: int, symmetric: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The true residuals of two right sides count, of softer chains and of indefinite ones."""
    count, makes = [], reused_factors.factorize
    monkeypatch.setattr(reused_factors, "factorize", lambda *given: count.append(1) or makes(*given))
    right = np.column_stack([np.sin(np.arange(400.0)), np.ones(400)])
    solver = ReusedFactorSolver(symmetric)
    solver.solve(chain(0.0, 0), right[:, 0], True)
    softer = chain(softening, springs, all_by)
    solver.solve(chain(softening / 2, min(springs, 20) // 2), right, False)
    found = solver.solve(softer, right, False)
    left = np.linalg.norm(right - softer @ found, axis=0) / np.linalg.norm(right, axis=0)
    assert left.max() <= LEFT
    assert len(count) == made
    if made == 1 and all_by == 0:
        assert left.max() < 1e-9  # measured: 7e-11
