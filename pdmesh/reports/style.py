"""Style of the pictures of grids."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

DPI = 200  # dots per inch
MARGIN = 0.02  # of what is drawn
CRACK = "#d62728"
CONDITIONS = ("#ff7f0e", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#bcbd22")


def shades(delta: NDArray[np.float64]) -> list[tuple[float, Any]]:
    """Each spacing, m, with its shade of grey."""
    spacings = np.unique(delta)
    return list(zip(spacings.tolist(), colormaps["Greys_r"](np.linspace(0.15, 0.62, len(spacings))), strict=True))


def marker(spacing: float, points: float) -> float:
    """Size of a node's mark in points, with `points` points to a metre."""
    return float(np.clip(0.6 * spacing * points, 0.25, 5))
