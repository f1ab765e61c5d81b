"""Fields of the nodes around a tip at the current state: displacement gradients, stress, and weights of bonds."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material_constants import poisson
from pdmesh.model.neighbours import ROUND_OFF, Pairs
from pdmesh.model.node_fields import with_field
from pdmesh.model.visibility import Sight
from pdsolve.bonds.assembly import BondSource
from pdsolve.conditions import unbreakable
from pdsolve.fracture.domain_integrals import Sampled, SampledMotion
from pdsolve.fracture.fields import Elastic
from pdsolve.fracture.gradients import Stiffness, gradients_of, green, hooke
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.state import State


class Surroundings:
    """The bonds of a run that no crack has cut, and the fields fitted to them."""

    def __init__(self, model: Model, operator: Operator, area: NDArray[np.float64], rest: bool) -> None:
        """`area` (n,) m^2; `rest`: the run is static."""
        self.model, self._area, self._rest = model, area, rest
        self.source, self.target = operator.bonds(at_start=True)
        self.start = np.searchsorted(self.source, np.arange(len(area) + 1))
        self.intact = np.ones(len(self.source), dtype=bool)
        nu = np.array([poisson(material) for material in model.materials])[model.material_of]
        nu = with_field(model.grid.fields, "nu", nu)
        self._elastic = Stiffness(model.node_values("E"), nu, model.materials[0].plane)

    def rows(self, place: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Rows of the nodes within a radius of a place, m."""
        return np.flatnonzero(np.hypot(*(self.model.grid.position - place).T) <= radius)

    def nearest(self, place: NDArray[np.float64]) -> int:
        """The row of the node nearest to a place."""
        return int(np.hypot(*(self.model.grid.position - place).T).argmin())

    def bonds(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Indices (k,) of the intact bonds of these nodes, in their order."""
        count = self.start[rows + 1] - self.start[rows]
        numbers = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - self.start[rows], count)
        return np.asarray(numbers[self.intact[numbers]])

    def pairs(self, numbers: NDArray[np.int64]) -> Pairs:
        """The bonds with these indices as pairs of nodes."""
        source, target, position = self.source[numbers], self.target[numbers], self.model.grid.position
        return Pairs(source, target, np.hypot(*(position[target] - position[source]).T))

    def plate(self, row: int) -> Elastic:
        """Elastic constants of a node."""
        return Elastic(float(self._elastic.E[row]), float(self._elastic.nu[row]), self._elastic.plane)

    def sampled(self, state: State, rows: NDArray[np.int64]) -> Sampled:
        """The fields of these nodes at a state."""
        numbers = self.bonds(rows)
        start = np.searchsorted(self.source[numbers], np.append(rows, len(self.intact)))
        families = start, self.target[numbers], rows
        position = self.model.grid.position

        def gradient(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return gradients_of(position, self._area, values[:, :2].astype(float), *families)

        H = gradient(state.value)
        strain = green(H)
        stiffness = Stiffness(self._elastic.E[rows], self._elastic.nu[rows], self._elastic.plane)
        motion = None
        if not self._rest:
            rate, second = (values[rows, :2].astype(float) for values in (state.rate, state.second))
            motion = SampledMotion(float(self.model.rho[rows].mean()), rate, second, gradient(state.rate))
        return Sampled(position[rows], self._area[rows], H, strain, hooke(strain, stiffness)[:, :3], motion)


class Round:
    """Weights of a run's bonds as its cracks grow."""

    def __init__(self, model: Model, near: Surroundings, filling: BondSource) -> None:
        assert filling.strength is not None
        self._model, self._strength, self._farthest = model, filling.strength, 1.5 * float(model.horizons.max())
        no_fail = unbreakable(model)
        self._pairs = near.pairs(np.arange(len(near.source)))
        self._no_fail = no_fail[near.source] | no_fail[near.target]
        self._began = self._strengths(model.grid.cracks)

    def share(self, cracks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share (b,) of each bond's initial weight that remains with cracks (k, 4); 0: it is cut."""
        remaining_share = self._strengths(cracks) / self._began
        return np.where(
            self._no_fail, 1.0, np.where(remaining_share > ROUND_OFF, np.minimum(remaining_share, 1.0), 0.0)
        )

    def _strengths(self, cracks: NDArray[np.float64]) -> NDArray[np.float64]:
        grid = dataclasses.replace(self._model.grid, cracks=cracks)
        far = Sight(grid, self._model.name).apart(self._pairs, self._model.materials[0].detour, self._farthest)
        return self._strength(self._pairs._replace(length=far))
