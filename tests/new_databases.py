"""New databases of nodes that are known as arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.results import Families, Nodes, Writer
from pdsolve.results.schema import Births, select_nodes


def create_writer(
    path: Path | None,
    nodes: Nodes,
    families: Callable[[int, int], Families],
    cracks: NDArray[np.float64],
    meta: Mapping[str, Any],
) -> Writer:
    """The writer of a new database at `path`, in memory if None; `families(first, last)` are those of these rows."""
    bonds = int((nodes.family - nodes.cut).sum())
    births = Births(
        len(nodes.ids),
        nodes.position.shape[1],
        bonds,
        lambda first, end: select_nodes(nodes, np.arange(first, end)),
        families,
    )
    return Writer.begin(path, births, cracks, meta)
