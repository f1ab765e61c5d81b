"""The axis of histories: a mean stays readable in the band of single nodes."""

from __future__ import annotations

import numpy as np
import pytest

from pdpost.figures.charts import histories
from pdsolve.measures.histories import NodeHistory


@pytest.mark.parametrize(("half_band", "span"), [(1.0, 4.4), (50.0, 4.0)])
def test_a_wide_band_is_cut_off(half_band: float, span: float) -> None:
    """The axis spans a band of twice the mean with a margin of 5 %, and twice a mean whose band is 50 times as wide."""
    time, mean = np.linspace(0.0, 1.0, 5), np.array([0.0, 1.0, 2.0, 1.0, 0.0])
    curve = NodeHistory("mean", "y", (1, 2), "frames", time, mean, mean - half_band, mean + half_band, None, 0.0)
    (axes,) = histories([curve], "velocity").axes
    assert np.ptp(axes.get_ylim()) == pytest.approx(span)
