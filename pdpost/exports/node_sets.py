"""The nodes of named conditions in a frame, as sets that ParaView and others show by their names."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.selection import selected
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
    found: dict[str, NDArray[np.bool_]] = {}
    for number, condition in enumerate(read(results, _Model).conditions):
        name = visible(f"{condition.get('kind', 'condition')} {condition.get('name') or number}")
        there = selected(nodes, condition.get("nodes"), condition.get("box"))
        found[name] = found.get(name, np.zeros(len(there), dtype=bool)) | there
    return found


def columns(results: Results, step: int) -> dict[str, NDArray[np.generic]]:
    """The sets as numbers (n,), 1 for a node in a set and 0 for others; none where they are too many."""
    found = node_sets(results, step)
    return {name: there.astype(np.int32) for name, there in found.items()} if len(found) <= MOST else {}
