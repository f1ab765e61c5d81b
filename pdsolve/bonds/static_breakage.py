"""Breaking of bonds at rest, the most overstretched first; forces are those of lasting bonds until they are removed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Filling, Part

TIE = 1e-3  # relative: bonds this near to the worst are as bad; they break together, in whatever order nodes are


class Breakable(NamedTuple):
    """Breakable bonds, b of them, in the order of their nodes."""

    source: NDArray[np.int64]  # (b,) row of the node whose bond it is
    target: NDArray[np.int64]  # (b,)
    xi: NDArray[np.float64]  # (b, d) m
    stiffness: NDArray[np.float64]  # (b,) force density for a unit stretch, N/m^3
    limit: NDArray[np.float64]  # (b,) stretch at which it breaks
    intact: NDArray[np.bool_]  # (b,) changes
    strain: NDArray[np.float64]  # (n,) of free nodes, from which bonds stretch; changes

    def stretches(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stretches (b,) at these displacements (n, d), without cancellation."""
        eta = value[self.target] - value[self.source]
        if self.strain.any():
            eta -= ((self.strain[self.source] + self.strain[self.target]) / 2)[:, None] * self.xi
        e = ((2 * self.xi + eta) * eta).sum(axis=1) / (self.xi**2).sum(axis=1)
        return np.asarray(e / (np.sqrt(1 + e) + 1))

    def worst(self, stretches: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
        """The intact bonds (k,) most over their limit, and the largest ratio of stretch to limit."""
        over = np.where(self.intact, stretches / self.limit, 0.0)
        most = float(over.max(initial=0.0))
        return np.flatnonzero(over > max(1.0, (1 - TIE) * most)), most

    def hold(self, which: NDArray[np.int64], stretches: NDArray[np.float64]) -> NDArray[np.float64]:
        """Energy densities (k,), J/m^3, that these bonds give their own nodes, half of each bond's."""
        length = np.sqrt((self.xi[which] ** 2).sum(axis=1))
        return np.asarray(self.stiffness[which] * length * stretches[which] ** 2 / 4)


class StaticBreakage:
    """Makes the bonds of a filling unbreakable, and records those that would break."""

    def __init__(self, filling: Filling) -> None:
        self._filling = filling
        self._columns: dict[int, tuple[NDArray[Any], ...]] = {}  # by first row, as parts may be filled again

    def filling(self) -> Filling:
        """The filling with unbreakable bonds."""
        return self._filling._replace(part=self._part)

    def breakable(self) -> Breakable | None:
        """Bonds with a limit; None without any."""
        if not self._columns:
            for _ in self.filling().parts():
                pass
        columns = [np.concatenate(column) for column in zip(*self._columns.values(), strict=True)]
        columns += [np.ones(len(columns[0]), dtype=bool), np.zeros(len(self._filling.area))]
        return Breakable(*columns) if len(columns[0]) else None

    def _part(self, rows: NDArray[np.int64]) -> Part:
        part = self._filling.part(rows)
        bonds = part.bonds
        which = np.flatnonzero(np.isfinite(bonds.limit))
        source = np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))[which] + part.first
        target = bonds.neighbour[which].astype(np.int64)
        self._columns[part.first] = (source, target, bonds.xi[which], bonds.stiffness[which], bonds.limit[which])
        for_ever = np.full(len(bonds.limit), np.inf)
        return part._replace(bonds=bonds._replace(peak=for_ever, limit=for_ever))
