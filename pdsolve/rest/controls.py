"""Places on an equilibrium path, its loads, and what grows in prescribed steps along it: energy spent, a monitored
opening, or the arc length."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.softening_bonds import Response, SofteningBonds

Array = NDArray[np.float64]


class PathPoint(NamedTuple):
    """A place on the path."""

    displacement: Array  # (n, d) m
    load_factor: float  # lambda
    energy_or_arc_length: float  # J/m that bonds have dissipated, or m along the path


class ProportionalLoads(NamedTuple):
    """Loads and prescribed displacements (n, w) that grow with one factor."""

    constrained: NDArray[np.bool_]
    constant_part: Array  # N/m, and m where held, at lambda = 0
    proportional_part: Array  # of it, from lambda = 0 to 1

    def loads_and_displacements_at(self, load_factor: float) -> Array:
        """Forces, N/m, and places, m."""
        return self.constant_part + load_factor * self.proportional_part

    @property
    def prescribed_growth(self) -> Array:
        """Ways (n, w), m, of what is held from lambda = 0 to 1; 0 of what is free."""
        return np.where(self.constrained, self.proportional_part, 0.0)


PathSolution = tuple[PathPoint, int, float]  # a place on the path, iterations and residual


class PathControl(Protocol):
    """A quantity of the displacements (n, d) that a path is followed by."""

    unit: str
    description: str  # what is prescribed, for messages

    def control_value(self, displacement: Array, dissipated_energy: float) -> float:
        """The quantity at these displacements, where bonds have spent so much, J/m."""

    def gradient_by_displacement(self, displacement: Array, response: Any) -> Array:
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


class ArcLengthControl:
    """The way along the path, m: in planes normal to its tangent (E. Riks, Int. J. Solids Struct. 15 (1979) 529)."""

    unit, description = "m", "the path has gone"

    def __init__(self, tangent: Array) -> None:
        """`tangent` (n, w) is a unit vector."""
        self._tangent = tangent

    def control_value(self, displacement: Array, dissipated_energy: float) -> float:
        """The displacements' component along the tangent, m."""
        return float((self._tangent * displacement).sum())

    def gradient_by_displacement(self, displacement: Array, response: Any) -> Array:
        """The tangent (n, w)."""
        return self._tangent
