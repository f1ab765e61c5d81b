"""Forces of conditions: peaks, which move, which are the strongest."""

from __future__ import annotations

import numpy as np
import pytest

from pdsolve.measures.forces import ConditionForceHistory, moving_conditions, strongest

STEPS = np.arange(4)


def history(name: str, force: list[float], way: list[float]) -> ConditionForceHistory:
    """A condition that acts along y."""
    columns = [np.column_stack([np.zeros(4), np.array(values)]) for values in (force, way)]
    return ConditionForceHistory(0, name, "displacement", STEPS, 1.0 * STEPS, *columns)


PULLED = history("pulled", [0.0, -3.0, -5.0, -2.0], [0.0, -1e-3, -2e-3, -3e-3])
FIXED = history("fixed", [0.0, 3.0, 5.0, 2.0], [0.0, 1e-7, 1e-7, 0.0])
FREE = history("free", [0.0] * 4, [0.0, 1e-3, 2e-3, 3e-3])


def test_the_peak_is_positive_on_a_load_displacement_curve() -> None:
    assert PULLED.peak_index == 2
    assert PULLED.force_along_axis == pytest.approx([0, 3, 5, 2])
    assert PULLED.displacement_along_axis == pytest.approx([0, 1e-3, 2e-3, 3e-3])


def test_fixed_nodes_and_nodes_without_a_force_have_no_curve() -> None:
    assert moving_conditions([PULLED, FIXED, FREE]) == [PULLED]
    assert moving_conditions([history("clamp", [0.0, 1.0, 1.0, 1.0], [0.0] * 4)]) == []


def test_the_strongest_are_in_their_order() -> None:
    weak = history("weak", [0.0, 1.0, 1.0, 1.0], [0.0] * 4)
    assert [one.name for one in strongest([weak, FIXED, PULLED], 2)] == ["fixed", "pulled"]
