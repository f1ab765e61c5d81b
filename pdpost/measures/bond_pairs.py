"""Bonds as pairs of nodes, and which of them are broken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, triu

from pdpost.measures.strain import bonds_are_broken, broken_bond_ends_and_steps
from pdsolve.results import Results


class BondPairs(NamedTuple):
    """The bonds between the nodes of a frame, each pair once."""

    node_rows: NDArray[np.int64]  # (b, 2) rows of its nodes
    is_broken: NDArray[np.bool_]  # (b,) from either side


def read_bond_pairs(results: Results, step: int) -> BondPairs:
    """Pairs of bonded nodes after `step` and whether each is broken; bonds cut by a pre-crack are left out.

    A bond that broke before its nodes were born anew counts as broken, unless the nodes are bonded again.
    """
    families = results.families(step)
    state = 2 + bonds_are_broken(results, families, step).astype(np.int8)
    count = len(families.start) - 1
    side = csr_array((state, families.neighbour, families.start), (count, count))
    if results.epoch(step):
        nodes, neighbours, _ = broken_bond_ends_and_steps(results, step, with_bonds_before_birth=True)
        broken_counts = csr_array((np.ones(len(nodes), dtype=np.int64), (nodes, neighbours)), (count, count))
        side = side.maximum((broken_counts > 0).astype(np.int8))
    bonds = triu(side.maximum(side.T.tocsr()), format="coo")
    return BondPairs(np.column_stack([bonds.row, bonds.col]).astype(np.int64), bonds.data != 2)
