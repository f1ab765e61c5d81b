"""Weights of bonds round the tips of growing cracks, relative to their initial weights."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF
from pdmesh.model.visibility import Sight
from pdsolve.bonds.assembly import BondSource
from pdsolve.conditions import unbreakable
from pdsolve.crack_growth.tip_gradients import Surroundings
from pdsolve.model import Model


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
