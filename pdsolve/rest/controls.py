"""Places on an equilibrium path, and what grows in prescribed steps along it: energy spent, or a monitored opening."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.softening_bonds import Response, SofteningBonds

Array = NDArray[np.float64]


class PathPoint(NamedTuple):
    """A place on the path."""

    displacement: Array  # (n, d) m
    load_factor: float  # lambda
    energy_or_arc_length: float  # J/m that bonds have dissipated, or m along the path


PathSolution = tuple[PathPoint, int, float]  # a place on the path, iterations and residual


class PathControl(Protocol):
    """A quantity of the displacements (n, d) that a path is followed by."""

    unit: str
    description: str  # what is prescribed, for messages

    def control_value(self, displacement: Array, dissipated_energy: float) -> float:
        """The quantity at these displacements, where bonds have spent so much, J/m."""

    def gradient_by_displacement(self, displacement: Array, response: Response) -> Array:
        """Derivative (n, d) of the quantity by the displacements."""


class DissipationControl:
    """The energy that bonds spend, J/m."""

    unit, description = "J/m", "bonds have dissipated"

    def __init__(self, bonds: SofteningBonds) -> None:
        self._bonds = bonds

    def control_value(self, displacement: Array, dissipated_energy: float) -> float:
        """Energy, J/m."""
        return dissipated_energy

    def gradient_by_displacement(self, displacement: Array, response: Response) -> Array:
        """Derivative (n, d) of the spent energy by the displacements, N/m."""
        return self._bonds.gradient(response)


class OpeningControl:
    """How much longer the distance between two nodes has become, m."""

    unit = "m"

    def __init__(self, gap_name: str, position: Array, end_nodes: tuple[int, int]) -> None:
        """`position` (n, d), m; `end_nodes` are rows of it."""
        self.description = f"the gap '{gap_name}' has opened by"
        self._one, self._other = end_nodes
        self._way = position[self._other] - position[self._one]
        self._length = float(np.sqrt((self._way**2).sum()))

    def control_value(self, displacement: Array, dissipated_energy: float) -> float:
        """The opening, without cancellation."""
        more = (displacement[self._other] - displacement[self._one])[: len(self._way)]
        now = float(np.sqrt(((self._way + more) ** 2).sum()))
        return float((2 * self._way + more) @ more) / (now + self._length)

    def gradient_by_displacement(self, displacement: Array, response: Response) -> Array:
        """Unit vectors (n, d) at the two nodes."""
        way = self._way + (displacement[self._other] - displacement[self._one])[: len(self._way)]
        out = np.zeros_like(displacement)
        out[self._other, : len(way)] = way / np.sqrt((way**2).sum())
        out[self._one] = -out[self._other]
        return out
