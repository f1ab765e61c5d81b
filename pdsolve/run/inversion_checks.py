"""Checks of the motion during a run: inverted triangles of nodes, and loss of digits in displacements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.graphs import tree_of
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.neighbours import ROUND_OFF
from pdsolve.checks import named, warn
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.model import Model
from pdsolve.run.inverted_on_lattice import find_inverted_lattice_triangles
from pdsolve.state import Broken

AROUND = 4  # nodes next to a node, of which two and the node are a triangle to look at
TOGETHER = 1000  # nodes whose bonds are asked for at once
FLAT = 0.1  # of a spacing squared: neighbours that span less are in line with the node
FRACTION = 0.005  # of what breaks a bond: displacements must be known to that, as errors add up over steps


class DisplacementRange(NamedTuple):
    """The least and the largest displacement along each axis, m, and their number type."""

    minimum_by_axis: tuple[float, ...]
    maximum_by_axis: tuple[float, ...]
    dtype_name: str


def compute_displacement_range(u: NDArray[np.floating]) -> DisplacementRange:
    """The extent of displacements (n, d), m."""
    least, most = (tuple(float(of(column)) for column in u.T) for of in (np.min, np.max))  # not over both axes: slow
    return DisplacementRange(least, most, u.dtype.name)


class InversionAndPrecisionChecks:
    """Checks the motion of a run from time to time; gives each warning once."""

    def __init__(
        self,
        model: Model,
        initial_bonds_of_rows: Callable[[int, int], tuple[NDArray[np.int64], NDArray[np.int64]]],
        inversion_and_imprecision_warned: tuple[bool, bool] = (False, False),
    ) -> None:
        """`initial_bonds_of_rows(first, end)` returns the rows of both ends of the initial bonds of sources `first` to
        `end` - 1; `inversion_and_imprecision_warned` are the warnings given already, of nodes before."""
        self._model, (self._said, self._vague) = model, inversion_and_imprecision_warned
        self._bonds, self._own = initial_bonds_of_rows, slice(None)
        self._triangles: _NodeTriangles | None = None  # of nodes off a lattice
        self._apart: NDArray[np.bool_] | None = None  # (n,) nodes whose triangle was not bonded at the start
        self._smallest = float(model.grid.delta.min())
        breaking, ratio = [np.inf], model.settings.horizon.ratio
        spacings = np.unique(model.grid.delta)
        has_spacing = np.zeros((len(model.materials), len(spacings)), dtype=np.bool_)
        has_spacing[model.material_of, np.searchsorted(spacings, model.grid.delta)] = True
        numbers, columns = np.nonzero(has_spacing)
        for entries, material in model.material_columns.of(numbers):
            spacing = spacings[columns[entries]]
            sizes = Sizes(critical_stretch(material, ratio * spacing), spacing, ratio * spacing, ratio)
            breaking += (limits(material, sizes).peak * spacing).tolist()
        self._breaking = min(breaking)  # m, lengthening that breaks or softens a bond

    @property
    def inversion_and_imprecision_warned(self) -> tuple[bool, bool]:
        """Whether warnings of inverted triangles, and of displacements too large for their precision, are given."""
        return self._said, self._vague

    def warn_of_inversion_or_imprecision(self, u: NDArray[np.floating], broken: Broken, step: int) -> None:
        """Warn of inverted triangles, and of displacements too large for their precision.

        `u` (n, d) are the displacements, m; `broken` are all broken bonds. For bodies in space, only the precision is
        checked.
        """
        extent = compute_displacement_range(u)
        if self.triangles_may_be_inverted(extent) and (words := self.describe_inverted_triangle(u, broken)) is not None:
            self.warn_of_inverted_triangle(words, step)
        self.warn_of_imprecise_displacements(extent, step)

    @property
    def smallest_spacing_and_breaking_elongation(self) -> tuple[float, float]:
        """The smallest spacing, and the lengthening that breaks or softens a bond, m."""
        return self._smallest, self._breaking

    def set_smallest_spacing_and_breaking_elongation_of_ranks(
        self, spacings_and_elongations: Sequence[tuple[float, float]], local_rows: slice
    ) -> None:
        """Take these lengths of all ranks as known, and look at the triangles of `local_rows` alone."""
        self._smallest, self._breaking = (min(column) for column in zip(*spacings_and_elongations, strict=True))
        self._own = local_rows

    def triangles_may_be_inverted(self, displacement_range: DisplacementRange) -> bool:
        """Whether triangles may be inverted."""
        wide = max(
            most - least
            for least, most in zip(displacement_range.minimum_by_axis, displacement_range.maximum_by_axis, strict=True)
        )
        return self._model.grid.dimension == 2 and not self._said and wide >= self._smallest

    def warn_of_inverted_triangle(self, triangle_text: str, step: int) -> None:
        """Warn, once, of an inverted triangle in `triangle_text`."""
        self._said = True
        warn(
            self._model,
            f"step {step}: a triangle turned inside out with its bonds intact, {triangle_text}: bonds do not keep nodes"
            " apart; use less compression",
        )

    def warn_of_imprecise_displacements(self, displacement_range: DisplacementRange, step: int) -> None:
        """Warn, once, of displacements too large for their precision."""
        largest = max(
            abs(value) for value in (*displacement_range.minimum_by_axis, *displacement_range.maximum_by_axis)
        )
        error = float(np.finfo(displacement_range.dtype_name).eps * largest)
        if not self._vague and error > FRACTION * self._breaking:
            self._vague = True
            warn(
                self._model,
                f"step {step}: displacements reach {largest:.3g} m, which {displacement_range.dtype_name} knows to"
                f" {error:.2g} m, and {FRACTION * self._breaking:.2g} m are needed: {self._breaking:.2g} m break a"
                " bond",
            )

    def describe_inverted_triangle(self, u: NDArray[np.floating], broken: Broken) -> str | None:
        """The nodes of an inverted triangle whose bonds are intact, in words; None if there is none."""
        nodes = len(self._model.grid)
        if self._apart is None:
            self._apart = np.zeros(nodes, dtype=bool)
        turned = self._find_inverted_triangles(u)
        near = np.zeros(nodes, dtype=bool)
        near[turned[:, 0]] = True
        broken_keys = (nodes * broken.source + broken.target)[near[broken.source]]
        for end in (1, 2):
            turned = turned[~np.isin(nodes * turned[:, 0] + turned[:, end], broken_keys, assume_unique=True)]
        were_bonded = np.zeros(len(turned), dtype=bool)
        for part in np.unique(turned[:, 0] // TOGETHER).tolist():
            rows = np.flatnonzero(turned[:, 0] // TOGETHER == part)
            source, target = self._bonds(part * TOGETHER, min((part + 1) * TOGETHER, nodes))
            keys, corner_keys = nodes * source + target, nodes * turned[rows, 0]
            bonded = [np.isin(corner_keys + turned[rows, end], keys, assume_unique=True) for end in (1, 2)]
            were_bonded[rows] = bonded[0] & bonded[1]
        self._apart[turned[~were_bonded, 0]] = True
        turned = turned[were_bonded]
        if len(turned):
            return ", ".join(named(self._model, int(corner)) for corner in turned[0])
        return None

    def _find_inverted_triangles(self, u: NDArray[np.floating]) -> NDArray[np.int64]:
        """Corners (t, 3) of the inverted triangles, without those whose nodes were not bonded at the start."""
        assert self._apart is not None
        position, flat = self._model.grid.position, FLAT * self._smallest**2
        inverted = None
        if self._triangles is None:
            inverted = find_inverted_lattice_triangles(position, u, self._own, flat, self._apart)
        if inverted is not None:
            return inverted
        if self._triangles is None:
            near = tree_of(position).query(position, min(AROUND + 1, len(position)))[1][:, 1:]
            ends, twice = np.zeros((2, len(position)), dtype=np.int64), np.zeros(len(position))
            for pair in combinations(near.T, 2):
                twice_area = _cross_product(*(position[end] - position for end in pair))
                larger = np.abs(twice_area) > np.abs(twice) * (1 + ROUND_OFF)
                ends[:, larger], twice[larger] = np.array(pair)[:, larger], twice_area[larger]
            low, high, _ = self._own.indices(len(position))
            rows = low + np.flatnonzero(np.abs(twice[low:high]) >= flat)
            self._triangles = _NodeTriangles(np.column_stack([rows, *ends[:, rows]]), twice[rows])
        corners, before = self._triangles
        current_position = position + u
        turned = (
            before
            * _cross_product(*(current_position[corners[:, end]] - current_position[corners[:, 0]] for end in (1, 2)))
            <= 0
        )
        return corners[turned & ~self._apart[corners[:, 0]]]


class _NodeTriangles(NamedTuple):
    """For each node, the largest triangle with two of its nearest nodes, if they are not in line with it; t of them."""

    corner_rows: NDArray[np.int64]  # (t, 3)
    signed_double_areas: NDArray[np.float64]  # (t,) twice its area, m^2, with the sign of its sense


def _cross_product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
