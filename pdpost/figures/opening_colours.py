"""Colours of the faces of a crack by when they opened."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from pdpost.figures.labels import scaled
from pdpost.measures.crack_faces import CrackSurface

CMAP = "viridis"
NEARLY = 0.9  # of the area: what opens later has the last colour


class Opening(NamedTuple):
    """The colours of opening times, and their unit."""

    painted: ScalarMappable  # of times in that unit
    factor: float  # of that unit in a second
    label: str


def opening_colours(surface: CrackSurface) -> Opening:
    """Colours from the first opening until nearly all of the area was open."""
    time = surface.opening_time[surface.face_opened_during_run]
    area = np.cumsum(surface.face_area[surface.face_opened_during_run])
    factor, unit = scaled([time], "s")
    first, last = 0.0, 1.0
    if len(time):
        first, end = float(time[0]), float(time[np.searchsorted(area, NEARLY * area[-1])])
        last = end if end > first else first + 1.0
    return Opening(ScalarMappable(Normalize(first * factor, last * factor), CMAP), factor, f"opened at, {unit}")
