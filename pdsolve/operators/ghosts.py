"""The interface of steppers to nodes that other ranks move."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Ghosts(Protocol):
    """Nodes of other ranks, whose motion comes from there."""

    own_block_range: tuple[int, int]  # the first block of this rank's own nodes, and the one after the last

    def set_places(self, places: NDArray[np.int64]) -> None:
        """Say in which column each row (n,) is in arrays by places."""

    def receive_values(self, values: NDArray[Any], at_places: bool = False) -> None:
        """Set the ghosts' columns of `values` (w, m), which are by rows, or by places."""
