"""The thesis's bonds: each node sums over its own horizon with its own constants, whatever the neighbour's horizon.

Stiffness of the bond i -> j: lambda_i c_i(xi) beta_ij A_j, with Hu's beta on the family |xi| <= horizon_i (thesis, eq.
14), areas by eq. 19 and the softening coefficient lambda_i = potential / actual bonds (thesis, "Effetti di bordo").
Where horizons differ, forces have no reaction: momentum drifts, and loaded rows lose part of their load. At a material
interface, a bond has the constants of its own node.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import full_family, hu_beta
from pdmesh.model.material_constants import critical_stretch, micromodulus
from pdmesh.model.neighbours import Neighbours, Pairs, chosen
from pdmesh.model.visibility import sight_of
from pdsolve.bonds.assembly import BondSource, Paired, Part, areas, part_of
from pdsolve.conditions import unbreakable
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.model import Model


class Rule:
    """Makes the bonds of a model from pairs and from the number of bonds of each node; see `ByPairs`."""

    def __init__(self, model: Model) -> None:
        """Raises GridError for an outline that encloses nothing."""
        grid = model.grid
        self.area, self._model = areas(model, "eq19"), model
        self.neighbours = Neighbours(grid.position, grid.delta, model.horizons)
        self._sight, self._held = sight_of(grid, model.name), unbreakable(model)
        self._full = full_family(model.settings.horizon.ratio)

    def looked(self, pairs: Pairs) -> Paired:
        """Pairs that no hole or edge separates, without the softening coefficient."""
        model = self._model
        pairs = chosen(pairs, self._sight.inside(pairs))
        reach = model.horizons[pairs.source]
        stiffness, peak, limit = (np.zeros(len(pairs.length)) for _ in range(3))
        for material_rows, material in model.materials_at(pairs.source):
            stiffness[material_rows] = micromodulus(material, pairs.length[material_rows], reach[material_rows])
            critical = critical_stretch(material, reach[material_rows])
            sizes = Sizes(critical, pairs.length[material_rows], reach[material_rows], model.settings.horizon.ratio)
            peak[material_rows], limit[material_rows] = limits(material, sizes)
        weight = self.area[pairs.target] * hu_beta(pairs.length, reach, model.grid.delta[pairs.target])
        return Paired(pairs, ~self._sight.cut(pairs), stiffness * weight, peak, limit, weight)

    def lack(self, rows: NDArray[np.int64], paired: Paired) -> NDArray[np.float64]:
        """Softening coefficient of rows (k,), which increase, with these pairs; see `softening`."""
        place = np.searchsorted(rows, paired.pairs.source[paired.intact])
        return np.asarray(softening(self._full, np.bincount(place, minlength=len(rows))))

    def part(self, rows: NDArray[np.int64], paired: Paired, lack: NDArray[np.float64]) -> Part:
        """Bonds of consecutive rows with these pairs and the nodes' softening coefficients (n,)."""
        paired = paired._replace(stiffness=paired.stiffness * lack[paired.pairs.source])
        return part_of(self._model.grid.position, self._held, rows, paired)


def fill(model: Model) -> BondSource:
    """One-sided bonds of the model. Raises GridError for an outline that encloses nothing."""
    rule, lack = Rule(model), np.zeros(len(model.grid))

    def paired_of(rows: NDArray[np.int64]) -> Paired:
        return rule.looked(rule.neighbours.pairs(rows))

    def part(rows: NDArray[np.int64]) -> Part:
        paired = paired_of(rows)
        lack[rows] = rule.lack(rows, paired)
        return rule.part(rows, paired, lack)

    return BondSource(rule.area, part, paired_of)


def softening(full: int, actual: NDArray[np.int64]) -> NDArray[np.float64]:
    """lambda (n,): bonds of a `full` family over the `actual` ones (n,), without cut and missing ones."""
    return full / np.maximum(actual, 1)
