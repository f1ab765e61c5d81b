"""Stiffness bound of laws whose nodes interact beyond their bonds, so that sums over own bonds are not enough."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds

ROUNDS = 60
SAFE = 1.08  # over what so many rounds find of the largest eigenvalue, a few percent less than it
SMALL = 1e-6  # of the shortest bond: values at which all laws are linear


def resistance(
    pulls: Callable[[NDArray[np.float64]], NDArray[np.float64]], scale: NDArray[np.float64], bonds: Bonds, width: int
) -> NDArray[np.float64]:
    """A bound (n,) of the stiffness of nodes, N/m^4, by power iteration at rest.

    It is `scale` (n,), N/m^4, times half the largest eigenvalue of the force `pulls` (n, width) divided by that scale.
    """
    nodes = len(scale)
    if not len(bonds.neighbour):
        return scale
    small = SMALL * float(np.sqrt((bonds.xi**2).sum(axis=1).min()))
    light = np.divide(1.0, scale, out=np.zeros(nodes), where=scale > 0)[:, None]
    way = np.random.default_rng(1).uniform(-1.0, 1.0, (nodes, width))
    largest = 0.0
    for _ in range(ROUNDS):
        size = float(np.abs(way).max())
        if size == 0:
            break
        way *= small / size
        after = -light * pulls(way)
        norm = float(np.sqrt((way * way * scale[:, None]).sum()))
        largest = float(np.sqrt((after * after * scale[:, None]).sum())) / norm if norm > 0 else 0.0
        way = after
    return np.asarray(scale * (SAFE * largest / 2))
