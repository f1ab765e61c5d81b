"""The nodes of named conditions in a frame, as sets that ParaView and others show by their names."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.node_arrays import selected
from pdmesh.plain_text import visible
from pdpost.reading.embedded_model import read
from pdsolve.results import Results

MOST = 64  # sets in a file; models with a condition for each node have more


class _Model(msgspec.Struct):
    """The keys of the grid file that name its conditions."""

    conditions: list[dict[str, Any]] = []


def node_sets(results: Results, step: int) -> dict[str, NDArray[np.bool_]]:
    """Masks (n,) of the nodes of each condition after `step`, by "kind name"; conditions of one name are one set."""
    nodes = results.nodes(step)
    sets: dict[str, NDArray[np.bool_]] = {}
    for number, condition in enumerate(read(results, _Model).conditions):
        name = visible(f"{condition.get('kind', 'condition')} {condition.get('name') or number}")
        mask = selected(nodes, condition.get("nodes"), condition.get("box"))
        sets[name] = sets.get(name, np.zeros(len(mask), dtype=bool)) | mask
    return sets


def columns(results: Results, step: int) -> dict[str, NDArray[np.generic]]:
    """The sets as numbers (n,), 1 for a node in a set and 0 for others; none where they are too many."""
    sets = node_sets(results, step)
    return {name: mask.astype(np.int32) for name, mask in sets.items()} if len(sets) <= MOST else {}
