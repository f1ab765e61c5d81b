"""Bonds as pairs of nodes, and which of them are broken.

The largest displacement and bond stretch describe a run in which nothing broke.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, triu

from pdsolve.measures.frame_steps import frames, last_frame
from pdsolve.measures.strain import bonds_are_broken, broken_bond_ends_and_steps
from pdsolve.results import Results

TOGETHER = 2_000_000  # bonds that are looked at at once


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


def largest_displacement(results: Results) -> float | None:
    """The largest displacement of any node in all frames, m; None if no frame holds displacements."""
    displacements = (_read_frame_displacements(results, step) for step in frames(results)[0].tolist())
    return max(
        (float(np.linalg.norm(u, axis=1).max(initial=0.0)) for u in displacements if u is not None), default=None
    )


def largest_stretch(results: Results) -> float | None:
    """The largest stretch of a bond that is intact in the last frame; None if it has no displacements."""
    step = last_frame(results)
    u = _read_frame_displacements(results, step)
    if u is None:
        return None
    families, position = results.families(step), results.nodes(step).position
    intact, largest = ~bonds_are_broken(results, families, step), []
    for first in range(0, len(intact), TOGETHER):
        bonds = first + np.flatnonzero(intact[first : first + TOGETHER])
        if len(bonds):
            node, neighbour = np.searchsorted(families.start, bonds, side="right") - 1, families.neighbour[bonds]
            before = position[neighbour] - position[node]
            after = before + u[neighbour] - u[node]
            largest.append(float((np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)).max()) - 1)
    return max(largest, default=None)


def _read_frame_displacements(results: Results, step: int) -> NDArray[np.float64] | None:
    """Displacements (n, d) of a frame, m, or None if it has none."""
    names, stored = ("ux", "uy", "uz")[: results.dimension], results.stored(step)
    if not set(names) <= set(stored):
        return None
    return np.column_stack([results.field(name, step) for name in names]).astype(np.float64)
