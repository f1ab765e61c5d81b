"""What is kept of bonds while they pass, part by part."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Filling, Part, stiffest


class Survey:
    """What is kept of the bonds while they pass, part by part."""

    def __init__(self, filling: Filling, symmetric: bool) -> None:
        self._filling, self._symmetric = filling, symmetric
        self._counts: list[NDArray[np.int64]] = []
        self._families: list[NDArray[np.int64]] = []
        self._stiffest: list[NDArray[np.float64]] = []
        self.softens = False

    def parts(self) -> Iterator[Part]:
        """All parts, noted."""
        for part in self._filling.parts():
            bonds = part.bonds
            self._counts.append(np.diff(bonds.start))
            self._families.append(part.family)
            self._stiffest.append(stiffest(bonds, bonds.stiffness, self._symmetric))
            self.softens |= bool((bonds.peak < bonds.limit).any())
            yield part

    @property
    def count(self) -> NDArray[np.int64]:
        """Bonds (n,) of each node."""
        return np.concatenate(self._counts)

    @property
    def family(self) -> NDArray[np.int64]:
        """The same (n,), with those a pre-crack cuts."""
        return np.concatenate(self._families)

    @property
    def stiffest(self) -> NDArray[np.float64]:
        """As in `Operator` (n,), of linear bonds."""
        return np.concatenate(self._stiffest)
