"""A warning of bonds that broke outside the finest zone, where strength is lower."""

from __future__ import annotations

import numpy as np

from pdmesh.model.zone_strengths import coarse_nodes, of_body, weakest_zones
from pdsolve.checks import named, warn
from pdsolve.model import Model
from pdsolve.results import Results


def warn_of_broken_bonds_outside_finest_zone(model: Model, results: Results) -> None:
    """Warn for each body of broken bonds of nodes coarser than its finest, which had less strength."""
    grid, weakest_zone_of_each = model.grid, weakest_zones(model.grid, model.settings)
    if not weakest_zone_of_each:
        return
    breaks, order = results.breaks(), np.argsort(grid.ids)
    rows, other_rows = (order[np.searchsorted(grid.ids, ids, sorter=order)] for ids in (breaks.node, breaks.neighbour))
    for weakest in weakest_zone_of_each:
        coarse = coarse_nodes(grid, weakest)
        outside = np.flatnonzero(coarse[rows] | coarse[other_rows])
        if len(outside):
            first = outside[0]
            warn(
                model,
                f"{len(outside) / len(breaks.step):.0%} of the broken bonds are outside the finest zone"
                f"{of_body(weakest.body)}, where strength is down to {weakest.share:.2g} of that within; the first"
                f" broke at step {breaks.step[first]}, {named(model, int(rows[first]))}; widen the fine zone, or set"
                ' material.coarse to "matched" or "unbreakable"',
            )
