"""Nodes of blocks on a device: row after row, idle ones behind the last."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Padded:
    """The order of n nodes in whole blocks, which have room for `room` of them."""

    room: int

    def spread(self, values: NDArray[Any], idle: float = 0.0) -> NDArray[Any]:
        """Nodal values (n, ...) in the device's order (..., m)."""
        wide = np.full((*values.shape[1:], self.room), idle, dtype=values.dtype)
        wide[..., : len(values)] = values.T
        return wide

    def rows(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where the device has these nodes (k,)."""
        return nodes

    def collected(self, values: NDArray[Any], state: NDArray[Any]) -> None:
        """Enter values (..., m) of the device in an array (n, ...) of the state."""
        state[:] = values[..., : len(state)].T
