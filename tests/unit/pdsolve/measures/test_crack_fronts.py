"""Fronts of cracks in bodies, as lines."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pdsolve.measures import crack_fronts


def test_a_front_without_length_is_no_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners of smoothed faces can coincide; intensities along such a front divided by its length of 0."""
    corners = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [3, 0, 0]], dtype=float)
    cracks: Any = SimpleNamespace(edge_corners=np.array([[0, 1], [2, 3], [3, 4]]), corners=corners)
    monkeypatch.setattr(crack_fronts, "front_edges_at", lambda cracks, time: np.arange(3))
    lines = crack_fronts.front_lines_at(cracks, 0.0)
    assert [crack_fronts.line_length(line) for line in lines] == [3.0]
