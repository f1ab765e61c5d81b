"""Nodes by their ids or by a box."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdsolve.results import Nodes

SLACK = 1e-9  # of a node's spacing: how far beside a box it is still in it


def in_box(nodes: Nodes, box: ArrayLike) -> NDArray[np.bool_]:
    """Which nodes (n,) are in a box x0, y0, x1, y1, m, or on its edge."""
    low, high = np.reshape(np.asarray(box, dtype=float), (2, 2))
    slack = SLACK * nodes.delta[:, None]
    return np.asarray(((nodes.position >= low - slack) & (nodes.position <= high + slack)).all(axis=1))


def selected(nodes: Nodes, ids: Sequence[int] | None, box: ArrayLike | None) -> NDArray[np.bool_]:
    """Which nodes (n,) a condition or a region of the grid file means: those of its ids that are in its box.

    All of them where it has no ids, anywhere where it has no box.
    """
    inside = np.ones(len(nodes.ids), dtype=bool) if ids is None else np.isin(nodes.ids, ids)
    return inside if box is None else inside & in_box(nodes, box)
