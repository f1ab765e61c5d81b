"""Whether branches of cracks are mirror images of others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pdsolve.measures.tips import CrackBranch


def mirrored(
    one: Sequence[CrackBranch], other: Sequence[CrackBranch], mirror: np.ndarray, shift: Sequence[float] = (0, 0)
) -> None:
    """Each branch of one, times `mirror` and shifted (m), is one of the other, point by point."""
    assert len(one) == len(other)
    left = list(other)
    for branch in one:
        place = branch.points * mirror + np.array(shift)
        alike = [its for its in left if its.points.shape == place.shape]
        image = min(alike, key=lambda its: float(np.abs(place - its.points).max()))
        left = [its for its in left if its is not image]
        assert place == pytest.approx(image.points, abs=1e-12)
        assert branch.passing_time == pytest.approx(image.passing_time, rel=1e-12)
        assert branch.direction * mirror == pytest.approx(image.direction, abs=1e-6)
        assert branch.length_along_crack == pytest.approx(image.length_along_crack, rel=1e-9)
        assert np.array_equal(branch.is_narrow, image.is_narrow)
        for mine, its in zip(branch.speed, image.speed, strict=True):
            assert mine == pytest.approx(its, rel=1e-6, nan_ok=True)
