"""The interface of steppers to nodes that other ranks move."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Ghosts(Protocol):
    """Nodes of other ranks, whose motion comes from there."""

    own_block_range: tuple[int, int]  # the first block of this rank's own nodes, and the one after the last

    def move_columns(self, places: NDArray[np.int64]) -> None:
        """Let `receive_values` find each row (n,) in the column `places` (n,)."""

    def receive_values(self, values: NDArray[Any]) -> None:
        """Set the ghosts' columns of `values` (w, m)."""
