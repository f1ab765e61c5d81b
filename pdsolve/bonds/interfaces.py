"""Bonds that cross an interface, and the constants that they have in place of those of the materials at their ends.

A bond between two regions crosses their interface; of several that name both, the last one counts. A bond whose segment
meets a drawn face crosses that; a node on a face is on the side that its normal points to. Of drawn faces, and of one
and of regions, the interface of the least G0 counts.

The bonds across a straight cut cost the more or the less of G0 by its angle to the lattice, 0 to 3.4 % more with a
horizon of 3 spacings in the plane, and 8.5 % with 2. Here each bond has its share of G0 over that cost, at the angle of
the interface, so that a cut along it costs G0. A bond between regions takes for the normal the difference of its ends':
the gradient of what is another region, fitted to the family of a node; its direction scatters by 5 degrees with a
horizon of 3 spacings, which the cost hardly shows.
"""

from __future__ import annotations

import copy
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.interfaces import ANY, REST, Interface
from pdmesh.model.lattice_calibration import calibrated_family, calibration, has_partial_cells
from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, Pairs, chosen, lengths, row_chunks
from pdsolve.model import Model

SLACK = 1e-6  # of a face: how far beside it a bond still crosses it
EVEN = 1e-6  # size of a gradient that is round-off; those of boundaries are about 1
DIRECTIONS = 33  # components that are tried along each axis for the dearest cut
DIGITS = 2  # of the components of normals: the cost of a cut changes by 0.2 % between two of them


class Cut(NamedTuple):
    """The bonds (k, d) of a node in a lattice of spacing 1, and what those that a cut crosses take of it, over G0."""

    xi: NDArray[np.float64]  # (k, d)
    energy: NDArray[np.float64]  # (k,) of each way of a bond, for each spacing along it

    def cost(self, normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Energy (p,) of cuts with these normals (p, d), over G0."""
        rounded, which = np.unique(np.abs(np.round(normal, DIGITS)), axis=0, return_inverse=True)
        rounded /= lengths(rounded)[:, None]
        total = np.zeros(len(rounded))
        for xi, energy in zip(self.xi, self.energy, strict=True):  # in this order however many normals there are
            along = sum(column * component for column, component in zip(rounded.T, xi, strict=True))
            total += np.abs(along) * energy
        return np.asarray(total[which.ravel()])

    def largest_cost(self) -> float:
        """Energy of the dearest cut, over G0."""
        components = (np.linspace(0, 1, DIRECTIONS),) * self.xi.shape[1]
        ways = np.stack(np.meshgrid(*components), axis=-1).reshape(-1, len(components))[1:]
        return float(self.cost(ways / lengths(ways)[:, None]).max())


@lru_cache
def _cut_of_springs(profile: str, plane: str, calibrated: Any, cohesive: bool, ratio: float) -> Cut:
    unit = Material(E=1.0, rho=1.0, G0=1.0)
    unit = msgspec.structs.replace(unit, micromodulus=profile, plane=plane, calibration=calibrated)
    xi, c = calibrated_family(unit, ratio)
    if cohesive:  # which soften by their opening, and are calibrated to a cut along a row
        return Cut(xi, c / (c * np.abs(xi[:, 1])).sum())
    stretch = calibration(ratio, unit, has_partial_cells(unit)).stretch
    return Cut(xi, c * lengths(xi) * (stretch * float(critical_stretch(unit, np.array([ratio]))[0])) ** 2 / 4)


def cut_of_springs(material: Material, ratio: float) -> Cut:
    """Cuts of the calibrated lattice of a material's springs."""
    cohesive = material.law == "cohesive"
    return _cut_of_springs(material.micromodulus, material.plane, material.calibration, cohesive, ratio)


class Crossings(NamedTuple):
    """What pairs (b,) have of the interfaces that they cross; NaN where nothing is given."""

    G0: NDArray[np.float64]  # (b,) J/m^2
    f_t: NDArray[np.float64]  # (b,) Pa
    stiffness: NDArray[np.float64]  # (b,) of their bonds, over that of the materials; 1 of others
    normal: NDArray[np.float64]  # (b, d) unit; 0 of others

    def material(self, material: Material, pairs: NDArray[np.int64] | slice, cut: Cut) -> Material:
        """A material with the constants of these pairs (k,) in place of its own, for bonds before their stiffness."""
        normal = self.normal[pairs]
        crosses = normal.any(axis=1)
        if not crosses.any():
            return material
        cost = np.ones(len(normal))
        cost[crosses] = cut.cost(normal[crosses])
        changed, softer = copy.copy(material), self.stiffness[pairs]
        for name, values, divisor in (("G0", self.G0[pairs], cost * softer), ("f_t", self.f_t[pairs], softer)):
            own = getattr(material, name)
            if own is not None:
                given = np.where(np.isnan(values), own, values)
                msgspec.structs.force_setattr(changed, name, np.where(crosses, given / divisor, own))
        return changed


class Interfaces:
    """The interfaces of a model."""

    def __init__(self, model: Model) -> None:
        self._model, self._interfaces = model, model.settings.interfaces

    def crossed(self, pairs: Pairs) -> Crossings | None:
        """What pairs have of the interfaces; None if they cross none."""
        count, d = len(pairs.source), self._model.grid.dimension
        of_pair, least, normal = np.full(count, -1), np.full(count, np.inf), np.zeros((count, d))
        for number, interface in enumerate(self._interfaces):
            if interface.between is not None:
                joins = self._between(interface, pairs)
                of_pair[joins], least[joins] = number, np.inf if interface.G0 is None else interface.G0
        joins = of_pair >= 0
        if joins.any():
            normal[joins] = self._normals[pairs.target[joins]] - self._normals[pairs.source[joins]]
        for number, interface in enumerate(self._interfaces):
            for corners in self._faces(interface, pairs):
                across, direction = self._across(corners, pairs)
                G0 = np.inf if interface.G0 is None else interface.G0
                weaker = across[(of_pair[across] < 0) | (least[across] > G0)]
                of_pair[weaker], least[weaker], normal[weaker] = number, G0, direction
        crosses = of_pair >= 0
        if not crosses.any():
            return None
        size = lengths(normal)[crosses, None]
        axis = np.eye(d)[-1]  # of a node whose family says nothing of the interface
        normal[crosses] = np.where(size > ROUND_OFF, normal[crosses] / np.maximum(size, ROUND_OFF), axis)
        columns = np.array([(each.G0, each.f_t, each.stiffness) for each in self._interfaces], dtype=float)
        constants = np.vstack([columns, (np.nan, np.nan, 1.0)])[of_pair]
        G0, f_t, stiffness = constants.T
        return Crossings(G0, f_t, stiffness, normal)

    def stiffness(self, pairs: Pairs) -> NDArray[np.float64] | float:
        """Stiffness (b,) of the bonds of pairs over that of the materials; 1 if no interface has another."""
        if all(interface.stiffness == 1 for interface in self._interfaces):
            return 1.0
        crossings = self.crossed(pairs)
        return 1.0 if crossings is None else crossings.stiffness

    def materials(self, number: int) -> NDArray[np.bool_]:
        """Mask of the materials, by their numbers, that bonds across an interface may have at their ends."""
        names = self._interfaces[number].between or (ANY,)
        return np.asarray(np.any([self._is_called(name) for name in names], axis=0))

    def uncrossed(self, partial_cells: bool) -> list[int]:
        """Numbers of the interfaces that no bond crosses; `partial_cells`: bonds reach half a spacing further."""
        grid = self._model.grid
        reach = self._model.horizons + (0.5 * grid.delta if partial_cells else 0.0)
        neighbours = Neighbours(grid.position, grid.delta, reach, mutual=True)
        numbers = []
        for number, interface in enumerate(self._interfaces):
            # rows of nodes that bonds across it may start at
            if interface.between is None:
                corners = np.array(interface.faces, dtype=float).reshape(-1, grid.dimension)
                far = float((self._model.horizons + grid.delta).max())
                rows = grid.chosen(None, [*(corners.min(axis=0) - far), *(corners.max(axis=0) + far)])
            else:
                sides = (self._is_called(name)[self._model.material_of] for name in interface.between)
                rows = min((np.flatnonzero(side) for side in sides), key=len)
            bonds = (self._bonded(neighbours, rows[part]) for part in row_chunks(len(rows)))
            if not any(self._crosses(interface, pairs) for pairs in bonds):
                numbers.append(number)
        return numbers

    def _crosses(self, interface: Interface, pairs: Pairs) -> bool:
        """Whether one of these pairs crosses an interface."""
        if interface.between is not None:
            return bool(self._between(interface, pairs).any())
        return any(len(self._across(corners, pairs)[0]) for corners in self._faces(interface, pairs))

    def _bonded(self, neighbours: Neighbours, rows: NDArray[np.int64]) -> Pairs:
        """The pairs of these rows in one body."""
        pairs, bodies = neighbours.pairs(rows), self._model.grid.bodies
        return pairs if bodies is None else chosen(pairs, ~bodies.parted(pairs.source, pairs.target))

    def _between(self, interface: Interface, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs between the two regions of an interface."""
        assert interface.between is not None
        first, second = (self._is_called(name)[self._model.material_of] for name in interface.between)
        number, (i, j) = self._model.material_of, (pairs.source, pairs.target)
        return np.asarray((number[i] != number[j]) & ((first[i] & second[j]) | (first[j] & second[i])))

    def _is_called(self, name: str) -> NDArray[np.bool_]:
        """Mask of the materials, by their numbers, that a name of an interface is about."""
        names = [None, *(region.name for region in self._model.settings.regions)]
        if name == ANY:
            return np.ones(len(names), dtype=np.bool_)
        if name == REST and REST not in names:
            return np.array([each is None for each in names])
        return np.array([each == name for each in names])

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Directions (n, d) from each node to other regions within its horizon; 0 where there are none."""
        model, grid = self._model, self._model.grid
        number, normals = model.material_of, np.zeros((len(grid), grid.dimension))
        neighbours = Neighbours(grid.position, grid.delta, model.horizons, mutual=True)
        for rows in row_chunks(len(grid)):
            source, target, _ = self._bonded(neighbours, rows)
            other = (number[source] != number[target]).astype(float)
            place = source - rows[0]
            near = np.bincount(place, other, len(rows)) > 0
            is_fitted = near[place]
            i, j = source[is_fitted], target[is_fitted]
            xi = (grid.position[j] - grid.position[i]) / model.horizons[i, None]
            numbers = np.cumsum(near) - 1
            gradient = _gradients(numbers[place[is_fitted]], xi, other[is_fitted], int(near.sum()))
            size = lengths(gradient)[:, None]
            normals[rows[near]] = np.where(size > EVEN, gradient / np.maximum(size, EVEN), 0.0)
        return normals

    def _faces(self, interface: Interface, pairs: Pairs) -> list[NDArray[np.float64]]:
        """The faces (d, d) of an interface that one of the pairs may cross."""
        d = self._model.grid.dimension
        corners = np.array(interface.faces, dtype=float).reshape(-1, d, d)
        if not len(corners) or not len(pairs.source):
            return []
        places = self._model.grid.position[pairs.source]
        reach = float(pairs.length.max())
        low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
        near = (corners.max(axis=1) >= low).all(axis=1) & (corners.min(axis=1) <= high).all(axis=1)
        return list(corners[near])

    def _across(self, corners: NDArray[np.float64], pairs: Pairs) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The pairs (k,) that cross a face (d, d), and its unit normal."""
        edges = corners[1:] - corners[0]
        normal = np.array([-edges[0, 1], edges[0, 0]]) if len(edges) == 1 else np.cross(*edges)
        normal = normal / np.sqrt(normal @ normal)
        position, delta = self._model.grid.position, self._model.grid.delta
        heights = [(position[nodes] - corners[0]) @ normal for nodes in pairs[:2]]
        above = [height >= -SLACK * delta[nodes] for height, nodes in zip(heights, pairs[:2], strict=True)]
        across = np.flatnonzero(above[0] != above[1])
        (first, second), (i, j) = (heights[0][across], heights[1][across]), (nodes[across] for nodes in pairs[:2])
        share = np.clip(first / (first - second), 0.0, 1.0)
        crossing = position[i] + share[:, None] * (position[j] - position[i]) - corners[0]
        weights = np.linalg.solve(edges @ edges.T, edges @ crossing.T)
        inside = (weights >= -SLACK).all(axis=0) & (weights.sum(axis=0) <= 1 + SLACK)
        return across[inside], normal


def _gradients(
    place: NDArray[np.int64], xi: NDArray[np.float64], values: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Gradients (count, d) by least squares of `values` (b,) at `xi` (b, d) from a node, which has 0, by its number."""
    nodes = 1 + np.bincount(place, minlength=count)

    def mean(terms: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(place, terms, count) / nodes)

    centre, share = np.array([mean(along) for along in xi.T]), mean(values)
    spread = np.array([[mean(a * b) for b in xi.T] for a in xi.T]) - centre[:, None] * centre
    slope = np.array([mean(along * values) for along in xi.T]) - centre * share
    matrices = spread.transpose(2, 0, 1) + ROUND_OFF * np.eye(xi.shape[1])  # nodes may be in a row
    return np.asarray(np.linalg.solve(matrices, slope.T[..., None])[..., 0])
