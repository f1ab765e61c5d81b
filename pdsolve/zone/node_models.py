"""Models of some of a model's nodes, such as those that a zone has now."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model import node_arrays
from pdsolve.model import Model


def model_of_rows(model: Model, rows: NDArray[np.int64]) -> Model:
    """The model of the nodes in `rows`, without conditions."""
    part = model.grid.part(rows)
    regions = []
    for region in model.settings.regions:
        region_ids = part.ids[node_arrays.selected(part, region.nodes, region.box)]
        if len(region_ids):
            regions.append(msgspec.structs.replace(region, nodes=tuple(region_ids.tolist()), box=None))
    settings = msgspec.structs.replace(model.settings, conditions=(), regions=tuple(regions))
    return Model(part, settings, model.name)


def model_of_rows_with_spacing_and_areas(
    model: Model, rows: NDArray[np.int64], widths: NDArray[np.float64], areas: NDArray[np.float64]
) -> Model:
    """The model of the nodes in `rows`, without conditions: `widths` (n,) times as far apart, with `areas` (n,)."""
    part = model_of_rows(model, rows)
    return dataclasses.replace(part, grid=dataclasses.replace(part.grid, delta=widths * part.grid.delta, areas=areas))
