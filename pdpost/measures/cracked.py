"""Which nodes are cracked, and since when; from the bonds that broke, to the step.

Damage is 1 - intact / initial bonds, bonds cut by a pre-crack counted as broken; a node is cracked above `CRACKED`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fields import CRACKED
from pdmesh.model.selection import rows_of
from pdsolve.results import Results

LINKED = 1.5  # spacings between two nodes of a crack
ROUND_OFF = 1e-6


def damage_at(results: Results, step: int) -> NDArray[np.float64]:
    """Damage (n,) after any step, between frames as well."""
    nodes, breaks = results.nodes(), results.breaks()
    row = rows_of(nodes, breaks.node[breaks.step <= step])
    gone: NDArray[np.int64] = nodes.cut + np.bincount(row, minlength=len(nodes.ids))
    return gone / np.maximum(nodes.family, 1)


def cracked_since(results: Results, threshold: float = CRACKED) -> NDArray[np.int64]:
    """The step (n,) from which on each node's damage is above `threshold`; -1 for nodes that stay sound."""
    nodes, breaks = results.nodes(), results.breaks()
    family = np.maximum(nodes.family, 1)
    most = np.floor(threshold * family).astype(np.int64)  # bonds a node may lose, but for a rounding
    most += ((most + 1) / family <= threshold).astype(np.int64) - (most / family > threshold)
    further = most + 1 - nodes.cut  # breaks that a node needs
    row = rows_of(nodes, breaks.node)
    order = np.lexsort((breaks.step, row))
    count = np.bincount(row, minlength=len(family))
    first = np.cumsum(count) - count
    since = np.where(further <= 0, 0, -1)
    broke = (further > 0) & (further <= count)
    since[broke] = breaks.step[order][(first + further - 1)[broke]]
    return since


def pre_crack_tips(cracks: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Ends of pre-cracks (k, 4) that no other segment touches, with the unit vector the crack arrives with."""
    ends = np.concatenate([cracks[:, :2], cracks[:, 2:]])
    starts = np.concatenate([cracks[:, 2:], cracks[:, :2]])
    return [
        (tip, (tip - start) / np.hypot(*(tip - start)))
        for tip, start in zip(ends, starts, strict=True)
        if (np.abs(ends - tip).max(axis=1) < 1e-12).sum() == 1
    ]
