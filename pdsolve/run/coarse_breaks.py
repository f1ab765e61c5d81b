"""A warning of bonds that broke outside the finest zone, where strength is lower."""

from __future__ import annotations

import numpy as np

from pdmesh.model.zone_strengths import outside_finest, weakest_zone
from pdsolve.checks import named, warn
from pdsolve.model import Model
from pdsolve.results import Results


def warn_of_coarse_breaks(model: Model, results: Results) -> None:
    """Warn if bonds of coarser nodes than the finest of their body broke, and had less strength for it."""
    grid, weakest = model.grid, weakest_zone(model.grid, model.settings)
    if weakest is None:
        return
    coarse = outside_finest(grid)
    breaks, order = results.breaks(), np.argsort(grid.ids)
    ends = (order[np.searchsorted(grid.ids, ids, sorter=order)] for ids in (breaks.node, breaks.neighbour))
    outside = np.flatnonzero(np.logical_or(*(coarse[end] for end in ends)))
    if len(outside):
        first = outside[0]
        row = int(order[np.searchsorted(grid.ids, breaks.node[first], sorter=order)])
        warn(
            model,
            f"{len(outside) / len(breaks.step):.0%} of the broken bonds are outside the finest zone, where strength is"
            f" down to {weakest.share:.2g} of that within; the first broke at step {breaks.step[first]},"
            f' {named(model, row)}; widen the fine zone, or set material.coarse to "matched" or "unbreakable"',
        )
