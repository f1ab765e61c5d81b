"""The bonds as pairs of nodes, and which of them are broken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, triu

from pdpost.measures.strain import broken
from pdsolve.results import Results


class Pairs(NamedTuple):
    """The bonds there were at the start, each pair of nodes once."""

    ends: NDArray[np.int64]  # (b, 2) rows of its nodes
    broken: NDArray[np.bool_]  # (b,) from either side


def pairs(results: Results, step: int) -> Pairs:
    """The pairs of bonded nodes and whether they are broken after `step`; those cut by a pre-crack are left out."""
    families = results.families()
    state = 1 + broken(results, families, step).astype(np.int8)
    count = len(families.start) - 1
    side = csr_array((state, families.neighbour, families.start), (count, count))
    found = triu(side.maximum(side.T.tocsr()), format="coo")
    return Pairs(np.column_stack([found.row, found.col]).astype(np.int64), found.data == 2)
