"""Weights of ordinary families."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import bonds_of

from pdsolve.laws import ordinary
from pdsolve.options import Options
from pdsolve.run.prepare import prepare


@pytest.mark.slow
def test_weights_do_not_depend_on_how_many_nodes_are_taken_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit; 63 nodes, seven or all at a time."""
    solid = msgspec.structs.replace(GLASS, model="ordinary", nu=0.3, micromodulus="constant")
    problem = prepare(plate(square_grid(9, 7), 3.0, material=solid), Options(kernel="listed", threads=1))
    model, bonds = problem.system.model, bonds_of(problem)
    whole = ordinary.columns(model, bonds)
    monkeypatch.setattr(ordinary, "TOGETHER", 7)
    parts = ordinary.columns(model, bonds)
    assert np.ptp(whole.dilating) > 0
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one, other)
