"""Statistics of bonds, collected part by part."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Counted, Filling, Part, stiffness_bound


class BondStatistics:
    """Statistics of bonds, collected part by part."""

    def __init__(self, filling: Filling, symmetric: bool) -> None:
        self._filling, self._symmetric = filling, symmetric
        self._counts: list[NDArray[np.int64]] = []
        self._families: list[NDArray[np.int64]] = []
        self._stiffest: list[NDArray[np.float64]] = []
        self.softens = False

    def parts(self) -> Iterator[Part]:
        """All parts of the bonds; statistics are collected while they are iterated."""
        for part in self._filling.parts():
            bonds = part.bonds
            self._counts.append(np.diff(bonds.start))
            self._families.append(part.family)
            self._stiffest.append(stiffness_bound(bonds, bonds.stiffness, self._symmetric))
            self.softens |= bool((bonds.peak < bonds.limit).any())
            yield part

    def counted(self, area: NDArray[np.float64]) -> Counted:
        """Data of the nodes besides their bonds, with these cells (n,), m^2, in space m^3."""
        return Counted(area, self.family, self.count)

    @property
    def count(self) -> NDArray[np.int64]:
        """Number (n,) of bonds of each node."""
        return np.concatenate(self._counts)

    @property
    def family(self) -> NDArray[np.int64]:
        """Number (n,) of bonds of each node at the start, including those cut by a pre-crack."""
        return np.concatenate(self._families)

    @property
    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness of each node under linear bonds, N/m^4."""
        return np.concatenate(self._stiffest)
