"""The area of the cracks that broken bonds make, by the measure of the lattice.

The bonds that a crack cuts in a full lattice hold G0 times its area, in the mean of cracks along a row and at 45
degrees, when each is at the critical stretch. A bond's share of this sum is its share of the area. Beside edges and
holes a bond stands for those that are missing there, by the sums of the bonds of its two nodes.

    share = c |xi| s_c^2 A_i A_j / 2, for E = 1 and G0 = 1

Two materials count by the mean of their G0. What bonds have taken from the motion is another number, whatever law
they have.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import calibration, has_partial_cells, hu_beta
from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch, dimension_of, micromodulus
from pdmesh.model.neighbours import ROWS, Neighbours, lengths
from pdmesh.model.node_arrays import Grid
from pdmesh.model.node_fields import with_field

MISSING = 4.0  # times: most that a bond stands for, where nearly all others of its nodes are missing


class BrokenArea(NamedTuple):
    """Cracks that bonds have made by breaking."""

    area: float  # m, in a body in space m^2
    cost: float  # J/m or J: G0 times this area


class _Shares:
    """Shares of bonds in the area of a crack, in lattices of one kind of material and one ratio of the horizon."""

    def __init__(self, material: Material, ratio: float) -> None:
        self._unit = msgspec.structs.replace(material, E=1.0, G0=1.0)
        self._ratio, self._partial = ratio, has_partial_cells(material)
        factors = calibration(ratio, material, self._partial)
        stretch = factors.stretch * float(critical_stretch(self._unit, np.array([ratio]))[0])
        self._factors, self._half = factors, factors.stiffness * stretch**2 / 2
        side = np.arange(-np.ceil(ratio + 1), np.ceil(ratio + 2))
        ways = np.stack(np.meshgrid(*(side,) * dimension_of(material.plane), indexing="ij"), axis=-1)
        family = lengths(ways.reshape(-1, dimension_of(material.plane)))
        self.whole = float(self.of(family[family > 0]).sum())

    @property
    def reach(self) -> float:
        """How far bonds reach, spacings."""
        return self._ratio + 0.5 * self._partial

    def of(self, length: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares (b,) of bonds `length` (b,) spacings long between whole cells, of a spacing's area; 0 of none."""
        horizon, spacing = np.full(len(length), self._ratio), np.ones(len(length))
        c = micromodulus(self._unit, length, horizon) * self._factors.shells.at(length)
        share = hu_beta(length, horizon, spacing) if self._partial else length <= self.reach * (1 + 1e-9)
        return np.asarray(self._half * c * share * length)


def broken_area(
    grid: Grid,
    ratio: float,
    materials: tuple[Material, ...],
    material_of: NDArray[np.int64],
    source: NDArray[np.int64],
    target: NDArray[np.int64],
) -> BrokenArea:
    """The area of cracks whose broken bonds go from the rows `source` (b,) to `target` (b,), each in both directions.

    `material_of` (n,) are numbers of `materials`.
    """
    d = grid.dimension
    kinds = {_kind(material): material for material in materials}  # few, where each node has a material of its own
    shares_of_kinds = [
        _Shares(msgspec.structs.replace(material, plane="space") if d == 3 else material, ratio)
        for material in kinds.values()
    ]
    numbers = {kind: number for number, kind in enumerate(kinds)}
    kind_of = np.array([numbers[_kind(material)] for material in materials])[material_of]
    position, delta, cells = grid.position, grid.delta, grid.cells
    G0 = with_field(grid.fields, "G0", np.array([material.G0 for material in materials])[material_of])

    def shares(
        source: NDArray[np.int64], target: NDArray[np.int64], length: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Shares of directed pairs (b,) by the material of their sources, over the spacing's area, cells counted."""
        h, number, out = delta[source], kind_of[source], np.zeros(len(source))
        for kind_number, of_kind in enumerate(shares_of_kinds):
            matching = np.flatnonzero(number == kind_number)
            out[matching] = of_kind.of(length[matching] / h[matching])
        return np.asarray(out * cells[target] / h**d)

    rows, which = np.unique(source, return_inverse=True)
    family_share, reach = np.zeros(len(rows)), max(of_kind.reach for of_kind in shares_of_kinds)
    near = Neighbours(position, delta, reach * delta)
    body = None if grid.bodies is None else grid.bodies.number
    for first in range(0, len(rows), ROWS):
        pairs = near.pairs(rows[first : first + ROWS])
        pair_shares = shares(*pairs)
        if body is not None:
            pair_shares = np.where(body[pairs.source] == body[pairs.target], pair_shares, 0.0)
        family_share += np.bincount(np.searchsorted(rows, pairs.source), pair_shares, len(rows))
    full_share = np.array([of_kind.whole for of_kind in shares_of_kinds])[kind_of[rows]]
    stands_for = np.clip(full_share / np.maximum(family_share, full_share / MISSING), 1.0, MISSING)
    length = lengths(position[target] - position[source])
    each_way = shares(source, target, length) * cells[source] / delta[source] * stands_for[which] / 2
    return BrokenArea(float(each_way.sum()), float((each_way * (G0[source] + G0[target]) / 2).sum()))


def _kind(material: Material) -> tuple[str, str, str]:
    """What of a material the shares of its bonds depend on, for E = 1 and G0 = 1."""
    return material.micromodulus, material.plane, material.calibration
