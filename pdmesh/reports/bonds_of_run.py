"""The bonds that a run of a model has, for pictures of them.

What the solver refuses, such as a grid without a material, has all pairs within a horizon, as in `pdmesh info`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Settings
from pdmesh.model.node_grid import Grid
from pdmesh.reports.bonds_and_step import CHUNK, bonds


class DirectedBonds(NamedTuple):
    """Directed bonds of some of a grid's nodes, those that a pre-crack cuts included."""

    source: NDArray[np.int64]  # (b,) row of the node whose bond it is
    target: NDArray[np.int64]  # (b,)
    intact: NDArray[np.bool_]  # (b,) no pre-crack cuts it


def bonds_of_run(grid: Grid, settings: Settings, name: str, rows: NDArray[np.int64]) -> Iterator[DirectedBonds]:
    """Bonds of the nodes in `rows`, which increase, in the conservative mode, a chunk of nodes at a time."""
    pairs_of = None
    if settings.material is not None:
        from pdsolve import Model, ModelError, bond_pairs

        with suppress(ModelError):
            pairs_of = bond_pairs(Model(grid, settings, name))
    if pairs_of is None:
        for part in bonds(grid, settings.horizon.ratio, rows):
            yield DirectedBonds(part.source[part.inside], part.target[part.inside], ~part.cut[part.inside])
        return
    for start in range(0, len(rows), CHUNK):
        pairs, intact, *_ = pairs_of(rows[start : start + CHUNK])
        yield DirectedBonds(pairs.source, pairs.target, intact)
