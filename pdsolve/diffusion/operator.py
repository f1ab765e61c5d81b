"""What makes potentials even, however its links are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Operator(Protocol):
    """Links of n nodes."""

    @property
    def name(self) -> str:
        """How links are stored: the name of the kernel, for the record."""

    @property
    def volume(self) -> NDArray[np.float64]:
        """The volume of each node (n,), m^d."""

    @property
    def total(self) -> NDArray[np.float64]:
        """(n,) 1/s: what leaves a node for each mol/m^3."""

    @property
    def count(self) -> NDArray[np.int64]:
        """The number of links of each node, (n,)."""

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Put into `out` (n,) what comes to each node, per volume and time, at this `potential` (n,)."""

    def tangent(self) -> csr_array:
        """The rates (n, n) by the potentials, 1/s."""

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Sum over links of what the `share` (n,) differs by, conductances and both volumes counted, m^d/s."""
