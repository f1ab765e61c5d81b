"""Solutions with old factors: what they leave, and when factors are made anew."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from pdsolve.steppers import old_factors
from pdsolve.steppers.old_factors import LEFT, Solver


def chain(softening: float) -> csr_array:
    """A chain of 400 springs that are softer by random shares, up to this one."""
    each = 1 - softening * np.random.default_rng(2).random(401)
    return diags_array([-each[1:-1], each[:-1] + each[1:], -each[1:-1]], offsets=[-1, 0, 1]).tocsr()


@pytest.mark.parametrize(("softening", "made"), [(0.3, 1), (0.9, 1), (1.2, 2)])
def test_old_factors_leave_little_or_are_made_anew(
    softening: float, made: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The true residual counts, of a softer chain and of one that is indefinite."""
    count, makes = [], old_factors.factors
    monkeypatch.setattr(old_factors, "factors", lambda *given: count.append(1) or makes(*given))
    right, solver = np.sin(np.arange(400.0)), Solver()
    solver.solve(chain(0.0), right, True)
    softer = chain(softening)
    found = solver.solve(softer, right, False)
    assert np.linalg.norm(right - softer @ found) <= LEFT * np.linalg.norm(right)
    assert len(count) == made
